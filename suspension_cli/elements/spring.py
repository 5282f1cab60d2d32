"""Energy, force and stiffness of linear springs between two bodies: flexures, cables.

A spring joins a point of the lower body to the coincident point of the upper body in the nominal
pose. Its strain (delta, phi) is in the frame of the upper body, so it does not depend on the
observer's frame: delta is the displacement of the lower point, phi = vee(skew(Q)) of the relative
rotation Q = R_u^T R_l (the axis of Q times the sine of its angle: the rotation vector, but for
terms of third order). A spring stores s K s / 2 - preload . s for the strain s. Its damping acts on
the rate of delta and on the relative angular velocity, both in the frame of the upper body. In the
strain of the flexures of a leg its lean replaces delta, see `lean`, and the tilt (-Q_yz, Q_xz) of
the z axis of the lower body the first two components of phi, which turn with the yaw.

Below, r is the vector from the upper COM to the lower point, w that from the lower COM to it. A
step x, t of both bodies in displacement and rotation gives, with E = exp(-[t_u]) exp([t_l]),

    delta = R_u^T (exp(-[t_u]) (r - w + x_l - x_u + exp([t_l]) w)) - a,      Q = R_u^T E R_l,

with the point a in the frame of the upper body; expanding the exponentials gives the derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import lean
from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.elements.geometric_stiffness import rotation_hessian, unit_trace
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact


_OF_SPRING = cross_matrix(np.eye(3)) / 2
_OF_LEG = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [0, 0, 0]], _OF_SPRING[2]]
)
"""Forms G of the components <G, Q> of phi."""


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
        delta (or lean) in m and phi in rad.
    pull
        Gradient of the energy with respect to the strain, N and N m.
    lean
        Derivatives of the lean by delta, first and second; None without legs.
    """

    reach: Inexact[np.ndarray, "*batch spring 3"]
    arm: Inexact[np.ndarray, "*batch spring 3"]
    strain: Inexact[np.ndarray, "*batch spring 6"]
    pull: Inexact[np.ndarray, "*batch spring 6"]
    lean: (
        tuple[
            Inexact[np.ndarray, "*batch spring 3 3"],
            Inexact[np.ndarray, "*batch spring 3 3 3"],
        ]
        | None
    ) = None

    def force(self, number: int) -> Inexact[np.ndarray, "*batch 3"]:
        """Gradient (..., 3) of the energy of a spring with respect to delta, N."""
        pull = self.pull[..., number, :3]
        if self.lean is None:
            return pull
        return (np.swapaxes(self.lean[0][..., number, :, :], -1, -2) @ pull[..., None])[..., 0]


def state(scene: Scene, pose: Pose) -> State:
    """Strains and forces of all springs in a pose."""
    springs = scene.springs
    upper, lower = pose.rotation[..., springs.upper, :, :], pose.rotation[..., springs.lower, :, :]
    arm = pose.arms(springs.lower, springs.lower_point)
    nominal = springs.upper_point - springs.lower_point
    reach = nominal + pose.shift[..., springs.lower, :] - pose.shift[..., springs.upper, :] + arm
    delta = (np.swapaxes(upper, -1, -2) @ reach[..., None])[..., 0] - springs.upper_point
    relative = np.swapaxes(upper, -1, -2) @ lower
    phi = np.einsum("...nijk,...njk->...ni", _forms(springs.leg), relative)
    derivatives = None
    if springs.leg.any():
        is_leg = (springs.leg != 0)[..., None]
        legs = lean.angle(np.where(is_leg, delta, 0.0), np.where(is_leg[..., 0], springs.leg, 1.0))
        delta = np.where(is_leg, legs[0], delta)
        derivatives = np.where(is_leg[..., None], legs[1], np.eye(3)), legs[2]
    strain = np.concatenate([delta, phi], axis=-1)
    pull = (springs.stiffness @ strain[..., None])[..., 0] - springs.preload
    return State(reach, arm, strain, pull, derivatives)


def _forms(leg: Inexact[np.ndarray, "*spring"]) -> Float[np.ndarray, "*spring 3 3 3"]:
    """Forms (..., 3, 3, 3) of the components of phi of springs and legs."""
    return np.where((leg != 0)[..., None, None, None], _OF_LEG, _OF_SPRING)


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic energy (...) of all springs relative to the nominal pose, J."""
    now = state(scene, pose)
    return (0.5 * (now.pull - scene.springs.preload) * now.strain).sum((-2, -1))


def strain_jacobian(
    scene: Scene, numbering: Layout, pose: Pose, now: State, number: int, *, rate: bool = False
) -> Inexact[np.ndarray, "*batch 6 coordinate"]:
    """Derivative (..., 6, N) of the strain of spring `number` with respect to the coordinates.

    With `rate`, that of delta and of the rotation from one body to the other, R_u^T (t_l - t_u).
    """
    up, low = _columns(scene, number)
    to_upper = np.swapaxes(pose.rotation[..., scene.springs.upper[number], :, :], -1, -2)
    result = np.zeros((*now.strain.shape[:-2], 6, numbering.size), dtype=now.strain.dtype)
    result[..., :3, low] = to_upper
    result[..., :3, up] = -to_upper
    result[..., :3, _turning(low)] = -to_upper @ cross_matrix(now.arm[..., number, :])
    result[..., :3, _turning(up)] = to_upper @ cross_matrix(now.reach[..., number, :])
    if now.lean is not None and not rate:
        result[..., :3, :] = now.lean[0][..., number, :, :] @ result[..., :3, :]
    turning = to_upper
    if not rate:  # a rotation h changes <P, E> by <P, [h]>
        p = _turned_forms(scene, pose, number)
        turning = (p - np.swapaxes(p, -1, -2))[..., [2, 0, 1], [1, 2, 0]]
    result[..., 3:, _turning(low)] = turning
    result[..., 3:, _turning(up)] = -turning
    return result


def _turned_forms(scene: Scene, pose: Pose, number: int) -> Inexact[np.ndarray, "*batch 3 3 3"]:
    """Forms P = R_u G R_l^T of the components <P, E> of phi of a spring."""
    springs = scene.springs
    upper = pose.rotation[..., springs.upper[number], :, :]
    lower = pose.rotation[..., springs.lower[number], :, :]
    g = _forms(springs.leg[..., number])
    return upper[..., None, :, :] @ g @ np.swapaxes(lower, -1, -2)[..., None, :, :]


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all springs."""
    if not scene.springs.label:
        return
    now, hessian = state(scene, pose), derivatives.hessian[..., :-1, :-1]
    legs = scene.springs.leg
    for number in range(len(scene.springs.label)):
        jacobian = strain_jacobian(scene, numbering, pose, now, number)
        transposed = np.swapaxes(jacobian, -1, -2)
        derivatives.gradient[...] += (transposed @ now.pull[..., number, :, None])[..., 0]
        hessian += transposed @ scene.springs.stiffness[..., number, :, :] @ jacobian
        if now.lean is not None and legs[..., number].any():
            moved = strain_jacobian(scene, numbering, pose, now, number, rate=True)[..., :3, :]
            pull, second = now.pull[..., number, :3], now.lean[1][..., number, :, :, :]
            curve = np.einsum("...i,...ijk->...jk", pull, second)
            hessian += np.swapaxes(moved, -1, -2) @ curve @ moved
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
    force = (upper @ now.force(number)[..., None])[..., 0]
    reach, arm = now.reach[..., number, :], now.arm[..., number, :]
    twist = now.pull[..., number, 3:]
    p = (twist[..., None, None] * _turned_forms(scene, pose, number)).sum(-3)
    turn = (p + np.swapaxes(p, -1, -2)) / 2 - unit_trace(p)
    product = _outer(arm, force)
    mixed = -product + unit_trace(product) - np.swapaxes(p, -1, -2) + unit_trace(p)
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
