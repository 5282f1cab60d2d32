"""Spectra in files: frequencies, and amplitude spectral densities or ratios of some signals.

A file is a text of columns, HDF5 or MATLAB of vectors, or XML of DTT with its channels. The one
reader of the spectra of the ground, platforms, sensors, actuators and requirements.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.conventions import DOFS
from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files import columns, data_files
from suspension_cli.files.columns import PER_M, PER_RAD, Columns

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    Points = tuple[Float[np.ndarray, " point"], Float[np.ndarray, " point"]]
    """Frequencies in Hz, ascending, above 0, and values, at least 0."""

_PREFIXES = {"": 1.0, "m": 1e3, "u": 1e6, "n": 1e9, "p": 1e12, "f": 1e15}
PER_FORCE = {f"{prefix}{unit}": per for prefix, per in _PREFIXES.items() for unit in ("N", "Nm")}
PER_V = {f"{prefix}V": per for prefix, per in _PREFIXES.items()}
UNITS = {
    "m": PER_M,
    "rad": PER_RAD,
    "motion": PER_M | PER_RAD,
    "force": PER_FORCE,
    "voltage": PER_V,
    "1": {"1": 1.0, "m/m": 1.0, "rad/rad": 1.0, "%": 100.0},
}
"""Units by kind of a column, without "per sqrt(Hz)"; 1 for ratios."""
PER_ROOT_HZ = r"\s*(/\s*(sqrt\s*\(?Hz\)?|rtHz|\u221aHz|Hz\^\(?(1/2|0\.5)\)?)|Hz\^\(?-(1/2|0\.5)\)?)"


def read(path: Path, unit: str, arm: float = 0.0) -> dict[str, Points]:
    """Read frequencies, and one or more columns.

    Headings are optional for two columns of text, and may give units: "f (mHz)",
    "x (um/sqrt(Hz))". The keys of the result are the headings in lower case; "" is the only column
    of a file without.

    `unit` is the SI unit of columns: "m" (coordinates that are rotations have "rad"), "rad", "1",
    "motion" (m or rad), "force" (N or N m) or "voltage". Columns in m may be strains of an arm of
    a length in m. Raises `InputError` with the line at fault.
    """
    with attribute_faults_to(str(path)):
        source = data_files.open_data_file(path)
        source = source if isinstance(source, Columns) else source.spectra
        width = len(source.names)
        if width < 2:
            problem = f"has one {source.noun}"
            raise InputError.of("", problem, "give a frequency and a value per point")
        if not source.headed and width > 2:
            problem = f"has {width} columns without headings"
            raise InputError.of("", problem, "begin with a line such as frequency,x,y,z")
        first = columns.recognise(source.names).get("frequency", 0) if source.headed else 0
        frequency = source.frequencies(first, low=1e-9)
        found = {}
        for n in (n for n in range(width) if n != first):
            name, scale = _split_heading(source.names[n], unit, arm) if source.headed else ("", 1.0)
            if name in found:
                remedy = "give each column a heading of its own"
                raise InputError.of("", "has two columns of one name", remedy, name)
            remedy = "give amplitude spectral densities, not dB: 10^(dB/20)"
            values = source.numbers(n, name or "value", 0.0, remedy=remedy) / scale
            if len(values) != len(frequency):
                problem = f"has {len(values)} elements, but there are {len(frequency)} frequencies"
                raise InputError.of(name, problem, "give one value per frequency")
            found[name] = frequency, values
        return found


def _split_heading(title: str, unit: str, arm: float) -> tuple[str, float]:
    """Split a heading into its name, in lower case, and its unit, as the number per SI unit."""
    title = re.sub(PER_ROOT_HZ, "", title) if unit != "1" else title
    units = UNITS["rad" if unit == "m" and title.lower().startswith(DOFS[3:]) else unit]
    units = units | ({"strain": 1 / arm} if arm and unit == "m" else {})
    name, scale = columns.split_unit(title, units, "" if unit == "1" else " per sqrt(Hz)")
    return name.lower(), scale
