"""Linear springs between two bodies: flexures, cables.

A spring joins a point of the lower body to the point of the upper body where it is in the nominal pose.  Its strain
s = (delta, phi) is taken in the frame of the upper body, so it does not depend on the frame that one looks from:
delta is the displacement of the lower point, phi = vee(skew(Q)) of the relative rotation Q = R_u^T R_l (the axis of
Q times the sine of its angle: the rotation vector, to third order).  It stores s K s / 2 - preload . s.

Below, r is the vector from the upper COM to the lower point, w that from the lower COM to it.  A step x, t in both
bodies' displacements and rotations gives, with E = exp(-[t_u]) exp([t_l]),

    delta = R_u^T (exp(-[t_u]) (r - w + x_l - x_u + exp([t_l]) w)) - a,      Q = R_u^T E R_l,

from which the first and second derivatives in this file follow by expanding the exponentials.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics.pose import Layout, Pose
from suspension_cli.rotations import cross_matrix


@dataclass(frozen=True)
class State:
    """All springs of a scene in one pose; vectors (..., s, 3) in global axes, m."""

    reach: Any
    """r: from the upper COM to the lower point."""
    arm: Any
    """w: from the lower COM to the lower point."""
    strain: Any
    """(..., s, 6): delta in m and phi in rad."""
    pull: Any
    """(..., s, 6): gradient of the energy with respect to the strain, N and N m."""


def state(scene: Scene, pose: Pose) -> State:
    """Strains and forces of all springs in a pose."""
    springs = scene.springs
    upper, lower = pose.rotation[..., springs.upper, :, :], pose.rotation[..., springs.lower, :, :]
    arm = pose.arms(springs.lower, springs.lower_point)
    nominal = springs.upper_point - springs.lower_point
    reach = nominal + pose.shift[..., springs.lower, :] - pose.shift[..., springs.upper, :] + arm
    delta = (np.swapaxes(upper, -1, -2) @ reach[..., None])[..., 0] - springs.upper_point
    phi = _vee(np.swapaxes(upper, -1, -2) @ lower)
    strain = np.concatenate([delta, phi], axis=-1)
    pull = (springs.stiffness @ strain[..., None])[..., 0] - springs.preload
    return State(reach, arm, strain, pull)


def _vee(matrix: Any) -> Any:
    """The vector v of the skew part [v] of a matrix."""
    m = matrix
    return np.stack([m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]], axis=-1) / 2


def energy(scene: Scene, pose: Pose) -> Any:
    """Elastic energy of all springs beyond that of the nominal pose, J, shape ``batch``."""
    now = state(scene, pose)
    return (0.5 * (now.pull - scene.springs.preload) * now.strain).sum((-2, -1))


def strain_jacobian(scene: Scene, numbering: Layout, pose: Pose, now: State, number: int) -> Any:
    """Derivative (..., 6, N) of one spring's strain with respect to the coordinates."""
    up, low = _columns(scene, number)
    to_upper = np.swapaxes(pose.rotation[..., scene.springs.upper[number], :, :], -1, -2)
    relative = to_upper @ pose.rotation[..., scene.springs.lower[number], :, :]
    result = np.zeros((*now.strain.shape[:-2], 6, numbering.size), dtype=now.strain.dtype)
    result[..., :3, low] = to_upper
    result[..., :3, up] = -to_upper
    result[..., :3, _turning(low)] = -to_upper @ cross_matrix(now.arm[..., number, :])
    result[..., :3, _turning(up)] = to_upper @ cross_matrix(now.reach[..., number, :])
    # [h] Q + Q^T [h] = [(tr(Q) I - Q) h], so vee(skew([h] Q)) = (tr(Q) I - Q) h / 2
    trace = np.trace(relative, axis1=-2, axis2=-1)[..., None, None]
    turning = 0.5 * (trace * np.eye(3) - relative) @ to_upper
    result[..., 3:, _turning(low)] = turning
    result[..., 3:, _turning(up)] = -turning
    return result


def add_curvature(scene: Scene, pose: Pose, now: State, number: int, hessian: Any) -> None:
    """Add the pull times the second derivative of one spring's strain to a Hessian (..., N, N), in place."""
    up, low = _columns(scene, number)
    upper = pose.rotation[..., scene.springs.upper[number], :, :]
    lower = pose.rotation[..., scene.springs.lower[number], :, :]
    force = (upper @ now.pull[..., number, :3, None])[..., 0]
    reach, arm = now.reach[..., number, :], now.arm[..., number, :]
    g = upper @ cross_matrix(now.pull[..., number, 3:]) @ np.swapaxes(lower, -1, -2)
    turn = (g + np.swapaxes(g, -1, -2)) / 4 - _trace(g) / 2
    mixed = -_outer(arm, force) + _trace(_outer(arm, force)) - np.swapaxes(g, -1, -2) / 2 + _trace(g) / 2
    low_turn, up_turn = _turning(low), _turning(up)
    hessian[..., low_turn, low_turn] += _about(force, arm) + turn
    hessian[..., up_turn, up_turn] += _about(force, reach) + turn
    across = cross_matrix(force)
    for rows, columns, block in ((up_turn, low_turn, mixed), (up_turn, low, across), (up_turn, up, -across)):
        hessian[..., rows, columns] += block
        hessian[..., columns, rows] += np.swapaxes(block, -1, -2)


def _columns(scene: Scene, number: int) -> tuple[slice, slice]:
    """Coordinates of the displacement of the upper and of the lower body."""
    up, low = 6 * int(scene.springs.upper[number]), 6 * int(scene.springs.lower[number])
    return slice(up, up + 3), slice(low, low + 3)


def _turning(displacement: slice) -> slice:
    """Coordinates of the rotation of the same body."""
    return slice(displacement.stop, displacement.stop + 3)


def _outer(a: Any, b: Any) -> Any:
    return a[..., :, None] * b[..., None, :]


def _trace(matrix: Any) -> Any:
    return np.trace(matrix, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)


def _about(force: Any, arm: Any) -> Any:
    """Hessian of force . (t x (t x arm)) / 2 in t."""
    product = _outer(force, arm)
    return (product + np.swapaxes(product, -1, -2)) / 2 - _trace(product)
