"""Columns of numbers that others wrote: their headings, units and valid numbers.

The one reader of tables in text: measurements, spectra of the ground and requirements, profiles of
fibres, stiffness of links. Datasets of HDF5 files and traces of DTT become `Columns` too, see
`measurements`.
"""

from __future__ import annotations

import csv
import math
import re
import string
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.files import whole_files

if TYPE_CHECKING:
    import numpy as np

WORDS = {
    "frequency": ("f", "freq", "frequency", "frequencies", "hz", "omega"),
    "real": ("re", "real"),
    "imaginary": ("im", "imag", "imaginary"),
    "magnitude": ("mag", "magnitude", "abs", "amplitude", "gain", "db"),
    "phase": ("phase", "deg", "arg", "angle"),
    "value": ("value", "h", "tf"),
    "coherence": ("coh", "coherence"),
    "uncertainty": ("sigma", "uncertainty", "err", "error", "std"),
}
"""Words of headings by what a column holds."""
_SMALL = {"m": 1e3, "u": 1e6, "\u00b5": 1e6, "\u03bc": 1e6, "n": 1e9, "p": 1e12, "f": 1e15}
PER_M = {"m": 1.0, "cm": 1e2} | {f"{prefix}m": number for prefix, number in _SMALL.items()}
PER_RAD = {"rad": 1.0} | {f"{prefix}rad": number for prefix, number in _SMALL.items()}
PER_HZ = {"Hz": 1.0, "hz": 1.0, "mHz": 1e3, "kHz": 1e-3}
PER_HZ |= dict.fromkeys(("rad/s", "rad", "omega"), 2 * math.pi)
"""Numbers of units per SI unit: to divide by them rounds correctly, 400 um are 0.0004 m."""


@dataclass(frozen=True)
class Columns:
    """Named columns of numbers of one file.

    `names` are headings if `headed`, else numbers from 1; of other files than texts those of
    datasets, by which `noun` calls them. `read` returns the column of a position in `names`,
    `place` the name of a row (from 0) in messages. `averages` is their number, if the file says.
    """

    names: Sequence[str]
    read: Callable[[int], Any]
    place: Callable[[int], str]
    headed: bool = True
    noun: str = "column"
    averages: float | None = None

    def find(self, key: str, wanted: str | int) -> int:
        """Return the position of a column given by heading or number; raises `InputError`."""
        if isinstance(wanted, int) and self.noun == "column":
            if 1 <= wanted <= len(self.names):
                return wanted - 1
            remedy = f"the file has columns 1 to {len(self.names)}"
        elif wanted in self.names:
            return list(self.names).index(str(wanted))
        elif not self.headed:
            remedy = f"it has no headings: give a number from 1 to {len(self.names)}"
        else:
            remedy = suggest(str(wanted), list(self.names))
        raise InputError.of(key, f"names no {self.noun}", remedy, format_value(wanted))

    def numbers(
        self,
        position: int,
        what: str,
        low: float = -math.inf,
        high: float = math.inf,
        remedy: str = "correct it",
        *,
        finite: bool = True,
        ascending: bool = False,
    ) -> np.ndarray:
        """Read real numbers, all from `low` to `high`, `finite` unless NaN means unknown.

        Raises `InputError` with the row of the first that is not.
        """
        import numpy as np

        values = np.asarray(self.read(position))
        name = format_value(self.names[position])
        if np.iscomplexobj(values) and not np.imag(values).any():  # as numpy.savetxt writes them
            values = np.real(values)
        if np.iscomplexobj(values):
            problem = f"the {self.noun} holds complex numbers"
            raise InputError.of(what, problem, "name it as value", name)
        values = values.astype(float)
        for n in np.flatnonzero(~np.isfinite(values) & finite)[:1]:
            problem = f"{self.noun} {name} holds {values[n]}, which is not a number"
            raise InputError.of(self.place(n), problem, "remove the point or correct it")
        for n in np.flatnonzero((values < low) | (values > high))[:1]:
            limit = f"below {low:g}" if values[n] < low else f"above {high:g}"
            raise InputError.of(self.place(n), f"the {what} {values[n]:.10g} is {limit}", remedy)
        for n in np.flatnonzero((np.diff(values) <= 0) & ascending)[:1]:
            again = values[n + 1] == values[n]
            problem = "is given twice" if again else f"follows {values[n]:.10g}"
            remedy = "remove one of them" if again else f"sort by ascending {what}"
            problem = f"the {what} {values[n + 1]:.10g} {problem}"
            raise InputError.of(self.place(n + 1), problem, remedy)
        return values

    def frequencies(self, position: int, scale: float | None = None, low: float = 0.0) -> Any:
        """Read ascending frequencies in Hz, in the unit of the heading or `scale` per Hz."""
        if scale is None:
            scale = split_unit(self.names[position], PER_HZ)[1] if self.headed else 1.0
        remedy = f"give frequencies in Hz, {'above 0' if low else 'from 0 up'}"
        values = self.numbers(position, "frequency", low * scale, remedy=remedy, ascending=True)
        return values / scale


def words(heading: str) -> list[str]:
    """List the words of a heading, in lower case."""
    return [word for word in re.split(r"[^a-z]+", heading.lower()) if word]


def recognise(names: Sequence[str]) -> dict[str, int]:
    """Recognise columns by their headings: positions by key of `WORDS`.

    >>> recognise(["freq [Hz]", "mag_dB", "phase"])
    {'frequency': 0, 'magnitude': 1, 'phase': 2}
    """
    found: dict[str, int] = {}
    for n, name in enumerate(names):
        roles = (role for word in words(name) for role, known in WORDS.items() if word in known)
        found.setdefault(next(roles, ""), n)
    found.pop("", None)
    return found


def recognise_complex(source: Columns) -> dict[str, int]:
    """Recognise a frequency beside one complex number, whatever the headings say of them."""
    import numpy as np

    if len(source.names) != 2 or not np.iscomplexobj(source.read(1)):
        return {}
    return {"frequency": 0, "value": 1}


def split_unit(title: str, units: Mapping[str, float], per: str = "") -> tuple[str, float]:
    """Split the heading of a column into its name and its unit, as the number per SI unit.

    The unit is in brackets, "x (um)", or a word that is one of `units`, position_mm; without either
    it is SI. Raises `InputError` for another unit in brackets (`per` ends its remedy).
    """
    bracketed = re.match(r"([^(\[]*)[(\[]([^)\]]*)", title.strip())
    if bracketed is not None:
        name = bracketed[1].rstrip("_" + string.whitespace)
        unit = bracketed[2].strip()
        if unit not in units:
            problem = f"has the column {format_value(title)}, whose unit is not known"
            raise InputError.of("", problem, f"give it in {', '.join(units)}{per}")
        return name, units[unit]
    parts = re.split(r"[\s_/]+", title.strip())
    for n, word in reversed([*enumerate(parts)]):
        if word in units:
            return " ".join(parts[:n]), units[word]
    return title.strip(), 1.0


def read(
    path: Path, most: int = whole_files.TEXT, kind: str = "a CSV, HDF5, MATLAB or DTT XML file"
) -> Columns:
    """Read a table with or without a line of headings, with comments after # or %.

    Cells are separated by commas, semicolons, tabs or blanks. Comment lines before the first
    numbers may hold the headings. Raises `InputError` with the line of a word among numbers, or of
    a wrong number of columns.
    """
    rows, above = _rows(whole_files.read_text(path, most, kind))
    if not rows:
        raise InputError.of("", "has no numbers", "give numbers in columns, the same in each line")
    width = len(rows[0][1])
    for line, cells in rows:
        if len(cells) != width:
            problem = f"has {len(cells)} columns, but line {rows[0][0]} has {width}"
            raise InputError.of(f"line {line}", problem, "give every line all columns")
    names = _headings(above, width)
    values = [[_number(cell, line) for cell in cells] for line, cells in rows]
    return Columns(
        names or [str(n) for n in range(1, width + 1)],
        lambda n: [row[n] for row in values],
        lambda n: f"line {rows[n][0]}",
        headed=names is not None,
    )


Lines = list[tuple[int, list[str]]]
"""Numbers of lines, and their cells."""


def _rows(text: str) -> tuple[Lines, Lines]:
    """Split lines with numbers into cells; also the lines above them, comments as line 0."""
    rows: Lines = []
    above: Lines = []
    mark = None
    for line, raw in enumerate(text.splitlines(), 1):
        bare = raw.strip()
        if bare.startswith(("#", "%")):
            comment = bare.lstrip("#% ")
            above += [] if rows else [(0, _split(comment, _delimiter(comment)))]
        elif bare:
            bare = bare.partition("#")[0]
            mark = mark if rows else _delimiter(bare)
            cells = _split(bare, mark)
            (rows if rows or _parsed(cells[0]) is not None else above).append((line, cells))
    return rows, above


def _headings(above: Lines, width: int) -> list[str] | None:
    """Choose the headings among the lines above the numbers; line 0 is a comment."""
    fitting = [cells for _, cells in above if len(cells) == width]
    for cells in reversed(fitting):
        if "frequency" in recognise(cells):
            return cells
    line, last = above[-1] if above else (0, [])
    if line and len(last) != width:
        problem = f"has {len(last)} headings for {width} columns"
        raise InputError.of(f"line {line}", problem, "give every column a heading")
    return fitting[-1] if line else None


def _delimiter(line: str) -> str | None:
    """Return the delimiter of a line: semicolon, comma or tab; None for blanks."""
    return next((mark for mark in (";", ",", "\t") if mark in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [cell.strip() for cell in cells]


def _parsed(cell: str) -> complex | float | None:
    """Return the real or complex number of a cell; None if it is none."""
    for kind, text in ((float, cell), (complex, cell.replace(" ", "").replace("i", "j"))):
        try:
            return kind(text)
        except ValueError:
            continue
    return None


def _number(cell: str, line: int) -> complex | float:
    number = _parsed(cell)
    if number is None:
        remedy = "write numbers with a decimal point, or # before a comment"
        raise InputError.of(f"line {line}", f"{format_value(cell)} is not a number", remedy)
    return number
