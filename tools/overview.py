"""Copy the tables of results/*.md into results/README.md.

They stand between `<!-- table: NAME.md -->` and `<!-- end -->`. The last step of `make all`;
`tests/docs/test_results.py` fails if a table differs from that of its file.
"""

from __future__ import annotations

import re
from pathlib import Path

RESULTS = Path(__file__).parent.parent / "results"
BLOCK = re.compile(r"<!-- table: (\S+) -->\n.*?<!-- end -->", re.DOTALL)


def page(text: str) -> str:
    """Regenerate the tables of a page."""
    return BLOCK.sub(
        lambda found: f"<!-- table: {found[1]} -->\n\n{table(RESULTS / found[1])}\n\n<!-- end -->",
        text,
    )


def table(path: Path) -> str:
    """Extract the first table of a page."""
    found = re.search(r"(?:^\|.*\n)+", path.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise SystemExit(f"{path}: no table")
    return found[0].rstrip("\n")


def main() -> None:
    """Regenerate the page."""
    readme = RESULTS / "README.md"
    readme.write_text(page(readme.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
