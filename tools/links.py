"""Check a built site: every link inside it, anchors and pictures included, leads to something that is there.

`python tools/links.py site`; run by `make docs`.  Links to other hosts are left alone, as a build may have no network.
"""

from __future__ import annotations

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    """What a page links to, and the anchors it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.targets: list[str] = []
        self.anchors = {""}
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take down links, pictures, scripts, styles, and whatever can be linked to."""
        found = dict(attrs)
        self.targets += [link for link in (found.get("href"), found.get("src")) if link]
        self.anchors |= {anchor for anchor in (found.get("id"), found.get("name")) if anchor}


def broken(folder: Path) -> list[str]:
    """One line for each link that leads nowhere."""
    pages = {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in folder.rglob("*.html")}
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
    """Check the site and say what is broken."""
    folder = Path(sys.argv[1])
    faults = broken(folder)
    if faults or not any(folder.rglob("*.html")):
        raise SystemExit("\n".join(faults) or f"{folder}: no pages")


if __name__ == "__main__":
    main()
