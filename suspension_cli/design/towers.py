"""Inverted pendulums and filters (blades with a keystone) of towers: tables, stiffness, inertia.

**Inverted pendulum.** A leg is a rigid bar of length L from a foot on the body (or support) below
to a joint on the stage. Leaning by an angle phi it bends the flexure at its foot (stiffness k) and
the joint at its top (k_t), and lowers the load F on it and its own weight m g at the height h of
its COM:

    V = (k + k_t) phi^2 / 2 - (F L + m g h) phi^2 / 2.

n legs that lean together by phi = x / L carry the weight W = n F. Their lateral stiffness, inertia
and the load at which they tip over are

    K = (n (k + k_t) - W L - n m g h) / L^2,      M = W / g + n (I + m h^2) / L^2,
    W_tip = n (k + k_t - m g h) / L,

I being the moment of inertia of a leg about its COM; they follow from the energies of leaning legs
(`tests/models/test_towers.py` writes them down). At high frequency only the inertia of the legs
transmits ground motion: the stage moves by the fraction -n m_c / (M_s + n m_t) of it,

    m_c = m (h/L) (1 - h/L) - I / L^2,      m_t = m (h/L)^2 + I / L^2,

M_s being the mass that moves with the tops. The fraction is 0 if the centre of percussion of the
legs is at their tops; a counterweight below the feet can move it there.

**Filter.** `[stage.filter]` adds a second body to a stage, its keystone, named STAGE-keystone. It
follows the stage in the list of bodies, so the next stage hangs from it. The blades (geometric
anti-springs) are a spring between both, stiff in all directions but the vertical. Their inertia
adds the kinetic energy m_c v_f v_k of the velocities of filter and keystone. With the mass M on the
blades, the keystone follows the filter by

    z_k / z_f = (k + m_c w^2) / (k - (M - m_c) w^2)

at the angular frequency w. The isolation saturates at m_c / (M - m_c), and the frequency of the
blades is sqrt(k / (M - m_c)). Measured filters have this form, (w0^2 + beta w^2) / (w0^2 - w^2)
(compare Stochino et al., Improvement of the seismic noise attenuation performance of the Monolithic
Geometric Anti-Spring filters, Nucl. Instrum. Methods A (2007)). A magic wand, a counterweight on
the blades, makes m_c small or negative. The masses of filter and keystone include that of the
blades. Both include m_c, so a relative inertia of -m_c between the two corrects the sum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated

from suspension_cli.design import key_rules, units
from suspension_cli.design.typed_tables import Problems, Table, doc, key

AXIAL_STIFFNESS = 1e8
"""Default stiffness of a leg along its length, N/m: an aluminium tube of 60 mm by 5 mm, 0.6 m
long."""
ROUND_ROD = 1.3
"""Bending over torsional stiffness of a round rod, E I / (G J) = 1 + nu at Poisson's ratio 0.3."""
SUFFIX = "-keystone"
LATERAL = 1e7
"""Default stiffness of a keystone across the vertical, N/m: far above that of any wire."""
TILT = 1e4
"""Default stiffness of a keystone against rotation, N m/rad: far above that of any wire."""
STEEL = 7900.0
"""Density of a keystone whose moments of inertia are not given, kg/m^3."""


class Counterweight(Table, frozen=True):
    """A mass, kg, at a distance below each foot, m, to move the leg's centre of percussion."""

    mass: units.Mass
    below: units.Length = key("distance below the flexure, m")


class InvertedPendulum(Table, frozen=True):
    """Legs on which a stage stands: feet on the body above it in the file, or on the support."""

    length: units.Length = key("length of a leg, foot to top, m", plausible=units.PART_SIZE)
    points: list[units.Vector] | None = key(
        "tops of the legs from this body's COM, m; instead of count and radius",
        min_length=3,
        max_length=24,
    )
    count: int | None = key("number of legs, evenly spaced on a circle", ge=3, le=24)
    radius: units.Length | None = key("radius of that circle, m", plausible=units.PART_SIZE)
    phase: units.Angle = key("angle of the first leg from the x axis towards y, rad", 0.0)
    top: units.Position = key(
        "height of the tops above this body's COM, m", 0.0, plausible=units.PART_SIZE
    )
    stiffness: units.Rigidity | None = key(
        "bending stiffness of a leg's flexure at its foot, N m/rad"
    )
    frequency: units.IsolatingFrequency | None = key(
        "lateral frequency with the load, Hz, instead of stiffness"
    )
    top_stiffness: units.RigidityOrZero = key(
        "bending stiffness of a leg's joint at its top, N m/rad", 0.0
    )
    yaw_stiffness: units.RigidityOrZero | None = key(
        "torsional stiffness of a leg, N m/rad; default that of a round rod"
    )
    axial_stiffness: units.Stiffness = key("stiffness along a leg, N/m", AXIAL_STIFFNESS)
    leg_mass: units.MassOrZero = key("mass of a leg, kg", 0.0)
    leg_com: units.Position | None = key("height of a leg's COM above its foot, m; default half")
    leg_inertia: units.MomentOrZero | None = key(
        "about a leg's COM, kg m^2; default that of a thin rod"
    )
    counterweight: Counterweight | None = None
    loss_angle: units.LossAngle | None = key("loss angle of the flexures in rad")
    q: units.Quality | None = key("Q of the lateral mode with the load, instead of loss_angle")

    rules = (
        key_rules.whole_or_parts("points", "count", "radius"),
        key_rules.required("points", when=lambda legs: legs.count is None and legs.radius is None),
        key_rules.excludes("points", "phase", "top"),
        key_rules.exactly_one("stiffness", "frequency"),
        key_rules.at_most_one("loss_angle", "q"),
    )

    def check(self) -> Problems:
        """Check the places of the legs, and their inertia."""
        if not self.leg_mass and (self.leg_inertia or self.leg_com):
            yield "leg_mass", "missing", "give the mass of a leg in kg"
        (x, y, _), *rest = tops(self)
        across = [(a - x, b - y) for a, b, _ in rest]
        area = max(abs(a * d - b * c) for a, b in across for c, d in across)
        if area <= 1e-6 * max(math.hypot(*one) for one in across) ** 2:
            problem = "has all legs on one line, so that the stage would fall over"
            yield "points", problem, "place a leg off this line"
        most = self.leg_mass * self.length**2
        weight = self.counterweight
        if self.leg_mass and (self.leg_inertia or 0.0) > most:
            problem = f"is more than m L^2 of the leg, {most:g} kg m^2"
            remedy = "give it about the leg's COM in kg m^2; a thin rod has m L^2 / 12"
            yield "leg_inertia", problem, remedy
        if weight is not None and weight.below > 2 * self.length:
            problem = f"is more than twice the length of the leg, {self.length:g} m"
            yield "counterweight.below", problem, "give it in m"


def tops(legs: InvertedPendulum) -> list[tuple[float, float, float]]:
    """List the tops of the legs from the COM of the stage, m."""
    if legs.points is not None:
        return list(legs.points)
    assert legs.count is not None and legs.radius is not None
    turns = (direction(legs.phase, n, legs.count) for n in range(legs.count))
    return [(legs.radius * x, legs.radius * y, legs.top) for x, y in turns]


def direction(phase: float, number: int, count: int) -> tuple[float, float]:
    """Cosine and sine of the angle of one of `count` points evenly spaced on a circle.

    Point 0 is at the angle `phase` (rad). Phases within rounding of a simple fraction of a quarter
    turn are taken as exactly that, so that mirror images are exact.
    """
    given = Fraction(phase / (math.pi / 2))
    simple = given.limit_denominator(24)
    turns = (simple if abs(simple - given) < 1e-9 else given) + Fraction(4 * number, count)
    rest = float(turns - round(turns)) * math.pi / 2
    x = math.cos(rest)
    y = math.sin(rest)
    # the quarter turns are exact
    for _ in range(round(turns) % 4):
        x, y = -y, x
    return x, y


def leg_count(legs: InvertedPendulum) -> int:
    """Count the legs; 0 if the table does not say."""
    return legs.count or 0 if legs.points is None else len(legs.points)


def offset(legs: InvertedPendulum) -> tuple[float, float, float]:
    """Compute the COM of the stage from the COM below, at whose height the feet are, m."""
    return (0.0, 0.0, legs.length - min(tops(legs), key=lambda top: top[2].real)[2])


def leg_inertia(legs: InvertedPendulum) -> tuple[float, float, float]:
    """Compute the inertia of one leg, a rigid bar between its ends, counterweight included.

    Returns the coefficients, kg, of the kinetic energy foot v_f^2 / 2 + coupling v_f v_t + top
    v_t^2 / 2, with v_f and v_t the velocities of both ends. The weight of coupling + top = m h / L
    rests on the top.
    """
    length = legs.length
    com = length / 2 if legs.leg_com is None else legs.leg_com
    moment = legs.leg_mass * length**2 / 12 if legs.leg_inertia is None else legs.leg_inertia
    masses = [(legs.leg_mass, com / length)]
    if legs.counterweight is not None:
        masses.append((legs.counterweight.mass, -legs.counterweight.below / length))
    own = moment / length**2
    foot = own + sum(m * (1 - s) ** 2 for m, s in masses)
    coupling = -own + sum(m * s * (1 - s) for m, s in masses)
    return foot, coupling, own + sum(m * s**2 for m, s in masses)


@dataclass(frozen=True)
class LegStatics:
    """Flexures and lateral motion of an inverted pendulum under its load."""

    flexure: float  # bending stiffness at the foot of a leg, N m/rad
    load: float  # weight of stage and all that hangs from it, and vertical preloads, N
    critical: float  # load at which the stage tips over, N
    stiffness: float  # lateral, with the load, N/m
    elastic: float  # of the flexures alone, N/m
    mass: float  # inertia against lateral motion, kg
    loss: float  # loss angle of the flexures, rad


def leg_statics(legs: InvertedPendulum, thrust: float, hung: float, gravity: float) -> LegStatics:
    """Compute the flexures of an inverted pendulum; formulas: see the module.

    `thrust` is that of all legs at their tops, N: the weight of what moves with the tops, the legs'
    own share included, and the vertical forces of preloads; `hung` without these forces.
    """
    count = len(tops(legs))
    length = legs.length
    _, coupling, top = leg_inertia(legs)
    own = count * (coupling + top) * gravity
    mass = (hung - own) / gravity + count * top
    flexure = legs.stiffness
    if flexure is None:
        assert legs.frequency is not None
        wanted = (2 * math.pi * legs.frequency) ** 2 * mass
        flexure = (wanted * length**2 + thrust * length) / count - legs.top_stiffness
    elastic = count * (flexure + legs.top_stiffness) / length**2
    stiffness = elastic - thrust / length
    loss = legs.loss_angle or 0.0
    if legs.q is not None:
        loss = stiffness / elastic / legs.q if stiffness.real > 0 else 0.0
    critical = elastic * length - own
    return LegStatics(flexure, thrust - own, critical, stiffness, elastic, mass, loss)


class Keystone(Table, frozen=True):
    """Mass with the moving part of the blades, kg; inertia, kg m^2, default a steel cylinder's."""

    mass: units.Mass
    inertia: list[Annotated[float, doc("", "kg m^2", gt=0, le=1e15)]] | None = key(
        "moments about x, y, z; default a steel cylinder's", count=3
    )


class Filter(Table, frozen=True):
    """Blades (geometric anti-springs) on this body, which carry a keystone.

    The next stage hangs from the keystone, the body STAGE-keystone; name the stage in hangs_from to
    hang from the filter's own body.
    """

    keystone: Keystone
    at: units.Vector = key(
        "the keystone's COM, from this body's, m", (0.0, 0.0, 0.0), plausible=units.PART_SIZE
    )
    frequency: units.IsolatingFrequency | None = key(
        "vertical frequency at the working point, Hz, with the load rigid"
    )
    stiffness: units.Stiffness | None = key(
        "vertical stiffness of all blades at the working point, N/m, instead of frequency"
    )
    load: units.Tension | None = key(
        "load under which the keystone is at its nominal point, its own weight"
        " included, N; default that of the design"
    )
    lateral_stiffness: units.Stiffness = key("of the blades, horizontal, N/m", LATERAL)
    tilt_stiffness: units.Rigidity = key("stiffness of the blades against rotation, N m/rad", TILT)
    saturation: units.Saturation | None = key(
        "fraction of the filter's vertical motion that reaches the keystone at high"
        " frequency, with the load rigid"
    )
    mass_coupling: units.MassCoupling | None = key(
        "inertia of the blades that couples both bodies, kg, instead of saturation"
    )
    loss_angle: units.LossAngle | None = key("loss angle of the blades' stiffness in rad")
    q: float | None = key("Q of the vertical mode, 1/loss_angle", unit="1", gt=1, le=1e12)
    modulus_slope: units.ModulusSlope = key(
        "(1/E) dE/dT of the blades, 1/K, for the shift of the working point that check reports",
        0.0,
    )
    thermal_expansion: units.Expansion = key("of the blades in 1/K; adds to that shift", 0.0)

    rules = (
        key_rules.exactly_one("stiffness", "frequency"),
        key_rules.at_most_one("loss_angle", "q"),
        key_rules.at_most_one("saturation", "mass_coupling"),
    )

    def check(self) -> Problems:
        """Check that the inertia of the blades is part of that of the keystone."""
        mass = self.keystone.mass
        if self.mass_coupling is not None and self.mass_coupling >= mass:
            problem = f"is not below the mass of the keystone, {mass:g} kg, which includes it"
            remedy = "add the part of the blades that moves with the keystone to its mass"
            yield "mass_coupling", problem, remedy


@dataclass(frozen=True)
class FilterStatics:
    """Blades of a filter under their load."""

    load: float  # vertical force on the blades at the nominal point, keystone included, N
    stiffness: float  # vertical, of the blades, N/m
    coupling: float  # m_c, kg
    mass: float  # inertia M - m_c against vertical motion at the load, kg
    loss: float  # loss angle, rad


def filter_statics(table: Filter, carried: float, hung: float, gravity: float) -> FilterStatics:
    """Compute the blades of a filter.

    `carried` is their load in the design, N: the weight of the keystone and of what hangs from it,
    and the vertical forces of preloads; `hung` without these forces.
    """
    load = carried if table.load is None else table.load
    whole = (load - carried + hung) / gravity
    coupling = table.mass_coupling or 0.0
    if table.saturation is not None:
        coupling = whole * table.saturation / (1 + table.saturation)
    stiffness = table.stiffness
    if stiffness is None:
        assert table.frequency is not None
        stiffness = (2 * math.pi * table.frequency) ** 2 * (whole - coupling)
    loss = 1 / table.q if table.q is not None else table.loss_angle or 0.0
    return FilterStatics(load, stiffness, coupling, whole - coupling, loss)


def keystone_inertia(keystone: Keystone) -> list[float]:
    """Moments of inertia of a keystone about x, y, z, kg m^2.

    By default those of a steel cylinder of height 2 r: m r^2 / 2 about z and 7 m r^2 / 12 across
    (any text on mechanics).
    """
    if keystone.inertia is not None:
        return keystone.inertia
    square = (keystone.mass / (2 * math.pi * STEEL)) ** (2 / 3)
    across = 7 * keystone.mass * square / 12
    return [across, across, keystone.mass * square / 2]
