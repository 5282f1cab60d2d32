"""Parts of the page that all sections share."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass
class Section:
    """A section of the page.

    Attributes
    ----------
    lines
        Markdown, below the title.
    modes
        Rows of `results/validation_modes.csv`.
    files
        Rows of other tables, the head first, by name of the CSV file in `results/`.
    """

    title: str
    lines: list[str] = field(default_factory=list)
    modes: list[list[str]] = field(default_factory=list)
    files: dict[str, list[list[str]]] = field(default_factory=dict)

    def printed(self) -> list[str]:
        """Lines and the tables that the page has in CSV files."""
        tables = [table(head, rows) for head, *rows in self.files.values()]
        return [*self.lines, *(line for one in tables for line in one)]


def table(head: list[str], rows: list[list[str]], *, left: int = 1) -> list[str]:
    """Lines of a table whose first columns are aligned to the left, between empty lines."""
    rule = ["---" if n < left else "---:" for n in range(len(head))]
    return ["", *(f"| {' | '.join(row)} |" for row in [head, rule, *rows]), ""]


def percent(value: float) -> str:
    """A relative deviation in percent, with two digits and its sign."""
    return f"{number_of_percent(value)} %"


def number_of_percent(value: float) -> str:
    """A relative deviation in percent without the sign %, for columns that have it in the head."""
    digits = max(2, 1 - int(np.floor(np.log10(max(abs(value) * 100, 1e-6)))))
    return f"{100 * value:+.{min(digits, 5)}f}"
