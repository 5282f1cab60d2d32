"""Columns of numbers of the CSV files that a design names.

When a design is read, the columns of each CSV file replace its name, so that its text, which
results embed, is complete.
"""

from __future__ import annotations

import math
from pathlib import Path

from suspension_cli.errors import InputError
from suspension_cli.files import bounded


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
        text = bounded.read_text(file, bounded.TOML, "a CSV file")
    except InputError as error:
        remedy = "give its path from the folder of the design file"
        raise BadTable(error.faults[0].problem, remedy) from None
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
