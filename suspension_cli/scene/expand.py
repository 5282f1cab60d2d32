"""Expansion of a design into a scene: bodies, wires, blades, legs and springs, in balance.

Each member of a part is listed as a mapping of its numbers (`Row`); `arrays.gather` makes arrays of
them.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design import derive
from suspension_cli.design.bodies import Body, body_inertia, body_mass
from suspension_cli.design.kept_results import keep_last
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.wires import Wire, WireSet
from suspension_cli.errors import Fault, InputError
from suspension_cli.rotations import cross
from suspension_cli.scene import legs, spring_rows
from suspension_cli.scene.arrays import Array, Index, Row, from_centres, gather, topology
from suspension_cli.scene.places import Places
from suspension_cli.scene.scene import (
    Bars,
    Blades,
    Bodies,
    Field,
    Scene,
    Springs,
    Wires,
    select_scenes,
)

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact

BALANCE = 1e-9
"""Residual force, over the weight, and torque, over the weight times 1 m, that count as 0."""
TORQUES = 1e-3
"""Weight (1/m) of torques relative to forces in a load that cannot be balanced."""
SUPPORTED = 1e-12
"""Fraction of the stiffest direction of springs below which a direction counts as not supported."""
ROUNDING = 1e-12
"""Relative difference of tensions or loads that are equal but for rounding."""


@dataclass(frozen=True)
class Members:
    """Bodies and members of all parts of one design, before the loads are known.

    Besides their arrays, wires have whether their tension is `fixed` by the design, or follows from
    a `natural` length, so that the pose is solved for; blades have the `given` load, else NaN.
    """

    design: Design
    places: Places
    wires: list[list[Row]]  # of each stage
    blades: list[list[Row]]  # of each stage
    struts: list[Row]  # of all legs
    bars: list[Row]  # of all legs
    springs: list[Row]  # of all stages, links and dampers

    @staticmethod
    def of(design: Design, other: Members | None = None) -> Members:
        """List the members of a design; those of stages that equal an `other` one's are its own."""
        places = Places.of(design)
        wires = []
        blades = []
        first = 0
        for n in range(1, len(design.stage) + 1):
            if other is not None and other._has(n, design, places, first):
                own = other.wires[n - 1], other.blades[n - 1]
            else:
                own = _list_stage(design, places, n, first)
            wires.append(own[0])
            blades.append(own[1])
            first += len(own[1])
        struts, bars = legs.struts_and_bars(design, places)
        springs = spring_rows.of_stages(design, places) + spring_rows.of_links(design, places)
        springs = spring_rows.with_upper_points(springs, places)
        return Members(design, places, wires, blades, struts, bars, springs)

    def _has(self, n: int, design: Design, places: Places, first: int) -> bool:
        """Whether the n-th stage of a design is its own, hangs alike, and has the same numbers."""
        own = self.design
        return (
            n <= len(own.stage)
            and (own.materials, own.constants) == (design.materials, design.constants)
            and own.stage[n - 1] == design.stage[n - 1]
            and self.places.parent[n] == places.parent[n]
            and bool((self.places.offset[n] == places.offset[n]).all())
            and sum(map(len, self.blades[: n - 1])) == first
        )

    def wire_facts(self, name: str) -> Bool[np.ndarray, " wire"]:
        """Whether each wire is ``fixed``, or ``natural``."""
        rows = chain.from_iterable(self.wires)
        return np.array([row[name] for row in rows], dtype=bool)

    @property
    def bodies(self) -> list[Body]:
        """Tables of the bodies of all stages."""
        return [stage.body for stage in self.design.stage]

    @property
    def topology(self) -> Hashable:
        """What designs have in common whose scenes can be one batch."""
        wires = chain.from_iterable(self.wires)
        blades = [*chain.from_iterable(self.blades)]
        lines = [*wires, *self.struts]
        signs = [(row["natural"], row["fixed"]) for row in lines if "fixed" in row]
        signs += [(bool(row.get("torsion")), any(row.get("mass", ()))) for row in lines]
        signs += [(bool(row["tip_mass"]), math.isnan(row["given"])) for row in blades]
        signs += [
            (bool(np.any(row.get("damping", 0.0))), row.get("carries", False))
            for row in self.springs
        ]
        constants = self.design.constants
        return (
            repr((constants.gravity, constants.gravity_gradient)),
            tuple(stage.name for stage in self.design.stage),
            tuple(self.places.parent),
            tuple(signs),
            topology(Wires, lines),
            topology(Blades, blades),
            topology(Bars, self.bars),
            topology(Springs, self.springs),
        )


@keep_last
def members_of(design: Design) -> Members:
    """List the members of a design, as its scene and the composition of its wires need them."""
    return Members.of(design)


def expand_as_drawn(design: Design) -> Scene:
    """Expand a design into its nominal scene, without its imperfections.

    Loads of blades are those of the nominal pose; `equilibrium.nominal` replaces them where the
    pose is solved for. Raises `InputError` if a stage cannot balance in its nominal pose, or a wire
    would be slack in it.
    """
    scene, faults = balance_as_drawn([members_of(design)])
    if faults:
        raise InputError(faults[0])
    return select_scenes(scene, 0)


def balance_as_drawn(each: Sequence[Members]) -> tuple[Scene, dict[int, list[Fault]]]:
    """Expand designs of one topology into a batch of nominal scenes, as `expand_as_drawn`.

    Also returns the faults of those that cannot balance or have a slack wire, by their number. The
    loads are computed for all at once. Springs and bars whose stiffness follows from the loads, of
    legs and filters, are those of one design each (`Members.topology` does not know them).
    """
    one = each[0]
    design = one.design
    gravity = derive.gravity_strength(design)
    field = derive.gravity_field(design)
    centre = np.array([own.places.centre for own in each])
    wires = from_centres(gather(Wires, [[*chain.from_iterable(own.wires)] for own in each]), centre)
    rows = [[*chain.from_iterable(own.blades)] for own in each]
    blades = from_centres(gather(Blades, rows), centre)
    struts = from_centres(gather(Wires, [members.struts for members in each]), centre)
    bars = from_centres(gather(Bars, [members.bars for members in each]), centre)
    springs = from_centres(gather(Springs, [members.springs for members in each]), centre)
    bodies = Bodies(
        name=tuple(stage.name for stage in design.stage),
        mass=np.array([[body_mass(body) for body in own.bodies] for own in each]),
        inertia=np.array([[body_inertia(body) for body in own.bodies] for own in each]),
        position=np.array([own.places.position for own in each]) + centre,
    )
    loads = _weights(gravity, bodies, wires, blades, bars)
    _add_preloads(loads, springs)
    _add_loads_from_below(loads, each)
    _rest_on_springs(loads, one, springs)
    # legs and filters
    loaded = [_loaded_springs(own, loads[n], gravity) for n, own in enumerate(each)]
    all_springs, all_bars, wrong = zip(*loaded, strict=True)
    faults = {n: own for n, own in enumerate(wrong) if own}
    tension, thrust, unbalanced = _tensions(one, loads, wires, struts, blades)
    for n, more in unbalanced.items():
        faults[n] = faults.get(n, []) + more
    every_spring = from_centres(gather(Springs, all_springs), centre)
    computed = len(every_spring.label) - len(springs.label)
    every_spring.preload[:, computed:] = springs.preload
    given = [[row["given"] for row in chain.from_iterable(own.blades)] for own in each]
    given_loads = np.array(given).reshape(len(each), -1)
    scene = Scene(
        name=design.design.name,
        gravity=gravity,
        bodies=bodies,
        # wires of natural lengths have the tension of their elongation: the pose is solved for
        wires=replace(wires, tension=np.where(one.wire_facts("natural"), wires.tension, tension)),
        blades=replace(blades, load=_blade_loads(gravity, wires, blades, tension, given_loads)),
        springs=every_spring,
        struts=replace(struts, tension=-thrust),
        bars=from_centres(gather(Bars, all_bars), centre),
        field=field and Field(*map(np.array, field)),
        solves_pose=derive.gives_natural_lengths(design),
    )
    return scene, faults


def _add_preloads(loads: Float[np.ndarray, "design 1+body 2 6"], springs: Springs) -> None:
    """Add what the given preloads of springs exert on both bodies, to all but the weights."""
    for n, (upper, lower) in enumerate(zip(springs.upper, springs.lower, strict=True)):
        preload = springs.preload[:, n]
        loads[:, lower, 0] += move_wrench(preload, springs.lower_point[:, n])
        loads[:, upper, 0] -= move_wrench(preload, springs.upper_point[:, n])


def _add_loads_from_below(
    loads: Float[np.ndarray, "design 1+body 2 6"], each: Sequence[Members]
) -> None:
    """Add to the load of each body those of the bodies that hang from it."""
    offset = np.array([own.places.offset for own in each])
    parent = each[0].places.parent
    centre = np.array([own.places.centre for own in each])
    if centre.any():
        offset = offset + centre - centre[:, parent]
    for n in range(len(parent) - 1, 0, -1):
        loads[:, parent[n]] += move_wrench(loads[:, n], offset[:, n, None])


def _rest_on_springs(
    loads: Float[np.ndarray, "design 1+body 2 6"], one: Members, springs: Springs
) -> None:
    """Give springs that carry the load of their body their preloads; what is left, to its wires.

    What a spring carries acts on the body above all the same: loads of that one are complete.
    """
    carries = np.array([row.get("carries", False) for row in one.springs], dtype=bool)
    for n in np.unique(springs.lower[carries]).tolist():
        own = np.flatnonzero(carries & (springs.lower == n))
        preload, left_over = rest_on(springs, own, loads[:, n, 0])
        springs.preload[:, own] = preload
        loads[:, n, 0] = left_over


def _tensions(
    one: Members,
    loads: Float[np.ndarray, "design 1+body 2 6"],
    wires: Wires,
    struts: Wires,
    blades: Blades,
) -> tuple[Array, Array, dict[int, list[Fault]]]:
    """Tensions of wires and thrusts of struts that carry the loads, N; faults where none do.

    `one` is any of the designs.
    """
    natural = one.wire_facts("natural")
    fixed = one.wire_facts("fixed")
    tension = wires.tension.copy()
    thrust = -struts.tension
    faults: dict[int, list[Fault]] = {}
    for n, stage in enumerate(one.design.stage, 1):
        load = loads[:, n, 0]
        on_legs = stage.inverted_pendulum is not None
        lines, force = (struts, thrust) if on_legs else (wires, tension)
        own = np.flatnonzero(lines.lower == n)
        left_over = load
        if on_legs:
            pull, left_over = carry(struts, own, blades, load)
            thrust[:, own] = -pull
        elif len(own):
            tension[:, own], left_over = carry(wires, own, blades, load, fixed[own])
        is_solved_for = not on_legs and natural[own].any()
        if not (is_solved_for or isinstance(stage, derive.Keystone)):
            found = _find_unbalanced(stage, loads[:, n], left_over, lines, own, force[:, own])
            for k, wrong in found.items():
                faults[k] = faults.get(k, []) + wrong
    return tension, thrust, faults


def _list_stage(design: Design, places: Places, n: int, first: int) -> tuple[list[Row], list[Row]]:
    """List the wires and the blades, numbered from `first`, of the n-th stage."""
    stage = design.stage[n - 1]
    above = places.parent[n]
    wires = [
        {"label": f"{stage.name}.{number}", "upper": above, "lower": n} | row
        for number, row in enumerate(_wires_of(design, stage, places.offset[n]), 1)
    ]
    tables = [stage.blades] * stage.blades.count if stage.blades else stage.blade
    blades: list[Row] = []
    for number, table in enumerate(tables):
        tip = getattr(table, "at", None)
        if tip is None:
            tip = np.mean([row["upper_point"] for row in wires if row["blade"] == number], axis=0)
        if stage.blades is not None and stage.blades.count == 1:
            tip[:2] = 0.0  # exactly, also on a ring
        vertical = derive.blade_stiffness(design, table, body_mass(stage.body), len(tables))
        stiffness = np.array([*(table.lateral_stiffness or (0.0, 0.0)), vertical])
        blades.append(
            {
                "label": f"{stage.name}.{getattr(table, 'name', f'blade{number + 1}')}",
                "body": above,
                "axes": stiffness > 0,
                "tip": tip,
                "stiffness": stiffness,
                "tip_mass": table.tip_mass + sum(damper.mass for damper in table.dampers),
                "loss": derive.part_loss(design, table),
                "given": math.nan if table.load is None else table.load,
            }
        )
    for row in wires:
        row["blade"] += first if row["blade"] >= 0 else 0
    return wires, blades


def _wires_of(design: Design, stage: Stage, offset: Array) -> Iterator[Row]:
    """List the wires of a stage; their `blade` is numbered within the stage."""
    equal = None if stage.wires is None else _elastic(design, stage.wires, stage.wires.l)
    for wire, upper, lower, blade in _ends_of(stage):
        span = offset + lower - upper
        length = float(np.sqrt(span @ span))
        natural = getattr(wire, "natural_length", None)
        tension = getattr(wire, "tension", None)
        row = equal or _elastic(design, wire, natural or length)
        stretched = 0.0 if natural is None else row["stiffness"] * (length - natural)
        yield row | {
            "upper_point": upper,
            "lower_point": lower,
            "span": span,
            "length": length,
            "tension": tension or stretched,
            "fixed": tension is not None,
            "natural": natural is not None,
            "blade": blade,
        }


def _ends_of(stage: Stage) -> Iterator[tuple[WireSet | Wire, Array, Array, int]]:
    """List the wires of a stage with their ends, and the blade of each, -1 for none."""
    names = [blade.name for blade in stage.blade]
    for wire in stage.wire:
        blade = -1 if wire.blade is None else names.index(wire.blade)
        yield wire, np.array(wire.upper), np.array(wire.lower), blade
    if stage.wires is not None:
        shape = derive.set_geometry(stage.wires)
        count = stage.blades.count if stage.blades else 0
        for number, (upper, lower) in enumerate(shape.ends):
            # one blade for all, two for the sides of y, or one for each
            blade = number if count == shape.count else int(count == 2 and upper[1] < 0)
            ends = np.array([*upper, -shape.d_upper]), np.array([*lower, shape.d])
            yield stage.wires, *ends, blade if count else -1


def _elastic(design: Design, table: WireSet | Wire, length: float) -> Row:
    return {
        "stiffness": derive.wire_stiffness(design, table, length),
        "torsion": table.torsion or 0.0,
        "loss": derive.wire_loss(design, table, length),
        "mass": derive.wire_mass_moments(design, table, length),
    }


def _weights(
    gravity: float, bodies: Bodies, wires: Wires, blades: Blades, bars: Bars
) -> Float[np.ndarray, "design 1+body 2 6"]:
    """Wrenches of the weight on each body about its COM, twice."""
    ends = wires.mass[..., :2] + wires.mass[..., 1:]
    loads = np.zeros((len(bodies.mass), len(bodies.name) + 1, 2, 6))
    loads[:, 1:, :, 2] = -gravity * bodies.mass[..., None]
    for body, point, mass in (
        (wires.upper, wires.upper_point, ends[..., 0]),
        (wires.lower, wires.lower_point, ends[..., 1]),
        (blades.body, blades.tip, blades.tip_mass),
        *((bars.body[:, n], bars.point[:, :, n], bars.loads[..., n]) for n in range(2)),
    ):
        weight = mass[..., None] * np.array([0.0, 0.0, -gravity, 0.0, 0.0, 0.0])
        for n in np.flatnonzero(mass.any(0)):
            loads[:, body[n]] += move_wrench(weight[:, n], point[:, n])[:, None]
    return loads


def _loaded_springs(
    own: Members, loads: Array, gravity: float
) -> tuple[list[Row], list[Row], list[Fault]]:
    """List all springs and bars of a design under its loads (1 + body, 2, 6), and their faults.

    Those of legs and of filters depend on the loads.
    """
    springs: list[Row] = []
    bars = [*own.bars]
    faults: list[Fault] = []
    design = own.design
    places = own.places
    for n, stage in enumerate(design.stage, 1):
        load = loads[n, 0]
        hung = -loads[n, 1, 2]
        above = places.parent[n]
        rows = legs.flexures(stage, load, hung, gravity)
        if isinstance(stage, derive.Keystone):
            row, coupling, wrong = spring_rows.filter_blades(design, stage, load, hung, gravity)
            rows.append(row)
            faults += wrong
            ends = {"body": (above, n), "point": (places.offset[n], np.zeros(3))}
            if coupling:
                inertia = (-coupling, coupling, -coupling)
                bars.append({"label": row["label"], "inertia": inertia} | ends)
        springs += [{"upper": above, "lower": n} | row for row in rows]
    return spring_rows.with_upper_points(springs, places) + own.springs, bars, faults


def _blade_loads(
    gravity: float, wires: Wires, blades: Blades, tension: Array, given: Array
) -> Float[np.ndarray, "design blade 3"]:
    """Force of each blade on its tip in the nominal pose, N.

    It balances its wires and its tip mass, or the load that the design gives (else NaN).
    """
    pull = (tension / wires.length)[..., None] * wires.span
    pull[..., 2] -= gravity * (wires.mass[..., 0] + wires.mass[..., 1])
    total = blades.tip_mass[..., None] * np.array([0.0, 0.0, -gravity])
    for n in np.flatnonzero(wires.blade >= 0):
        total[:, wires.blade[n]] += pull[:, n]
    total[..., 2] = np.where(np.isnan(given), total[..., 2], -given)
    return np.where(blades.axes, -total, 0.0)


class _Advice(NamedTuple):
    """What to say of a stage that cannot balance, and of its wires or legs without load."""

    key: str  # of what does not balance, below the stage
    remedy: str
    line_key: str
    line_problem: str
    line_force: str
    line_remedy: str


def _advice_for(stage: Stage) -> _Advice:
    if stage.inverted_pendulum is not None:
        key = ".inverted_pendulum"
        remedy = "hang the load at the height of the legs' circle, or below its centre"
        better = "place the load between the legs"
        return _Advice(key, remedy, key, "leg {} would be pulled", "thrust", better)
    key = ".spring"
    remedy = "leave out preload, so that the springs carry the load"
    if stage.wire_tables:
        key = ""
        remedy = "move the attachments or the COM, or give wires a natural_length"
        remedy += " to have the pose solved for"
    elif any(spring.preload is None for spring in stage.spring):
        remedy = "the springs have no stiffness there: give some, or a preload that carries it"
    line_key = ".wire" if stage.wire else ".wires"
    better = "move its ends, or remove the wire"
    return _Advice(key, remedy, line_key, "wire {} would be slack", "tension", better)


def _find_unbalanced(
    stage: Stage, loads: Array, left_over: Array, lines: Wires, own: Index, force: Array
) -> dict[int, list[Fault]]:
    """Find designs with a load left over on a stage, or with slack wires or pulled legs."""
    least = BALANCE * np.abs(loads[:, 1]).max(-1)
    wrong = (np.abs(left_over).max(-1) > least) | ~(force > 0).all(-1)
    found: dict[int, list[Fault]] = {}
    if not wrong.any():
        return found
    advice = _advice_for(stage)
    path = f"stage.{stage.name}"
    for k in np.flatnonzero(wrong).tolist():
        rest = _describe_wrench(left_over[k], least[k])
        if rest:
            problem = f"cannot balance in the nominal pose: {', '.join(rest[:3])} left over"
            found[k] = [Fault(f"{path}{advice.key}", problem, advice.remedy)]
            continue
        found[k] = []
        for n, value in zip(own, force[k], strict=True):
            if not value > 0:
                what = advice.line_problem.format(lines.label[n])
                problem = f"{what} in the nominal pose ({advice.line_force} {value:.3g} N)"
                found[k].append(Fault(f"{path}{advice.line_key}", problem, advice.line_remedy))
    return found


def _describe_wrench(wrench: Array, least: float) -> list[str]:
    """Describe the components of a wrench (6,) above a limit and not beside larger ones."""
    size = np.abs(wrench)
    described = []
    for axis in np.argsort(-size).tolist():
        if size[axis] > max(least, 1e-3 * size.max()):
            what = f"N of force along {DOFS[axis]}" if axis < 3 else f"N m of {DOFS[axis]} torque"
            described.append(f"{wrench[axis]:.3g} {what}")
    return described


# Tensions.


def move_wrench(wrench: Array, offset: Array) -> Array:
    """Transform a wrench (..., 6) to a point that lies at -offset (..., 3) from its own, m."""
    torque = wrench[..., 3:] + cross(offset, wrench[..., :3])
    force = np.broadcast_to(wrench[..., :3], torque.shape)
    return np.concatenate([force, torque], axis=-1)


def wire_wrenches(direction: Array, point: Array) -> Array:
    """Compute force and torque (..., w, 6) of a unit tension in each wire on the lower body.

    From unit vectors to the lower ends and the places of these from the COM, m.
    """
    return np.concatenate([-direction, cross(point, -direction)], axis=-1)


def least_energy(
    wrenches: Inexact[np.ndarray, "*batch wire 6"],
    load: Inexact[np.ndarray, "*batch 6"],
    strain: Inexact[np.ndarray, "*batch part wire"],
    given: Inexact[np.ndarray, "*batch part"] | float = 0.0,
) -> tuple[Inexact[np.ndarray, "*batch wire"], Inexact[np.ndarray, "*batch 6"]]:
    """Find the tensions of least elastic energy that balance a load.

    Minimise |S T + g|^2 / 2 subject to sum_i T_i w_i + load = 0 (least squares if that has no
    solution). With S = Q R and y = R T + Q^T g the energy is y^2 / 2 but for a constant.

    The w_i are the `wrenches` of unit tensions, S are `strains`, g is due to tensions that are
    given, sqrt(J); the load (N and N m) is all else that acts on the body. Returns the tensions (N)
    and the wrench that is left over.
    """
    orthogonal, triangle = np.linalg.qr(strain)
    root = np.linalg.inv(triangle)
    start = _product(orthogonal.swapaxes(-1, -2), given + np.zeros(strain.shape[:-1]))
    act = wrenches.swapaxes(-1, -2)
    rest = load - _product(act, _product(root, start))

    def fit(weight: Array) -> Array:
        inverse = np.linalg.pinv(weight[:, None] * (act @ root), rcond=1e-10)
        return _product(root, _product(inverse, -weight * rest) - start)

    tension = fit(np.ones(6))
    left_over = load + _product(act, tension)
    lost = np.abs(left_over).max(-1) > ROUNDING * np.abs(load).max(-1)
    if lost.any():
        # where not all can be balanced, forces are balanced first: what is left over reads better
        forces_first = fit(np.array([1.0, 1.0, 1.0, TORQUES, TORQUES, TORQUES]))
        left_over = np.where(lost[..., None], load + _product(act, forces_first), left_over)
    return tension, left_over


def rest_on(
    springs: Springs, own: Index, load: Inexact[np.ndarray, "*batch 6"]
) -> tuple[Inexact[np.ndarray, "*batch own 6"], Inexact[np.ndarray, "*batch 6"]]:
    """Distribute a load on a body about its COM over springs, in the nominal pose.

    Each exerts -K_i u_i at its point, as if the body had sunk by a small rigid motion u on springs
    that had no strain before. These are the forces of least elastic energy that carry the load
    (Castigliano; Timoshenko, Strength of Materials, part I). Returns the force and torque of each
    spring, and the wrench left over where the springs have no stiffness.
    """
    unit = np.broadcast_to(np.eye(6), (len(own), 6, 6))
    point = springs.lower_point[..., own, None, :]
    moved = move_wrench(unit, point)
    act = moved.swapaxes(-1, -2)  # from wrenches at the points to wrenches about the COM
    sunk = springs.stiffness[..., own, :, :] @ moved  # wrenches at the points, by rigid motions
    whole = (act @ sunk).sum(-3)
    # N/m and N m/rad are made comparable, so that a soft rotation is not taken for none
    size = np.sqrt(np.abs(np.diagonal(whole, axis1=-2, axis2=-1)))
    scale = 1 / np.where(size > 0, size, 1.0)
    compared = scale[..., :, None] * whole * scale[..., None, :]
    inverse = np.linalg.pinv(compared, rcond=SUPPORTED, hermitian=True)
    preload = np.zeros(sunk.shape[:-1])
    left_over = load
    for _again in range(2):  # the second time what rounding left over
        motion = scale * _product(inverse, -scale * left_over)
        preload = preload + _product(sunk, motion[..., None, :])
        left_over = load + _product(act, preload).sum(-2)
    # where not all can be balanced, forces are balanced first: what is left over reads better
    weight = np.array([1.0, 1.0, 1.0, TORQUES, TORQUES, TORQUES])
    motion = _product(np.linalg.pinv(weight[:, None] * whole, rcond=SUPPORTED), -weight * load)
    forces_first = load + _product(whole, motion)
    lost = np.abs(left_over).max(-1) > BALANCE * np.abs(load).max(-1)
    return preload, np.where(lost[..., None], forces_first, left_over)


def _product(matrix: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return (matrix @ vector[..., None])[..., 0]


def strains(
    stiffness: Inexact[np.ndarray, "*batch wire"],
    direction: Inexact[np.ndarray, "*batch wire 3"],
    blade: Index,
    axes: Bool[np.ndarray, "blade 3"] | Float[np.ndarray, "0 3"],
    blade_stiffness: Inexact[np.ndarray, "*batch blade 3"],
) -> Inexact[np.ndarray, "*batch part wire"]:
    """Compute the matrix S such that |S T|^2 / 2 is the energy of tensions T of wires and blades.

    One row per wire and per axis of a blade, in 1/sqrt(N/m).
    """
    rows = np.eye(len(blade)) / np.sqrt(stiffness)[..., None]
    for number in sorted(set(blade[blade >= 0].tolist())):
        pull = np.where((blade == number)[:, None], direction, 0.0)[..., axes[number]]
        soft = np.sqrt(blade_stiffness[..., number, :][..., axes[number]])
        rows = np.concatenate([rows, pull.swapaxes(-1, -2) / soft[..., None]], axis=-2)
    return rows


def carry(
    lines: Wires,
    own: Index,
    blades: Blades,
    load: Inexact[np.ndarray, "*batch 6"],
    fixed: Bool[np.ndarray, " own"] | None = None,
) -> tuple[Inexact[np.ndarray, "*batch own"], Inexact[np.ndarray, "*batch 6"]]:
    """Distribute a load on a body about its COM over its wires or legs, in the nominal pose.

    `own` are their numbers. Returns their tensions, of which those that are `fixed` are the lines'
    own, and the wrench left over.
    """
    free = np.ones(len(own), dtype=bool) if fixed is None else ~fixed
    direction = lines.span[..., own, :] / lines.length[..., own, None]
    wrenches = wire_wrenches(direction, lines.lower_point[..., own, :])
    tension = np.where(free, 0.0, lines.tension[..., own])
    if not free.any():
        return tension, load + _product(wrenches.swapaxes(-1, -2), tension)
    strain = strains(
        lines.stiffness[..., own], direction, lines.blade[own], blades.axes, blades.stiffness
    )
    # those of a symmetric set are equal, and so are exact
    equal = (load[..., 2] / direction[..., 2].sum(-1))[..., None] + np.zeros(tension.shape)
    if free.all() and _are_least(equal, wrenches, load, strain):
        return equal, load + _product(wrenches.swapaxes(-1, -2), equal)
    left_over = load + _product(wrenches.swapaxes(-1, -2), tension)
    given = _product(strain, tension)
    tension[..., free], left_over = least_energy(
        wrenches[..., free, :], left_over, strain[..., free], given
    )
    even = np.abs(tension - equal).max(-1, keepdims=True) <= ROUNDING * np.abs(equal[..., :1])
    return np.where(even, equal, tension), left_over


def _are_least(
    equal: Inexact[np.ndarray, "*batch wire"],
    wrenches: Inexact[np.ndarray, "*batch wire 6"],
    load: Inexact[np.ndarray, "*batch 6"],
    strain: Inexact[np.ndarray, "*batch part wire"],
) -> bool:
    """Whether equal tensions are those of `least_energy`, but for rounding, in each of a batch.

    They are if they balance the load, all wires pull up alike, and the energy grows alike with
    their tensions: the Lagrange multiplier of the vertical force then does for all.
    """
    pull = equal[..., None] * wrenches
    left_over = load + pull.sum(-2)
    if not (np.abs(left_over) <= ROUNDING * np.abs(pull).sum(-2)).all():
        return False
    slope = _product(strain.swapaxes(-1, -2), _product(strain, equal))
    each = np.stack([wrenches[..., 2], slope])
    return bool((np.abs(each - each[..., :1]) <= ROUNDING * np.abs(each)).all())
