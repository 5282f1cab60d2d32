"""Noise of sensors, actuators and drivers: a number, a known part, points, a table or a file.

>>> density("bosem", [1.0, 1000.0]).round(13).tolist()
[1.5e-10, 6e-11]
>>> density([[1.0, 1e-9], [100.0, 1e-11]], [10.0]).round(13).tolist()
[1e-10]
"""

from __future__ import annotations

import csv
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from msgspec import Meta

from suspension_cli.design import key_rules, units
from suspension_cli.design.typed_tables import Plausible, Problems, Table, doc, key
from suspension_cli.errors import suggest

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float
    from numpy.typing import ArrayLike

NOISY = Plausible(1e-4, "more than that of any sensor", (("nm/sqrt(Hz)", 1e-9),))
"""Optical shadow sensors reach 1e-10 m/sqrt(Hz)."""
Density = Annotated[float, Meta(ge=0, le=1e3)]
MotionDensity = Annotated[float, doc(plausible=NOISY, ge=0, le=1e3)]
PositiveDensity = Annotated[float, Meta(gt=0, le=1e3)]
PositiveMotion = Annotated[float, doc(plausible=NOISY, gt=0, le=1e3)]
Point = Annotated[
    list[Annotated[float, Meta(gt=0, le=1e9)]], doc("frequency in Hz, and density", count=2)
]
DRIVERS = {"dac-18bit": 1.5e-7}
"""Noise of known drivers, V/sqrt(Hz), flat: the 18-bit converter of Advanced LIGO (LIGO-T0900338 as
quoted in log 7154 of LIGO Hanford)."""


class NoiseSpectrum(Table, frozen=True):
    """Amplitude spectral density against frequency."""

    asd: Density | Annotated[list[PositiveDensity], Meta(min_length=2)] | None = key(
        "above the corner, or one per frequency, in the unit of the key"
    )
    corner: units.Corner | None = key("Hz; the density is asd sqrt(1 + corner / f)")
    frequency: list[units.Frequency] | None = key("Hz, ascending; log-interpolated", min_length=2)
    file: str | None = key("file of the spectrum: CSV, HDF5, MATLAB or DTT XML", max_length=500)
    column: str | None = key("column, dataset or channel of file, where it has several")
    source: str = key("where the numbers come from", "", max_length=1000)

    def check(self) -> Problems:
        """Check that lists have one length."""
        if self.file is not None:
            problem = "is read where the design is read from a file, and not from a text"
            yield "file", problem, "give {frequency = [...], asd = [...]}"
            return
        counts = [len(one) if isinstance(one, list) else 0 for one in (self.asd, self.frequency)]
        if self.asd is None or counts[0] != counts[1]:
            problem = "asd and frequency are lists of one length, or asd a number without frequency"
            yield "", problem, "give {asd, corner}, {frequency = [...], asd = [...]} or {file}"

    rules = (
        key_rules.excludes("frequency", "corner"),
        key_rules.ascending("frequency"),
        key_rules.needs("column", "file"),
    )


class MotionSpectrum(NoiseSpectrum, frozen=True):
    """Amplitude spectral density of a sensor against frequency, as motion."""

    asd: MotionDensity | Annotated[list[PositiveMotion], Meta(min_length=2)] | None = key(
        "m/sqrt(Hz) or rad/sqrt(Hz): above the corner, or one per frequency"
    )


Points = Annotated[list[Point], Meta(min_length=2)]
MotionNoise = MotionDensity | str | Points | MotionSpectrum
Noise = Density | str | Points | NoiseSpectrum


@cache
def sensors() -> dict[str, NoiseSpectrum]:
    """Noise of known sensors as motion, m/sqrt(Hz), by name."""
    text = Path(__file__).with_name("sensor_noise.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    points: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        points.setdefault(row["sensor"], []).append((float(row["frequency"]), float(row["asd"])))
    return {
        name: NoiseSpectrum(frequency=[f for f, _ in own], asd=[asd for _, asd in own])
        for name, own in points.items()
    }


def known() -> dict[str, float | NoiseSpectrum]:
    """Noise of known sensors and drivers, by name."""
    return {**sensors(), **DRIVERS}


def problems(table: Table, *keys: str) -> Problems:
    """Check the names and points of keys that take noise."""
    for name in keys:
        noise = getattr(table, name)
        known_here = DRIVERS if name == "driver_noise" else sensors()
        if isinstance(noise, str) and noise not in known_here:
            problem = "is neither a known sensor or driver nor a file beside the design"
            yield name, problem, f"{suggest(noise, [*known_here])}; or give a file, or a number"
        if isinstance(noise, list):
            frequency = [point[0] for point in noise]
            if any(after <= before for before, after in pairwise(frequency)):
                yield name, "has points that do not ascend", "sort [f, asd] by the frequency f"


def frequencies(noise: float | str | list[list[float]] | NoiseSpectrum) -> list[float]:
    """List the frequencies (Hz) at which a noise is given; none for one without a table."""
    spectrum = known()[noise] if isinstance(noise, str) else noise
    if isinstance(spectrum, list):
        return [point[0] for point in spectrum]
    if isinstance(spectrum, NoiseSpectrum) and spectrum.frequency is not None:
        return list(spectrum.frequency)
    return []


def density(
    noise: float | str | list[list[float]] | NoiseSpectrum, frequency: ArrayLike
) -> Float[np.ndarray, " frequency"]:
    """Evaluate an amplitude spectral density at frequencies in Hz, in the unit of its key.

    It is flat, or flat with power rising as 1/f below a corner, or interpolated on logarithmic
    axes and constant outside.
    """
    import numpy as np

    at = np.asarray(frequency, dtype=float)
    spectrum = known()[noise] if isinstance(noise, str) else noise
    if isinstance(spectrum, list):
        known_at, asd = np.array(spectrum).T
    elif isinstance(spectrum, NoiseSpectrum) and spectrum.frequency is not None:
        known_at = np.array(spectrum.frequency)
        asd = np.asarray(spectrum.asd)
    elif isinstance(spectrum, NoiseSpectrum):
        with np.errstate(divide="ignore"):
            return np.asarray(spectrum.asd) * np.sqrt(1 + (spectrum.corner or 0.0) / at)
    else:
        return np.full(at.shape, spectrum)
    with np.errstate(divide="ignore"):
        return np.exp(np.interp(np.log(at), np.log(known_at), np.log(asd)))
