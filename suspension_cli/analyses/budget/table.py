"""Tables of spectra in text files: frequency, and a column per motion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.csv_columns import PER_HZ, PER_M, PER_RAD, BadTable, split_unit
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.measurements import text
from suspension_cli.measurements.columns import Columns, recognise
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Inexact

UNITS = {"m": PER_M, "rad": PER_RAD, "1": {"1": 1.0, "m/m": 1.0, "rad/rad": 1.0, "%": 100.0}}
"""Units by kind of a column, without "per sqrt(Hz)"; 1 for ratios."""
PER_ROOT_HZ = r"\s*(/\s*(sqrt\s*\(?Hz\)?|rtHz|\u221aHz|Hz\^\(?(1/2|0\.5)\)?)|Hz\^\(?-(1/2|0\.5)\)?)"


@dataclass(frozen=True)
class Table:
    """Columns of values, at least 0, against frequency (Hz, ascending, above 0).

    The only column of a file without names is "".
    """

    file: str
    frequency: Array
    column: dict[str, Array]


def read(path: Path, unit: str, arm: float = 0.0) -> Table:
    """Read a table: frequency, then one or more columns (format: `measurements.text`).

    Headings are optional for two columns, and may give units: "f (mHz)", "x (um/sqrt(Hz))".

    Parameters
    ----------
    unit
        SI unit of columns: "m" (coordinates that are rotations have "rad"), "rad", or "1".
    arm
        Length (m) whose strain columns in m may have as unit, "strain"; 0 for none.

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
        if not columns.headed and width > 2:
            problem = f"has {width} columns without headings"
            raise InputError([Fault("", problem, "begin with a line such as frequency,x,y,z")])
        known = recognise(columns.names) if columns.headed else {}
        if "frequency_unit" in known:
            raise InputError([Fault("", "has frequencies in rad/s", "give them in Hz")])
        first = columns.names.index(known.get("frequency", columns.names[0]))
        titles = columns.names if columns.headed else ["frequency", ""]
        names, scales = zip(
            *(_split(title, "Hz" if n == first else unit, arm) for n, title in enumerate(titles)),
            strict=True,
        )
        for n, name in enumerate(names):
            if name in names[:n]:
                remedy = "give each column a heading of its own"
                raise InputError([Fault("", "has two columns of one name", remedy, name)])
        order = [first, *(n for n in range(width) if n != first)]
        names = [names[n] for n in order]
        values = [np.asarray(columns.read(n)) for n in order]
        _check(np.array(values).T, columns)
        values = [value / scales[n] for n, value in zip(order, values, strict=True)]
        return Table(str(path), values[0], dict(zip(names[1:], values[1:], strict=True)))


def _split(title: str, unit: str, arm: float) -> tuple[str, float]:
    """Split a heading into its name, in lower case, and its unit, as the number per SI unit."""
    if unit == "Hz":
        units = PER_HZ
    else:
        title = re.sub(PER_ROOT_HZ, "", title) if unit != "1" else title
        units = UNITS["rad" if unit == "m" and title.lower().startswith(DOFS[3:]) else unit]
        units = units | ({"strain": 1 / arm} if arm and unit == "m" else {})
    try:
        name, scale = split_unit(title, units)
    except BadTable as error:
        per = " per sqrt(Hz)" if unit in ("m", "rad") else ""
        raise InputError.of("", error.problem, error.remedy + per) from None
    return name.lower(), scale


def _check(rows: Inexact[np.ndarray, "line column"], columns: Columns) -> None:
    """Raise `InputError` for the first line whose frequency or values are at fault."""
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
    """Interpolate a spectrum (n,) at frequencies (f,) by power laws, linearly next to a 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.exp(np.interp(np.log(frequency), np.log(at), np.log(value)))
    straight = np.interp(frequency, at, value)
    positive = np.interp(frequency, at, (value == 0).astype(float)) == 0
    return np.where(positive, log, straight)
