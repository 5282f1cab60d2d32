"""Columns of numbers of the CSV files that a design names; units of columns in their headings.

When a design is read, the columns of each CSV file replace its name, so that its text, which
results embed, is complete.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path

from suspension_cli.errors import InputError, format_value
from suspension_cli.files import bounded

_SMALL = {"m": 1e3, "u": 1e6, "\u00b5": 1e6, "\u03bc": 1e6, "n": 1e9, "p": 1e12, "f": 1e15}
PER_M = {"m": 1.0, "cm": 1e2} | {f"{prefix}m": number for prefix, number in _SMALL.items()}
PER_RAD = {"rad": 1.0} | {f"{prefix}rad": number for prefix, number in _SMALL.items()}
PER_HZ = {"Hz": 1.0, "hz": 1.0, "mHz": 1e3, "kHz": 1e-3}
"""Numbers of units per SI unit: to divide by them rounds correctly, 400 um are 0.0004 m."""


class BadTable(Exception):
    """Fault of a CSV file: what is wrong, and what to do."""

    def __init__(self, problem: str, remedy: str) -> None:
        super().__init__(problem)
        self.problem, self.remedy = problem, remedy


def split_unit(title: str, units: Mapping[str, float]) -> tuple[str, float]:
    """Split the heading of a column into its name and its unit, as the number per SI unit.

    The unit is in brackets, "x (um)", or a word that is one of `units`, position_mm; without either
    it is SI. Raises `BadTable` for another unit in brackets.
    """
    bracketed = re.match(r"(.*?)[\s_]*[(\[]([^)\]]*)", title.strip())
    if bracketed is not None:
        name, unit = bracketed[1], bracketed[2].strip()
        if unit not in units:
            problem = f"has the column {format_value(title)}, whose unit is not known"
            raise BadTable(problem, f"give it in {', '.join(unit for unit in units if unit)}")
        return name, units[unit]
    words = re.split(r"[\s_/]+", title.strip())
    for n, word in reversed([*enumerate(words)]):
        if word in units:
            return " ".join(words[:n]), units[word]
    return title.strip(), 1.0


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
