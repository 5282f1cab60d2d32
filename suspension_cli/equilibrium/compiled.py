"""Newton's method for the equilibria of many builds, as one loop that `numba` compiles.

The method and its limits are those of `solve`; each build is solved on its own, so its result does
not depend on the others. Steps solve K x = -g by an LDL^T factorisation, whose pivots tell whether
the equilibrium is stable; after a short step the same factors are used again.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from suspension_cli.compiled import compiled, constant, factorise, inlined, substitute
from suspension_cli.elements import bending
from suspension_cli.elements.compiled import (
    BEND,
    BLADE,
    FLEX,
    SPRING,
    STIFFNESS,
    WIRE,
    add_blades,
    add_springs,
    add_wires,
    fill_geometry,
)
from suspension_cli.elements.compiled_arrays import Derivatives, PoseArrays, WireRows
from suspension_cli.elements.compiled_vectors import (
    Vector,
    add_block,
    added,
    cross_matrix,
    diagonal,
    dot,
    matrix,
    multiple,
    product,
    scaled,
    symmetric,
    transposed,
    vector,
)
from suspension_cli.elements.compiled_weight import (
    MASS,
    MOMENTS,
    add_bodies,
    add_lines,
    pack_bodies,
    pack_gravity,
    pack_lines,
)
from suspension_cli.elements.compiled_wire import WireArrays, wire_sections
from suspension_cli.equilibrium.residual_scale import LEAST_ARM, ROUNDINGS
from suspension_cli.equilibrium.tree import parents
from suspension_cli.scene.arrays import inner_axes
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Blades, Flex, Scene, Springs, Wires

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

SHORT = 1e-6
"""Length of a step (rad, or in units of the largest lever arm) after which the factors are used
again: with stiff wires on a soft pendulum K changes by some 1e3 times a rotation, so the next step
is some 1e3 times shorter."""
FAIR = 1e-12
"""Smallest pivot, relative to the stiffness of its coordinate, of factors that are used; a build
with a smaller one is left to `solve`."""
SUPPORTED = 6
"""Number of coordinates of the support, which come first."""
EPS = float(np.finfo(float).eps)
ROUNDED = 1e-15
"""Residual (relative to the weight) that no step reduces."""
SOLVED, NOMINAL, FAILED = 0, 1, 2
"""Status of a build: solved; left as it is since its nominal pose balances; nearly singular."""


class Topology(NamedTuple):
    """Bodies that elements join, and their coordinates.

    Attributes
    ----------
    wires, struts, lines
        Upper and lower body, and blade or -1; of lines, see `compiled_weight`.
    springs
        Upper and lower body.
    place
        Coordinates of both bodies and of the blade's tip of each wire; N for none.
    sections
        Sections of wires that bend, see `compiled_wire`; (0, 0, 10) for strings.
    blades, tips
        Body and coordinates of blades, see `Layout`.
    parent
        Body that each body hangs from.
    """

    wires: Int[np.ndarray, "wire 3"]
    struts: Int[np.ndarray, "strut 3"]
    lines: Int[np.ndarray, "line 3"]
    springs: Int[np.ndarray, "spring 2"]
    place: Int[np.ndarray, "wire 15"]
    sections: Float[np.ndarray, "_ section 10"]
    blades: Int[np.ndarray, " blade"]
    tips: Int[np.ndarray, "blade 3"]
    parent: Int[np.ndarray, " 1+body"]


class Numbers(NamedTuple):
    """Numbers of a batch of scenes, or of one build: one row per element."""

    bodies: Float[np.ndarray, "*build body 13"]
    wires: Float[np.ndarray, "*build wire 13"]
    blades: Float[np.ndarray, "*build blade 6"]
    springs: Float[np.ndarray, "*build spring 49"]
    flex: Float[np.ndarray, "*build _ 19"]
    struts: Float[np.ndarray, "*build strut 13"]
    lines: Float[np.ndarray, "*build line 9"]


class Limits(NamedTuple):
    """Most steps of Newton's method, and the constants of `solve` of these names."""

    steps: int
    balanced: float
    last_step: float
    cap: float


class Results(NamedTuple):
    """Results of Newton's method, see `Equilibrium`; `status`: `SOLVED`, `NOMINAL` or `FAILED`."""

    tension: Float[np.ndarray, "build wire"]
    residual: Float[np.ndarray, " build"]
    rounding: Float[np.ndarray, " build"]
    steps: Int[np.ndarray, " build"]
    pivot: Float[np.ndarray, " build"]
    status: Int[np.ndarray, " build"]


class Tangent(NamedTuple):
    """Tangent stiffness and mass of a batch of scenes.

    Attributes
    ----------
    soft
        The stiffness if wires kept their lengths, N/m, N and N m.
    form
        Elongation of each wire per coordinate.
    stiffness
        The soft part plus the sum of k a a^T over the wires.
    mass
        Of bodies about their COMs as they are turned, without tip masses.
    """

    soft: Float[np.ndarray, "build coordinate coordinate"]
    form: Float[np.ndarray, "build wire coordinate"]
    stiffness: Float[np.ndarray, "build coordinate coordinate"]
    mass: Float[np.ndarray, "build coordinate coordinate"]


def pack(scene: Scene, numbering: Layout) -> tuple[Topology, Float[np.ndarray, "_ 3"], Numbers]:
    """Pack a scene with one batch axis: topology, gravity (see `compiled_weight`) and numbers."""
    wires, blades, springs, struts = scene.wires, scene.blades, scene.springs, scene.struts
    bends = scene.flex is not None
    lines, masses = pack_lines(scene)
    place = np.full((len(wires.label), 15), numbering.size)
    place[:, :6] = 6 * wires.upper[:, None] + np.arange(6)
    place[:, 6:12] = 6 * wires.lower[:, None] + np.arange(6)
    on_blade = wires.blade >= 0
    place[on_blade, 12:] = numbering.blade[wires.blade[on_blade]]
    topology = Topology(
        np.stack([wires.upper, wires.lower, wires.blade], axis=-1),
        np.stack([struts.upper, struts.lower, struts.blade], axis=-1),
        lines,
        np.stack([springs.upper, springs.lower], axis=-1),
        place,
        wire_sections(scene.fibres.wire if bends and scene.fibres else ()),
        blades.body,
        numbering.blade,
        parents(scene),
    )
    flex = bending.wire_resistance(scene)
    if flex is not None and flex.bend is None:
        flex = Flex(flex.upper, flex.lower, np.zeros((flex.twist.shape[-1], 2, 3)), flex.twist)
    batch = scene.batch
    numbers = Numbers(
        pack_bodies(scene),
        _table(batch, wires, WIRE),
        _table(batch, blades, BLADE),
        _table(batch, springs, SPRING),
        np.zeros((*batch, 0, 19)) if flex is None else _table(batch, flex, FLEX),
        _table(batch, struts, WIRE),
        masses,
    )
    return topology, pack_gravity(scene), numbers


@inlined
def _numbers_of(numbers: Numbers, p: int) -> Numbers:
    """Numbers of one build of a batch."""
    return Numbers(
        numbers.bodies[p],
        numbers.wires[p],
        numbers.blades[p],
        numbers.springs[p],
        numbers.flex[p],
        numbers.struts[p],
        numbers.lines[p],
    )


@inlined
def _pose_of(poses: PoseArrays, p: int) -> PoseArrays:
    """Pose of one build of a batch."""
    return PoseArrays(poses.shift[p], poses.turn[p], poses.deflection[p])


def _table(
    batch: tuple[int, ...], part: Wires | Blades | Springs | Flex, names: tuple[str, ...]
) -> Float[np.ndarray, "build element number"]:
    """Fields of a part of the scene side by side."""
    axes, values = inner_axes(type(part)), [getattr(part, name) for name in names]
    inner = [axes[name] - 1 for name in names]
    widths = [math.prod(v.shape[v.ndim - own :]) for v, own in zip(values, inner, strict=True)]
    count = max(v.shape[v.ndim - own - 1] for v, own in zip(values, inner, strict=True))
    result, start = np.empty((*batch, count, sum(widths))), 0
    for value, own, width in zip(values, inner, widths, strict=True):
        flat = value.reshape(*value.shape[: value.ndim - own], width)
        result[..., start : start + width] = flat
        start += width
    return result


@compiled
def _evaluate(
    topology: Topology,
    gravity: Float[np.ndarray, "_ 3"],
    numbers: Numbers,
    pose: PoseArrays,
    tension: Float[np.ndarray, " wire"],
    derivatives: Derivatives,
    curved: bool,
    form: Float[np.ndarray, "_ _"],
) -> None:
    """Derivatives of the energy of one build, the second ones if `curved`.

    For `form` see `add_wires`.
    """
    derivatives.gradient[:], derivatives.on_tips[:] = 0.0, 0.0
    if curved:
        derivatives.hessian[:] = 0.0
    bodies, tips, sections = numbers.bodies, topology.tips, topology.sections
    add_bodies(bodies, gravity, pose, derivatives, curved)
    if len(numbers.lines):
        add_lines(bodies, topology.lines, numbers.lines, tips, gravity, pose, derivatives, curved)
    wires = WireRows(topology.wires, sections, numbers.wires, numbers.flex)
    add_wires(wires, tips, pose, tension, derivatives, curved, form)
    if len(numbers.struts):
        none, thrust = numbers.flex[:0], np.empty(len(numbers.struts))
        struts = WireRows(topology.struts, sections, numbers.struts, none)
        add_wires(struts, tips, pose, thrust, derivatives, curved, none)
    if len(numbers.springs):
        add_springs(topology.springs, numbers.springs, pose, derivatives, curved)
    add_blades(topology.blades, tips, numbers.blades, pose, derivatives, curved)


@compiled
def _scales(
    topology: Topology,
    gravity: Float[np.ndarray, "_ 3"],
    numbers: Numbers,
    scale: Float[np.ndarray, " coordinate-5"],
    load: Float[np.ndarray, " 1+body"],
    arm: Float[np.ndarray, " 1+body"],
) -> float:
    """Fill the scale of the residual in every coordinate but the support's; largest lever arm."""
    ends, wires, springs = topology.wires, numbers.wires, numbers.springs
    bodies, pull = len(numbers.bodies), math.sqrt(dot(vector(gravity, 0, 0), vector(gravity, 0, 0)))
    largest = 1e-3
    load[:], arm[:] = 0.0, LEAST_ARM
    for n in range(bodies):
        load[n + 1] = pull * numbers.bodies[n, MASS]
    for n in range(len(numbers.lines)):
        own, mixed, other = vector(numbers.lines, n, MOMENTS)
        load[topology.lines[n, 0]] += pull * (own + mixed)
        load[topology.lines[n, 1]] += pull * (mixed + other)
    for n in range(bodies, 0, -1):
        load[topology.parent[n]] += load[n]
    for n in range(len(wires)):
        for body, start in ((ends[n, 0], 0), (ends[n, 1], 3)):
            for axis in range(3):
                size = abs(wires[n, start + axis])
                arm[body], largest = max(arm[body], size), max(largest, size)
    for n in range(len(springs)):
        body = topology.springs[n, 1]
        for axis in range(3):
            size = abs(springs[n, 3 + axis])
            arm[body], largest = max(arm[body], size), max(largest, size)
    scale[:] = load[0]
    for n in range(bodies):
        scale[6 * n : 6 * n + 3] = load[n + 1]
        scale[6 * n + 3 : 6 * n + 6] = load[n + 1] * arm[n + 1]
    for n in range(len(wires)):
        if ends[n, 2] >= 0:
            for axis in range(3):
                scale[topology.place[n, 12 + axis] - 6] = load[ends[n, 1]]
    return largest


@compiled
def _rotate_by(step: Vector, turn: Float[np.ndarray, "1+body 3 3"], n: int) -> None:
    """Multiply one rotation 1 + `turn` by that of a rotation vector, see `rotations`."""
    size = math.sqrt(dot(step, step))
    if size == 0.0:
        return
    skew, half = cross_matrix(scaled(1 / size, step)), math.sin(size / 2)
    more = added(multiple(math.sin(size), skew), multiple(2 * half * half, product(skew, skew)))
    old = matrix(turn, n)
    add_block(turn[n], 0, 0, added(more, product(more, old)))


@compiled
def _residual(
    gradient: Float[np.ndarray, " coordinate"],
    target: Float[np.ndarray, " coordinate-6"],
    scale: Float[np.ndarray, " coordinate-6"],
) -> float:
    largest = 0.0
    for i in range(len(scale)):
        size = abs(gradient[6 + i] - target[i]) / scale[i]
        if not size <= largest:
            largest = size
    return largest


@compiled
def _largest_size(values: Float[np.ndarray, "*shape"]) -> float:
    result = 0.0
    for value in values.flat:
        result = max(result, abs(value))
    return result


@compiled
def _rounding(
    ends: Int[np.ndarray, "wire 3"],
    wires: Float[np.ndarray, "wire 13"],
    tension: Float[np.ndarray, " wire"],
    pose: PoseArrays,
    scale: Float[np.ndarray, " coordinate-6"],
) -> float:
    """Residual that rounding may cause, see `solve`."""
    shift, turn, _ = pose
    result = 0.0
    for n in range(len(wires)):
        motion = 0.0
        for body, start in ((ends[n, 0], 0), (ends[n, 1], 3)):
            reach = _largest_size(wires[n, start : start + 3])
            motion += _largest_size(shift[body]) + _largest_size(turn[body]) * reach
        force = ROUNDINGS * EPS * (abs(tension[n]) + wires[n, STIFFNESS] * motion)
        result = max(result, force / scale[6 * (ends[n, 1] - 1)])
    return result


@compiled
def newton_batch(
    topology: Topology,
    gravity: Float[np.ndarray, "_ 3"],
    numbers: Numbers,
    poses: PoseArrays,
    targets: Float[np.ndarray, "build coordinate-6"],
    limits: Limits,
    accept_nominal: bool,
    results: Results,
) -> None:
    """Solve for the pose of every build, in place of its start.

    Parameters
    ----------
    topology, gravity, numbers
        See `pack`.
    poses
        Start and result.
    targets
        Gradient to reach, N and N m.
    accept_nominal
        Whether to leave a start that balances as it is.
    results
        To be filled.
    """
    tension, residuals, roundings, steps, pivots, status = results
    builds, free = targets.shape
    bodies = numbers.bodies.shape[1]
    size = free + SUPPORTED
    gradient, hessian = np.empty(size), np.empty((size, size))
    derivatives = Derivatives(gradient, hessian, np.empty((numbers.blades.shape[1], 3)))
    # one element more for rigid directions of blades
    scale_all = np.empty(free + 1)
    scale = scale_all[:free]
    load, arm = np.empty(bodies + 1), np.empty(bodies + 1)
    factor, pivot = np.zeros((free, free)), np.empty(free)
    x, where = np.empty(free), np.empty(free, dtype=np.int64)
    tips, none = topology.tips, np.empty((0, 0))
    for p in range(builds):
        own, pose, target = _numbers_of(numbers, p), _pose_of(poses, p), targets[p]
        largest = _scales(topology, gravity, own, scale_all, load, arm)
        _evaluate(topology, gravity, own, pose, tension[p], derivatives, True, none)
        residual = _residual(gradient, target, scale)
        count, fresh, slow, converged, least = 0, True, False, False, np.nan
        status[p] = SOLVED
        if accept_nominal and residual <= limits.balanced:
            status[p] = NOMINAL
            most_steps = 0
        else:
            most_steps = limits.steps
        while count < most_steps and not converged and math.isfinite(residual):
            if fresh:
                fair = factorise(hessian, factor, pivot, where, 0, SUPPORTED)
                least = 1.0
                for i in range(free):
                    least = min(least, pivot[i] / abs(hessian[SUPPORTED + i, SUPPORTED + i]))
                if not fair > FAIR:
                    status[p] = FAILED
                    break
            for i in range(free):
                x[i] = target[i] - gradient[SUPPORTED + i]
            substitute(factor, x)
            longest, step = 0.0, 0.0
            for i in range(free):
                rotation = i < 6 * bodies and i % 6 >= 3
                step = max(step, abs(x[i]))
                longest = max(longest, abs(x[i]) / (1.0 if rotation else largest))
            shorten = max(longest / limits.cap, 1.0)
            for n in range(bodies):
                for i in range(3):
                    pose.shift[n + 1, i] += x[6 * n + i] / shorten
                    x[6 * n + 3 + i] /= shorten
                _rotate_by((x[6 * n + 3], x[6 * n + 4], x[6 * n + 5]), pose.turn, n + 1)
            for n in range(len(tips)):
                for i in range(3):
                    if tips[n, i] < size:
                        pose.deflection[n, i] += x[tips[n, i] - SUPPORTED] / shorten
            # full steps until they are short, then with the factors of the last one
            fresh = longest > SHORT or slow
            _evaluate(topology, gravity, own, pose, tension[p], derivatives, fresh, none)
            before, residual = residual, _residual(gradient, target, scale)
            step /= shorten
            # as far as rounding lets the residual fall
            converged = step < limits.last_step and (residual < ROUNDED or residual > before / 2)
            slow = not fresh and residual > before / 10
            count += 1
        residuals[p], steps[p], pivots[p] = residual, count, least
        roundings[p] = (
            _rounding(topology.wires, own.wires, tension[p], pose, scale) if count else 0.0
        )


@compiled
def _tangents(
    topology: Topology,
    gravity: Float[np.ndarray, "_ 3"],
    numbers: Numbers,
    inertia: Float[np.ndarray, "build body 3 3"],
    poses: PoseArrays,
    result: Tangent,
) -> None:
    soft, form, whole, masses = result
    place, size = topology.place, soft.shape[-1]
    gradient, hessian = np.empty(size), np.empty((size, size))
    derivatives = Derivatives(gradient, hessian, np.empty((numbers.blades.shape[1], 3)))
    tension = np.empty(len(place))
    for p in range(len(soft)):
        own, pose = _numbers_of(numbers, p), _pose_of(poses, p)
        form[p], masses[p] = 0.0, 0.0
        _evaluate(topology, gravity, own, pose, tension, derivatives, True, form[p])
        for i in range(size):
            for j in range(i + 1):
                soft[p, i, j] = soft[p, j, i] = hessian[i, j]
        for n in range(len(place)):
            for i in range(place.shape[1]):
                row = place[n, i]
                if row == size:
                    continue
                stretched = own.wires[n, STIFFNESS] * form[p, n, row]
                for j in range(i + 1):
                    if place[n, j] < size:
                        hessian[row, place[n, j]] += stretched * form[p, n, place[n, j]]
        for i in range(size):
            for j in range(i + 1):
                whole[p, i, j] = whole[p, j, i] = hessian[i, j]
        for n in range(len(own.bodies)):
            for i in range(3):
                masses[p, 6 * n + 6 + i, 6 * n + 6 + i] = own.bodies[n, MASS]
            rotation = added(diagonal(1.0), matrix(pose.turn, n + 1))
            turned = product(product(rotation, matrix(inertia[p], n)), transposed(rotation))
            add_block(masses[p], 6 * n + 9, 6 * n + 9, symmetric(turned))


def _copy(pose: Pose) -> PoseArrays:
    """Arrays of a pose that loops can write to."""
    return PoseArrays(
        *(np.array(part, order="C") for part in (pose.shift, pose.turn, pose.deflection))
    )


def tangent(scene: Scene, numbering: Layout, pose: Pose) -> Tangent:
    """Tangent stiffness of a batch of scenes, with and without stretching of wires, and mass."""
    packed, count, size = pack(scene, numbering), scene.batch[0], numbering.size
    soft, stiffness, mass = (np.empty((count, size, size)) for _ in range(3))
    form = np.empty((count, len(scene.wires.label), size))
    poses = _copy(pose)  # not read-only, as those of `newton`: else `_evaluate` is compiled again
    inertia = scene.bodies.inertia
    inertia = constant(inertia, (count, *inertia.shape[-3:]))
    made = Tangent(soft, form, stiffness, mass)
    _tangents(*packed, inertia, poses, made)
    return made


@compiled
def _geometries(
    topology: Topology,
    numbers: Numbers,
    poses: PoseArrays,
    tension: Float[np.ndarray, "build wire"],
    result: Float[np.ndarray, "build wire 25"],
) -> None:
    for p in range(len(result)):
        wires = WireRows(topology.wires, topology.sections, numbers.wires[p], numbers.flex[p])
        fill_geometry(wires, _pose_of(poses, p), tension[p], result[p])


def wire_geometry(
    scene: Scene, numbering: Layout, pose: Pose, tension: Inexact[np.ndarray, "build wire"]
) -> WireArrays:
    """Geometry of the wires of a batch of scenes that bend, in equilibrium."""
    topology, _, numbers = pack(scene, numbering)
    result = np.empty((*scene.batch, len(scene.wires.label), 25))
    _geometries(topology, numbers, _copy(pose), constant(tension), result)
    return WireArrays(topology.place, topology.sections, result)


def newton(
    scene: Scene,
    numbering: Layout,
    start: Pose,
    target: Float[np.ndarray, "build coordinate"] | float,
    limits: Limits,
    *,
    accept_nominal: bool,
) -> tuple[Pose, dict[str, Float[np.ndarray, "build ..."]], int, Int[np.ndarray, " build"]]:
    """Solve for the poses of a batch of scenes from poses `start`, one per scene.

    See `newton_batch`.

    Returns
    -------
    pose : Pose
    results : dict of arrays
        Residual, rounding, tension, pivot and flex of an `Equilibrium`.
    steps : int
        Most that any build took.
    status : (p,) array
        `SOLVED`, `NOMINAL` or `FAILED`.
    """
    packed = pack(scene, numbering)
    count = scene.batch[0]
    poses = _copy(start)
    free = target[..., 6:] if isinstance(target, np.ndarray) else target
    targets = constant(np.asarray(free, dtype=float), (count, numbering.size - 6))
    results = Results(
        tension=np.zeros((count, len(scene.wires.label))),
        residual=np.empty(count),
        rounding=np.empty(count),
        steps=np.empty(count, dtype=np.int64),
        pivot=np.empty(count),
        status=np.empty(count, dtype=np.uint8),
    )
    newton_batch(*packed, poses, targets, limits, accept_nominal, results)
    found = {
        "residual": results.residual,
        "rounding": results.rounding,
        "tension": results.tension,
        "pivot": results.pivot,
        "flex": packed[2].flex[..., BEND:],
    }
    return Pose(*poses), found, int(results.steps.max(initial=0)), results.status
