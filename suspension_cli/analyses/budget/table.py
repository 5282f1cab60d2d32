"""Tables of spectra in text files: frequency, and a column per motion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files import columns
from suspension_cli.files.columns import PER_M, PER_RAD
from suspension_cli.scene.arrays import Array

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


def read(path: Path, unit: str) -> Table:
    """Read a table: frequency, then one or more columns (format: `files.columns`).

    Headings are optional for two columns, and may give units: "f (mHz)", "x (um/sqrt(Hz))".

    Parameters
    ----------
    unit
        SI unit of columns: "m" (coordinates that are rotations have "rad"), "rad", or "1".

    Raises
    ------
    InputError
        With the line at fault.
    """
    with attribute_faults_to(str(path)):
        source = columns.read(path)
        width = len(source.names)
        if width < 2:
            problem, remedy = "has one column", "write a frequency and a value per line"
            raise InputError.of("", problem, remedy)
        if not source.headed and width > 2:
            problem = f"has {width} columns without headings"
            raise InputError.of("", problem, "begin with a line such as frequency,x,y,z")
        first = columns.recognise(source.names).get("frequency", 0) if source.headed else 0
        frequency, found = source.frequencies(first, low=1e-9), {}
        for n in (n for n in range(width) if n != first):
            name, scale = _split(source.names[n], unit) if source.headed else ("", 1.0)
            if name in found:
                remedy = "give each column a heading of its own"
                raise InputError.of("", "has two columns of one name", remedy, name)
            remedy = "give amplitude spectral densities, not dB: 10^(dB/20)"
            found[name] = source.numbers(n, name or "value", 0.0, remedy=remedy) / scale
        return Table(str(path), frequency, found)


def _split(title: str, unit: str) -> tuple[str, float]:
    """Split a heading into its name, in lower case, and its unit, as the number per SI unit."""
    title = re.sub(PER_ROOT_HZ, "", title) if unit != "1" else title
    units = UNITS["rad" if unit == "m" and title.lower().startswith(DOFS[3:]) else unit]
    name, scale = columns.split_unit(title, units, "" if unit == "1" else " per sqrt(Hz)")
    return name.lower(), scale


def interpolate(frequency: Array, at: Array, value: Array) -> Array:
    """Interpolate a spectrum (n,) at frequencies (f,) by power laws, linearly next to a 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.exp(np.interp(np.log(frequency), np.log(at), np.log(value)))
    straight = np.interp(frequency, at, value)
    positive = np.interp(frequency, at, (value == 0).astype(float)) == 0
    return np.where(positive, log, straight)
