"""Tables of numbers in text files: columns under one line of names."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.scene.arrays import Array


@dataclass(frozen=True)
class Table:
    """Columns against frequency.

    Attributes
    ----------
    file : str
    frequency : (n,) array
        Hz, ascending, above 0.
    column : dict of (n,) arrays
        By name, none negative; "" is the name of the only column of a file without names.
    """

    file: str
    frequency: Array
    column: dict[str, Array]


def read(path: Path) -> Table:
    """Read a table: frequency in Hz, then one or more columns; `#` begins a comment.

    Commas, semicolons, tabs or spaces separate columns. A first line of names is optional where
    there are two columns; what follows a name in brackets (a unit) is ignored.

    Raises
    ------
    InputError
        With the number of the line at fault.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise _fault(path, "", f"cannot be read ({error.strerror})", "name a CSV file") from None
    except UnicodeDecodeError:
        raise _fault(path, "", "is not text", "save it as CSV (UTF-8)") from None
    names: list[str] = []
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), 1):
        bare = line.partition("#")[0].strip()
        if not bare:
            continue
        cells = [cell.strip() for cell in _split(bare)]
        if not rows and not names and not _is_number(cells[0]):
            names = [re.sub(r"[(\[].*", "", cell).strip().strip('"').lower() for cell in cells]
            continue
        rows.append(_parse_row(path, number, cells, names, rows))
    if not rows:
        raise _fault(path, "", "contains no numbers", "write lines of a frequency and values")
    values = np.array(rows)
    if not names:
        if values.shape[1] > 2:
            problem = f"has {values.shape[1]} columns without names"
            raise _fault(path, "line 1", problem, "begin with a line such as frequency,x,y,z")
        names = ["frequency", ""]
    twice = next((name for n, name in enumerate(names) if name in names[:n]), None)
    if twice is not None:
        problem = f"names two columns {format_value(twice)}"
        raise _fault(path, "line 1", problem, "give each a name of its own")
    return Table(str(path), values[:, 0], dict(zip(names[1:], values[:, 1:].T, strict=True)))


def interpolate(frequency: Array, at: Array, value: Array) -> Array:
    """Interpolate a spectrum (n,) at frequencies (f,): straight lines in a log-log plot.

    Next to a value of 0 the lines are straight in a linear plot.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.exp(np.interp(np.log(frequency), np.log(at), np.log(value)))
    straight = np.interp(frequency, at, value)
    positive = np.interp(frequency, at, (value == 0).astype(float)) == 0
    return np.where(positive, log, straight)


def _split(line: str) -> list[str]:
    for separator in (",", ";", "\t"):
        if separator in line:
            return line.split(separator)
    return line.split()


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _parse_row(
    path: Path, number: int, cells: list[str], names: list[str], rows: list[list[float]]
) -> list[float]:
    """Parse a line of numbers, with its place among those before it."""
    where = f"line {number}"
    count = len(names) or (len(rows[0]) if rows else len(cells))
    if len(cells) != count or count < 2:
        problem = f"has {len(cells)} columns instead of {max(count, 2)}"
        raise _fault(path, where, problem, "write a frequency and a value for each column")
    for cell in cells:
        if not _is_number(cell):
            raise _fault(path, where, "is not a number", "write for example 1.5e-9", cell)
    row = [float(cell) for cell in cells]
    if not np.isfinite(row).all():
        raise _fault(path, where, "contains a number that is not finite", "remove the line")
    if row[0] <= 0:
        raise _fault(path, where, "has no positive frequency", "give it in Hz", cells[0])
    if rows and row[0] <= rows[-1][0]:
        problem = f"frequency is not above the one before it ({rows[-1][0]:g})"
        raise _fault(path, where, problem, "sort the lines by frequency, each once", cells[0])
    if min(row[1:]) < 0:
        problem = "has a negative value"
        remedy = "give amplitude spectral densities, not dB (dB: 10^(dB/20))"
        raise _fault(path, where, problem, remedy, next(c for c in cells[1:] if float(c) < 0))
    return row


def _fault(path: Path, key: str, problem: str, remedy: str, value: str | None = None) -> InputError:
    given = None if value is None else format_value(float(value) if _is_number(value) else value)
    return InputError([Fault(key, problem, remedy, given)], str(path))
