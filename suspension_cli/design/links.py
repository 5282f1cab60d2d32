"""Elements between any two bodies: tables `[[link]]`, `[[damper]]` and `[[cavity]]` of a design.

The beam of a cavity runs along +x from the first mirror to the second. Only the numbers of its
table describe it: the drawn places of the mirrors may be metres apart where the mirrors are
kilometres.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

from suspension_cli.conventions import DOFS, GROUND
from suspension_cli.design import key_rules, units
from suspension_cli.design.cross_sections import CrossSection, circle
from suspension_cli.design.typed_tables import Plausible, Problems, Table, doc, key

Between = Annotated[
    list[units.Name],
    doc(
        'the two bodies: a stage first, then another stage, "support" (the suspension point) or'
        ' "ground" (beside it)',
        min_length=2,
        max_length=2,
    ),
]
At = Annotated[
    units.Vector, doc("the common point, from the COM of the first body, nominal pose, m")
]
Active = Annotated[
    bool,
    doc(
        "it may give power to the motion, as a sensor with an actuator does; otherwise negative"
        " damping and loss are refused"
    ),
]
Series = Annotated[
    list[units.Coefficient], doc("one number per frequency, at least 2", min_length=2)
]


class BetweenBodies(Table, frozen=True):
    """Base of the tables of elements between any two bodies."""

    name: units.Name
    between: Between


class StiffnessTable(Table, frozen=True):
    """Complex stiffness against frequency: a CSV file, or its columns."""

    file: str | None = key(
        "CSV file, from this file's folder: frequency in Hz, two columns per axis (1 or 6)"
    )
    form: Literal["real-imaginary", "modulus-loss"] = key(
        "the two columns per axis; loss angle in rad",
        "real-imaginary",
    )
    axis: units.Dof | None = key("axis of a table of one axis; the others have no stiffness")
    frequency: list[units.Frequency] = key("Hz, ascending", [])
    real: list[Series] = key("per axis a list over frequency, N/m or N m/rad", [])
    imaginary: list[Series] = key("per axis a list over frequency, N/m or N m/rad", [])
    static: list[units.Coefficient] | None = key(
        "per axis; default real at the lowest frequency",
        min_length=1,
        max_length=6,
    )
    factor: float = key("factor on all stiffnesses of the table", 1.0, unit="1", gt=0, le=1e6)

    rules = (key_rules.ascending("frequency"),)

    def check(self) -> Problems:
        """Check that each axis has one value per frequency, and a static stiffness."""
        axes = 6 if self.axis is None else 1
        count = len(self.frequency)
        if self.file is not None:
            remedy = "read the design from its file, or give frequency, real and imaginary"
            yield "file", "is read only with a design file, not with its text alone", remedy
            return
        if not count:
            yield "", "has no frequencies", "give file, or frequency, real and imaginary"
            return
        for name, rows in (("real", self.real), ("imaginary", self.imaginary)):
            if len(rows) != axes:
                remedy = "give one list for the one axis, or remove axis"
                if axes == 6:
                    remedy = f'give a list per axis, {", ".join(DOFS)}, or name one: axis = "x"'
                yield name, f"has {len(rows)} axes instead of {axes}", remedy
                return
            if any(len(row) != count for row in rows):
                problem = f"has an axis without exactly {count} values"
                yield name, problem, "give one value per frequency"
                return
        static = [row[0] for row in self.real] if self.static is None else self.static
        if len(static) != axes:
            yield "static", f"has {len(static)} numbers for {axes} axes", "give one per axis"
        for axis, value, *rows in zip(DOFS, static, self.real, self.imaginary, strict=False):
            if value == 0 and any(map(any, rows)):
                what = f"the static stiffness along {self.axis or axis} is 0"
                remedy = "give static, or use damping for a viscous force"
                yield "static", f"{what}, but at other frequencies it is not", remedy


class Strands(Table, frozen=True):
    """Equal curved wires side by side that join the two bodies: a heat link, a cable."""

    to: units.Vector = key("far end, from the second body's COM (or suspension point), m")
    material: units.MaterialName
    diameter: units.Length = key("diameter of one wire, m")
    shape: Literal["u", "catenary", "points"] = key(
        '"u": vertical legs and a half circle below them; "points": straight pieces'
        " through points; without load"
    )
    count: int = key("number of wires, which bend independently", 1, ge=1, le=1_000_000)
    length: units.Length | None = key("length of one wire, m; not with points")
    points: list[units.Vector] = key("points between the ends, from the first body's COM, m", [])

    rules = (
        key_rules.by_kind(
            "shape",
            {"u": (["length"], []), "catenary": (["length"], []), "points": ([], ["points"])},
        ),
    )


class Link(BetweenBodies, frozen=True):
    """A spring between any two bodies at a common point: a heat link, a cable, a stop."""

    at: At = (0.0, 0.0, 0.0)
    stiffness: units.Matrix6 | None = key(
        "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N/m, N m/rad"
    )
    table: StiffnessTable | None = None
    strands: Strands | None = None
    loss_angle: units.LossAngle | None = key(
        "of the stiffness, rad; default for strands that of their material"
    )
    damping: units.Matrix6 | None = key("six elements or a full 6x6: N s/m, N m s/rad")
    preload: units.Wrench = key(
        "force (N) and torque (N m) on the first body at the point, nominal pose",
        [0.0] * 6,
    )
    active: Active = False

    rules = (
        key_rules.exactly_one("stiffness", "table", "strands"),
        key_rules.symmetric("stiffness", "damping"),
        key_rules.excludes("table", "loss_angle"),
    )

    @property
    def made_of(self) -> str | None:
        """Name of the material that its stiffness and loss follow from, if any does."""
        return None if self.strands is None else self.strands.material

    @property
    def cross_section(self) -> CrossSection | None:
        """Cross-section of what is made of that material, for its loss."""
        if self.strands is None:
            return None
        radius = self.strands.diameter / 2
        return circle(radius, radius)


class EddyCurrent(Table, frozen=True):
    """A magnet, taken as a dipole along an axis, in front of a plate or inside a tube."""

    shape: Literal["plate", "tube"] = key(
        '"plate": large, across the axis; "tube": long, around it'
    )
    axis: Literal["x", "y", "z"] = key("direction of the dipole")
    conductivity: units.Conductivity = key("of the conductor in use, S/m; copper has 5.8e7")
    thickness: units.Length = key("thickness of the plate or tube wall, m")
    gap: units.Length = key("from the magnet's centre to the plate, or inner radius of the tube, m")
    moment: float | None = key("dipole moment of one magnet, A m^2", unit="A m^2", gt=0, le=1e6)
    remanence: float | None = key(
        "remanence, T: the moment is remanence volume / mu_0", unit="T", gt=0, le=5
    )
    volume: float | None = key("volume of the magnet, m^3", unit="m^3", gt=0, le=1)
    count: int = key("number of equal magnets, far apart", 1, ge=1, le=1000)

    rules = (
        key_rules.exactly_one("moment", "remanence"),
        key_rules.together("remanence", "volume"),
    )


class Damper(BetweenBodies, frozen=True):
    """A viscous damper between any two bodies at a common point."""

    at: At = (0.0, 0.0, 0.0)
    damping: units.Matrix6 | None = key(
        "x, y, z, roll, pitch, yaw at the point, or a full 6x6: N s/m, N m s/rad"
    )
    eddy_current: EddyCurrent | None = None
    active: Active = False

    rules = (key_rules.exactly_one("damping", "eddy_current"), key_rules.symmetric("damping"))


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
    radii: list[Radius] = key("of curvature, m, above 0 if concave; 1e12 if flat", count=2)
    power: float = key(
        "circulating power, W, at the detuning", unit="W", plausible=STRONG, ge=0, le=1e12
    )
    detuning: float = key(
        "laser's frequency less the cavity's resonance, Hz; above 0 the optical spring restores",
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
        "fraction of the power lost per round trip, instead of pole",
        unit="1",
        gt=0,
        le=0.9,
    )
    wavelength: units.Length = key("wavelength of the light in m", 1064e-9, plausible=OPTICAL)

    rules = (
        key_rules.at_most_one("pole", "finesse", "transmission"),
        key_rules.exactly_one(
            "pole", "finesse", "transmission", when=lambda cavity: cavity.detuning != 0
        ),
    )

    def check(self) -> Problems:
        """Check its ends, and that a beam is stable."""
        if GROUND in self.between:
            yield "between", "ends on the ground", 'take a stage, or "support" for a mirror at rest'
        if 0 in self.radii:
            yield "radii", "must not be zero", "give 1e12 for a flat mirror"
            return
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
