"""Amplitude spectral densities and transmissibilities as tables, and how they are read."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.errors import InputError, attribute_faults_to
from suspension_cli.files import columns
from suspension_cli.files.columns import PER_M, PER_RAD

if TYPE_CHECKING:
    from jaxtyping import Float

UNITS = {"m": PER_M, "rad": PER_RAD, "1": {"1": 1.0, "m/m": 1.0, "rad/rad": 1.0, "%": 100.0}}
"""Units by kind of a column, without "per sqrt(Hz)"; 1 for ratios."""
PER_ROOT_HZ = r"\s*(/\s*(sqrt\s*\(?Hz\)?|rtHz|\u221aHz|Hz\^\(?(1/2|0\.5)\)?)|Hz\^\(?-(1/2|0\.5)\)?)"


@dataclass(frozen=True)
class Spectrum:
    """Values, at least 0, at some frequencies; power laws between them.

    Attributes
    ----------
    name
        Of the model or file.
    frequency
        Hz, ascending, above 0.
    value
        m/sqrt(Hz) or rad/sqrt(Hz); 1 for transmissibilities.
    """

    name: str
    frequency: Float[np.ndarray, " point"]
    value: Float[np.ndarray, " point"]

    def at(self, frequency: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
        """Interpolate at frequencies in Hz by power laws, linearly next to a 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.interp(np.log(frequency), np.log(self.frequency), np.log(self.value))
        straight = np.interp(frequency, self.frequency, self.value)
        positive = np.interp(frequency, self.frequency, (self.value == 0).astype(float)) == 0
        return np.where(positive, np.exp(log), straight)

    def through(self, platform: Spectrum) -> Spectrum:
        """Multiply by a transmissibility, where both are known."""
        low = max(self.frequency[0], platform.frequency[0])
        high = min(self.frequency[-1], platform.frequency[-1])
        at = np.unique(np.clip(np.union1d(self.frequency, platform.frequency), low, high))
        name = f"{self.name} x {platform.name}"
        return Spectrum(name, at, self.at(at) * platform.at(at))


def read(path: Path, unit: str, arm: float = 0.0) -> dict[str, Spectrum]:
    """Read a table: frequency, then one or more columns (format: `files.columns`).

    Headings are optional for two columns, and may give units: "f (mHz)", "x (um/sqrt(Hz))". The
    keys of the result are the headings in lower case; "" is the only column of a file without.

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
            name, scale = _split(source.names[n], unit, arm) if source.headed else ("", 1.0)
            if name in found:
                remedy = "give each column a heading of its own"
                raise InputError.of("", "has two columns of one name", remedy, name)
            remedy = "give amplitude spectral densities, not dB: 10^(dB/20)"
            values = source.numbers(n, name or "value", 0.0, remedy=remedy) / scale
            found[name] = Spectrum(str(path), frequency, values)
        return found


def _split(title: str, unit: str, arm: float) -> tuple[str, float]:
    """Split a heading into its name, in lower case, and its unit, as the number per SI unit."""
    title = re.sub(PER_ROOT_HZ, "", title) if unit != "1" else title
    units = UNITS["rad" if unit == "m" and title.lower().startswith(DOFS[3:]) else unit]
    units = units | ({"strain": 1 / arm} if arm and unit == "m" else {})
    name, scale = columns.split_unit(title, units, "" if unit == "1" else " per sqrt(Hz)")
    return name.lower(), scale
