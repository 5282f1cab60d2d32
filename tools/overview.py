"""Put the tables of results/*.md into results/README.md, between `<!-- table: NAME.md -->` and `<!-- end -->`.

The last step of `make all`; `tests/test_results.py` fails when a table there is not that of its file.
"""

from __future__ import annotations

import re
from pathlib import Path

RESULTS = Path(__file__).parent.parent / "results"
BLOCK = re.compile(r"<!-- table: (\S+) -->\n.*?<!-- end -->", re.DOTALL)


def page(text: str) -> str:
    """The page with its tables made anew."""
    return BLOCK.sub(lambda found: f"<!-- table: {found[1]} -->\n\n{table(RESULTS / found[1])}\n\n<!-- end -->", text)


def table(path: Path) -> str:
    """The first table of a page."""
    found = re.search(r"(?:^\|.*\n)+", path.read_text(encoding="utf-8"), re.MULTILINE)
    if found is None:
        raise SystemExit(f"{path}: no table")
    return found[0].rstrip("\n")


def main() -> None:
    """Make the page anew."""
    readme = RESULTS / "README.md"
    readme.write_text(page(readme.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
