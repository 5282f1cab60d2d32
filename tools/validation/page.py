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
    """

    title: str
    lines: list[str] = field(default_factory=list)
    modes: list[list[str]] = field(default_factory=list)


def table(head: list[str], rows: list[list[str]], *, left: int = 1) -> list[str]:
    """Lines of a table whose first columns are aligned to the left, between empty lines."""
    rule = ["---" if n < left else "---:" for n in range(len(head))]
    return ["", *(f"| {' | '.join(row)} |" for row in [head, rule, *rows]), ""]


def percent(value: float) -> str:
    """A relative deviation in percent, with two digits and its sign."""
    digits = max(2, 1 - int(np.floor(np.log10(max(abs(value) * 100, 1e-6)))))
    return f"{100 * value:+.{min(digits, 5)}f} %"
