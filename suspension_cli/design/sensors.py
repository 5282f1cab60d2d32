"""Noise of sensors, and OSEMs: a position sensor and a coil at one point of a body."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from suspension_cli.design import tables, units
from suspension_cli.design.tables import Plausible, Problems, Table, doc, key

NOISY = Plausible(1e-4, "more than that of any sensor", (("nm/sqrt(Hz)", 1e-9),))
"""Optical shadow sensors reach 1e-10 m/sqrt(Hz)."""
SpectralDensity = Annotated[float, doc(plausible=NOISY, ge=0, le=1e3)]
PositiveDensity = Annotated[float, doc(plausible=NOISY, gt=0, le=1e3)]
Reference = Literal["support", "inertial"]


class NoiseSpectrum(Table, frozen=True):
    """Amplitude spectral density of a sensor against frequency."""

    asd: SpectralDensity | Annotated[list[PositiveDensity], Meta(min_length=2)] = key(
        "m/sqrt(Hz) or rad/sqrt(Hz): above the corner, or one per frequency"
    )
    corner: units.Corner | None = key("Hz; the density is asd sqrt(1 + corner / f)")
    frequency: list[units.Frequency] | None = key("Hz, ascending; log-interpolated", min_length=2)

    def check(self) -> Problems:
        """Check that lists have one length."""
        counts = [len(one) if isinstance(one, list) else 0 for one in (self.asd, self.frequency)]
        if counts[0] != counts[1]:
            problem = "asd and frequency are lists of one length, or asd a number without frequency"
            yield "", problem, "give {asd, corner} or {frequency = [...], asd = [...]}"

    rules = (tables.excludes("frequency", "corner"), tables.ascending("frequency"))


SENSORS = {
    # after LIGO-T0900496, as rounded in LIGO's public noise budget of triple suspensions (function
    # HAM_SUS_OSEM_noise, "original_data"); Carbone et al., Class. Quantum Grav. 29, 115005 (2012)
    # describe the sensor
    "bosem": NoiseSpectrum(
        frequency=[0.1, 0.5, 1.0, 10.0, 100.0], asd=[1e-8, 3e-10, 1.5e-10, 6e-11, 6e-11]
    ),
}
"""Noise of known sensors, m/sqrt(Hz)."""


class Osem(Table, frozen=True):
    """An optical sensor and electromagnetic actuator: senses and pushes a body along a line."""

    name: units.Name
    stage: units.Name = key("the stage that it senses and pushes", names="stage")
    at: units.Vector = key("the point, from the stage's COM, m")
    direction: Literal["x", "y", "z", "-x", "-y", "-z"] | units.Direction = key(
        "of positive readings and forces: an axis, or a vector"
    )
    reference: Reference = key("that of a loop, whose OSEMs have the same one", "support")
    sensor: Literal["bosem"] | None = key("a known sensor, for its noise")
    sensor_noise: SpectralDensity | NoiseSpectrum = key("as that of a loop, m/sqrt(Hz)", 0.0)
    force_noise: float = key("of the coil, N/sqrt(Hz), flat", 0.0, ge=0, le=1e3)
    driver_noise: float = key("of the driver's input, V/sqrt(Hz), flat", 0.0, ge=0, le=1e3)
    coil: units.Positive | None = key("force per current, N/A", unit="N/A")
    transconductance: units.Positive | None = key("current per input voltage, A/V", unit="A/V")
    counts_per_volt: units.Positive | None = key("counts per voltage, 1/V", unit="1/V")
    range: units.Positive | None = key("largest input, V; without transconductance current, A")

    def check(self) -> Problems:
        """Check the direction."""
        if not any(self.vector):
            yield "direction", "has no direction", "give x, y, z, not all zero"

    rules = (
        tables.excludes("sensor", "sensor_noise"),
        tables.needs("transconductance", "coil"),
        tables.needs("counts_per_volt", "transconductance"),
        tables.needs("driver_noise", "transconductance"),
        tables.needs("range", "coil"),
    )

    @property
    def vector(self) -> tuple[float, ...]:
        """Unit vector of the direction."""
        along = self.direction
        if isinstance(along, str):
            along = [(-1.0 if along[0] == "-" else 1.0) * (along[-1] == axis) for axis in "xyz"]
        size = math.hypot(*along) or 1.0
        return tuple(part / size for part in along)

    @property
    def actuator_noise(self) -> float:
        """Amplitude spectral density of the force, N/sqrt(Hz)."""
        driven = self.driver_noise * (self.transconductance or 0.0) * (self.coil or 0.0)
        return math.hypot(self.force_noise, driven)
