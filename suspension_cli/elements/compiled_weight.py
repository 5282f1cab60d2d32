"""Weight of bodies, blade tips and wires of one build, as loops that `numba` compiles.

The formulas are those of `weight`; `tests/models/test_gravity.py` compares both. They are used
where wires have weight, or gravity is a vector or has a gradient. A body is a row of 13 numbers:
mass, nominal position and second moments of mass.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.compiled import compiled
from suspension_cli.elements import weight
from suspension_cli.elements.compiled_vectors import add_lower, turning, vector

if TYPE_CHECKING:
    from suspension_cli.scene.scene import Scene

MOMENTS = 13
"""First column of the mass of a wire in its row."""


def pack_gravity(scene: Scene) -> Any:
    """Strength of gravity, -g (3,) and -dg_i/dx_j (9,) in one array."""
    field = scene.field
    vector = (0.0, 0.0, -scene.gravity) if field is None else field.vector
    gradient = np.zeros(9) if field is None else field.gradient.ravel()
    return np.concatenate([[scene.gravity], -np.asarray(vector), -gradient]).astype(float)


def pack_bodies(scene: Scene) -> Any:
    """Rows (p, n, 13) of the bodies of a batch of scenes."""
    bodies, batch = scene.bodies, scene.batch
    moments = weight.second_moments(scene)
    parts = (
        bodies.mass[..., None],
        bodies.position[..., 1:, :],
        moments.reshape(*moments.shape[:-2], 9),
    )
    spread = [np.broadcast_to(v, (*batch, *v.shape[-2:])) for v in parts]
    return np.ascontiguousarray(np.concatenate(spread, axis=-1))


@compiled
def _rotated(turn: Any, vector: Any, out: Any) -> None:
    for i in range(3):
        out[i] = vector[i]
        for j in range(3):
            out[i] += turn[i, j] * vector[j]


@compiled
def _add_lift(gravity: Any, place: Any, mass: float, out: Any) -> None:
    """Add the gradient of the energy of a mass at a place, N."""
    for i in range(3):
        out[i] += mass * gravity[1 + i]
        for j in range(3):
            out[i] += mass * gravity[4 + 3 * i + j] * place[j]


@compiled
def _fill_motion(body: int, arm: Any, turn: Any, tips: Any, rows: Any, jacobian: Any) -> None:
    """Coordinates (9,) that move a point of a body or of a blade tip, and its motion (9, 3)."""
    jacobian[:] = 0.0
    for i in range(6):
        rows[i] = 6 * body + i
    for i in range(3):
        rows[6 + i] = tips[i]
        jacobian[i, i] = 1.0
        for j in range(3):
            jacobian[6 + i, j] = turn[j, i]
        jacobian[6 + i, i] += 1.0
    jacobian[3, 1], jacobian[3, 2] = -arm[2], arm[1]
    jacobian[4, 0], jacobian[4, 2] = arm[2], -arm[0]
    jacobian[5, 0], jacobian[5, 1] = -arm[1], arm[0]


@compiled
def _add_point(rows: Any, jacobian: Any, force: Any, gradient: Any) -> None:
    for i in range(9):
        if rows[i] < len(gradient):
            for j in range(3):
                gradient[rows[i]] += jacobian[i, j] * force[j]


@compiled
def _add_slope(
    gravity: Any, mass: float, row: Any, left: Any, column: Any, right: Any, hessian: Any
) -> None:
    """Add -m J_l G J_r^T to the lower triangle."""
    for i in range(9):
        for j in range(9):
            if len(hessian) > row[i] >= column[j]:
                for k in range(3):
                    for m in range(3):
                        hessian[row[i], column[j]] += (
                            mass * left[i, k] * gravity[4 + 3 * k + m] * right[j, m]
                        )


@compiled
def _add_body(
    gravity: Any, own: Any, shift: Any, turn: Any, first: int, g: Any, h: Any, curved: bool
) -> None:
    """Add the derivatives of one body: its weight, and the torque of a gradient on it."""
    place, force = np.empty(3), np.zeros(3)
    for i in range(3):
        place[i] = own[1 + i] + shift[i]
    _add_lift(gravity, place, own[0], force)
    for i in range(3):
        g[first + i] += force[i]
    uniform = True
    for i in range(9):
        uniform = uniform and gravity[4 + i] == 0.0
    if uniform:
        return
    slope, moments, half = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    turns = np.zeros((3, 3, 3))
    for i in range(3):
        for j in range(3):
            slope[i, j] = gravity[4 + 3 * i + j]
            if curved and i >= j:
                h[first + i, first + j] += own[0] * slope[i, j]
            half[i, j] = own[4 + 3 * i + j]
            for k in range(3):
                half[i, j] += turn[i, k] * own[4 + 3 * k + j]
    for i in range(3):
        turns[i, (i + 2) % 3, (i + 1) % 3] = 1.0
        turns[i, (i + 1) % 3, (i + 2) % 3] = -1.0
        for j in range(3):
            moments[i, j] = half[i, j]
            for k in range(3):
                moments[i, j] += half[i, k] * turn[j, k]
    for a in range(3):
        one = slope @ turns[a]
        left = one @ moments
        g[first + 3 + a] += left[0, 0] + left[1, 1] + left[2, 2]
        for b in range(a + 1 if curved else 0):
            twice = (slope @ (turns[a] @ turns[b] + turns[b] @ turns[a])) @ moments
            mixed = left @ turns[b]
            for i in range(3):
                h[first + 3 + a, first + 3 + b] += twice[i, i] / 2 - mixed[i, i]


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
        See `equilibrium.compiled.Packed`; bodies as `pack_bodies` makes them.
    gravity : (13,) array
        From `pack_gravity`.
    pose : tuple of arrays
        Shift, turn and deflection.
    """
    w_upper, w_lower, w_blade, _, b_body, b_tips = topology[:6]
    bodies, wires, blades, bars = numbers[0], numbers[1], numbers[2], numbers[5]
    shift, turn, deflection = pose
    for n in range(len(bodies)):
        own, first = bodies[n], 6 * n + 6
        _add_body(gravity, own, shift[n + 1], turn[n + 1], first, gradient, hessian, curved)
    point, arms, places = np.empty(3), np.empty((2, 3)), np.empty((2, 3))
    rows, jacobian = np.empty((2, 9), dtype=np.int64), np.empty((2, 9, 3))
    forces = np.empty((1, 3))
    force = forces[0]
    uniform = True
    for i in range(9):
        uniform = uniform and gravity[4 + i] == 0.0
    for n in range(len(blades)):
        body, mass = b_body[n], blades[n, 9]
        if mass == 0.0:
            continue
        for i in range(3):
            point[i] = blades[n, i] + deflection[n, i]
        _rotated(turn[body], point, arms[0])
        for i in range(3):
            places[0, i] = shift[body, i] + arms[0, i] + (bodies[body - 1, 1 + i] if body else 0.0)
            force[i] = 0.0
        _add_lift(gravity, places[0], mass, force)
        _fill_motion(body, arms[0], turn[body], b_tips[n], rows[0], jacobian[0])
        _add_point(rows[0], jacobian[0], force, gradient)
        for i in range(3):
            on_tips[n, i] += force[i]
        if curved:
            add_lower(hessian, 6 * body + 3, turning(vector(forces, 0, 0), vector(arms, 0, 0)))
        if curved and not uniform:
            _add_slope(gravity, mass, rows[0], jacobian[0], rows[0], jacobian[0], hessian)
    lines = (topology, bodies, gravity, pose, gradient, hessian, on_tips, curved, uniform)
    _add_lines(w_upper, w_lower, w_blade, wires, MOMENTS, *lines)
    if len(bars):
        none = np.full(len(bars), -1, dtype=np.int64)
        _add_lines(topology[10], topology[11], none, bars, 6, *lines)


@compiled
def _add_lines(
    uppers: Any,
    lowers: Any,
    on_blades: Any,
    lines: Any,
    moments: int,
    topology: Any,
    bodies: Any,
    gravity: Any,
    pose: Any,
    gradient: Any,
    hessian: Any,
    on_tips: Any,
    curved: bool,
    uniform: bool,
) -> None:
    """Add the weights of straight lines between points of bodies or blade tips: wires, bars.

    Rows of `lines` begin with both ends; from the column `moments` on they have m_uu, m_ul, m_ll.
    """
    b_tips, (shift, turn, deflection) = topology[5], pose
    point, arms, places = np.empty(3), np.empty((2, 3)), np.empty((2, 3))
    rows, jacobian = np.empty((2, 9), dtype=np.int64), np.empty((2, 9, 3))
    forces, none = np.empty((1, 3)), np.empty(3, dtype=np.int64)
    force = forces[0]
    none[:] = len(gradient)
    for n in range(len(lines)):
        mass = lines[n, moments : moments + 3]
        if mass[0] == 0.0 and mass[1] == 0.0 and mass[2] == 0.0:
            continue
        for end in range(2):
            body = uppers[n] if end == 0 else lowers[n]
            on_blade = end == 0 and on_blades[n] >= 0
            for i in range(3):
                point[i] = lines[n, 3 * end + i]
                if on_blade:
                    point[i] += deflection[on_blades[n], i]
            _rotated(turn[body], point, arms[end])
            for i in range(3):
                start = bodies[body - 1, 1 + i] if body else 0.0
                places[end, i] = shift[body, i] + arms[end, i] + start
            tips = b_tips[on_blades[n]] if on_blade else none
            _fill_motion(body, arms[end], turn[body], tips, rows[end], jacobian[end])
            if not on_blade:
                jacobian[end, 6:] = 0.0
        for end in range(2):
            body = uppers[n] if end == 0 else lowers[n]
            force[:] = 0.0
            _add_lift(gravity, places[0], mass[end], force)
            _add_lift(gravity, places[1], mass[end + 1], force)
            _add_point(rows[end], jacobian[end], force, gradient)
            for i in range(3):
                if end == 0 and on_blades[n] >= 0:
                    on_tips[on_blades[n], i] += force[i]
            if curved:
                turned = turning(vector(forces, 0, 0), vector(arms, end, 0))
                add_lower(hessian, 6 * body + 3, turned)
            if curved and not uniform:
                for other in range(2):
                    _add_slope(
                        gravity,
                        mass[end + other],
                        rows[end],
                        jacobian[end],
                        rows[other],
                        jacobian[other],
                        hessian,
                    )
