"""Wires and blades: tables of the design file, and the uniform stretches of a wire."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any, Literal

from suspension_cli.design import key_rules, units
from suspension_cli.design.cross_sections import CrossSection, circle, rectangle, taper
from suspension_cli.design.typed_tables import Plausible, Problems, Table, doc, given, key

CROSS_SECTIONS: dict[str, Callable[[Any], CrossSection]] = {
    "radius": lambda ends: circle(*(ends if isinstance(ends, list) else (ends, ends))),
    "section": lambda ribbon: rectangle(ribbon.width, ribbon.thickness),
}
"""Cross-sections by their keys in `AnyWire` and `WireSection`."""
NOT_ROUND = tuple(name for name in CROSS_SECTIONS if name != "radius")
"""Those without necks."""

TALL = Plausible(50.0, "larger than any suspension", serious=True)
"""Lengths and positions; mirror suspensions are up to about 10 m tall."""
Radii = Annotated[
    list[units.WireSize],
    doc("radius in m at the upper and at the lower end of a taper", count=2),
]
# a list: msgspec 0.22 crashes on a union of a bounded number and a tuple of them
Steps = Annotated[int, doc("number of uniform steps of a taper; default 16", ge=1, le=256)]


class Ribbon(Table, frozen=True):
    """A ribbon: width along y, thickness along x."""

    width: units.WireSize = key("width along y, m")
    thickness: units.WireSize = key("thickness along x, m")


class WireSection(Table, frozen=True):
    """A stretch of a wire: uniform, or tapered linearly from one radius to another."""

    length: units.Length | None = key("loaded length, m; a section without it takes the rest")
    radius: units.WireSize | Radii | None = key("radius, m; [upper, lower] of a taper")
    section: Ribbon | None = None
    material: units.MaterialName | None = key("default the wire's")
    steps: Steps | None = None

    rules = (key_rules.exactly_one(*CROSS_SECTIONS),)

    def check(self) -> Problems:
        """Check that steps divide a taper."""
        if self.steps is not None and not isinstance(self.radius, list):
            yield "steps", "goes with a taper", "give radius = [upper, lower], or remove it"


class Clamp(Table, frozen=True):
    """Directions of the wire at its clamps, both from the upper towards the lower end."""

    upper: units.Direction | None = None
    lower: units.Direction | None = None


class EndTemperatures(Table, frozen=True):
    """Temperatures of the two ends of a wire, linear in between."""

    upper: units.Kelvin
    lower: units.Kelvin


PlaceAndTemperature = Annotated[
    list[Annotated[float, doc("fraction of the length from the upper end, or K", ge=0, le=1e4)]],
    doc("fraction of the length from the upper end, and temperature in K", count=2),
]
TemperatureProfile = Annotated[
    list[PlaceAndTemperature],
    doc("[fraction, K] from [0.0, ...] to [1.0, ...], linear in between", min_length=2),
]


Clamped = (
    Annotated[
        Literal["wire", "bending-point"],
        doc(
            '"wire", "bending-point", or a table of directions { upper = [x, y, z], lower = [x,'
            " y, z] }"
        ),
    ]
    | Clamp
)


class Neck(Table, frozen=True):
    """Thick ends of a fibre, equal above and below: stock, and a taper to the fibre's radius."""

    radius: units.WireSize = key("radius of the stock, m")
    length: units.Length = key("length of each linear taper, m")
    stock: units.Separation = key("length of uniform stock beyond each taper, m", 0.0)
    steps: Steps | None = None


UNREAD = (
    "is a file that was not read",
    "read the design from its file, or give { position, diameter }",
)


class Profile(Table, frozen=True):
    """Diameter of a round fibre along its length, as measured."""

    file: str | None = key("CSV file, from this file's folder; read once", max_length=1000)
    position: list[units.Position] = key(
        "from the upper end down, ascending, m", [], max_length=20000
    )
    diameter: list[units.WireSize] = key("diameter at each position, m", [], max_length=20000)
    error: float = key("relative error of its reduction", 1e-3, unit="1", ge=1e-4, le=0.1)

    rules = (key_rules.same_length("diameter", "position"), key_rules.ascending("position"))

    def check(self) -> Problems:
        """Check that there are places."""
        if self.file is not None and not self.position:
            yield "file", *UNREAD
        elif len(self.position) < 2:
            yield "", "has fewer than two places", "give position and diameter, each a list"


DAMPER = Plausible(2.0, "more than any damper of a wire or blade", (("g", 1e-3),))


class MassOnSpring(Table, frozen=True):
    """A mass on a lossy spring: what all dampers of wires and blades are made of."""

    mass: units.Mass = key("mass of one damper, kg", plausible=DAMPER)
    frequency: units.Frequency | None = key("resonance of the damper with its place at rest, Hz")
    stiffness: units.Stiffness | None = key("stiffness of the spring, N/m, instead of frequency")
    loss_angle: units.LossAngle = key("loss angle of the spring, rad; 1/Q with its place at rest")

    rules = (key_rules.exactly_one("frequency", "stiffness"), key_rules.not_tiny("mass"))

    @property
    def spring(self) -> float:
        """Stiffness in N/m."""
        if self.frequency is None:
            assert self.stiffness is not None
            return self.stiffness
        return (2 * math.pi * self.frequency) ** 2 * self.mass


class TipDamper(MassOnSpring, frozen=True):
    """A mass on a lossy spring on the tip of a blade, moving vertically.

    Its weight is part of the load of the blade.
    """


class WireDamper(MassOnSpring, frozen=True):
    """A mass on a lossy spring at a point of a wire, across it, along it, or both.

    In a direction in which it has no spring, the mass moves with the wire.
    """

    at: float = key(
        "place, as a fraction of the length from the upper end", 0.5, unit="1", ge=1e-3, le=0.999
    )
    acts: Literal["across", "along", "both"] = key(
        "direction of the spring, relative to the wire", "across"
    )


class AnyWire(Table, frozen=True):
    """Composition of a wire or of each of a set, and how its ends are held."""

    material: units.MaterialName | None = key(
        "name of a material, built in or of [materials]; with a cross-section: k = E A / l"
    )
    radius: units.WireSize | None = key("radius of a round wire, m")
    section: Ribbon | None = None
    sections: list[WireSection] | None = key(
        "stretches from the upper to the lower end, instead of radius and section",
        min_length=1,
        max_length=100,
    )
    neck: Neck | None = key("thick ends of a fibre of this radius, equal above and below")
    profile: Annotated[str, doc("a CSV file", max_length=1000)] | Profile | None = key(
        "measured diameter: a CSV file, { file, error } or { position, diameter, error }"
    )
    k: units.Stiffness | None = key(
        "spring constant of one wire, N/m; default E A over l or, if given, the natural_length"
    )
    torsion: units.Torsion | None = key(
        "torsional stiffness, N m/rad; default (G J + T I_p / A) / l in beam and violin, else 0"
    )
    clamp: Clamped = key(
        '"wire": along the nominal wire; "bending-point": the ends are the effective'
        " bending points; or directions { upper, lower }",
        "wire",
    )
    bending: Literal["hinged"] | None = key(
        '"hinged": in the string model, the string ends sqrt(E I / T) from each clamp'
    )
    temperature: units.Kelvin | EndTemperatures | TemperatureProfile | None = key(
        "in K; of both ends, { upper, lower }, linear in between; or a profile [[0.0,"
        " 16.0], [1.0, 23.0]]: fraction of the length from the upper end, and K"
    )

    dampers: list[WireDamper] = key("masses on lossy springs along the wire", [], max_length=10)

    rules = (
        key_rules.excludes("profile", *CROSS_SECTIONS, "sections", "neck"),
        key_rules.excludes("neck", *NOT_ROUND, "sections"),
        key_rules.excludes("sections", *CROSS_SECTIONS),
    )

    def check(self) -> Problems:
        """Check that it has k, or a material and one way to give its cross-section."""
        if isinstance(self.profile, str):
            yield "profile", *UNREAD
        if isinstance(self.temperature, list):
            yield from _check_temperatures(self.temperature)
        shapes = given(self, *CROSS_SECTIONS)
        whole = given(self, "profile", "sections", "neck", *CROSS_SECTIONS)
        if self.k is None and not whole:
            remedy = f"give the wire's {' or '.join(CROSS_SECTIONS)} in m, or k in N/m"
            yield next(iter(CROSS_SECTIONS)), "missing", remedy
        if self.bending and not whole:
            remedy = "give material and radius too, or remove it"
            yield "bending", "needs the wire's cross-section", remedy
        if self.dampers and not whole:
            remedy = "give material and radius too, or remove them"
            yield "dampers", "need the wire's cross-section", remedy
        places = [damper.at for damper in self.dampers]
        if any(lower <= upper for upper, lower in pairwise(places)):
            yield "dampers", "are not in the order of the wire", "sort them by at, each place once"
        if len(shapes) > 1:
            yield shapes[0], f"conflicts with a {shapes[1]}", "keep one of the two"
        pieces = [*enumerate(self.sections or (), 1)]
        bare = [f"sections.{n}.material" for n, one in pieces if one.material is None]
        if self.material is None and self.k is None and (bare or not pieces):
            remedy = "name a material for the whole wire, or give k in N/m"
            yield [*bare, "material"][0], "missing", remedy
        if self.neck is not None and self.radius is None:
            yield "radius", "missing", "give the radius between the necks in m"
        elif self.neck is not None and self.radius is not None and self.neck.radius <= self.radius:
            problem = f"is not above the radius of the fibre ({self.radius:g} m)"
            yield "neck.radius", problem, "give the radius of the thick ends in m"
        open_ended = [n for n, one in pieces if one.length is None]
        for n in open_ended[1:]:
            remedy = f"give it in m; section {open_ended[0]} takes the rest already"
            yield f"sections.{n}.length", "missing", remedy


def _check_temperatures(profile: TemperatureProfile) -> Problems:
    """Check that a profile of temperature covers the wire, downwards."""
    fractions = [fraction for fraction, _ in profile]
    if fractions[0] != 0 or fractions[-1] != 1:
        remedy = "start with the upper end, [0.0, ...], and end with the lower one, [1.0, ...]"
        yield "temperature", f"covers {fractions[0]:g} to {fractions[-1]:g} of the wire", remedy
    elif any(low >= high for low, high in pairwise(fractions)):
        remedy = "sort the fractions of the length, each once"
        yield "temperature", "is not in the order of the wire", remedy
    if min(kelvin for _, kelvin in profile) <= 0:
        yield "temperature", "has a temperature of 0 K", "give each place as [fraction, K]"


def list_temperatures(wire: AnyWire) -> list[tuple[float, float]]:
    """List fractions of the length from the upper end with temperatures (K), linear in between.

    Empty for a wire at the temperature of its design.
    """
    given = wire.temperature
    if given is None:
        return []
    if isinstance(given, EndTemperatures):
        return [(0.0, given.upper), (1.0, given.lower)]
    if isinstance(given, list):
        return [(fraction, kelvin) for fraction, kelvin in given]
    return [(0.0, given), (1.0, given)]


def cross_sections(table: AnyWire | WireSection) -> list[CrossSection]:
    """List the cross-sections that a table gives; a valid one gives at most one."""
    given = ((make, getattr(table, key)) for key, make in CROSS_SECTIONS.items())
    return [make(value) for make, value in given if value is not None]


SEPARATIONS = ("s", "s_upper", "s_lower")
RADII = ("ring", "ring_upper", "ring_lower")


def is_ring(wires: WireSet) -> bool:
    """Whether the ends of a set lie on circles."""
    return any(getattr(wires, name) is not None for name in RADII)


class WireSet(AnyWire, frozen=True):
    """Wires symmetric in x and y, in the paper's symbols: 1, 2 or 4; or any number on a ring."""

    count: int = key("number of wires: 1, 2 or 4; any with a ring", ge=1, le=100)
    l: units.Length = key("loaded length of each wire, m", plausible=TALL)
    s: units.Separation | None = key("half separation in x at both ends, m (four wires)")
    s_upper: units.Separation | None = key("half separation in x at the upper end, m")
    s_lower: units.Position | None = key(
        "half separation in x at the lower end, m; below 0 wires cross"
    )
    t1: units.Separation | None = key("half separation in y at the upper end, m")
    t2: units.Position | None = key("half separation in y at the lower end, m; below 0 wires cross")
    ring: units.Separation | None = key("radius of the ends' circle, m, above and below")
    ring_upper: units.Separation | None = key("radius of the upper ends' circle, m")
    ring_lower: units.Position | None = key(
        "radius of the lower ends' circle, m; below 0 wires cross"
    )
    phase: units.Angle = key("angle of the first wire of a ring from x towards y, rad", 0.0)
    d: units.Position = key("height of the lower end above the COM of this body, m", 0.0)
    d_upper: units.Position = key("depth of the upper end below the COM above, m", 0.0)

    rules = (key_rules.whole_or_parts(*SEPARATIONS), key_rules.whole_or_parts(*RADII))

    def check(self) -> Problems:
        """Check also the geometry of a grid of 1, 2 or 4 wires, or of a ring."""
        yield from super().check()
        across = ("t1", "t2")
        if is_ring(self):
            for name in given(self, *SEPARATIONS, *across):
                yield name, "conflicts with a ring", "keep one of the two"
            return
        if self.phase:
            yield "phase", "goes with a ring", "give ring in m too, or remove it"
        if self.count not in (1, 2, 4):
            remedy = "give one of these, or ring (the radius in m of the circle of the ends)"
            yield "count", "is not 1, 2 or 4", remedy
            return
        if self.count == 4 and not given(self, *SEPARATIONS):
            yield "s", "missing", "give the half separation in x, m"
        for name in across:
            if self.count > 1 and getattr(self, name) is None:
                yield name, "missing", "give the half separation in y, m"
        for name in {1: (*SEPARATIONS, *across), 2: SEPARATIONS, 4: ()}[self.count]:
            if getattr(self, name):
                problem = f"must be 0 for {self.count} wire{'s' * (self.count > 1)}"
                yield name, problem, "remove it or change count"


class Wire(AnyWire, frozen=True):
    """One wire, its ends in the frames of the two bodies, from their COMs or the support point."""

    upper: units.Vector = key("upper end, from the COM above or support point, m", plausible=TALL)
    lower: units.Vector = key("lower end, from this body's COM, m", plausible=TALL)
    natural_length: units.Length | None = key("unstretched length, m; the pose is then solved for")
    tension: units.Tension | None = key("in the nominal pose, N, instead of a natural length")
    blade: units.Name | None = key(
        "the [[stage.blade]] that carries the upper end", names="blade of the stage"
    )

    rules = (key_rules.excludes("natural_length", "tension"),)


LONG = Plausible(10.0, "longer than any blade", serious=True)
WIDE = Plausible(2.0, "wider than any blade")
HEAVY = Plausible(10.0, "more than any blade bears at its tip", (("g", 1e-3),))
BladeThickness = Annotated[units.Length, doc(plausible=Plausible(0.1, "thicker than any blade"))]


class BladeGeometry(Table, frozen=True):
    """A tapered cantilever blade."""

    length: units.Length = key("length from the clamp to the tip, m", plausible=LONG)
    base_width: units.Length = key("width at the clamp, m", plausible=WIDE)
    thickness: BladeThickness = key("thickness, m")
    shape_factor: float = key("1 rectangular, 1.5 triangular", unit="1", ge=0.5, le=10)
    material: units.MaterialName


class AnyBlade(Table, frozen=True):
    """Stiffness, load and loss of a cantilever blade, or of each of a set."""

    stiffness: units.Stiffness | None = key("vertical stiffness of one blade at its tip, N/m")
    uncoupled_frequency: units.IsolatingFrequency | None = key(
        "Hz, of this stage's mass m alone on its n blades: stiffness (2 pi f)^2 m / n"
    )
    geometry: BladeGeometry | None = None
    load: units.Tension | None = key(
        "load in N, tip mass included, at which the tip is at its nominal position;"
        " default that in the nominal pose"
    )
    tip_mass: units.MassOrZero = key("mass that moves with one tip, kg", 0.0, plausible=HEAVY)
    lateral_stiffness: tuple[units.Stiffness, units.Stiffness] | None = key(
        "stiffness of one tip along x and y, N/m; default rigid"
    )
    loss_angle: units.LossAngle | None = key("in rad; default that of the material, else 0")
    material: units.MaterialName | None = key(
        "the blade's material, for its loss, without a geometry"
    )
    thickness: BladeThickness | None = key("thickness in m, for its loss, without a geometry")
    temperature: units.Kelvin | None = key("in K; default that of [constants]")
    damper: TipDamper | list[TipDamper] | None = None

    rules = (
        key_rules.exactly_one("stiffness", "uncoupled_frequency", "geometry"),
        key_rules.excludes("geometry", "material", "thickness"),
        key_rules.needs("thickness", "material", unless="geometry"),
        key_rules.not_tiny("tip_mass"),
    )

    def check(self) -> Problems:
        """Check that a tip with a damper has a mass of its own."""
        if self.dampers and not self.tip_mass:
            remedy = "give the mass that moves with the tip besides the damper (a clamp; kg)"
            yield "damper", "needs tip_mass, which is 0", remedy

    @property
    def dampers(self) -> list[TipDamper]:
        """All dampers on the tip."""
        if self.damper is None:
            return []
        return self.damper if isinstance(self.damper, list) else [self.damper]

    @property
    def made_of(self) -> str | None:
        """Name of its material, if the design gives it."""
        return self.material if self.geometry is None else self.geometry.material


def names_on_tip(blade: str, count: int) -> list[str]:
    """Names of the coordinates of so many dampers on the tip of a blade, by its label.

    >>> names_on_tip("upper.blade1", 1)
    ['upper.blade1.damper.z']
    """
    numbers = range(1, count + 1) if count > 1 else [""] * count
    return [f"{blade}.damper{number}.z" for number in numbers]


class BladeSet(AnyBlade, frozen=True):
    """Cantilever blades on the body above (or the support) that carry a symmetric set of wires."""

    count: int = key(
        "number of blades, 1, 2 or 4; each of two carries the wires on its side of y;"
        " on a ring 1, or one per wire",
        ge=1,
        le=100,
    )


class Blade(AnyBlade, frozen=True):
    """One cantilever blade, for wires that name it."""

    name: units.Name = key("name by which wires refer to it")
    at: units.Vector | None = key("tip, from the COM above, m; default the mean of its wires' ends")


STEPS = 16
"""Default number of steps of a taper."""
HALF = [0.5 * 1.5 ** (n - 15) for n in range(16)]
BOUNDARIES = [*HALF, *(1 - place for place in HALF[-2::-1])]
"""Fractions of the length at which a wire with a profile of temperature is cut into pieces, each at
one temperature. A wire bends near its clamps, over a length that these places need not know: each
piece is a third as long as it is far from the nearer clamp, down to a thousandth of the wire."""
CLOSE = 1e-9
"""Fraction of the length below which two places along a wire count as one."""


@dataclass(frozen=True)
class Stretch:
    """A uniform stretch of wire."""

    length: float  # loaded, m
    material: str | None
    shape: CrossSection
    temperature: float | None = None  # K; None: that of the design


def reduced(profile: Profile, error: float | None = None) -> list[WireSection]:
    """Reduce a profile to uniform sections, from the upper end.

    Between two places the diameter is linear. Stretches in which it changes by a fraction of at
    most sqrt(error) become one section of the same volume: mass is exact, and means of other powers
    of the radius (compliance, bending stiffness) are wrong by a third to all of `error` (default
    that of the profile; 0: one section per pair of places).
    """
    wanted = profile.error if error is None else error
    return _reduced(tuple(profile.position), tuple(profile.diameter), wanted)


@lru_cache(maxsize=64)  # a design needs them often
def _reduced(
    position: tuple[float, ...], diameter: tuple[float, ...], wanted: float
) -> list[WireSection]:
    limit = math.sqrt(wanted)
    sections: list[WireSection] = []
    length = volume = 0.0
    low = math.inf
    high = 0.0
    points = zip(position, diameter, strict=True)
    for (top, above), (bottom, below) in pairwise(points):
        # a steep stretch is divided, so that none exceeds the limit
        parts = max(1, math.ceil(abs(math.log(below / above)) / limit)) if wanted else 1
        span = (bottom - top) / parts
        for n in range(parts):
            ends = [above + (below - above) * k / parts for k in (n, n + 1)]
            low = min(*ends, low)
            high = max(*ends, high)
            if length and (not wanted or high > low * (1 + limit)):
                sections.append(_section(length, volume))
                length = volume = 0.0
                low = min(ends)
                high = max(ends)
            length += span
            volume += span * (ends[0] ** 2 + ends[0] * ends[1] + ends[1] ** 2) / 3
    return [*sections, _section(length, volume)]


def _section(length: float, volume: float) -> WireSection:
    return WireSection(length=length, radius=math.sqrt(volume / length) / 2)


def given_sections(wire: WireSet | Wire) -> Sequence[WireSection] | None:
    """Sections of a wire: given, of a fibre with necks, or of a measured profile; else None."""
    if isinstance(wire.profile, Profile):
        return reduced(wire.profile)
    if wire.neck is None:
        return wire.sections
    neck = wire.neck
    radius = wire.radius
    assert radius is not None
    stock = [WireSection(length=neck.stock, radius=neck.radius)] if neck.stock else []
    return [
        *stock,
        WireSection(length=neck.length, radius=[neck.radius, radius], steps=neck.steps),
        WireSection(radius=radius),
        WireSection(length=neck.length, radius=[radius, neck.radius], steps=neck.steps),
        *stock,
    ]


def thinnest(wire: WireSet | Wire | WireSection) -> float | None:
    """Find the smallest cross-section of a wire, m^2, where stress is largest; None if unknown."""
    if not isinstance(wire, WireSection) and isinstance(wire.profile, Profile):
        return math.pi * min(wire.profile.diameter) ** 2 / 4
    tables = (None if isinstance(wire, WireSection) else given_sections(wire)) or [wire]
    areas = (shape.least_area for table in tables for shape in cross_sections(table))
    return min(areas, default=None)


def stretches(wire: WireSet | Wire, length: float) -> list[Stretch]:
    """Divide a wire of a loaded `length` (m) into uniform stretches, from its upper to lower end.

    Empty if the cross-section is unknown. Given lengths may miss `length` by 1e-6; they are scaled.
    """
    sections = given_sections(wire)
    if sections is None:
        whole = [Stretch(length, wire.material, shape) for shape in cross_sections(wire)]
        return _with_temperatures(whole, list_temperatures(wire))
    given = sum(piece.length or 0.0 for piece in sections)
    rest = length - given if any(piece.length is None for piece in sections) else 0.0
    scale = 1.0 if rest.real > 0 else length / given
    found: list[Stretch] = []
    for piece in sections:
        own = scale * (rest if piece.length is None else piece.length)
        shapes = cross_sections(piece)
        if isinstance(piece.radius, list):
            upper, lower = piece.radius
            shapes = taper(upper, lower, piece.steps or STEPS)
        name = piece.material or wire.material
        found += [Stretch(own / len(shapes), name, shape) for shape in shapes]
    return _with_temperatures(found, list_temperatures(wire))


def _with_temperatures(pieces: list[Stretch], profile: list[tuple[float, float]]) -> list[Stretch]:
    """Give each stretch its temperature; if that varies along the wire, cut it into cells."""
    if len({kelvin for _, kelvin in profile}) < 2:
        common = profile[0][1] if profile else None
        return [replace(piece, temperature=common) for piece in pieces]
    whole = sum(piece.length for piece in pieces)
    found: list[Stretch] = []
    start = 0.0
    for piece in pieces:
        end = start + piece.length / whole
        inside = [place for place in BOUNDARIES if start + CLOSE < place < end - CLOSE]
        for low, high in pairwise([start, *inside, end]):
            kelvin = temperature_at(profile, (low + high) / 2)
            found.append(replace(piece, length=(high - low) * whole, temperature=kelvin))
        start = end
    return found


def temperature_at(profile: list[tuple[float, float]], fraction: float) -> float:
    """Interpolate a profile of temperature at a fraction of the length from the upper end, K."""
    for (low, above), (high, below) in pairwise(profile):
        if fraction <= high:
            return above + (below - above) * (fraction - low) / (high - low)
    return profile[-1][1]
