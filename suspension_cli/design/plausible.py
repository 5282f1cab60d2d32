"""Numbers of a design that no suspension has: millimetres written as metres, grams as kilograms, GPa as Pa.

A design with such numbers is valid, so these are doubts, not faults.  Limits are wide: they are crossed by a slip of a factor of a thousand, not by a bold
design.  Those that are physical:

- No solid is denser than osmium, 22,590 kg/m^3 (CRC Handbook of Chemistry and Physics); a body below the density of air, 1.2 kg/m^3, would float.
- With S the integral of x x^T over the mass, a body of mass m nowhere denser than rho has det S >= m^3 (m/rho)^2 / (5^3 (4 pi/3)^2), that of a homogeneous
  ellipsoid: of all bodies of one mass and density none is more compact.  So moments of inertia alone tell what density a body must reach.
- No solid is stiffer than diamond, 1.22 TPa (CRC Handbook).
- No material breaks above a fifth of Young's modulus: the ideal strength is about a tenth of it (Orowan, Rep. Prog. Phys. 12, 185 (1949)).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.derive import body_inertia, body_mass, com_offset, set_geometry, volume
from suspension_cli.design.schema import Body, Design, Material, Perturbation, Stage
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet
from suspension_cli.errors import Fault, key_shown, shown

OSMIUM = 22_600.0
"""kg/m^3; nothing is denser."""
AIR = 1.2
"""kg/m^3; a lighter body would float."""
USUAL = 3000.0
"""kg/m^3; of masses of silica and steel with some air between."""
FOAM = 25.0
"""kg/m^3; lighter solids are aerogels."""
STIFFEST, SOFTEST = 1.3e12, 1e7
"""Young's modulus in Pa: above diamond, and of soft rubber."""
IDEAL = 0.2
"""Share of Young's modulus that no strength reaches."""
EXPANSION = 1e-3
"""1/K; twice that of any solid."""
LONGEST_WIRE = 50.0
"""m; suspensions of mirrors are up to about 10 m tall."""
LARGEST = 10.0
"""m; of a body or blade."""
THICK = 0.1
"""Thickness of a wire or blade as a share of its length."""
BEYOND = 0.5
"""How far outside a body its wires may end (on posts, ears, prisms), as a share of the body's largest half."""
INFERRED = 3.0
"""How many times the half sides of the homogeneous box of the same inertia count as a body whose shape is not given."""
ABSURD = 5.0
"""Factor beyond those bounds from which it is a slip, not a bold design."""
GRAVITY = (1.0, 30.0)
"""m/s^2; the Moon's is 1.6, Jupiter's 25."""
BLADE_FREQUENCY = 100.0
"""Hz; blades that isolate bounce at a few."""
LARGE_TURN = 0.1
"""rad; a misalignment of 6 degrees."""
LARGE_SHIFT = 0.05
"""An error of position or length as a share of the wire's length."""
LARGE_SHARE = 0.5
"""A relative tolerance."""
SENSOR_NOISE = 1e-4
"""m or rad per sqrt(Hz); optical shadow sensors reach 1e-10."""

MILLIMETRES = (("mm", 1e-3), ("um", 1e-6))
MOMENTS = (("g m^2", 1e-3), ("kg cm^2", 1e-4), ("kg mm^2", 1e-6), ("g mm^2", 1e-9))


@dataclass(frozen=True)
class Doubt:
    """A number that is hard to believe.

    Attributes
    ----------
    fault : Fault
        Where, what and what to do.
    serious : bool
        Whether answers mean nothing with it, so that analyses warn of it too.
    """

    fault: Fault
    serious: bool = False

    @property
    def line(self) -> str:
        """One line of text."""
        return self.fault.line("")


def suspected_unit(value: float, good: Callable[[float], bool], units: tuple[tuple[str, float], ...] = MILLIMETRES) -> str:
    """``did you mean mm?`` for the first unit (name, size in SI) in which a value would be `good`; "" if there is none."""
    return next((f"did you mean {name}?" for name, size in units if good(value * size)), "")


def of_design(design: Design) -> list[Doubt]:
    """All doubts about the numbers of a design, from its tables alone."""
    found = [*_surroundings(design)]
    for name, material in design.materials.items():
        found += _material(material, f"materials.{key_shown(name)}")
    above: Stage | None = None
    stages: dict[str, Stage | None] = {SUPPORT: None}
    for stage in design.stage:
        path = f"stage.{stage.name}"
        parent = above if stage.hangs_from is None else stages[stage.hangs_from]
        found += [*_body(stage.body, f"{path}.body"), *_wires(stage, parent, path), *_blades(stage, path)]
        for number, spring in enumerate(stage.spring, 1):
            found += _outside(stage.body, spring.at, (f"{path}.spring.{number}.at",) * 3, "the point of the spring lies")
        stages[stage.name] = above = stage
    for number, item in enumerate(design.perturbation, 1):
        found += _perturbation(design, item, f"perturbation.{number}")
    return [*found, *_tolerance(design), *_noise(design)]


def _surroundings(design: Design) -> Iterator[Doubt]:
    g = design.constants.gravity
    if not GRAVITY[0] <= g <= GRAVITY[1]:
        hint = suspected_unit(g, lambda v: GRAVITY[0] <= v <= GRAVITY[1], (("cm/s^2", 1e-2), ("mm/s^2", 1e-3))) or "give it in m/s^2: 9.81 on Earth"
        yield Doubt(Fault("constants.gravity", "no planet has this gravity", hint, shown(g)))


def _material(material: Material, path: str) -> Iterator[Doubt]:
    """Values that a design itself gives."""
    modulus, density, strength = material.youngs_modulus, material.density, material.tensile_strength

    def stiff(value: float) -> bool:
        return SOFTEST <= value <= STIFFEST

    if modulus is not None and not stiff(modulus):
        hint = suspected_unit(modulus, stiff, (("GPa", 1e9), ("MPa", 1e6), ("kPa", 1e3))) or "give it in Pa: 2e11 for steel"
        yield Doubt(Fault(f"{path}.youngs_modulus", f"no solid of wires or blades has a modulus of {modulus:g} Pa", hint, shown(modulus)), serious=True)
    if density is not None:
        yield from _given_density(density, f"{path}.density")
    if material.thermal_expansion is not None and abs(material.thermal_expansion) > EXPANSION:
        hint = suspected_unit(abs(material.thermal_expansion), lambda v: v <= EXPANSION, (("1e-6 1/K", 1e-6),)) or "give it in 1/K: 1.2e-5 for steel"
        yield Doubt(Fault(f"{path}.thermal_expansion", "no solid expands so much", hint, shown(material.thermal_expansion)))
    if strength is not None and modulus is not None and stiff(modulus) and strength > IDEAL * modulus:
        problem = f"is more than {IDEAL:g} of Young's modulus, which no material bears"
        yield Doubt(Fault(f"{path}.tensile_strength", problem, "give it in Pa: 2e9 for strong steel", shown(strength)))


def _given_density(density: float, key: str) -> Iterator[Doubt]:
    if density > OSMIUM:
        hint = suspected_unit(density, lambda v: FOAM <= v <= OSMIUM, (("g/m^3", 1e-3),)) or "give it in kg/m^3"
        yield Doubt(Fault(key, f"is denser than osmium ({OSMIUM:g} kg/m^3)", hint, shown(density)), serious=True)
    elif density < FOAM:
        hint = suspected_unit(density, lambda v: FOAM <= v <= OSMIUM, (("g/cm^3", 1e3),)) or "give it in kg/m^3"
        yield Doubt(Fault(key, "is lighter than foam", hint, shown(density)), serious=True)


def _body(body: Body, path: str) -> Iterator[Doubt]:
    sizes = {"radius": body.radius, "inner_radius": body.inner_radius, "length": body.length, "size": None if body.size is None else max(body.size)}
    for key, size in sizes.items():
        if size is not None and size > LARGEST:
            hint = suspected_unit(size, lambda v: v <= LARGEST)
            yield Doubt(Fault(f"{path}.{key}", f"a body of {size:g} m hangs from nothing", hint, shown(getattr(body, key))), serious=True)
    if body.density is not None:
        yield from _given_density(body.density, f"{path}.density")
    elif body.shape is not None:
        yield from _mean_density(body, path)
    if body.inertia is not None:
        yield from _inertia(body, path)


def _believable(density: float) -> bool:
    return AIR <= density <= OSMIUM


def _mean_density(body: Body, path: str) -> Iterator[Doubt]:
    """Mass over volume."""
    density = body_mass(body) / volume(body)
    if _believable(density):
        return
    if density > OSMIUM:
        problem, units = f"makes the body denser ({density:.3g} kg/m^3) than osmium ({OSMIUM:g})", (("g", 1e-3), ("mg", 1e-6))
    else:
        problem, units = (
            f"makes the body lighter ({density:.3g} kg/m^3) than air ({AIR:g}), for its shape",
            (("mm for the sizes", 1e9), ("mm", 1e6), ("mm", 1e3)),
        )
    hint = suspected_unit(density, lambda v: 100 <= v <= OSMIUM, units) or suspected_unit(density, _believable, units)
    yield Doubt(Fault(f"{path}.mass", problem, hint or "check mass (kg) and sizes (m)", shown(body.mass)), serious=True)


def second_moments(body: Body) -> tuple[float, float, float]:
    """Integrals of x^2, y^2 and z^2 over the mass (products of inertia left out), kg m^2: (I_y + I_z - I_x)/2 and so on."""
    rows = body_inertia(body)
    moments = [rows[n][n] for n in range(3)]
    x, y, z = (sum(moments) / 2 - moment for moment in moments)
    return x, y, z


def _inertia(body: Body, path: str) -> Iterator[Doubt]:
    mass, moments = body_mass(body), second_moments(body)
    largest = max(moments)
    if min(moments) < -1e-6 * largest:
        problem = "no rigid body has one moment above the sum of the other two"
        hint = suspected_unit(1.0, lambda v: _triangle(body, v), MOMENTS) or "check the three moments, in kg m^2"
        yield Doubt(Fault(f"{path}.inertia", problem, hint, shown(body.inertia)), serious=True)
        return
    if min(moments) <= 1e-6 * largest:  # drawn as a plate or rod without thickness
        return
    # 5 S / m are the squares of the half axes of the ellipsoid, the most compact body with these moments
    density = mass / (4 * math.pi / 3 * math.sqrt(math.prod(5 * moment / mass for moment in moments)))
    if _believable(density):
        return
    units = sorted(MOMENTS, key=lambda unit: abs(math.log(density * unit[1] ** -1.5 / USUAL))) if density < AIR else []
    hint = suspected_unit(1.0, lambda v: 100 <= density * v**-1.5 <= OSMIUM, tuple(units))
    if not hint and density > OSMIUM and 100 <= density * 1e-3**2.5 <= OSMIUM:
        hint = f"did you mean g for the mass {mass:g}?"
    word = f"denser than osmium ({OSMIUM:g})" if density > OSMIUM else f"lighter than air ({AIR:g})"
    problem = f"a body of {mass:g} kg with these moments has about {density:.3g} kg/m^3, {word}"
    yield Doubt(
        Fault(f"{path}.inertia", problem, hint or "check mass (kg) and inertia (kg m^2)", shown(body.inertia)),
        serious=density > OSMIUM or density < AIR / ABSURD,
    )


def _triangle(body: Body, factor: float) -> bool:
    """Whether a body's moments would be possible with the largest times a factor."""
    rows = body_inertia(body)
    *small, large = sorted(rows[n][n] for n in range(3))
    return max(*small, factor * large) <= (sum(small) + factor * large) / 2


def half_sides(body: Body) -> tuple[float, float, float]:
    """Half the extent of a body along x, y and z, m; without a shape, of the homogeneous box of the same inertia."""
    if body.shape == "box":
        assert body.size is not None
        x, y, z = (side / 2 for side in body.size)
        return x, y, z
    if body.shape == "cylinder":
        assert body.radius is not None and body.length is not None
        halves = [body.radius] * 3
        halves["xyz".index(body.axis or "x")] = body.length / 2
        return halves[0], halves[1], halves[2]
    mass = body_mass(body)
    x, y, z = (math.sqrt(3 * max(moment, 0.0) / mass) for moment in second_moments(body))
    return x, y, z


def reach(body: Body) -> tuple[float, float, float]:
    """How far from the COM of a body wires may end along x, y and z, m."""
    halves = half_sides(body)
    x, y, z = ((1.0 if body.shape is not None else INFERRED) * half + BEYOND * max(halves) for half in halves)
    return x, y, z


def _outside(body: Body, point: tuple[float, float, float], keys: tuple[str, ...], what: str) -> Iterator[Doubt]:
    """The coordinate of a point that lies furthest outside a body, if any."""
    far = [abs(value) / limit for value, limit in zip(point, reach(body), strict=True)]
    worst = far.index(max(far))
    if far[worst] <= 1:
        return
    limit = reach(body)[worst]
    axis = "xyz"[worst]
    half = half_sides(body)[worst]
    known = f"whose half along {axis} is {half:.3g} m" if body.shape is not None else f"about {half:.2g} m from middle to end along {axis} by its inertia"
    problem = f"{what} {abs(point[worst]):.3g} m from the COM, far outside the body ({known})"
    hint = suspected_unit(abs(point[worst]), lambda v: v <= limit) or "check it, and the size of the body, in m"
    yield Doubt(Fault(keys[worst], problem, hint, shown(point[worst])), serious=far[worst] > ABSURD)


def _wires(stage: Stage, above: Stage | None, path: str) -> Iterator[Doubt]:
    if stage.wires is not None:
        wires, shape = stage.wires, set_geometry(stage.wires)
        key = f"{path}.wires"
        side = ("s_lower", "s_upper") if wires.s is None else ("s", "s")
        yield from _long(shape.length, f"{key}.l")
        yield from _thick(wires, shape.length, key)
        yield from _outside(stage.body, (shape.s_lower, shape.t2, shape.d), (f"{key}.{side[0]}", f"{key}.t2", f"{key}.d"), "lower ends of wires lie")
        if above is not None:
            ends = (shape.s_upper, shape.t1, shape.d_upper)
            yield from _outside(above.body, ends, (f"{key}.{side[1]}", f"{key}.t1", f"{key}.d_upper"), f"upper ends of wires lie, on {above.name},")
    for number, wire in enumerate(stage.wire, 1):
        key = f"{path}.wire.{number}"
        length = math.hypot(*(p + q - u for p, q, u in zip(com_offset(stage), wire.lower, wire.upper, strict=True)))
        yield from _long(length, key)
        yield from _thick(wire, length, key)
        yield from _outside(stage.body, wire.lower, (f"{key}.lower",) * 3, "the lower end lies")
        if above is not None:
            yield from _outside(above.body, wire.upper, (f"{key}.upper",) * 3, f"the upper end lies, on {above.name},")


def _long(length: float, key: str) -> Iterator[Doubt]:
    if length > LONGEST_WIRE:
        hint = suspected_unit(length, lambda v: v <= LONGEST_WIRE) or "give lengths in m"
        yield Doubt(Fault(key, "no tower is tall enough for this wire", hint, f"{length:g}"), serious=True)


def _thick(wire: WireSet | Wire, length: float, key: str) -> Iterator[Doubt]:
    """A wire, or a section of it, that is thicker than a tenth of the wire's length."""
    tables = [(key, wire)] if wire.sections is None else [(f"{key}.sections.{n}", piece) for n, piece in enumerate(wire.sections, 1)]
    for path, table in tables:
        sizes: dict[str, float] = {}
        if table.radius is not None:
            sizes["radius"] = 2 * (max(table.radius) if isinstance(table.radius, list) else table.radius)
        if table.section is not None:
            sizes |= {"section.width": table.section.width, "section.thickness": table.section.thickness}
        for name, size in sizes.items():
            if size > THICK * length:
                hint = suspected_unit(size, lambda v: v <= THICK * length) or "give it in m"
                problem = f"the wire is {size:.3g} m thick, more than a tenth of its length of {length:.3g} m"
                yield Doubt(Fault(f"{path}.{name}", problem, hint, shown(size / 2 if name == "radius" else size)), serious=True)
                break


def _blades(stage: Stage, path: str) -> Iterator[Doubt]:
    if stage.blades is not None:
        yield from _blade(stage.blades, stage, f"{path}.blades")
    for blade in stage.blade:
        yield from _blade(blade, stage, f"{path}.blade.{blade.name}")


def _blade(blade: BladeSet | Blade, stage: Stage, path: str) -> Iterator[Doubt]:
    shape, mass = blade.geometry, body_mass(stage.body)
    if shape is not None:
        key = f"{path}.geometry"
        if shape.length > LARGEST:
            hint = suspected_unit(shape.length, lambda v: v <= LARGEST)
            yield Doubt(Fault(f"{key}.length", "no blade is so long", hint, shown(shape.length)), serious=True)
        for name, limit, word in (("thickness", THICK * shape.length, "a tenth of "), ("base_width", shape.length, "")):
            value = getattr(shape, name)
            if value > limit:
                problem = f"is more than {word}the blade's length of {shape.length:g} m"
                hint = suspected_unit(value, lambda v, limit=limit: v <= limit) or "give it in m"
                yield Doubt(Fault(f"{key}.{name}", problem, hint, shown(value)), serious=value > ABSURD * limit)
    if blade.thickness is not None and blade.thickness > 0.1:
        yield Doubt(Fault(f"{path}.thickness", "no blade is so thick", suspected_unit(blade.thickness, lambda v: v <= 0.1), shown(blade.thickness)))
    f = blade.uncoupled_frequency
    if f is not None and f > BLADE_FREQUENCY:
        hint = suspected_unit(f, lambda v: v <= BLADE_FREQUENCY, (("mHz", 1e-3),)) or "give it in Hz"
        yield Doubt(Fault(f"{path}.uncoupled_frequency", "blades as stiff as this do not isolate", hint, shown(f)))
    if blade.tip_mass > mass:
        hint = suspected_unit(blade.tip_mass, lambda v: v <= mass, (("g", 1e-3),)) or "give it in kg"
        yield Doubt(Fault(f"{path}.tip_mass", f"is more than the stage itself ({mass:g} kg)", hint, shown(blade.tip_mass)))


def _length_of_wires(stage: Stage) -> float:
    """Longest nominal wire of a stage, m; 0 if it has none."""
    if stage.wires is not None:
        return stage.wires.l
    spans = (math.hypot(*(p + q - u for p, q, u in zip(com_offset(stage), wire.lower, wire.upper, strict=True))) for wire in stage.wire)
    return max(spans, default=0.0)


def _perturbation(design: Design, item: Perturbation, path: str) -> Iterator[Doubt]:
    name = item.body or (item.wire or "").rsplit(".", 1)[0]
    stage = next(stage for stage in design.stage if stage.name == name)
    limit = LARGE_SHIFT * _length_of_wires(stage)
    shifts: dict[str, tuple[tuple[float, ...] | None, float]] = {
        "upper_offset": (item.upper_offset, limit),
        "lower_offset": (item.lower_offset, limit),
        "length_change": (None if item.length_change is None else (item.length_change,), limit),
        "com_offset": (item.com_offset, BEYOND * max(half_sides(stage.body))),
    }
    for key, (values, most) in shifts.items():
        yield from _shift(max(map(abs, values or ()), default=0.0), most, f"{path}.{key}", getattr(item, key))
    turn = max(map(abs, item.rotation or ()), default=0.0)
    if turn > LARGE_TURN:
        hint = suspected_unit(turn, lambda v: v <= LARGE_TURN, (("degrees", math.pi / 180), ("mrad", 1e-3))) or "give it in rad"
        yield Doubt(Fault(f"{path}.rotation", f"an error of {turn:g} rad is {math.degrees(turn):.3g} degrees", hint, shown(item.rotation)))


def _shift(size: float, most: float, key: str, value: object) -> Iterator[Doubt]:
    if size > most > 0:
        hint = suspected_unit(size, lambda v: v <= most) or "give it in m"
        yield Doubt(Fault(key, f"an error of {size:g} m is larger than any that is built", hint, shown(value)))


def _tolerance(design: Design) -> Iterator[Doubt]:
    """Spreads that no workshop makes."""
    if design.tolerance is None:
        return
    stages = {stage.name: stage for stage in design.stage}
    tables = [(kind, n, item) for kind in ("wire", "body", "blade") for n, item in enumerate(getattr(design.tolerance, kind), 1)]
    for kind, n, item in tables:
        stage = stages[item.stage or item.wire.rsplit(".", 1)[0]]
        lengths = {"length": LARGE_SHIFT * _length_of_wires(stage), "com": BEYOND * max(half_sides(stage.body))}
        lengths |= {"upper": lengths["length"], "lower": lengths["length"]}
        for key in ("k", "radius", "mass", "inertia", "stiffness", *lengths):
            spread = getattr(item, key, None)
            if spread is None:
                continue
            size, where = spread.normal or spread.uniform or 0.0, f"tolerance.{kind}.{n}.{key}"
            if key in lengths:
                yield from _shift(size, lengths[key], where, size)
            elif size > LARGE_SHARE:
                hint = suspected_unit(size, lambda v: v <= LARGE_SHARE, (("%", 1e-2),)) or "give it as a share"
                yield Doubt(Fault(where, f"is a share, and {100 * size:g} % of scatter is no build", hint, shown(size)))


def _noise(design: Design) -> Iterator[Doubt]:
    for loop in design.control.loop if design.control is not None else ():
        if loop.sensor_noise > SENSOR_NOISE:
            hint = suspected_unit(loop.sensor_noise, lambda v: v <= SENSOR_NOISE, (("nm/sqrt(Hz)", 1e-9),)) or "give it in m/sqrt(Hz) or rad/sqrt(Hz)"
            yield Doubt(Fault(f"control.loop.{loop.name}.sensor_noise", "is more than any sensor's", hint, shown(loop.sensor_noise)))
