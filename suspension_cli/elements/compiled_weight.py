"""Weight of bodies, blade tips, wires and bars of one build, as loops that `numba` compiles.

The formulas are those of `weight`; `tests/elements/test_weight.py` compares both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.compiled import compiled, inlined
from suspension_cli.elements import weight
from suspension_cli.elements.compiled_arrays import Derivatives, PoseArrays
from suspension_cli.elements.compiled_vectors import (
    Matrix,
    Vector,
    add_block,
    add_lower,
    add_vector,
    added,
    cross,
    cross_matrix,
    diagonal,
    dot,
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
    from jaxtyping import Float, Int

    from suspension_cli.scene.scene import Scene

MASS, POSITION, SECOND_MOMENTS = 0, 1, 4
"""First columns in the row of 13 numbers of a body."""

MOMENTS = 6
"""First column of m_uu, m_ul and m_ll in the row of 9 numbers of a line, after both ends."""


def pack_gravity(scene: Scene) -> Float[np.ndarray, "_ 3"]:
    """Derivatives of the energy per mass: -g (1, 3), and below it, unless 0, -dg_i/dx_j (3, 3)."""
    field = scene.field
    if field is None:
        return np.array([[0.0, 0.0, scene.gravity]])
    return -(field.vector[None] if field.is_uniform else np.vstack([field.vector, field.gradient]))


def pack_bodies(scene: Scene) -> Float[np.ndarray, "build body 13"]:
    """Rows of the bodies of a batch of scenes."""
    bodies, moments = scene.bodies, weight.second_moments(scene)
    result = np.empty((*scene.batch, len(bodies.name), 13))
    result[..., MASS] = bodies.mass
    result[..., POSITION:SECOND_MOMENTS] = bodies.position[..., 1:, :]
    result[..., SECOND_MOMENTS:] = moments.reshape(*moments.shape[:-2], 9)
    return result


def pack_lines(
    scene: Scene,
) -> tuple[Int[np.ndarray, "line 3"], Float[np.ndarray, "build line 9"]]:
    """Bodies, blade and rows of all masses but bodies, as lines of mass.

    A point mass is a line whose mass is at its upper end.
    """
    ends, rows = [np.zeros((0, 3), dtype=np.intp)], [np.zeros((*scene.batch, 0, 9))]
    for masses in weight.masses(scene):
        count = len(masses.body[0])
        ends.append(np.full((count, 3), -1))
        rows.append(np.zeros((*scene.batch, count, 9)))
        ends[-1][:, 0], ends[-1][:, 1] = masses.body[0], masses.body[-1]
        if masses.blade[0] is not None:
            ends[-1][:, 2] = masses.blade[0]
        rows[-1][..., 0:3], rows[-1][..., 3:6] = masses.point[0], masses.point[-1]
        rows[-1][..., MOMENTS] = masses.moment[0][0]
        if len(masses.point) == 2:
            rows[-1][..., 7], rows[-1][..., 8] = masses.moment[1]
    return np.concatenate(ends), np.concatenate(rows, axis=-2)


@inlined
def _slope(gravity: Float[np.ndarray, "_ 3"]) -> Matrix:
    """Second derivative of the energy per mass."""
    return vector(gravity, 1, 0), vector(gravity, 2, 0), vector(gravity, 3, 0)


@inlined
def _lift(
    gravity: Float[np.ndarray, "_ 3"],
    bodies: Float[np.ndarray, "body 13"],
    body: int,
    shift: Float[np.ndarray, "1+body 3"],
    arm: Vector,
) -> Vector:
    """Gradient of the energy per mass at a point of a body."""
    lift = vector(gravity, 0, 0)
    if len(gravity) > 1:
        place = plus(vector(shift, body, 0), arm)
        if body > 0:
            place = plus(place, vector(bodies, body - 1, POSITION))
        lift = plus(lift, times(_slope(gravity), place))
    return lift


@compiled
def _add_tide(
    slope: Matrix, own: Matrix, turn: Matrix, first: int, derivatives: Derivatives, curved: bool
) -> None:
    """Add the derivatives of the energy of one body in a gradient of gravity, beyond its weight."""
    rotation = added(diagonal(1.0), turn)
    moments = product(product(rotation, own), transposed(rotation))
    m = product(moments, slope)
    torque = m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]
    add_vector(derivatives.gradient, first + 3, torque)
    if curved:
        both = diagonal(trace(moments) * trace(slope) - 2 * trace(m))
        mixed = added(multiple(trace(slope), moments), multiple(trace(moments), slope))
        curvature = subtracted(added(multiple(3.0, symmetric(m)), both), mixed)
        add_lower(derivatives.hessian, first + 3, curvature)


@inlined
def _add_force(
    force: Vector, body: int, arm: Vector, derivatives: Derivatives, curved: bool
) -> None:
    """Add the derivatives of the energy of a force at a point of a body."""
    add_vector(derivatives.gradient, 6 * body, force)
    add_vector(derivatives.gradient, 6 * body + 3, cross(arm, force))
    if curved:
        add_lower(derivatives.hessian, 6 * body + 3, turning(force, arm))


@inlined
def add_bodies(
    bodies: Float[np.ndarray, "body 13"],
    gravity: Float[np.ndarray, "_ 3"],
    pose: PoseArrays,
    derivatives: Derivatives,
    curved: bool,
) -> None:
    """Add the derivatives of the weights of the bodies of one build."""
    for n in range(len(bodies)):
        mass, first = bodies[n, MASS], 6 * n + 6
        lift = _lift(gravity, bodies, n + 1, pose.shift, (0.0, 0.0, 0.0))
        add_vector(derivatives.gradient, first, scaled(mass, lift))
        if len(gravity) > 1:
            if curved:
                add_lower(derivatives.hessian, first, multiple(mass, _slope(gravity)))
            own = (
                vector(bodies, n, SECOND_MOMENTS),
                vector(bodies, n, SECOND_MOMENTS + 3),
                vector(bodies, n, SECOND_MOMENTS + 6),
            )
            _add_tide(_slope(gravity), own, matrix(pose.turn, n + 1), first, derivatives, curved)


@compiled
def add_lines(
    bodies: Float[np.ndarray, "body 13"],
    ends: Int[np.ndarray, "line 3"],
    lines: Float[np.ndarray, "line 9"],
    tips: Int[np.ndarray, "blade 3"],
    gravity: Float[np.ndarray, "_ 3"],
    pose: PoseArrays,
    derivatives: Derivatives,
    curved: bool,
) -> None:
    """Add the derivatives of all other weights of one build, before those of blades.

    The arrays are those of `pack_bodies`, `pack_lines` and `pack_gravity`; `tips` are the
    coordinates of the tips of blades, see `Layout`.
    """
    (shift, turn, deflection), hessian = pose, derivatives.hessian
    for n in range(len(lines)):
        u, l, b = ends[n, 0], ends[n, 1], ends[n, 2]
        m_uu, m_ul, m_ll = vector(lines, n, MOMENTS)
        upper_point, lower_point = vector(lines, n, 0), vector(lines, n, 3)
        if b >= 0:
            upper_point = plus(upper_point, vector(deflection, b, 0))
        arm_u, arm_l = turned(matrix(turn, u), upper_point), turned(matrix(turn, l), lower_point)
        lift_u = _lift(gravity, bodies, u, shift, arm_u)
        lift_l = _lift(gravity, bodies, l, shift, arm_l)
        force = plus(scaled(m_uu, lift_u), scaled(m_ul, lift_l))
        _add_force(force, u, arm_u, derivatives, curved)
        if b >= 0:
            for axis in range(3):
                derivatives.on_tips[b, axis] += force[axis]
        force = plus(scaled(m_ul, lift_u), scaled(m_ll, lift_l))
        _add_force(force, l, arm_l, derivatives, curved)
        if curved and len(gravity) > 1:
            slope = _slope(gravity)
            rows, motion = np.empty((2, 9), dtype=np.int64), np.zeros((2, 9, 3))
            _fill_motion(u, arm_u, rows[0], motion[0])
            _fill_motion(l, arm_l, rows[1], motion[1])
            for axis in range(3):
                rows[0, 6 + axis] = tips[b, axis] if b >= 0 else len(hessian)
                rows[1, 6 + axis] = len(hessian)
            if b >= 0:
                add_block(motion[0], 6, 0, transposed(added(diagonal(1.0), matrix(turn, u))))
            _add_slope(multiple(m_uu, slope), rows[0], motion[0], rows[0], motion[0], hessian)
            _add_slope(multiple(m_ul, slope), rows[0], motion[0], rows[1], motion[1], hessian)
            _add_slope(multiple(m_ul, slope), rows[1], motion[1], rows[0], motion[0], hessian)
            _add_slope(multiple(m_ll, slope), rows[1], motion[1], rows[1], motion[1], hessian)


@compiled
def _fill_motion(
    body: int, arm: Vector, rows: Int[np.ndarray, " 9"], motion: Float[np.ndarray, "9 3"]
) -> None:
    """Fill in the coordinates of a body, and the motion of a point of it per coordinate."""
    for i in range(6):
        rows[i] = 6 * body + i
    add_block(motion, 0, 0, diagonal(1.0))
    add_block(motion, 3, 0, cross_matrix(arm))


@compiled
def _add_slope(
    form: Matrix,
    rows: Int[np.ndarray, " 9"],
    left: Float[np.ndarray, "9 3"],
    columns: Int[np.ndarray, " 9"],
    right: Float[np.ndarray, "9 3"],
    hessian: Float[np.ndarray, "coordinate coordinate"],
) -> None:
    """Add J_l F J_r^T to the lower triangle."""
    for i in range(9):
        turned_row = times(form, vector(left, i, 0))
        for j in range(9):
            if len(hessian) > rows[i] >= columns[j]:
                hessian[rows[i], columns[j]] += dot(turned_row, vector(right, j, 0))
