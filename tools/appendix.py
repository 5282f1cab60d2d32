"""Tables of the appendix of docs/paper.md, and the CSV files in results/ that have the rest.

A table stands between `<!-- result: NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import io
import re

from suspension_cli.files.whole_files import write_bytes
from tools.tables import ROOT

PAGE = ROOT / "docs" / "paper.md"


def write_block(name: str, lines: list[str]) -> None:
    """Replace what stands in the page under a name."""
    mark = f"<!-- result: {name} -->"
    text = PAGE.read_text("utf-8")
    found = re.search(rf"{mark}\n.*?<!-- end -->", text, re.DOTALL)
    if found is None:
        raise SystemExit(f"{PAGE}: no place {mark}")
    body = "\n".join(lines).strip("\n")
    whole = text[: found.start()] + f"{mark}\n\n{body}\n\n<!-- end -->" + text[found.end() :]
    write_bytes(PAGE, whole.encode())
    print(body)


def write_csv(name: str, head: list[str], rows: list[list[str]]) -> None:
    """Write `results/NAME.csv`."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows([head, *rows])
    write_bytes(ROOT / "results" / f"{name}.csv", stream.getvalue().encode())
