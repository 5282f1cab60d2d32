"""Tables of text, as wide as the terminal."""

from __future__ import annotations

import contextlib
import math
import re
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass

LEAST = 24
"""Least width of a last column of text; in a narrower terminal lines are too long."""
GLUE = "\ue000"
"""Stands for a space at which text is not folded."""
AS_GIVEN = "as given"
"""Form of a column of numbers that the user gave, see `write_given`."""
PLACE = re.compile("\ue001(\\d+)\ue002")
"""Stands for a table that was collected instead of rendered; with its number."""


@dataclass(frozen=True)
class Table:
    """Columns and rows, as `render` takes them."""

    columns: Mapping[str, str]
    rows: Sequence[Sequence[float | str | None]]

    @property
    def cells(self) -> list[list[str]]:
        """Text of every cell, a list for each column."""
        columns = [[row[n] for row in self.rows] for n in range(len(self.columns))]
        return [
            _cells(column, form)
            for column, form in zip(columns, self.columns.values(), strict=True)
        ]


_COLLECTED: ContextVar[list[Table] | None] = ContextVar("_COLLECTED", default=None)


@contextlib.contextmanager
def collecting() -> Iterator[list[Table]]:
    """Collect tables instead of rendering them: `render` returns `PLACE` with their number.

    Documents in other formats than text thus have the tables that commands print.
    """
    found: list[Table] = []
    token = _COLLECTED.set(found)
    try:
        yield found
    finally:
        _COLLECTED.reset(token)


def width() -> int:
    """Length of a line in the terminal; unlimited where stdout is not a terminal."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else 1_000_000


def render(columns: Mapping[str, str], rows: Iterable[Sequence[float | str | None]]) -> str:
    r"""Render a table: numbers are aligned on the point, text in the last column is folded.

    Parameters
    ----------
    columns
        Headings, with units on a second line, and the format of the numbers below; "" for text,
        `AS_GIVEN` for numbers that the user gave.
    rows
        Numbers or text; None and numbers that are not finite become "-".

    >>> print(render({"frequency\nHz": "#.3g", "mode": ""}, [(0.79, "yaw"), (12.5, "roll")]))
      frequency  mode
             Hz
          0.790  yaw
         12.5    roll
    """
    table = Table(columns, [*rows])
    collected = _COLLECTED.get()
    if collected is not None:
        collected.append(table)
        return f"\ue001{len(collected) - 1}\ue002"
    return _text(table)


def _text(table: Table) -> str:
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table as Grid
    from rich.text import Text

    formats = table.columns.values()
    cells = [
        align(head.split("\n"), column) if form else [head, *column]
        for head, form, column in zip(table.columns, formats, table.cells, strict=True)
    ]
    widths = [2 + max(map(cell_len, "\n".join(column).split("\n"))) for column in cells]
    if not [*formats][-1]:
        widths[-1] = min(widths[-1], max(width() - 2 - sum(widths[:-1]), LEAST))
    grid = Grid.grid()
    for wide in widths:
        grid.add_column(width=wide)
    for row in zip(*cells, strict=True):
        grid.add_row(*map(Text, row))
    console = Console(width=sum(widths), force_terminal=False, force_jupyter=False)
    with console.capture() as captured:
        console.print(grid)
    lines = captured.get().replace(GLUE, " ").splitlines()
    return "\n".join(f"  {line}".rstrip() for line in lines)


def with_error(value: float, error: float) -> str:
    """Write a number with its standard error, in brackets, in units of the last digit.

    Numbers whose error is below their fifth digit, or unknown, are written alone.

    >>> with_error(0.496083, 0.000123), with_error(-3.2e-22, 1.5e-23), with_error(152.0, 23.0)
    ('0.49608(12)', '-3.20(15)e-22', '152(23)')
    """
    largest = max(abs(value), abs(error))
    if not (math.isfinite(largest) and error > 1e-5 * abs(value)):
        return _cell(value, "#.5g")
    exponent = 0 if 1e-4 <= largest < 1e5 else math.floor(math.log10(largest))
    scale = 10.0**exponent
    place = int(f"{error / scale:.1e}".partition("e")[2])  # of the first digit, when rounded
    decimals = max(1 - place, 0)
    last_digits = round(error / scale * 10**decimals)
    power = f"e{exponent:+03d}" if exponent else ""
    return f"{value / scale:.{decimals}f}({last_digits}){power}"


def write_given(values: Sequence[float]) -> list[str]:
    """Write numbers that the user gave with all digits, those of a computed grid with 5 or more.

    More are written where different numbers would look alike.

    >>> write_given([10.0, 10.00001, 10.0 ** 0.5])
    ['10', '10.00001', '3.1623']
    """
    written: list[str] = []
    for digits in range(5, 18):
        written = [_with_digits(value, digits) for value in values]
        if len({*written}) == len({*values}):
            break
    return written


def _with_digits(value: float, digits: int) -> str:
    """Write a number with 12 digits if these are all that it has, else with so many."""
    complete = f"{value:.12g}"
    return complete if float(complete) == value else f"{value:.{digits}g}"


def _cells(column: Sequence[float | str | None], form: str) -> list[str]:
    if form == AS_GIVEN:
        return write_given([float(value or 0.0) for value in column])
    return [_cell(value, form) for value in column]


def _cell(value: float | str | None, form: str) -> str:
    from suspension_cli.errors import escape_unprintable

    if isinstance(value, str):
        return re.sub(r" (?=%|[-+]\d)", GLUE, escape_unprintable(value))
    return f"{value:{form}}" if value is not None and math.isfinite(value) else "-"


def align(heads: list[str], cells: list[str]) -> list[str]:
    """Align numbers on the point, or on the right where some have exponents; words on the right."""
    if not any(re.search(r"[\d)]e[-+]", cell) for cell in cells):
        points = [re.fullmatch(r"[-+]?[\d,]+(\.?\d*(?:\(\d+\))?)", cell) for cell in cells]
        longest = max((len(point[1]) for point in points if point), default=0)
        pairs = zip(cells, points, strict=True)
        cells = [cell + " " * (longest - len(p[1])) if p else cell for cell, p in pairs]
    wide = max(map(len, heads + cells))
    return ["\n".join(head.rjust(wide) for head in heads), *(cell.rjust(wide) for cell in cells)]
