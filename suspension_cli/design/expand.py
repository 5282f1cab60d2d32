"""Design -> Scene: every wire, blade and spring spelled out, tensions that carry the weight."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from suspension_cli.conventions import SUPPORT
from suspension_cli.design import statics
from suspension_cli.design.derive import SetGeometry, blade_loss, blade_stiffness, body_mass, com_offset, set_geometry, wire_loss, wire_stiffness
from suspension_cli.design.parts import BladePart, StagePart, WirePart, packed
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import Blade, BladeSet
from suspension_cli.errors import Fault, InputError


def nominal(design: Design) -> Scene:
    """The scene of a design as drawn, without its imperfections.

    Where all natural lengths are given, loads of blades are those of the drawing: `mechanics.nominal` has them follow from the pose that is solved for.

    Raises
    ------
    InputError
        If a stage cannot balance in its nominal pose, or a wire would be slack in it.
    """
    parts = spelled_out(design)
    faults = _balance(design, parts)
    if faults:
        raise InputError(faults)
    return packed(design, parts)


def spelled_out(design: Design) -> list[StagePart]:
    """The wires and blades of every stage, in the scene's order, without the tensions."""
    numbers = {SUPPORT: 0} | {stage.name: n for n, stage in enumerate(design.stage, 1)}
    parts: list[StagePart] = []
    for n, stage in enumerate(design.stage, 1):
        parent = n - 1 if stage.hangs_from is None else numbers[stage.hangs_from]
        parts.append(_part(design, stage, parent))
    return parts


def _part(design: Design, stage: Stage, parent: int) -> StagePart:
    mass = body_mass(stage.body)
    if stage.wires is None:
        part = StagePart(stage, parent, np.array(com_offset(stage)))
        for number, wire in enumerate(stage.wire, 1):
            upper, lower = np.array(wire.upper), np.array(wire.lower)
            span = part.offset + lower - upper
            length = np.sqrt((span**2).sum())
            k = wire_stiffness(design, wire, wire.natural_length or length)
            given = wire.tension if wire.natural_length is None else k * (length - wire.natural_length)
            loss, natural = wire_loss(design, wire, length), wire.natural_length is not None
            part.wires.append(WirePart(f"{stage.name}.{number}", upper, lower, span, k, wire.torsion or 0.0, loss, wire.blade, given, natural))
        for blade in stage.blade:
            ends = np.mean([wire.upper_point for wire in part.wires if wire.blade == blade.name], axis=0)
            tip = np.array(blade.at) if blade.at is not None else ends
            part.blades[blade.name] = _blade(design, blade, f"{stage.name}.{blade.name}", tip, mass, len(stage.blade))
        return part
    shape = set_geometry(stage.wires)
    part = StagePart(stage, parent, np.array(com_offset(stage)))
    k = wire_stiffness(design, stage.wires, shape.length)
    loss = wire_loss(design, stage.wires, shape.length)
    for number, (along, across) in enumerate(signs(shape.count), 1):
        upper = np.array([along * shape.s_upper, across * shape.t1, -shape.d_upper])
        lower = np.array([along * shape.s_lower, across * shape.t2, shape.d])
        span = np.array([along * (shape.s_lower - shape.s_upper), across * (shape.t2 - shape.t1), -shape.height])
        name = _blade_of(stage.blades, number, across)
        part.wires.append(WirePart(f"{stage.name}.{number}", upper, lower, span, k, stage.wires.torsion or 0.0, loss, name, None, natural=False))
    if stage.blades is not None:
        for name, tip in _set_tips(stage.blades, shape):
            part.blades[name] = _blade(design, stage.blades, f"{stage.name}.blade{name}", tip, mass, stage.blades.count)
    return part


def signs(count: int) -> list[tuple[int, int]]:
    """Signs of x and y of the wires of a symmetric set, in their numbered order."""
    return {1: [(0, 0)], 2: [(0, 1), (0, -1)], 4: [(1, 1), (1, -1), (-1, 1), (-1, -1)]}[count]


def _blade_of(blades: BladeSet | None, number: int, across: int) -> str | None:
    if blades is None:
        return None
    if blades.count == 4:
        return str(number)
    if blades.count == 2:
        return "1" if across > 0 else "2"
    return "1"


def _set_tips(blades: BladeSet, shape: SetGeometry) -> list[tuple[str, Array]]:
    """Name and tip of each blade of a set; a blade with two wires has its tip between them."""
    z = -shape.d_upper
    if blades.count == 4:
        return [(str(n), np.array([a * shape.s_upper, b * shape.t1, z])) for n, (a, b) in enumerate(signs(4), 1)]
    if blades.count == 2:
        return [("1", np.array([0.0, shape.t1, z])), ("2", np.array([0.0, -shape.t1, z]))]
    return [("1", np.array([0.0, 0.0, z]))]


def _blade(design: Design, blade: BladeSet | Blade, label: str, tip: Array, mass: float, count: int) -> BladePart:
    vertical = blade_stiffness(design, blade, mass, count)
    lateral = blade.lateral_stiffness
    stiffness = np.array([0.0, 0.0, vertical] if lateral is None else [*lateral, vertical])
    return BladePart(label, tip, np.real(stiffness) > 0, stiffness, blade.tip_mass, blade_loss(design, blade), blade.load)


def _balance(design: Design, parts: list[StagePart]) -> list[Fault]:
    """Tensions and blade loads of every stage, from the bottom up; the faults of what cannot balance."""
    g = design.constants.gravity
    loads = [np.array([0.0, 0.0, -g * body_mass(part.stage.body), 0.0, 0.0, 0.0]) for part in parts]
    faults: list[Fault] = []
    for n in range(len(parts), 0, -1):
        part, load = parts[n - 1], loads[n - 1]
        faults += _carry(part, load.copy(), g)
        if part.parent > 0:
            above = loads[part.parent - 1] + statics.moved(load, part.offset)
            for blade in part.blades.values():
                above = above + statics.moved(np.array([0.0, 0.0, -g * blade.tip_mass, 0.0, 0.0, 0.0]), blade.tip)
            loads[part.parent - 1] = above
    return faults


def _carry(part: StagePart, load: Array, gravity: float) -> list[Fault]:
    """Find the tensions of one stage under its load (about its COM)."""
    stage, wires = part.stage, part.wires
    key, weight = f"stage.{stage.name}", max(float(np.abs(load).max()), 1e-12)
    for spring in stage.spring:
        load = load + statics.moved(np.array(spring.preload), np.array(spring.at))
    if not wires:
        return statics.imbalance(load, weight, f"{key}.spring", "give the springs a preload that carries the body")
    direction = np.array([wire.direction for wire in wires])
    wrenches = statics.wire_wrenches(direction, np.array([wire.lower_point for wire in wires]))
    solves_pose = any(wire.natural for wire in wires)
    fixed = np.array([wire.given is not None and not wire.natural for wire in wires])
    tension = np.array([wire.given if wire.given is not None else 0.0 for wire in wires])
    carrying = np.where(fixed, tension, 0.0)
    left_over = load + wrenches.T @ carrying
    if not fixed.all():
        if stage.wires is not None and np.abs(np.delete(load, 2)).max() <= 1e-12 * weight:
            carrying = -load[2] / (len(wires) * -direction[:, 2])
            left_over = load + wrenches.T @ carrying
        else:
            carrying, left_over = _share(part, wrenches, left_over, carrying, fixed)
    part.tension = np.where([wire.natural for wire in wires], tension, carrying)
    part.loads = {name: _blade_load(part, name, carrying, gravity) for name in part.blades}
    if solves_pose:
        return []
    remedy = "move the attachments or the COM, or give wires a natural_length to have the pose solved for"
    return statics.imbalance(left_over, weight, key, remedy) or _slack(part)


def _share(part: StagePart, wrenches: Array, load: Array, given: Array, fixed: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Tensions of least elastic energy of the wires that are free to share a load, beside those that are given; and what is left over."""
    wires, names, free = part.wires, list(part.blades), ~fixed
    stiffness = np.array([wire.stiffness for wire in wires])
    blade = np.array([names.index(wire.blade) if wire.blade else -1 for wire in wires])
    axes = np.array([part.blades[name].axes for name in names]).reshape(-1, 3)
    springs = np.array([part.blades[name].stiffness for name in names]).reshape(-1, 3)
    c = statics.compliance(stiffness, np.array([wire.direction for wire in wires]), blade, axes, springs)
    own = c[np.ix_(free, free)]
    # a given wire on a free wire's blade pulls it down already: minimise about the tensions that it would call for
    shift = np.linalg.solve(own, c[np.ix_(free, fixed)] @ given[fixed])
    carried, left_over = statics.least_energy(wrenches[free], load - wrenches[free].T @ shift, own)
    result = given.astype(carried.dtype)
    result[free] = carried - shift
    lower, upper = np.array([wire.lower_point for wire in wires]), np.array([wire.upper_point for wire in wires])
    return statics.evened(result, upper, lower, stiffness), left_over


def _slack(part: StagePart) -> list[Fault]:
    where = "wires" if part.stage.wires is not None else "wire"
    return [
        Fault(
            f"stage.{part.stage.name}.{where}",
            f"wire {wire.label} would be slack in the nominal pose (tension {tension:.3g} N)",
            "move its ends, or leave the wire out",
        )
        for wire, tension in zip(part.wires, part.tension, strict=True)
        if not tension.real > 0
    ]


def _blade_load(part: StagePart, name: str, tension: Array, gravity: float) -> Array:
    """Force of a blade on its tip in the nominal pose: it holds up its wires and its own tip mass, or the weight that is given."""
    blade = part.blades[name]
    pull = [t * wire.direction for t, wire in zip(tension, part.wires, strict=True) if wire.blade == name]
    total = np.sum(pull, axis=0) + np.array([0.0, 0.0, -gravity * blade.tip_mass])
    if blade.load is not None:
        total = np.array([*total[:2], -blade.load])
    return np.where(blade.axes, -total, 0.0)
