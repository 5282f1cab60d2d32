"""Expansion of a design into a scene: all wires, blades and springs, with balanced tensions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from suspension_cli.conventions import SUPPORT
from suspension_cli.design.bodies import body_mass
from suspension_cli.design.derive import (
    SetGeometry,
    blade_loss,
    blade_stiffness,
    com_offset,
    gravity_strength,
    set_geometry,
    wire_loss,
    wire_mass_moments,
    wire_stiffness,
)
from suspension_cli.design.keystones import Keystone
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import Blade, BladeSet, WireSet
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene import tensions, towers
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.links import preload_wrenches
from suspension_cli.scene.parts import BladePart, StagePart, WirePart, pack
from suspension_cli.scene.scene import Scene


def expand_as_drawn(design: Design) -> Scene:
    """Expand a design into its nominal scene, without its imperfections.

    Loads of blades are those of the nominal pose; `equilibrium.nominal` replaces them where the
    pose is solved for. Raises `InputError` if a stage cannot balance in its nominal pose, or a wire
    would be slack in it.
    """
    parts = expand_stages(design)
    faults = _balance(design, parts)
    if faults:
        raise InputError(faults)
    return pack(design, parts)


def expand_stages(design: Design) -> list[StagePart]:
    """Expand wires and blades of every stage, in the scene's order, without tensions."""
    numbers = {SUPPORT: 0} | {stage.name: n for n, stage in enumerate(design.stage, 1)}
    parts: list[StagePart] = []
    for n, stage in enumerate(design.stage, 1):
        parent = n - 1 if stage.hangs_from is None else numbers[stage.hangs_from]
        parts.append(_part(design, stage, parent))
    return parts


def _part(design: Design, stage: Stage, parent: int) -> StagePart:
    part = StagePart(stage, parent, np.array(com_offset(stage)))
    if stage.wires is None:
        _add_single_wires(design, part)
    else:
        _add_symmetric_set(design, part, stage.wires)
    towers.add_legs(part)
    return part


def _add_single_wires(design: Design, part: StagePart) -> None:
    stage, mass = part.stage, body_mass(part.stage.body)
    for number, wire in enumerate(stage.wire, 1):
        upper, lower = np.array(wire.upper), np.array(wire.lower)
        span = part.offset + lower - upper
        length = np.sqrt((span**2).sum())
        known = wire.natural_length or length  # the drawn length does not matter then
        k = wire_stiffness(design, wire, known)
        natural = wire.natural_length is not None
        part.wires.append(
            WirePart(
                label=f"{stage.name}.{number}",
                upper_point=upper,
                lower_point=lower,
                span=span,
                stiffness=k,
                torsion=wire.torsion or 0.0,
                loss=wire_loss(design, wire, known),
                blade=wire.blade,
                given=k * (length - wire.natural_length) if natural else wire.tension,
                natural=natural,
                mass=np.array(wire_mass_moments(design, wire, known)),
            )
        )
    for blade in stage.blade:
        if blade.at is not None:
            tip = np.array(blade.at)
        else:
            tip = np.mean([w.upper_point for w in part.wires if w.blade == blade.name], axis=0)
        label = f"{stage.name}.{blade.name}"
        part.blades[blade.name] = _blade(design, blade, label, tip, mass, len(stage.blade))


def _add_symmetric_set(design: Design, part: StagePart, wires: WireSet) -> None:
    stage, mass, shape = part.stage, body_mass(part.stage.body), set_geometry(wires)
    k = wire_stiffness(design, wires, shape.length)
    loss = wire_loss(design, wires, shape.length)
    moments = np.array(wire_mass_moments(design, wires, shape.length))
    for number, (upper, lower) in enumerate(_set_ends(shape), 1):
        part.wires.append(
            WirePart(
                label=f"{stage.name}.{number}",
                upper_point=np.array([*upper, -shape.d_upper]),
                lower_point=np.array([*lower, shape.d]),
                span=np.array([lower[0] - upper[0], lower[1] - upper[1], -shape.height]),
                stiffness=k,
                torsion=wires.torsion or 0.0,
                loss=loss,
                blade=_blade_of(stage.blades, number, shape),
                mass=moments,
            )
        )
    if stage.blades is not None:
        for name, tip in _set_tips(stage.blades, shape):
            label = f"{stage.name}.blade{name}"
            part.blades[name] = _blade(design, stage.blades, label, tip, mass, stage.blades.count)


def wire_signs(count: int) -> list[tuple[int, int]]:
    """List the signs of x and y of the wires of a symmetric set, by number."""
    return {1: [(0, 0)], 2: [(0, 1), (0, -1)], 4: [(1, 1), (1, -1), (-1, 1), (-1, -1)]}[count]


def _set_ends(shape: SetGeometry) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """List x and y (m) of the upper and the lower end of each wire of a set."""
    if shape.is_ring:
        return [shape.ring_ends(number) for number in range(shape.count)]
    return [
        ((x * shape.s_upper, y * shape.t1), (x * shape.s_lower, y * shape.t2))
        for x, y in wire_signs(shape.count)
    ]


def _blade_of(blades: BladeSet | None, number: int, shape: SetGeometry) -> str | None:
    if blades is None:
        return None
    if blades.count == shape.count:
        return str(number)
    if blades.count == 2:
        return "1" if wire_signs(shape.count)[number - 1][1] > 0 else "2"
    return "1"


def _set_tips(blades: BladeSet, shape: SetGeometry) -> list[tuple[str, Array]]:
    """List name and tip of each blade of a set; the tip of one with two wires is between them."""
    z = -shape.d_upper
    if shape.is_ring and blades.count > 1:
        ends = (shape.ring_ends(n)[0] for n in range(shape.count))
        return [(str(n), np.array([*end, z])) for n, end in enumerate(ends, 1)]
    if blades.count == 4:
        return [
            (str(n), np.array([a * shape.s_upper, b * shape.t1, z]))
            for n, (a, b) in enumerate(wire_signs(4), 1)
        ]
    if blades.count == 2:
        return [("1", np.array([0.0, shape.t1, z])), ("2", np.array([0.0, -shape.t1, z]))]
    return [("1", np.array([0.0, 0.0, z]))]


def _blade(
    design: Design, blade: BladeSet | Blade, label: str, tip: Array, mass: float, count: int
) -> BladePart:
    vertical = blade_stiffness(design, blade, mass, count)
    lateral = blade.lateral_stiffness
    stiffness = np.array([0.0, 0.0, vertical] if lateral is None else [*lateral, vertical])
    return BladePart(
        label,
        tip,
        np.real(stiffness) > 0,
        stiffness,
        blade.tip_mass,
        blade_loss(design, blade),
        blade.load,
    )


def _balance(design: Design, parts: list[StagePart]) -> list[Fault]:
    """Set tensions and blade loads of every stage, from the bottom up; return the faults."""
    g = gravity_strength(design)
    # of each stage two wrenches: all that acts on it, and the weight in that, without preloads
    weights = [tensions.weight_wrench(g * body_mass(p.stage.body), np.zeros(3)) for p in parts]
    loads = [np.stack([weight, weight]) for weight in weights]
    position = [np.zeros(3)]
    for part in parts:
        position.append(position[part.parent] + part.offset)
    for body, wrench in preload_wrenches(design, np.array(position)):
        loads[body - 1] = loads[body - 1] + np.stack([wrench, 0.0 * wrench])
    if any(np.any(wire.mass) for part in parts for wire in part.wires):
        _add_wire_weights(parts, loads, g)
    faults: list[Fault] = []
    for n in range(len(parts), 0, -1):
        part, load = parts[n - 1], loads[n - 1]
        on_stage, on_parent = towers.bar_weights(part, g)
        load = load + on_stage
        faults += _balance_stage(design, part, load[0], -load[1, 2])
        if part.parent > 0:
            above = loads[part.parent - 1] + tensions.move_wrench(load, part.offset) + on_parent
            for blade in part.blades.values():
                above = above + tensions.weight_wrench(g * blade.tip_mass, blade.tip)
            loads[part.parent - 1] = above
    return faults


def _add_wire_weights(parts: list[StagePart], loads: list[Array], gravity: float) -> None:
    """Add the weight of wires to the loads of the bodies that carry their ends."""
    for n, part in enumerate(parts):
        for wire in part.wires:
            upper, lower = gravity * (wire.mass[:2] + wire.mass[1:])
            ends = [(n, lower, wire.lower_point)]
            if part.parent > 0:
                ends.append((part.parent - 1, upper, wire.upper_point))
            for body, weight, point in ends:
                loads[body] = loads[body] + tensions.weight_wrench(weight, point)


def _balance_stage(design: Design, part: StagePart, load: Array, hung: float) -> list[Fault]:
    """Set the tensions of one stage under its load (6,) about its COM; return its faults.

    `hung` is the weight in the load, N, without the preloads of links.
    """
    stage, wires, gravity = part.stage, part.wires, gravity_strength(design)
    key, weight = f"stage.{stage.name}", max(float(np.abs(load).max()), 1e-12)
    for spring in stage.spring:
        load = load + tensions.move_wrench(np.array(spring.preload), np.array(spring.at))
    if part.struts:
        return towers.balance_legs(part, load, hung, gravity, weight)
    if isinstance(stage, Keystone):
        return towers.hold_keystone(design, part, load, hung, gravity)
    if not wires:
        return tensions.report_imbalance(
            load, weight, f"{key}.spring", "give the springs a preload that carries the body"
        )
    direction = np.array([wire.direction for wire in wires])
    wrenches = tensions.wire_wrenches(direction, np.array([wire.lower_point for wire in wires]))
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
            carrying, left_over = _distribute(part, wrenches, left_over, carrying, fixed)
    part.tension = np.where([wire.natural for wire in wires], tension, carrying)
    part.loads = {name: _blade_load(part, name, carrying, gravity) for name in part.blades}
    if solves_pose:
        return []
    remedy = (
        "move the attachments or the COM, or give wires a natural_length to have the pose"
        " solved for"
    )
    return tensions.report_imbalance(left_over, weight, key, remedy) or _slack(part)


def _distribute(
    part: StagePart, wrenches: Array, load: Array, given: Array, fixed: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Distribute a load over the wires without given tension, with least elastic energy.

    Returns all tensions (w,), and the wrench (6,) left over.
    """
    wires, names, free = part.wires, list(part.blades), ~fixed
    stiffness = np.array([wire.stiffness for wire in wires])
    blade = np.array([names.index(wire.blade) if wire.blade else -1 for wire in wires])
    axes = np.array([part.blades[name].axes for name in names]).reshape(-1, 3)
    springs = np.array([part.blades[name].stiffness for name in names]).reshape(-1, 3)
    c = tensions.compliance(
        stiffness, np.array([wire.direction for wire in wires]), blade, axes, springs
    )
    own = c[np.ix_(free, free)]
    # A wire of given tension deflects the blade that it shares with a free wire: minimise about the
    # tensions of the free wires that this deflection corresponds to.
    shift = np.linalg.solve(own, c[np.ix_(free, fixed)] @ given[fixed])
    carried, left_over = tensions.least_energy(wrenches[free], load - wrenches[free].T @ shift, own)
    result = given.astype(carried.dtype)
    result[free] = carried - shift
    lower, upper = (
        np.array([wire.lower_point for wire in wires]),
        np.array([wire.upper_point for wire in wires]),
    )
    return tensions.equalise_mirrored(result, upper, lower, stiffness), left_over


def _slack(part: StagePart) -> list[Fault]:
    where = "wires" if part.stage.wires is not None else "wire"
    return [
        Fault(
            f"stage.{part.stage.name}.{where}",
            f"wire {wire.label} would be slack in the nominal pose (tension {tension:.3g} N)",
            "move its ends, or remove the wire",
        )
        for wire, tension in zip(part.wires, part.tension, strict=True)
        if not tension.real > 0
    ]


def _blade_load(part: StagePart, name: str, tension: Array, gravity: float) -> Array:
    """Compute the force (3,) of a blade on its tip in the nominal pose, N.

    It balances its wires and its tip mass, or the load that the design gives.
    """
    blade = part.blades[name]
    pull = [
        t * wire.direction
        for t, wire in zip(tension, part.wires, strict=True)
        if wire.blade == name
    ]
    total = np.sum(pull, axis=0) + np.array([0.0, 0.0, -gravity * blade.tip_mass])
    for wire in part.wires:
        if wire.blade == name:
            total = total + np.array([0.0, 0.0, -gravity * (wire.mass[0] + wire.mass[1])])
    if blade.load is not None:
        total = np.array([*total[:2], -blade.load])
    return np.where(blade.axes, -total, 0.0)
