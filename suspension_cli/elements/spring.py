"""Energy, force and stiffness of linear springs between two bodies: flexures, cables.

A spring joins a point of the lower body to the coincident point of the upper body in the nominal
pose. Its strain (delta, phi) is in the frame of the upper body, so it does not depend on the
observer's frame: delta is the displacement of the lower point, phi = vee(skew(Q)) of the relative
rotation Q = R_u^T R_l (the axis of Q times the sine of its angle: the rotation vector, but for
terms of third order). A spring stores s K s / 2 - preload . s for the strain s. Its damping acts on
the rate of delta and on the relative angular velocity, both in the frame of the upper body.

Below, r is the vector from the upper COM to the lower point, w that from the lower COM to it. A
step x, t of both bodies in displacement and rotation gives, with E = exp(-[t_u]) exp([t_l]),

    delta = R_u^T (exp(-[t_u]) (r - w + x_l - x_u + exp([t_l]) w)) - a,      Q = R_u^T E R_l,

with the point a in the frame of the upper body; expanding the exponentials gives the derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.elements.geometric_stiffness import rotation_hessian, unit_trace
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


@dataclass(frozen=True)
class State:
    """All springs of a scene in one pose.

    Attributes
    ----------
    reach
        r, from the upper COM to the lower point, global axes, m.
    arm
        w, from the lower COM to the lower point, global axes, m.
    strain
        delta in m and phi in rad.
    pull
        Gradient of the energy with respect to the strain, N and N m.
    """

    reach: Inexact[np.ndarray, "*batch spring 3"]
    arm: Inexact[np.ndarray, "*batch spring 3"]
    strain: Inexact[np.ndarray, "*batch spring 6"]
    pull: Inexact[np.ndarray, "*batch spring 6"]


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


def _vee(matrix: Inexact[np.ndarray, "*batch 3 3"]) -> Inexact[np.ndarray, "*batch 3"]:
    """Vector v of the skew part [v] of a matrix."""
    difference = matrix - np.swapaxes(matrix, -1, -2)
    return difference[..., [2, 0, 1], [1, 2, 0]] / 2


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic energy (...) of all springs relative to the nominal pose, J."""
    now = state(scene, pose)
    return (0.5 * (now.pull - scene.springs.preload) * now.strain).sum((-2, -1))


def strain_jacobian(
    scene: Scene, numbering: Layout, pose: Pose, now: State, number: int, *, rate: bool = False
) -> Inexact[np.ndarray, "*batch 6 coordinate"]:
    """Derivative (..., 6, N) of the strain of spring `number` with respect to the coordinates.

    With `rate`, that of the rotation from one body to the other, R_u^T (t_l - t_u), instead of phi.
    """
    up, low = _columns(scene, number)
    to_upper = np.swapaxes(pose.rotation[..., scene.springs.upper[number], :, :], -1, -2)
    relative = to_upper @ pose.rotation[..., scene.springs.lower[number], :, :]
    result = np.zeros((*now.strain.shape[:-2], 6, numbering.size), dtype=now.strain.dtype)
    result[..., :3, low] = to_upper
    result[..., :3, up] = -to_upper
    result[..., :3, _turning(low)] = -to_upper @ cross_matrix(now.arm[..., number, :])
    result[..., :3, _turning(up)] = to_upper @ cross_matrix(now.reach[..., number, :])
    # [h] Q + Q^T [h] = [(tr(Q) I - Q) h], so vee(skew([h] Q)) = (tr(Q) I - Q) h / 2
    turning = to_upper if rate else 0.5 * (unit_trace(relative) - relative) @ to_upper
    result[..., 3:, _turning(low)] = turning
    result[..., 3:, _turning(up)] = -turning
    return result


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all springs."""
    if not scene.springs.label:
        return
    now, hessian = state(scene, pose), derivatives.hessian[..., :-1, :-1]
    for number in range(len(scene.springs.label)):
        jacobian = strain_jacobian(scene, numbering, pose, now, number)
        transposed = np.swapaxes(jacobian, -1, -2)
        derivatives.gradient[...] += (transposed @ now.pull[..., number, :, None])[..., 0]
        hessian += transposed @ scene.springs.stiffness[..., number, :, :] @ jacobian
        _add_curvature(scene, pose, now, number, hessian)


def _add_curvature(
    scene: Scene,
    pose: Pose,
    now: State,
    number: int,
    hessian: Inexact[np.ndarray, "*batch coordinate coordinate"],
) -> None:
    """Add pull times second derivative of a spring's strain to the Hessian, in place."""
    up, low = _columns(scene, number)
    upper = pose.rotation[..., scene.springs.upper[number], :, :]
    lower = pose.rotation[..., scene.springs.lower[number], :, :]
    force = (upper @ now.pull[..., number, :3, None])[..., 0]
    reach, arm = now.reach[..., number, :], now.arm[..., number, :]
    g = upper @ cross_matrix(now.pull[..., number, 3:]) @ np.swapaxes(lower, -1, -2)
    turn = (g + np.swapaxes(g, -1, -2)) / 4 - unit_trace(g) / 2
    product = _outer(arm, force)
    mixed = -product + unit_trace(product) - np.swapaxes(g, -1, -2) / 2 + unit_trace(g) / 2
    low_turn, up_turn = _turning(low), _turning(up)
    hessian[..., low_turn, low_turn] += rotation_hessian(_outer(force, arm)) + turn
    hessian[..., up_turn, up_turn] += rotation_hessian(_outer(force, reach)) + turn
    skew = cross_matrix(force)
    for rows, columns, block in (
        (up_turn, low_turn, mixed),
        (up_turn, low, skew),
        (up_turn, up, -skew),
    ):
        hessian[..., rows, columns] += block
        hessian[..., columns, rows] += np.swapaxes(block, -1, -2)


def _columns(scene: Scene, number: int) -> tuple[slice, slice]:
    """Coordinates of the displacement of the upper and of the lower body."""
    up, low = 6 * int(scene.springs.upper[number]), 6 * int(scene.springs.lower[number])
    return slice(up, up + 3), slice(low, low + 3)


def _turning(displacement: slice) -> slice:
    """Coordinates of the rotation of the body, from those of displacement."""
    return slice(displacement.stop, displacement.stop + 3)


def _outer(
    a: Inexact[np.ndarray, "*batch 3"], b: Inexact[np.ndarray, "*batch 3"]
) -> Inexact[np.ndarray, "*batch 3 3"]:
    return a[..., :, None] * b[..., None, :]


def damping_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Viscous damping (..., N, N) of all springs."""
    return _sum_forms(scene, numbering, pose, scene.springs.damping, rate=True)


def loss_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Imaginary part (..., N, N) of the stiffness of all springs."""
    springs = scene.springs
    return _sum_forms(scene, numbering, pose, springs.stiffness * springs.loss[:, None, None])


def _sum_forms(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    form: Inexact[np.ndarray, "... spring 6 6"],
    *,
    rate: bool = False,
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Sum (..., N, N) of forms in the strains of the springs, or in their rates."""
    now, result = state(scene, pose), 0.0
    for number in range(len(scene.springs.label)):
        if form[..., number, :, :].any():
            jacobian = strain_jacobian(scene, numbering, pose, now, number, rate=rate)
            result = result + np.swapaxes(jacobian, -1, -2) @ form[..., number, :, :] @ jacobian
    return result


ELEMENT = Element(energy, add_derivatives, damping=damping_matrix, loss=loss_matrix, compiled=True)
