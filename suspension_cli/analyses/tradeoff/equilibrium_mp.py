"""Equilibrium of wires and blades in 50 digits.

Newton's method with forces in 50 digits, from the definitions of a scene; stiffness and starting
pose are those of `equilibrium`. A step reduces the error some 1e10 times.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tradeoff.high_precision import Number, context
from suspension_cli.equilibrium import solve as equilibrium
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.pose import Layout, layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float

EquilibriumArrays = tuple[Array, Array, Array]
"""Displacements of the COMs from their nominal positions (body, 3), m; rotation matrices less the
unit matrix (body, 3, 3); wire tensions (wire,), N."""
Mp = Number
"""A vector or matrix of mpmath."""

MAX_STEPS = 12
CONVERGED = 1e-30
"""Step (m or rad) at which the iteration ends."""


def solve(scene: Scene) -> EquilibriumArrays | None:
    """Solve for the equilibrium of one build, rounded to double precision.

    None if there is no equilibrium, or a body can turn freely.
    """
    mp, start = context(), equilibrium.solve(scene)
    numbering = layout(scene)
    assert start.stiffness is not None  # of one build
    hessian = start.stiffness[6:, 6:]
    root = np.sqrt(np.abs(np.diag(hessian)))
    if not np.all(start.converged) or np.linalg.cond(hessian / root[:, None] / root) > 1 / (
        1e3 * np.finfo(float).eps
    ):
        return None
    shift = [_numbers(row) for row in start.pose.shift]
    turn = [_orthogonal(matrix) for matrix in start.pose.rotation]
    bent = [_numbers(row) for row in start.pose.deflection]
    for _ in range(MAX_STEPS):
        gradient, _ = _gradient(scene, numbering, shift, turn, bent)
        step = -np.linalg.solve(hessian, np.array([float(value) for value in gradient[6:]]))
        for n in range(1, len(shift)):
            here = step[6 * (n - 1) : 6 * n]
            shift[n] = shift[n] + _numbers(here[:3])
            turn[n] = _rotation(_numbers(here[3:])) * turn[n]
        for n, axis in np.argwhere(scene.blades.axes).tolist():
            bent[n][axis] += mp.mpf(float(step[numbering.blade[n, axis] - 6]))
        if np.abs(step).max() < CONVERGED:
            _, tension = _gradient(scene, numbering, shift, turn, bent)
            turned = [(matrix - mp.eye(3)).tolist() for matrix in turn]
            return (
                np.array([list(row) for row in shift], dtype=float),
                np.array(turned, dtype=float),
                np.array(tension, dtype=float),
            )
    return None


def _gradient(
    scene: Scene, numbering: Layout, shift: list[Mp], turn: list[Mp], bent: list[Mp]
) -> tuple[list[Number], list[Number]]:
    """Gradient of the energy by coordinate, and tensions."""
    mp, wires, blades = context(), scene.wires, scene.blades
    force = [
        mp.matrix([0, 0, mp.mpf(scene.gravity) * mp.mpf(float(m))])
        for m in (0.0, *scene.bodies.mass)
    ]
    torque = [mp.zeros(3, 1) for _ in force]
    tip = [_numbers(k) for k in blades.stiffness]
    tip = [
        mp.matrix([k[axis] * q[axis] for axis in range(3)]) - _numbers(load)
        for k, q, load in zip(tip, bent, blades.load, strict=True)
    ]
    for n, body in enumerate(blades.body.tolist()):
        weight = mp.matrix([0, 0, mp.mpf(scene.gravity) * mp.mpf(float(blades.tip_mass[n]))])
        arm = turn[body] * (_numbers(blades.tip[n]) + bent[n])
        force[body] += weight
        torque[body] += _cross(arm, weight)
        tip[n] += turn[body].T * weight
    tension = []
    for n, (up, low, blade) in enumerate(
        zip(wires.upper.tolist(), wires.lower.tolist(), wires.blade.tolist(), strict=True)
    ):
        upper, lower, span = (
            _numbers(values[n]) for values in (wires.upper_point, wires.lower_point, wires.span)
        )
        arms = turn[up] * (upper + bent[blade] if blade >= 0 else upper), turn[low] * lower
        # nominal span plus changes, so that the nominal pose is exact
        now = span + shift[low] + arms[1] - lower - shift[up] - arms[0] + upper
        length = _norm(now)
        tension.append(
            mp.mpf(float(wires.tension[n]))
            + mp.mpf(float(wires.stiffness[n])) * (length - _norm(span))
        )
        pull = now * (tension[-1] / length)
        for body, arm, sign in ((low, arms[1], 1), (up, arms[0], -1)):
            force[body] += sign * pull
            torque[body] += sign * _cross(arm, pull)
        if blade >= 0:
            tip[blade] -= turn[up].T * pull
    gradient = [mp.zero] * numbering.size
    for n, (f, t) in enumerate(zip(force, torque, strict=True)):
        gradient[6 * n : 6 * n + 6] = [*f, *t]
    for n, axis in np.argwhere(blades.axes).tolist():
        gradient[numbering.blade[n, axis]] = tip[n][axis]
    return gradient, tension


def _numbers(values: Float[np.ndarray, " _"]) -> Mp:
    return context().matrix([context().mpf(float(value)) for value in values])


def _norm(vector: Mp) -> Number:
    return context().sqrt(sum(x * x for x in vector))


def _cross(a: Mp, b: Mp) -> Mp:
    return context().matrix(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _rotation(vector: Mp) -> Mp:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    mp, angle = context(), _norm(vector)
    if angle == 0:
        return mp.eye(3)
    u = vector / angle
    skew = mp.matrix([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return mp.eye(3) + mp.sin(angle) * skew + 2 * mp.sin(angle / 2) ** 2 * skew * skew


def _orthogonal(matrix: Float[np.ndarray, "3 3"]) -> Mp:
    """Orthonormalise a rotation matrix to all digits (Gram and Schmidt)."""
    mp = context()
    first = _numbers(matrix[:, 0])
    first = first / _norm(first)
    second = _numbers(matrix[:, 1])
    second = second - first * sum(a * b for a, b in zip(first, second, strict=True))
    second = second / _norm(second)
    third = _cross(first, second)
    return mp.matrix([[first[i], second[i], third[i]] for i in range(3)])
