"""Columns of numbers of the CSV files that a design names.

When a design is read, the columns of each CSV file replace its name, so that its text, which
results embed, is complete.
"""

from __future__ import annotations

import math
from pathlib import Path

MAX_BYTES = 4_000_000


class BadTable(Exception):
    """Fault of a CSV file: what is wrong, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.problem, self.remedy = problem, remedy


def read(file: Path) -> tuple[list[str], list[list[float]]]:
    """Read the headings (if any) and the columns of a CSV file.

    Cells are separated by commas or semicolons; what follows # is a comment.

    Raises `BadTable` if it cannot be read, or its lines are not numbers in the same columns.
    """
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES + 1)
        text = data.decode("utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is not text"
        remedy = "give its path from the folder of the design file"
        raise BadTable(f"cannot be read ({reason})", remedy) from None
    if len(data) > MAX_BYTES:
        raise BadTable(f"has more than {MAX_BYTES} bytes", "give a table of fewer lines")
    headings: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        cells = [cell.strip() for cell in line.partition("#")[0].replace(";", ",").split(",")]
        if not any(cells):
            continue
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows:
                remedy = "write numbers with commas between them"
                raise BadTable(f"has no numbers in line {number}", remedy) from None
            headings = cells
            continue
        if not all(map(math.isfinite, row)) or (rows and len(row) != len(rows[0])):
            raise BadTable(
                f"has {len(row)} numbers in line {number}, or one that is not finite",
                "give every line finite numbers in the same columns",
            )
        rows.append(row)
    return headings, list(map(list, zip(*rows, strict=True)))
