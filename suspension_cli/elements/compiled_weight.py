"""Weight of bodies, blade tips, wires and bars of one build, as loops that `numba` compiles.

The formulas are those of `weight`; `tests/elements/test_weight.py` compares both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.compiled import compiled, inlined
from suspension_cli.elements import weight
from suspension_cli.elements.compiled import LOWER_POINT, TIP, TIP_MASS, UPPER_POINT, WIRE_MASS
from suspension_cli.elements.compiled_vectors import (
    add_block,
    add_lower,
    add_vector,
    added,
    cross,
    cross_matrix,
    diagonal,
    matrix,
    multiple,
    plus,
    product,
    scaled,
    subtracted,
    symmetric,
    times,
    trace,
    transposed,
    turned,
    turning,
    vector,
)

if TYPE_CHECKING:
    from suspension_cli.scene.scene import Scene

MASS, POSITION, SECOND_MOMENTS = 0, 1, 4
"""First columns in the row of 13 numbers of a body."""

BAR = ("point", "inertia")
"""Fields of `Bars` in a row of 9 numbers."""


def pack_gravity(scene: Scene) -> Any:
    """Derivatives of the energy per mass, (4, 3): the first, -g, and the second, -dg_i/dx_j."""
    field = scene.field
    if field is None:
        return np.vstack([np.array([0.0, 0.0, scene.gravity]), np.zeros((3, 3))])
    return -np.vstack([field.vector, field.gradient])


def pack_bodies(scene: Scene) -> Any:
    """Rows (p, n, 13) of the bodies of a batch of scenes."""
    bodies, moments = scene.bodies, weight.second_moments(scene)
    result = np.empty((*scene.batch, len(bodies.name), 13))
    result[..., MASS] = bodies.mass
    result[..., POSITION:SECOND_MOMENTS] = bodies.position[..., 1:, :]
    result[..., SECOND_MOMENTS:] = moments.reshape(*moments.shape[:-2], 9)
    return result


@inlined
def _slope(gravity: Any) -> Any:
    """Second derivative of the energy per mass."""
    return vector(gravity, 1, 0), vector(gravity, 2, 0), vector(gravity, 3, 0)


@inlined
def _lift(gravity: Any, bodies: Any, body: int, shift: Any, arm: Any) -> Any:
    """Gradient of the energy per mass at a point of a body."""
    place = plus(vector(shift, body, 0), arm)
    if body > 0:
        place = plus(place, vector(bodies, body - 1, POSITION))
    return plus(vector(gravity, 0, 0), times(_slope(gravity), place))


@compiled
def _add_tide(
    slope: Any, own: Any, turn: Any, first: int, gradient: Any, hessian: Any, curved: bool
) -> None:
    """Add the derivatives of the energy that a gradient gives one body, beside its weight."""
    rotation = added(diagonal(1.0), turn)
    moments = product(product(rotation, own), transposed(rotation))
    m = product(moments, slope)
    torque = m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]
    add_vector(gradient, first + 3, torque)
    if curved:
        both = diagonal(trace(moments) * trace(slope) - 2 * trace(m))
        mixed = added(multiple(trace(slope), moments), multiple(trace(moments), slope))
        curvature = subtracted(added(multiple(3.0, symmetric(m)), both), mixed)
        add_lower(hessian, first + 3, curvature)


@inlined
def _add_force(force: Any, body: int, arm: Any, gradient: Any, hessian: Any, curved: bool) -> None:
    """Add the derivatives of the energy of a force at a point of a body."""
    add_vector(gradient, 6 * body, force)
    add_vector(gradient, 6 * body + 3, cross(arm, force))
    if curved:
        add_lower(hessian, 6 * body + 3, turning(force, arm))


@compiled
def _add_line(
    mass: Any,
    upper: int,
    lower: int,
    blade: int,
    upper_point: Any,
    lower_point: Any,
    bodies: Any,
    gravity: Any,
    pose: Any,
    tips: Any,
    gradient: Any,
    hessian: Any,
    on_tips: Any,
    curved: bool,
    uniform: bool,
) -> None:
    """Add the weight of a straight line between points of bodies, the upper one maybe on a blade.

    Its mass is given by the moments m_uu, m_ul and m_ll.
    """
    shift, turn, deflection = pose
    m_uu, m_ul, m_ll = mass
    if blade >= 0:
        upper_point = plus(upper_point, vector(deflection, blade, 0))
    arm_u = turned(matrix(turn, upper), upper_point)
    arm_l = turned(matrix(turn, lower), lower_point)
    lift_u = _lift(gravity, bodies, upper, shift, arm_u)
    lift_l = _lift(gravity, bodies, lower, shift, arm_l)
    force = plus(scaled(m_uu, lift_u), scaled(m_ul, lift_l))
    _add_force(force, upper, arm_u, gradient, hessian, curved)
    if blade >= 0:
        add_vector(on_tips[blade], 0, force)
    force = plus(scaled(m_ul, lift_u), scaled(m_ll, lift_l))
    _add_force(force, lower, arm_l, gradient, hessian, curved)
    if uniform or not curved:
        return
    # motion of both points per coordinate: translation and rotation of the body, and the tip
    rows, motion = np.full((2, 9), len(hessian)), np.zeros((2, 9, 3))
    for end in range(2):
        body, arm = (lower, arm_l) if end else (upper, arm_u)
        for i in range(6):
            rows[end, i] = 6 * body + i
        add_block(motion[end], 0, 0, diagonal(1.0))
        add_block(motion[end], 3, 0, cross_matrix(arm))
    if blade >= 0:
        for i in range(3):
            rows[0, 6 + i] = tips[blade, i]
        add_block(motion[0], 6, 0, transposed(added(diagonal(1.0), matrix(turn, upper))))
    for end in range(2):
        for other in range(2):
            form = multiple(m_ul if end != other else m_ll if end else m_uu, _slope(gravity))
            for i in range(9):
                left = times(form, vector(motion[end], i, 0))
                for j in range(9):
                    if len(hessian) > rows[end, i] >= rows[other, j]:
                        for k in range(3):
                            hessian[rows[end, i], rows[other, j]] += left[k] * motion[other, j, k]


@compiled
def add_weights(
    topology: Any,
    gravity: Any,
    numbers: Any,
    pose: Any,
    gradient: Any,
    hessian: Any,
    on_tips: Any,
    curved: bool,
) -> None:
    """Add the derivatives of all weights of one build, before those of blades.

    Parameters
    ----------
    topology, numbers
        See `equilibrium.compiled`.
    gravity : (4, 3) array
        From `pack_gravity`.
    pose : tuple of arrays
        Shift, turn and deflection.
    """
    bodies, wires, blades, bars = numbers.bodies, numbers.wires, numbers.blades, numbers.bars
    shift, turn, _ = pose
    slope, uniform, nothing = _slope(gravity), True, (0.0, 0.0, 0.0)
    for row in slope:
        uniform = uniform and row == nothing
    for n in range(len(bodies)):
        mass, first = bodies[n, MASS], 6 * n + 6
        add_vector(gradient, first, scaled(mass, _lift(gravity, bodies, n + 1, shift, nothing)))
        if not uniform:
            if curved:
                add_lower(hessian, first, multiple(mass, slope))
            own = (
                vector(bodies, n, SECOND_MOMENTS),
                vector(bodies, n, SECOND_MOMENTS + 3),
                vector(bodies, n, SECOND_MOMENTS + 6),
            )
            _add_tide(slope, own, matrix(turn, n + 1), first, gradient, hessian, curved)
    rest = bodies, gravity, pose, topology.tips, gradient, hessian, on_tips, curved, uniform
    for n in range(len(blades)):
        body, tip, mass = (
            topology.blade_body[n],
            vector(blades, n, TIP),
            (blades[n, TIP_MASS], 0.0, 0.0),
        )
        if mass != nothing:
            _add_line(mass, body, body, n, tip, tip, *rest)
    for n in range(len(wires)):
        mass, u, l = vector(wires, n, WIRE_MASS), topology.upper[n], topology.lower[n]
        if mass != nothing:
            ends = vector(wires, n, UPPER_POINT), vector(wires, n, LOWER_POINT)
            _add_line(mass, u, l, topology.blade[n], *ends, *rest)
    for n in range(len(bars)):
        mass, u, l = vector(bars, n, 6), topology.bar_upper[n], topology.bar_lower[n]
        _add_line(mass, u, l, -1, vector(bars, n, 0), vector(bars, n, 3), *rest)
