"""Statics of a design in the equilibrium of the string model, as `check` lists it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from suspension_cli.design import heat_flow, materials
from suspension_cli.design.bodies import Body, Solid, centre_of_mass
from suspension_cli.design.derive import Keystone, gravity_strength, wire_line_densities
from suspension_cli.design.kept_results import keep_last
from suspension_cli.design.links import LIGHT
from suspension_cli.design.locked_stages import as_in_file
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.towers import filter_statics, leg_inertia, leg_statics
from suspension_cli.design.wires import (
    Blade,
    BladeSet,
    Profile,
    Wire,
    WireSet,
    given_sections,
    thinnest,
)
from suspension_cli.elements import taut_string
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.solve import Equilibrium, solve_once
from suspension_cli.equilibrium.tree import carried_weights
from suspension_cli.models.cavity import angular_stiffness, optical_spring
from suspension_cli.models.string import STRING
from suspension_cli.physics.loads import (
    BladeLoad,
    BodyHeat,
    BodyPose,
    CavityLoad,
    ConductedHeat,
    FilterLoad,
    LegLoad,
    LinkLoad,
    Lowest,
    ReducedProfile,
    Statics,
    Stress,
    Vector,
    WireLoad,
    WireWeights,
)
from suspension_cli.rotations import rotation_vector
from suspension_cli.scene import curved_wires, spring_rows
from suspension_cli.scene.places import Places
from suspension_cli.scene.scene import Scene

__all__ = ["Statics", "Stress", "blade_loads", "list_wire_tables", "solve", "wire_loads"]


@keep_last
def solve(design: Design) -> Statics:
    """Solve for the loads of a design; raises `InputError` if it cannot balance."""
    scene = expand(design)
    strings = STRING.completed(scene, design)
    balanced = solve_once(strings)
    balanced.demand(strings)
    pose = balanced.pose
    (ends, top) = _end_heights(scene, balanced)
    wires = tuple(wire_loads(design, scene, balanced))
    turns = rotation_vector(pose.turn)
    bodies_heat, conducted = _heat(design)
    names = enumerate(scene.bodies.name, 1)
    stages = enumerate(design.stage, 1)
    return Statics(
        wires=wires,
        blades=tuple(blade_loads(design, scene, balanced)),
        bodies=tuple(BodyPose(n, _vector(pose.shift[i]), _vector(turns[i])) for i, n in names),
        lowest=tuple(
            _find_lowest(one.body, n, scene, balanced, float(ends[n])) for n, one in stages
        ),
        top=top,
        residual=float(balanced.residual),
        links=tuple(_links(design)),
        legs=tuple(_legs(design, scene, balanced)),
        filters=tuple(_filters(design, scene, balanced)),
        cavities=tuple(_cavities(design)),
        profiles=tuple(_profiles(design)),
        weights=_weigh_wires(design, scene, wires),
        temperatures=bodies_heat,
        heat=conducted,
    )


def _heat(design: Design) -> tuple[tuple[BodyHeat, ...], tuple[ConductedHeat, ...]]:
    """Temperatures of bodies and the heat that is conducted between them, with `[heat]`."""
    flow = heat_flow.solve(as_in_file(design))
    if flow is None or design.heat is None:
        return (), ()
    removed = dict.fromkeys(design.heat.held, 0.0)
    conducted: list[ConductedHeat] = []
    for one in flow.conductors:
        power = flow.power(one)
        first, second = one.ends
        for name, gained in ((first, -power), (second, power)):
            if name in removed:
                removed[name] += gained
        warm, cold = (first, second) if power >= 0 else (second, first)
        high = flow.temperature[warm]
        low = flow.temperature[cold]
        conducted.append(ConductedHeat(one.label, warm, cold, abs(power), high, low))
    names = dict.fromkeys(name for one in flow.conductors for name in one.ends)
    bodies = (
        BodyHeat(name, flow.temperature[name], flow.absorbed.get(name, 0.0), removed.get(name))
        for name in names
    )
    return tuple(bodies), tuple(conducted)


def _vector(values: np.ndarray) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))


def list_wire_tables(stage: Stage) -> list[WireSet] | list[Wire]:
    """List the table of each wire of a stage."""
    return [stage.wires] * stage.wires.count if stage.wires is not None else stage.wire


class _Section(NamedTuple):
    """Where a wire or blade is stressed: its load over an area (m^2), of a material."""

    area: float
    material: str | None
    strength: float | None  # Pa

    @staticmethod
    def of(design: Design, area: float, material: str | None) -> _Section:
        """The section with the strength of its material, if that is known."""
        strength = materials.resolve(design, material).tensile_strength if material else None
        return _Section(area, material, strength)


def wire_loads(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[WireLoad]:
    """Loads of wires; their own weight adds to the tension at their upper ends."""
    parts: list[tuple[WireSet | Wire, list[_Section]]] = []
    for stage in design.stage:
        own = [(table, _wire_sections(design, table)) for table in stage.wire_tables]
        parts += own if stage.wires is None else own * stage.wires.count
    wires = scene.wires
    tension = balanced.tension
    weight = scene.gravity * (wires.mass[:, 0] + wires.mass[:, 1])
    above = tension + weight * -wires.span[:, 2] / wires.length
    stretch = tension / wires.stiffness
    for n, (table, sections) in enumerate(parts):
        yield WireLoad(
            label=wires.label[n],
            tension=float(tension[n]),
            stretch=float(stretch[n]),
            strain=float(stretch[n] / wires.length[n]),
            **_largest_stress(sections, float(above[n]), table.material),
        )


def _wire_sections(design: Design, table: WireSet | Wire) -> list[_Section]:
    """List the thinnest section of each piece of a wire."""
    pieces = given_sections(table) or [table]
    areas = [(thinnest(piece), piece.material or table.material) for piece in pieces]
    return [_Section.of(design, area, name) for area, name in areas if area is not None]


def blade_loads(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[BladeLoad]:
    """Loads of blades of length L, base width b and thickness h.

    The largest stress under F, at the base, is moment F L over section modulus b h^2 / 6:
    6 F L / (b h^2).
    """
    parts: list[tuple[BladeSet | Blade, list[_Section]]] = []
    for stage in design.stage:
        own = [(table, _blade_sections(design, table)) for table in stage.blade_tables]
        parts += own if stage.blades is None else own * stage.blades.count
    stiffness = scene.blades.stiffness[:, 2]
    loads = scene.blades.load[:, 2] - stiffness * balanced.pose.deflection[:, 2]
    for n, (table, sections) in enumerate(parts):
        load = float(loads[n])
        stressed = _largest_stress(sections, load, table.made_of)
        sag = load / float(stiffness[n])
        yield BladeLoad(label=scene.blades.label[n], load=load, sag=sag, **stressed)


def _blade_sections(design: Design, table: BladeSet | Blade) -> list[_Section]:
    """The base of a blade, if its shape is known."""
    shape = table.geometry
    if shape is None:
        return []
    area = shape.base_width * shape.thickness**2 / (6 * shape.length)
    return [_Section.of(design, area, shape.material)]


def _largest_stress(
    sections: Sequence[_Section], load: float, material: str | None
) -> dict[str, Any]:
    """Largest stress (Pa) of sections under a load (N), and that nearest to breaking.

    The `material` is that where no section is known.
    """
    stresses = [(load / own.area, own) for own in sections]
    largest, where = max(stresses, key=lambda pair: pair[0], default=(None, None))
    name = material if where is None else where.material
    known = [
        (stress / own.strength, own.strength, own.material)
        for stress, own in stresses
        if own.strength is not None
    ]
    fraction, strength, name = max(known, default=(None, None, name or ""))
    return {"stress": largest, "strength": strength, "fraction": fraction, "material": name}


def _end_heights(scene: Scene, balanced: Equilibrium) -> tuple[np.ndarray, float]:
    """Lowest end of a wire on each body, the support first (infinite: none), and highest of all.

    Heights z from the suspension point, m.
    """
    wires = scene.wires
    pose = balanced.pose
    body = np.concatenate([wires.upper, wires.lower])
    point = np.concatenate([wires.upper_point, wires.lower_point])
    z = (scene.bodies.position + pose.shift)[body, 2] + pose.arms(body, point)[:, 2]
    lowest = np.full(len(pose.shift), np.inf)
    np.minimum.at(lowest, body, z)
    return lowest, float(z.max()) if len(z) else 0.0


def _find_lowest(body: Body, n: int, scene: Scene, balanced: Equilibrium, end: float) -> Lowest:
    """Find the lowest point of a body: of its shape, its ends of wires or its COM."""
    z = float(scene.bodies.position[n, 2] + balanced.pose.shift[n, 2])
    points = [(z, "centre of mass"), (end, "wires")]
    up = balanced.pose.rotation[n, 2]
    if body.shape is not None:
        points = [(z - _half_height(body, up), "body"), *points]
    centre = np.array(centre_of_mass(body))
    points += [
        (z + float(up @ (np.array(part.at) - centre)) - _half_height(part, up), "body")
        for part in body.parts
    ]
    lowest = min(points, key=lambda point: point[0])
    return Lowest(name=scene.bodies.name[n - 1], z=lowest[0], point=lowest[1])


def _half_height(body: Solid, up: np.ndarray) -> float:
    """Half the extent (m) of a shape along a unit vector `up` in its own axes; 0 of a point."""
    if body.shape is None:
        return 0.0
    if body.shape == "sphere":
        assert body.radius is not None
        return body.radius
    if body.shape == "box":
        return float(np.abs(up) @ np.array(body.size) / 2)
    assert body.radius is not None and body.length is not None
    along = abs(float(up["xyz".index(body.axis or "x")]))
    return body.length / 2 * along + body.radius * float(np.sqrt(max(1 - along**2, 0.0)))


def _weigh_wires(design: Design, scene: Scene, loads: Sequence[WireLoad]) -> WireWeights | None:
    """Compute the weight of the wires; None where no density is known."""
    wires = scene.wires
    gravity = gravity_strength(design)
    total = ratio = sag = softening = 0.0
    worst = ""
    tables = [table for stage in design.stage for table in list_wire_tables(stage)]
    known: dict[tuple[int, float], float] = {}  # masses of equal wires
    for n, (table, load) in enumerate(zip(tables, loads, strict=True)):
        length = float(wires.length[n])
        kind = id(table), length
        if kind not in known:
            pieces = wire_line_densities(design, table, length)
            mass = sum(piece * density for piece, density in pieces)
            known[kind] = mass + sum(damper.mass for damper in table.dampers)
        weight = gravity * known[kind]
        total += weight
        if weight / load.tension > ratio:
            ratio = weight / load.tension
            worst = load.label
        across = weight * math.hypot(*wires.span[n, :2].tolist()) / length
        sag = max(sag, across * length / (8 * load.tension))
        stiffness = float(wires.stiffness[n]) * length
        softening = max(softening, across**2 * stiffness / (12 * load.tension**3))
    if not total:
        return None
    error = max(ratio**2 / 12, softening)
    included = design.constants.wire_weight
    return WireWeights(included, worst, total=total, ratio=ratio, sag=sag, error=error)


def _profiles(design: Design) -> Iterator[ReducedProfile]:
    """Measured profiles of fibres, from top to bottom."""
    for stage in design.stage:
        for number, table in enumerate(stage.wire_tables, 1):
            if isinstance(table.profile, Profile):
                name = f"{stage.name}.{'wires' if stage.wires is not None else number}"
                places = table.profile.position
                sections = given_sections(table) or ()
                yield ReducedProfile(wire=name, places=len(places), sections=len(sections))


def _links(design: Design) -> Iterator[LinkLoad]:
    """Links and dampers between bodies, in the order of the file."""
    if not (design.link or design.damper):
        return
    places = Places.of(design)
    for link in design.link:
        first, second = (places.position[places.number[name]] for name in link.between)
        found = LinkLoad(
            link.name,
            tuple(link.between),
            _vector(np.diag(spring_rows.link_stiffness(design, link, first, second))),
            _vector(np.diag(spring_rows.matrix(link.damping))),
            table=link.table and (link.table.frequency[0], link.table.frequency[-1]),
        )
        if link.strands is not None:
            curve = spring_rows.link_curve(link, first, second)
            wire = spring_rows.wire_of(design, link.strands)
            weight = link.strands.count * curve.length * wire.weight
            sag = curved_wires.sag(curve, wire)
            found = replace(found, length=curve.length, weight=weight, sag=sag[0])
        yield found
    for damper in design.damper:
        damping = _vector(np.diag(spring_rows.damper_matrix(damper)))
        yield LinkLoad(damper.name, tuple(damper.between), (0.0, 0.0, 0.0), damping)


def _legs(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[LegLoad]:
    """Compute the loads of inverted pendulums."""
    if not scene.struts.label:
        return
    thrust = -taut_string.state(scene, balanced.pose, struts=True).tension
    nominal = scene.drawn or scene
    gravity = float(scene.gravity)
    as_designed = carried_weights(nominal)
    hung = carried_weights(scene)
    for number, stage in enumerate(design.stage, 1):
        legs = stage.inverted_pendulum
        if legs is None:
            continue
        own = scene.struts.lower == number
        _, coupling, top = leg_inertia(legs)
        weight = gravity * (coupling + top) * own.sum()
        nominal_thrust = float(-nominal.struts.tension[own].sum())
        drawn = leg_statics(legs, nominal_thrust, float(as_designed[number - 1]), gravity)
        load = float(thrust[own].sum()) - weight
        stiffness = drawn.stiffness - (load - drawn.load) / legs.length
        mass = drawn.mass + float(hung[number - 1] - as_designed[number - 1]) / gravity
        yield LegLoad(
            stage=stage.name,
            thrust=thrust[own].tolist(),
            load=load,
            critical=drawn.critical,
            margin=drawn.critical / load - 1,
            flexure=drawn.flexure,
            stiffness=stiffness,
            elastic=drawn.elastic,
            frequency=math.sqrt(stiffness / mass) / (2 * math.pi) if stiffness > 0 else None,
            tilt=legs.length * drawn.elastic / stiffness if stiffness > 0 else None,
            saturation=-own.sum() * coupling / mass,
            dilution=stiffness / drawn.elastic,
        )


def _filters(design: Design, scene: Scene, balanced: Equilibrium) -> Iterator[FilterLoad]:
    """Compute the working points of filters."""
    pose = balanced.pose
    springs = scene.springs
    for number, stage in enumerate(design.stage, 1):
        if not isinstance(stage, Keystone):
            continue
        table = stage.blades_table
        spring = int(np.flatnonzero(springs.lower == number)[-1])
        upper = int(springs.upper[spring])
        above = springs.upper_point[spring]
        load = float(springs.preload[spring, 2])
        stiffness = float(springs.stiffness[spring, 2, 2])
        point = pose.shift[upper] + pose.arms(np.array([upper]), above[None])[0]
        sag = float(pose.rotation[upper][:, 2] @ (point - pose.shift[number] - above))
        carried = load + stiffness * sag
        hung = float(carried_weights(scene)[number - 1])
        numbers = filter_statics(table, carried, hung, float(scene.gravity))
        force = load * (table.modulus_slope + 2 * table.thermal_expansion)
        yield FilterLoad(
            stage=stage.blades_of,
            carried=carried,
            load=load,
            stiffness=stiffness,
            frequency=math.sqrt(stiffness / numbers.mass) / (2 * math.pi),
            sag=sag,
            saturation=numbers.coupling / numbers.mass,
            thermal_force=force,
            thermal_shift=force / stiffness,
        )


def _cavities(design: Design) -> Iterator[CavityLoad]:
    """Compute the forces and stiffnesses of the light in all cavities."""
    for cavity in design.cavity:
        soft, hard = np.linalg.eigvalsh(angular_stiffness(cavity)[2:, 2:]).tolist()
        yield CavityLoad(
            name=cavity.name,
            force=2 * cavity.power / LIGHT,
            stability=cavity.g[0] * cavity.g[1],
            soft=soft,
            hard=hard,
            spring=optical_spring(cavity)[0],
            pole=cavity.half_width if math.isfinite(cavity.half_width) else None,
        )
