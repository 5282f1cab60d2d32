"""Check that all internal links of a built site, anchors and pictures included, have a target.

`python tools/links.py site`; run by `make docs`. Links to other hosts are not checked, as a build
may have no network.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """Link targets and anchors of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Record links, pictures, scripts, styles and anchors."""
        found = dict(attrs)
        self.targets += [link for link in (found.get("href"), found.get("src")) if link]
        self.anchors |= {anchor for anchor in (found.get("id"), found.get("name")) if anchor}


def broken(folder: Path) -> list[str]:
    """List broken links, one line each."""
    pages = {
        path.resolve(): Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")
    }
    faults = []
    for path, page in pages.items():
        for link in page.targets:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            if not target.exists():
                faults.append(f"{path.relative_to(folder.resolve())}: {link}: no such file")
            elif target in pages and unquote(parts.fragment) not in pages[target].anchors:
                faults.append(f"{path.relative_to(folder.resolve())}: {link}: no such anchor")
    return faults


def main() -> None:
    """Check the site and report what is broken."""
    folder = Path(sys.argv[1])
    faults = broken(folder)
    if faults or not any(folder.rglob("*.html")):
        raise SystemExit("\n".join(faults) or f"{folder}: no pages")


if __name__ == "__main__":
    main()
