"""Table `[[cavity]]` of a design: light between two mirrors, whose pressure couples their motions.

The beam runs along +x from the first mirror to the second. Only the numbers of the table describe
the cavity: the drawn places of the mirrors may be metres apart where the mirrors are kilometres.
"""

from __future__ import annotations

import math
from typing import Annotated

from suspension_cli.conventions import GROUND
from suspension_cli.design import tables, units
from suspension_cli.design.links import BetweenBodies
from suspension_cli.design.tables import Plausible, Problems, doc, if_sound, key

LIGHT = 299_792_458.0
"""Speed of light in m/s (exact)."""
STRONG = Plausible(2e7, "more than any cavity holds", (("mW", 1e-3), ("uW", 1e-6)))
OPTICAL = Plausible(
    2e-5, "longer than infrared light", (("nm", 1e-9), ("um", 1e-6)), 1e-7, "shorter than light"
)
SHARP = Plausible(1e7, "higher than any cavity's", (), 10.0, "too low for a single pole", True)
Radius = Annotated[float, doc("radius of curvature in m", "m", ge=-1e12, le=1e12)]


class Cavity(BetweenBodies, frozen=True):
    """Light between two mirrors: optical spring, and angular stiffness of its pressure.

    The static pressure is taken as balanced by the control of length and alignment.
    """

    length: units.Length = key("length of the cavity in m; the drawn places do not matter")
    radii: list[Radius] = key(
        "radii of curvature of the two mirrors in m, above 0 if concave; 1e12 for a flat one",
        min_length=2,
        max_length=2,
    )
    power: float = key(
        "circulating power in W at the detuning", unit="W", plausible=STRONG, ge=0, le=1e12
    )
    detuning: float = key(
        "laser's frequency less the cavity's resonance in Hz, to be compared with the pole;"
        " above 0 the optical spring restores and drives, below 0 it repels and damps",
        0.0,
        unit="Hz",
        ge=-1e12,
        le=1e12,
    )
    pole: float | None = key("half width of the resonance in Hz", unit="Hz", ge=1e-6, le=1e12)
    finesse: float | None = key(
        "finesse, instead of pole", unit="1", plausible=SHARP, ge=1, le=1e12
    )
    transmission: float | None = key(
        "fraction of the power lost per round trip, through both mirrors and otherwise; instead of"
        " pole",
        unit="1",
        gt=0,
        le=0.9,
    )
    wavelength: units.Length = key("wavelength of the light in m", 1064e-9, plausible=OPTICAL)

    def _check_ends(self) -> Problems:
        if GROUND in self.between:
            yield "between", "ends on the ground", 'take a stage, or "support" for a mirror at rest'
        if 0 in self.radii:
            yield "radii", "must not be zero", "give 1e12 for a flat mirror"

    def _check_stability(self) -> Problems:
        first, second = self.g
        if not 0 < first * second < 1:
            problem = (
                f"has g1 g2 = (1 - length/R1) (1 - length/R2) = {first * second:.4g} with"
                f" length = {self.length:g} m, so no beam is stable"
            )
            yield "radii", problem, "choose radii and length with g1 g2 between 0 and 1"
        if abs(self.detuning) > self.spacing / 2:
            problem = f"is beyond half the free spectral range of {self.spacing:.4g} Hz"
            yield "detuning", problem, "count it from the nearest resonance"

    rules = (
        tables.at_most_one("pole", "finesse", "transmission"),
        tables.exactly_one(
            "pole", "finesse", "transmission", when=lambda cavity: cavity.detuning != 0
        ),
        _check_ends,
        if_sound,
        _check_stability,
    )

    @property
    def active(self) -> bool:
        """Whether the delay of the optical spring gives power to the motion."""
        return self.detuning > 0

    @property
    def g(self) -> tuple[float, float]:
        """Stability factors 1 - L/R of the two mirrors."""
        first, second = self.radii
        return 1 - self.length / first, 1 - self.length / second

    @property
    def spacing(self) -> float:
        """Free spectral range c / 2L in Hz."""
        return LIGHT / (2 * self.length)

    @property
    def half_width(self) -> float:
        """Half width of the resonance in Hz: given, or c / 4LF with the finesse F.

        If the power falls by the fraction T per round trip, the amplitude falls to r = sqrt(1 - T),
        and F = pi sqrt(r) / (1 - r).
        """
        if self.pole is not None:
            return self.pole
        finesse = self.finesse
        if self.transmission is not None:
            kept = math.sqrt(1 - self.transmission)
            finesse = math.pi * math.sqrt(kept) / (1 - kept)
        return math.inf if finesse is None else self.spacing / (2 * finesse)
