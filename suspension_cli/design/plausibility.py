"""Implausible numbers of a design: millimetres written as metres, grams as kilograms, GPa as Pa.

Such a design is valid, so these are warnings, not faults. Limits are wide: a unit that is wrong by
a factor of a thousand exceeds them, an unusual design does not. Ranges of single numbers stand
beside their keys (`units.Plausible`); here are those that depend on other numbers:

- No solid is denser than osmium, 22,590 kg/m^3 (CRC Handbook of Chemistry and Physics); a body
  less dense than air, 1.2 kg/m^3, would float.
- With S the integral of x x^T over the mass, a body of mass m nowhere denser than rho has det S >=
  m^3 (m/rho)^2 / (5^3 (4 pi/3)^2), that of a homogeneous ellipsoid, the most compact body of given
  mass and density. So mass and moments of inertia give a lower bound on the largest density.
- No material breaks above a fifth of Young's modulus: the ideal strength is about a tenth of it
  (Orowan, Rep. Prog. Phys. 12, 185 (1949)).
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design import foton, imperfections, loop_filters, rules
from suspension_cli.design.bodies import (
    Body,
    body_inertia,
    body_mass,
    half_sides,
    second_moments,
    volume,
)
from suspension_cli.design.derive import com_offset, set_geometry
from suspension_cli.design.faults import fault_of
from suspension_cli.design.filters import SUFFIX
from suspension_cli.design.imperfections import Imperfection
from suspension_cli.design.links import Damper
from suspension_cli.design.schema import Design, Loop, Perturbation, Stage
from suspension_cli.design.units import Plausible
from suspension_cli.design.wires import Blade, BladeSet, Profile, Wire, WireSet, cross_sections
from suspension_cli.errors import Fault, format_key, format_value

RAISE = "attach the wires higher above the COM (raise d)"
"""What to do about most unstable equilibria."""
OSMIUM = 22_600.0
"""kg/m^3; nothing is denser."""
AIR = 1.2
"""kg/m^3; a lighter body would float."""
USUAL = 3000.0
"""kg/m^3; typical of masses of silica and steel with gaps."""
IDEAL = 0.2
"""Fraction of Young's modulus that no strength reaches."""
LONGEST_WIRE = 50.0
"""m; mirror suspensions are up to about 10 m tall."""
THICK = 0.1
"""Largest thickness of a wire or blade as a fraction of its length."""
BEYOND = 0.5
"""Largest distance of a wire's end from a body (on posts, ears), in its largest half sides."""
INFERRED = 3.0
"""Factor on the half sides of the homogeneous box of its inertia, for a body of unknown shape."""
SERIOUS = 5.0
"""Factor on these bounds beyond which a number is an error."""
LARGE_TURN = 0.1
"""rad; a misalignment of 6 degrees."""
LARGE_SHIFT = 0.05
"""Largest error of position or length as a fraction of the wire's length."""
LARGE_FRACTION = 0.5
"""Largest relative tolerance."""
FASTEST_LOOP = 100.0
"""Hz; the unity gain of local control is below about 10 Hz."""
MAGNETISATION = 1.3e6
"""A/m; dipole moment per volume of the strongest magnets (a remanence of 1.6 T)."""
FLAT_MAGNET = 0.1
"""Least distance from a magnet's centre to a conductor, in radii of the sphere of its volume."""

MILLIMETRES = (("mm", 1e-3), ("um", 1e-6))
MOMENTS = (("g m^2", 1e-3), ("kg cm^2", 1e-4), ("kg mm^2", 1e-6), ("g mm^2", 1e-9))


@dataclass(frozen=True)
class ImplausibleNumber:
    """An implausible number.

    Attributes
    ----------
    fault
        Its place, the problem and the remedy.
    serious
        Whether results are then meaningless, so that analyses warn too.
    """

    fault: Fault
    serious: bool = False

    @property
    def line(self) -> str:
        """The warning as one line of text."""
        return self.fault.line("")


def suggest_unit(
    value: float, good: Callable[[float], bool], units: tuple[tuple[str, float], ...] = MILLIMETRES
) -> str:
    """Suggest the first unit (name, size in SI) in which a value is `good`: "did you mean mm?"."""
    return next((f"did you mean {name}?" for name, size in units if good(value * size)), "")


def _above(
    key: str,
    value: float | None,
    most: float,
    problem: str,
    remedy: str = "give it in m",
    units: tuple[tuple[str, float], ...] = MILLIMETRES,
    *,
    shown: object = None,
    serious: bool = False,
) -> Iterator[ImplausibleNumber]:
    """Report a number above `most`, with a likely unit or a remedy."""
    plausible = Plausible(most, problem, remedy, units, serious=serious)
    if value is not None:
        yield from _outside(key, value, plausible, value if shown is None else shown)


def _outside(
    key: str, size: float, plausible: Plausible, shown: object
) -> Iterator[ImplausibleNumber]:
    """Report a number whose size is outside its plausible range."""

    def good(value: float) -> bool:
        return plausible.low <= value <= plausible.high

    if not good(size):
        hint = suggest_unit(size, good, plausible.units) or plausible.remedy
        problem = plausible.above if size > plausible.high else plausible.below
        fault = Fault(key, problem, hint, format_value(shown))
        yield ImplausibleNumber(fault, plausible.serious)


def _check_ranges(design: Design) -> Iterator[ImplausibleNumber]:
    """Check all numbers whose keys declare a plausible range."""
    for path, table in rules.tables(design):
        for key, plausible in rules.keys_with(type(table), "plausible"):
            value = getattr(table, key)
            if sizes := [*_sizes(value)]:
                yield from _outside(f"{path}.{key}", max(sizes), plausible, value)


def _sizes(value: Any) -> Iterator[float]:
    if isinstance(value, (list, tuple)):
        for item in value:
            yield from _sizes(item)
    elif isinstance(value, (int, float)):
        yield abs(value)


def find_implausible(design: Design) -> list[ImplausibleNumber]:
    """Find implausible numbers of a design, from its tables alone."""
    found = [*_check_ranges(design)]
    for name, material in design.materials.items():
        found += _above(
            f"materials.{format_key(name)}.tensile_strength",
            material.tensile_strength,
            IDEAL * (material.youngs_modulus or math.inf),
            f"is more than {IDEAL:g} times Young's modulus, which no material bears",
            "give it in Pa: 2e9 for strong steel",
            (),
        )
    above: Stage | None = None
    stages: dict[str, Stage | None] = {SUPPORT: None}
    for stage in design.stage:
        path = f"stage.{stage.name}"
        parent = above if stage.hangs_from is None else stages[stage.hangs_from]
        if stage.body.density is None and stage.body.shape is not None:
            found += _check_mean_density(stage.body, f"{path}.body")
        if stage.body.inertia is not None:
            found += _check_inertia(stage.body, f"{path}.body")
        found += _check_wires(stage, parent, path)
        if stage.blades is not None:
            found += _check_blade(stage.blades, stage, f"{path}.blades")
        for blade in stage.blade:
            found += _check_blade(blade, stage, f"{path}.blade.{blade.name}")
        for number, spring in enumerate(stage.spring, 1):
            keys = (f"{path}.spring.{number}.at",) * 3
            found += _check_point(stage.body, spring.at, keys, "the point of the spring lies")
        stages[stage.name] = above = stage
    for number, item in enumerate(design.perturbation, 1):
        found += _check_perturbation(design, item, f"perturbation.{number}")
    for damper in design.damper:
        found += _check_magnet(damper)
    return [*found, *_check_tolerance(design), *_check_loops(design), *_check_planes(design)]


def _is_plausible(density: float) -> bool:
    return AIR <= density <= OSMIUM


def _check_mean_density(body: Body, path: str) -> Iterator[ImplausibleNumber]:
    density = body_mass(body) / volume(body)
    if _is_plausible(density):
        return
    problem = f"makes the body less dense ({density:.3g} kg/m^3) than air ({AIR:g}), for its shape"
    units = (("mm for the sizes", 1e9), ("mm", 1e6), ("mm", 1e3))
    if density > OSMIUM:
        problem = f"makes the body denser ({density:.3g} kg/m^3) than osmium ({OSMIUM:g})"
        units = (("g", 1e-3), ("mg", 1e-6))
    hint = suggest_unit(density, lambda v: 100 <= v <= OSMIUM, units)
    hint = hint or suggest_unit(density, _is_plausible, units) or "check mass (kg) and sizes (m)"
    yield ImplausibleNumber(fault_of(body, path, "mass", problem, hint), serious=True)


def _check_inertia(body: Body, path: str) -> Iterator[ImplausibleNumber]:
    mass, moments = body_mass(body), second_moments(body)
    largest = max(moments)
    if min(moments) < -1e-6 * largest:
        problem = "one moment exceeds the sum of the other two, impossible for a rigid body"
        hint = suggest_unit(1.0, lambda v: _is_possible(body, v), MOMENTS)
        hint = hint or "check the three moments, in kg m^2"
        yield ImplausibleNumber(fault_of(body, path, "inertia", problem, hint), serious=True)
        return
    if min(moments) <= 1e-6 * largest:  # modelled as a plate or rod without thickness
        return
    # 5 S / m are the squares of the half axes of the ellipsoid, the most compact body with these
    # moments
    volume = 4 * math.pi / 3 * math.sqrt(math.prod(5 * moment / mass for moment in moments))
    density = mass / volume
    if _is_plausible(density):
        return
    word, units, hint = f"denser than osmium ({OSMIUM:g})", [], ""
    if density < AIR:
        word = f"less dense than air ({AIR:g})"
        units = sorted(MOMENTS, key=lambda u: abs(math.log(density * u[1] ** -1.5 / USUAL)))
        hint = suggest_unit(1.0, lambda v: 100 <= density * v**-1.5 <= OSMIUM, tuple(units))
    elif 100 <= density * 1e-3**2.5 <= OSMIUM:
        hint = f"did you mean g for the mass {mass:g}?"
    problem = f"a body of {mass:g} kg with these moments has {density:.3g} kg/m^3, {word}"
    yield ImplausibleNumber(
        fault_of(body, path, "inertia", problem, hint or "check mass (kg) and inertia (kg m^2)"),
        serious=density > OSMIUM or density < AIR / SERIOUS,
    )


def _is_possible(body: Body, factor: float) -> bool:
    """Whether a body's moments are possible with the largest multiplied by a factor."""
    rows = body_inertia(body)
    *small, large = sorted(rows[n][n] for n in range(3))
    return max(*small, factor * large) <= (sum(small) + factor * large) / 2


def reach(body: Body) -> tuple[float, float, float]:
    """Compute the largest plausible distances of wire ends from a COM along x, y and z, m."""
    halves = half_sides(body)
    x, y, z = (
        (1.0 if body.shape is not None else INFERRED) * half + BEYOND * max(halves)
        for half in halves
    )
    return x, y, z


def _check_point(
    body: Body, point: tuple[float, float, float], keys: tuple[str, ...], what: str
) -> Iterator[ImplausibleNumber]:
    """Check a point of a body; report the coordinate that lies furthest outside it."""
    limits = reach(body)
    far = [abs(value) / limit for value, limit in zip(point, limits, strict=True)]
    worst = far.index(max(far))
    half, given = half_sides(body)[worst], body.shape is not None
    size = f"{half:.3g} m" if given else f"about {half:.2g} m by its inertia"
    known = f"whose half along {'xyz'[worst]} is {size}"
    yield from _above(
        keys[worst],
        abs(point[worst]),
        limits[worst],
        f"{what} {abs(point[worst]):.3g} m from the COM, far outside the body ({known})",
        "check it, and the size of the body, in m",
        shown=point[worst],
        serious=far[worst] > SERIOUS,
    )


def _check_wires(stage: Stage, above: Stage | None, path: str) -> Iterator[ImplausibleNumber]:
    if stage.wires is not None:
        wires, shape = stage.wires, set_geometry(stage.wires)
        key = f"{path}.wires"
        lower, upper = ("s_lower", "s_upper") if wires.s is None else ("s", "s")
        if shape.is_ring:
            lower, upper = ("ring_lower", "ring_upper") if wires.ring is None else ("ring", "ring")
        yield from _check_size(wires, shape.length, key)
        yield from _check_point(
            stage.body,
            (max(shape.s_lower, shape.ring_lower), shape.t2, shape.d),
            (f"{key}.{lower}", f"{key}.t2", f"{key}.d"),
            "lower ends of wires lie",
        )
        if above is not None:
            yield from _check_point(
                above.body,
                (max(shape.s_upper, shape.ring_upper), shape.t1, shape.d_upper),
                (f"{key}.{upper}", f"{key}.t1", f"{key}.d_upper"),
                f"upper ends of wires lie, on {above.name},",
            )
    for number, wire in enumerate(stage.wire, 1):
        key, length = f"{path}.wire.{number}", _span(stage, wire)
        yield from _check_size(wire, length, key)
        yield from _check_point(stage.body, wire.lower, (f"{key}.lower",) * 3, "the lower end lies")
        if above is not None:
            what = f"the upper end lies, on {above.name},"
            yield from _check_point(above.body, wire.upper, (f"{key}.upper",) * 3, what)


def _span(stage: Stage, wire: Wire) -> float:
    """Distance of the ends of a wire in the nominal pose, m."""
    ends = zip(com_offset(stage), wire.lower, wire.upper, strict=True)
    return math.hypot(*(p + q - u for p, q, u in ends))


def _check_size(wire: WireSet | Wire, length: float, key: str) -> Iterator[ImplausibleNumber]:
    """Check that a wire is not too long, and thinner than a tenth of its length."""
    where = f"{key}.l" if isinstance(wire, WireSet) else key
    problem = f"is longer than any suspension ({LONGEST_WIRE:g} m)"
    yield from _above(where, length, LONGEST_WIRE, problem, "give lengths in m", serious=True)
    own = f"a tenth of its length of {length:.3g} m"
    if isinstance(wire.profile, Profile):
        thick = max(wire.profile.diameter)
        remedy = "write the unit into the titles of the columns: position_mm,diameter_um"
        problem = f"the fibre is {thick:.3g} m thick, more than {own}"
        yield from _above(f"{key}.profile", thick, THICK * length, problem, remedy, ())
    sizes = [("neck.radius", wire.neck.radius, wire.neck.radius)] if wire.neck else []
    tables = [("", wire)] if wire.sections is None else []
    tables += [(f"sections.{n}.", piece) for n, piece in enumerate(wire.sections or (), 1)]
    for path, table in tables:
        given = [size for shape in cross_sections(table) for size in shape.sizes()]
        sizes += [(path + name, value, size) for name, value, size in given]
    for name, value, size in sizes:
        problem = f"the wire is {size:.3g} m thick, more than {own}"
        where = f"{key}.{name}"
        yield from _above(where, size, THICK * length, problem, shown=value, serious=True)


def _check_blade(blade: BladeSet | Blade, stage: Stage, path: str) -> Iterator[ImplausibleNumber]:
    shape, mass = blade.geometry, body_mass(stage.body)
    for name, share, word in (("thickness", THICK, "a tenth of "), ("base_width", 1.0, "")):
        if shape is not None:
            value, limit = getattr(shape, name), share * shape.length
            problem = f"is more than {word}the blade's length of {shape.length:g} m"
            serious = value > SERIOUS * limit
            yield from _above(f"{path}.geometry.{name}", value, limit, problem, serious=serious)
    problem = f"is more than the mass of the stage itself ({mass:g} kg)"
    yield from _above(
        f"{path}.tip_mass", blade.tip_mass, mass, problem, "give it in kg", (("g", 1e-3),)
    )


def _length_of_wires(stage: Stage) -> float:
    """Longest nominal wire of a stage, m; 0 if it has none."""
    if stage.wires is not None:
        return stage.wires.l
    return max((_span(stage, wire) for wire in stage.wire), default=0.0)


def _check_perturbation(
    design: Design, item: Perturbation, path: str
) -> Iterator[ImplausibleNumber]:
    part, name = imperfections.perturbed_part(item)
    if part == "link":
        return
    name = name.split(".", 1)[0].removesuffix(SUFFIX)
    stage = next(stage for stage in design.stage if stage.name == name)
    for row in imperfections.perturbed(part):
        value = getattr(item, row.name)
        if value is not None and not row.relative:
            size = max(map(abs, value)) if row.vector else abs(value)
            yield from _check_imperfection(row, size, stage, f"{path}.{row.name}", value)


def _check_imperfection(
    row: Imperfection, size: float, stage: Stage, key: str, value: object
) -> Iterator[ImplausibleNumber]:
    """Check the size (in SI units) of an imperfection."""
    if row.unit == "rad":
        most, units = LARGE_TURN, (("degrees", math.pi / 180), ("mrad", 1e-3))
        problem = f"an error of {size:g} rad is {math.degrees(size):.3g} degrees"
    else:
        wire, units = row.part == "wire", MILLIMETRES
        most = (
            LARGE_SHIFT * _length_of_wires(stage) if wire else BEYOND * max(half_sides(stage.body))
        )
        problem = f"an error of {size:g} m is more than {most:.2g} m, larger than in any real build"
    if most > 0:
        yield from _above(key, size, most, problem, f"give it in {row.unit}", units, shown=value)


def _check_unity_gain(loop: Loop, body: Body, axis: int) -> Iterator[ImplausibleNumber]:
    """Report a loop whose unity gain is above `FASTEST_LOOP`, where bodies move as free masses."""
    inertia = body_mass(body) if axis < 3 else body_inertia(body)[axis - 3][axis - 3]
    ratio = 0.0
    with contextlib.suppress(ArithmeticError):  # a root at this frequency
        size = abs(loop_filters.controller_and_sensor(loop).at(FASTEST_LOOP))
        ratio = size / (inertia * (2 * math.pi * FASTEST_LOOP) ** 2)
    if ratio > 1:
        keys = ("damper", "filter", "gain_at", "gain")
        key, value = next((key, own) for key in keys if (own := getattr(loop, key)))
        problem = f"has unity gain above {FASTEST_LOOP:g} Hz (there the gain is {ratio:.2g})"
        unit = "N s/m or N m s/rad" if key == "damper" else "N/m or N m/rad at each frequency"
        remedy = f"lower it, or check its unit ({unit})"
        shown = None if key == "gain_at" else format_value(value)
        yield ImplausibleNumber(Fault(f"control.loop.{loop.name}.{key}", problem, remedy, shown))


def _check_tolerance(design: Design) -> Iterator[ImplausibleNumber]:
    stages = {stage.name: stage for stage in design.stage}
    rows = [
        (row, item, f"tolerance.{part}.{n}.{row.spread}")
        for part in imperfections.PARTS
        for n, item in enumerate(getattr(design.tolerance, part, ()), 1)
        for row in imperfections.scattered(part)
    ]
    for row, item, key in rows:
        spread = getattr(item, row.spread)
        if spread is None:
            continue
        size = spread.normal or spread.uniform or 0.0
        if row.relative:
            problem = f"is a fraction, and no build scatters by {100 * size:g} %"
            remedy = "give it as a fraction of the nominal value"
            yield from _above(key, size, LARGE_FRACTION, problem, remedy, (("%", 1e-2),))
        else:
            name = item.stage or item.wire.rsplit(".", 1)[0]
            stage = stages[name.removesuffix(SUFFIX)]
            yield from _check_imperfection(row, size, stage, key, size)


def _check_magnet(damper: Damper) -> Iterator[ImplausibleNumber]:
    """Report a conductor inside a magnet, whose damping grows as 1/gap^3."""
    magnet = damper.eddy_current
    if magnet is None:
        return
    volume = magnet.volume or (magnet.moment or 0.0) / MAGNETISATION
    least = FLAT_MAGNET * (3 * volume / (4 * math.pi)) ** (1 / 3)
    if magnet.gap < least:
        problem = f"is inside a magnet of this strength, whose centre is above {least:.2g} m away"
        fault = fault_of(
            magnet, f"damper.{damper.name}.eddy_current", "gap", problem, "give it in m"
        )
        yield ImplausibleNumber(fault, serious=True)


def _check_loops(design: Design) -> Iterator[ImplausibleNumber]:
    bodies = {stage.name: stage.body for stage in design.stage}
    for loop in design.control.loop if design.control is not None else ():
        name, _, push = loop.actuator.partition("@")[0].rpartition(".")
        if name in bodies and (dof := push.partition("_")[2]) in DOFS:
            yield from _check_unity_gain(loop, bodies[name], DOFS.index(dof))


def _check_planes(design: Design) -> Iterator[ImplausibleNumber]:
    """Report filters with poles or zeros in rad/s because their strings name no plane."""
    for loop in design.control.loop if design.control is not None else ():
        for key in ("filter", "sensor_response"):
            text = getattr(loop, key) or ""
            factors = foton.find_without_plane(text)
            if not factors:
                continue
            bare = factors[0][:-1]
            name, _, numbers = bare.partition("(")
            scales = "divides" if name.startswith("pole") else "multiplies"
            size = numbers.partition(",")[0].strip() + ("^2" if "2" in name else "")
            problem = (
                f"{' and '.join(factors)} without a plane: in rad/s by Foton's rule, not in Hz, and"
                f" {factors[0]} {scales} the gain at 0 Hz by {size}"
            )
            remedy = f'write {bare}, "n") for Hz and a gain of 1, or {bare}, "s") if this is meant'
            where = f"control.loop.{loop.name}.{key}"
            yield ImplausibleNumber(Fault(where, problem, remedy, format_value(text)), serious=True)
