"""Tables of spectra in text files: frequency, and a column per motion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.measurements import text
from suspension_cli.measurements.columns import Columns, recognise
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Inexact


@dataclass(frozen=True)
class Table:
    """Columns against frequency (Hz, ascending, above 0), none negative.

    The only column of a file without names has the name "".
    """

    file: str
    frequency: Array
    column: dict[str, Array]


def read(path: Path) -> Table:
    """Read a table: frequency in Hz, then one or more columns, with or without headings.

    Headings are optional where there are two columns; what follows one in brackets (a unit) is
    ignored. The format of text is that of `measurements.text`.

    Raises
    ------
    InputError
        With the line at fault.
    """
    with attribute_faults_to(str(path)):
        columns = text.read(path)
        width = len(columns.names)
        if width < 2:
            problem, remedy = "has one column", "write a frequency and a value per line"
            raise InputError([Fault("", problem, remedy)])
        if columns.headed:
            names = [re.sub(r"[(\[].*", "", name).strip().lower() for name in columns.names]
        elif width == 2:
            names = ["frequency", ""]
        else:
            problem = f"has {width} columns without headings"
            raise InputError([Fault("", problem, "begin with a line such as frequency,x,y,z")])
        for n, name in enumerate(names):
            if name in names[:n]:
                remedy = "give each column a heading of its own"
                raise InputError([Fault("", "has two columns of one name", remedy, name)])
        known = recognise(columns.names) if columns.headed else {}
        if "frequency_unit" in known:
            raise InputError([Fault("", "has frequencies in rad/s", "give them in Hz")])
        first = columns.names.index(known.get("frequency", columns.names[0]))
        order = [first, *(n for n in range(width) if n != first)]
        names = [names[n] for n in order]
        values = [np.asarray(columns.read(n)) for n in order]
        _check(np.array(values).T, columns)
        return Table(str(path), values[0], dict(zip(names[1:], values[1:], strict=True)))


def _check(rows: Inexact[np.ndarray, "line column"], columns: Columns) -> None:
    """Raise `InputError` for the first line (of n) whose frequency or values are at fault."""
    finite = np.isfinite(rows).all(1) & ~np.iscomplex(rows).any(1)
    real = np.real(rows)
    frequency, ascending = real[:, 0], np.diff(real[:, 0], prepend=-np.inf) > 0
    for good, problem, remedy, shown in (
        (finite, "contains something that is no finite number", "remove the line", None),
        (frequency > 0, "has no positive frequency", "give it in Hz", frequency),
        (
            ascending,
            "frequency is not above that of the line before",
            "sort the lines by frequency, each once",
            frequency,
        ),
        (
            (real[:, 1:] >= 0).all(1),
            "has a negative value",
            "give amplitude spectral densities, not dB: 10^(dB/20)",
            real[:, 1:].min(1),
        ),
    ):
        if not good.all():
            n = int(np.argmin(good))
            value = None if shown is None else format_value(float(shown[n]))
            raise InputError([Fault(columns.place(n), problem, remedy, value)])


def interpolate(frequency: Array, at: Array, value: Array) -> Array:
    """Interpolate a spectrum (n,) at frequencies (f,): straight lines in a log-log plot.

    Next to a value of 0 the lines are straight in a linear plot.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.exp(np.interp(np.log(frequency), np.log(at), np.log(value)))
    straight = np.interp(frequency, at, value)
    positive = np.interp(frequency, at, (value == 0).astype(float)) == 0
    return np.where(positive, log, straight)
