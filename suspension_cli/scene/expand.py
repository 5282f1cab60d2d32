"""Expansion of a design into a scene: bodies, wires, blades, legs and springs, in balance.

Each member of a part is listed as a mapping of its numbers (`Row`); `arrays.gather` makes arrays of
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.bodies import body_inertia, body_mass
from suspension_cli.design.derive import (
    Keystone,
    blade_loss,
    blade_stiffness,
    gives_natural_lengths,
    gravity_strength,
    set_geometry,
    wire_loss,
    wire_mass_moments,
    wire_stiffness,
)
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import Wire, WireSet
from suspension_cli.errors import Fault, InputError
from suspension_cli.scene import links, tensions, towers
from suspension_cli.scene.arrays import Array, Index, gather
from suspension_cli.scene.gravity import field_of
from suspension_cli.scene.places import Places
from suspension_cli.scene.scene import Bars, Blades, Bodies, Scene, Springs, Wires

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.towers import Row


def expand_as_drawn(design: Design) -> Scene:
    """Expand a design into its nominal scene, without its imperfections.

    Loads of blades are those of the nominal pose; `equilibrium.nominal` replaces them where the
    pose is solved for. Raises `InputError` if a stage cannot balance in its nominal pose, or a wire
    would be slack in it.
    """
    places, gravity = Places.of(design), gravity_strength(design)
    wire_rows, blade_rows = list_wires(design, places)
    strut_rows, bar_rows = towers.legs(design, places)
    wires, blades = gather(Wires, wire_rows), gather(Blades, blade_rows)
    struts, bars = gather(Wires, strut_rows), gather(Bars, bar_rows)
    bodies = Bodies(
        name=tuple(stage.name for stage in design.stage),
        mass=np.array([body_mass(stage.body) for stage in design.stage]),
        inertia=np.array([body_inertia(stage.body) for stage in design.stage]),
        position=places.position,
    )
    joining = links.of_links(design, places) + links.of_dampers(design, places)
    loads = _weights(places, gravity, bodies, wires, blades, bars)
    for row in joining:
        preload, point = row["preload"], row["lower_point"]
        above = point + places.between(row["upper"], row["lower"])
        loads[row["lower"], 0] += tensions.move_wrench(preload, point)
        loads[row["upper"], 0] -= tensions.move_wrench(preload, above)
    for n in range(len(design.stage), 0, -1):
        loads[places.parent[n]] += tensions.move_wrench(loads[n], places.offset[n])
    spring_rows, coupling, faults = _springs(design, places, loads, gravity)
    spring_rows += joining
    for row in spring_rows:
        row["upper_point"] = row["lower_point"] + places.between(row["upper"], row["lower"])
    natural = np.array([row["natural"] for row in wire_rows], dtype=bool)
    fixed = np.array([row["fixed"] for row in wire_rows], dtype=bool)
    tension, thrust = wires.tension.copy(), -struts.tension
    for n, stage in enumerate(design.stage, 1):
        load = loads[n, 0] + _preload(stage)
        if stage.inverted_pendulum is not None:
            own = np.flatnonzero(struts.lower == n)
            pull, left_over = tensions.carry(struts, own, blades, load)
            thrust[own] = -pull
            faults += _imbalance(stage, loads[n], left_over) or _loose(stage, struts, own, -pull)
        elif stage.wires is not None or stage.wire:
            own = np.flatnonzero(wires.lower == n)
            tension[own], left_over = tensions.carry(wires, own, blades, load, fixed[own])
            if not natural[own].any():
                wrong = _imbalance(stage, loads[n], left_over)
                faults += wrong or _loose(stage, wires, own, tension[own])
        elif not isinstance(stage, Keystone):
            faults += _imbalance(stage, loads[n], load)
    if faults:
        raise InputError(faults)
    given = np.array([row["given"] for row in blade_rows])
    return Scene(
        name=design.design.name,
        gravity=gravity,
        bodies=bodies,
        wires=replace(wires, tension=np.where(natural, wires.tension, tension)),
        blades=replace(blades, load=_blade_loads(gravity, wires, blades, tension, given)),
        springs=gather(Springs, spring_rows),
        struts=replace(struts, tension=-thrust),
        bars=gather(Bars, bar_rows + coupling) if coupling else bars,
        field=field_of(design),
        solves_pose=gives_natural_lengths(design),
    )


def list_wires(design: Design, places: Places) -> tuple[list[Row], list[Row]]:
    """List the wires and the blades of all stages.

    Besides their arrays: whether the tension of a wire is `fixed` by the design, or follows from a
    `natural` length, so that the pose is solved for; the `given` load of a blade, else NaN.
    """
    wires: list[Row] = []
    blades: list[Row] = []
    for n, stage in enumerate(design.stage, 1):
        first, above = len(blades), places.parent[n]
        own = [
            {"label": f"{stage.name}.{number}", "upper": above, "lower": n} | row
            for number, row in enumerate(_wires_of(design, stage, places.offset[n]), 1)
        ]
        names = [blade.name for blade in stage.blade]
        if stage.blades is not None:
            names = [f"blade{number + 1}" for number in range(stage.blades.count)]
        for number, name in enumerate(names):
            table = stage.blades or stage.blade[number]
            tip = getattr(table, "at", None)
            if tip is None:
                on = [row["upper_point"] for row in own if row["blade"] == number]
                tip = np.mean(on, axis=0)
            if stage.blades is not None and stage.blades.count == 1:
                tip[:2] = 0.0  # exactly, also on a ring
            vertical = blade_stiffness(design, table, body_mass(stage.body), len(names))
            stiffness = np.array([*(table.lateral_stiffness or (0.0, 0.0)), vertical])
            blade = {
                "label": f"{stage.name}.{name}",
                "body": above,
                "axes": stiffness > 0,
                "tip": tip,
                "stiffness": stiffness,
                "tip_mass": table.tip_mass,
                "loss": blade_loss(design, table),
                "given": np.nan if table.load is None else table.load,
            }
            blades.append(blade)
        wires += [row | {"blade": first + row["blade"] if row["blade"] >= 0 else -1} for row in own]
    return wires, blades


def _wires_of(design: Design, stage: Stage, offset: Array) -> Iterator[Row]:
    """List the wires of a stage; their `blade` is numbered within the stage."""
    table = stage.wires
    if table is None:
        names = [blade.name for blade in stage.blade]
        for wire in stage.wire:
            span = offset + wire.lower - wire.upper
            length = float(np.sqrt(span @ span))
            row = _elastic(design, wire, wire.natural_length or length)
            tension = wire.tension or 0.0
            if wire.natural_length is not None:
                tension = row["stiffness"] * (length - wire.natural_length)
            yield row | {
                "upper_point": wire.upper,
                "lower_point": wire.lower,
                "span": span,
                "length": length,
                "tension": tension,
                "fixed": wire.tension is not None,
                "natural": wire.natural_length is not None,
                "blade": -1 if wire.blade is None else names.index(wire.blade),
            }
        return
    shape, same = set_geometry(table), _elastic(design, table, table.l)
    signs = wire_signs(shape.count) if not shape.is_ring else []
    ends = [
        ((x * shape.s_upper, y * shape.t1), (x * shape.s_lower, y * shape.t2)) for x, y in signs
    ]
    for number, (upper, lower) in enumerate(ends or map(shape.ring_ends, range(shape.count))):
        span = np.array([lower[0] - upper[0], lower[1] - upper[1], -shape.height])
        blade = -1
        if stage.blades is not None:
            shared = stage.blades.count < shape.count
            blade = number if not shared else int(stage.blades.count == 2 and signs[number][1] < 0)
        yield same | {
            "upper_point": (*upper, -shape.d_upper),
            "lower_point": (*lower, shape.d),
            "span": span,
            "length": np.sqrt(span @ span),
            "fixed": False,
            "natural": False,
            "blade": blade,
        }


def _elastic(design: Design, table: WireSet | Wire, length: float) -> Row:
    return {
        "stiffness": wire_stiffness(design, table, length),
        "torsion": table.torsion or 0.0,
        "loss": wire_loss(design, table, length),
        "mass": wire_mass_moments(design, table, length),
    }


def wire_signs(count: int) -> list[tuple[int, int]]:
    """List the signs of x and y of the wires of a symmetric set, by number."""
    return {1: [(0, 0)], 2: [(0, 1), (0, -1)], 4: [(1, 1), (1, -1), (-1, 1), (-1, -1)]}[count]


def _weights(
    places: Places, gravity: float, bodies: Bodies, wires: Wires, blades: Blades, bars: Bars
) -> Float[np.ndarray, "1+body 2 6"]:
    """Wrenches of the weight on each body about its COM, twice."""
    ends = wires.mass[:, :2] + wires.mass[:, 1:]
    masses = (bodies.mass, ends.ravel(), blades.tip_mass, bars.loads.ravel())
    joined = np.stack([wires.upper, wires.lower], axis=1)
    body = [np.arange(1, len(places.parent)), joined.ravel(), blades.body, bars.body.ravel()]
    points = np.stack([wires.upper_point, wires.lower_point], axis=1), blades.tip, bars.point
    weight = np.outer(np.concatenate(masses), [0.0, 0.0, -gravity, 0.0, 0.0, 0.0])
    centres = np.zeros((len(bodies.mass), 3))
    at = np.concatenate([centres, *(point.reshape(-1, 3) for point in points)])
    loads = np.zeros((len(places.parent), 2, 6))
    np.add.at(loads, np.concatenate(body), tensions.move_wrench(weight, at)[:, None])
    return loads


def _preload(stage: Stage) -> Array:
    """Wrench (6,) of a stage's own springs on it about its COM."""
    wrenches = [
        tensions.move_wrench(np.array(spring.preload), np.array(spring.at))
        for spring in stage.spring
    ]
    return np.sum(wrenches, axis=0) if wrenches else np.zeros(6)


def _springs(
    design: Design, places: Places, loads: Array, gravity: float
) -> tuple[list[Row], list[Row], list[Fault]]:
    """List the springs of stages, the bars of the inertia of filters' blades, and their faults."""
    springs: list[Row] = []
    bars: list[Row] = []
    faults: list[Fault] = []
    for n, stage in enumerate(design.stage, 1):
        load, hung, above = loads[n, 0] + _preload(stage), -loads[n, 1, 2], places.parent[n]
        own = links.of_stage(design, stage) + towers.flexures(stage, load, hung, gravity)
        if isinstance(stage, Keystone):
            row, coupling, wrong = towers.filter_blades(design, stage, load, hung, gravity)
            own.append(row)
            faults += wrong
            between = {"body": (above, n), "point": (places.offset[n], np.zeros(3))}
            if coupling:
                inertia = (-coupling, coupling, -coupling)
                bars.append({"label": row["label"], "inertia": inertia} | between)
        springs += [{"upper": above, "lower": n} | row for row in own]
    return springs, bars, faults


def _blade_loads(
    gravity: float, wires: Wires, blades: Blades, tension: Array, given: Array
) -> Float[np.ndarray, "blade 3"]:
    """Force of each blade on its tip in the nominal pose, N.

    It balances its wires and its tip mass, or the load that the design gives (else NaN).
    """
    on = wires.blade >= 0
    pull = (tension / wires.length)[:, None] * wires.span
    pull[:, 2] -= gravity * (wires.mass[:, 0] + wires.mass[:, 1])
    total = np.outer(blades.tip_mass, [0.0, 0.0, -gravity])
    np.add.at(total, wires.blade[on], pull[on])
    total[:, 2] = np.where(np.isnan(given), total[:, 2], -given)
    return np.where(blades.axes, -total, 0.0)


def _imbalance(stage: Stage, loads: Array, left_over: Array) -> list[Fault]:
    """Report the forces and torques that are left over of a load, as a fault."""
    key, remedy = ".spring", "give the springs a preload that carries the body"
    if stage.inverted_pendulum is not None:
        key = ".inverted_pendulum"
        remedy = "hang the load at the height of the legs' circle, or below its centre"
    elif stage.wire_tables:
        key, remedy = (
            "",
            (
                "move the attachments or the COM, or give wires a natural_length to have the pose"
                " solved for"
            ),
        )
    least = tensions.BALANCE * max(np.abs(loads[0]).max(), 1e-12)
    least = max(least, 1e-3 * np.abs(left_over).max())
    found = [
        f"{left_over[axis]:.3g} {'N of force along' if axis < 3 else 'N m of'} {DOFS[axis]}"
        + (" torque" if axis > 2 else "")
        for axis in np.argsort(-np.abs(left_over))
        if abs(left_over[axis]) > least
    ]
    problem = f"cannot balance in the nominal pose: {', '.join(found[:3])} left over"
    return [Fault(f"stage.{stage.name}{key}", problem, remedy)] if found else []


def _loose(stage: Stage, lines: Wires, own: Index, force: Array) -> list[Fault]:
    """Report wires that would be slack, or legs that would be pulled."""
    key, what, remedy = "wires", "wire {} would be slack", "move its ends, or remove the wire"
    name = "tension"
    if stage.inverted_pendulum is not None:
        key, what, name = "inverted_pendulum", "leg {} would be pulled", "thrust"
        remedy = "place the load between the legs"
    elif stage.wire:
        key = "wire"
    return [
        Fault(
            f"stage.{stage.name}.{key}",
            f"{what.format(lines.label[n])} in the nominal pose ({name} {value:.3g} N)",
            remedy,
        )
        for n, value in zip(own, force, strict=True)
        if not value > 0
    ]
