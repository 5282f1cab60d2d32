"""Weight along -z and inertia of rigid bars between points of two bodies: legs, blades of filters.

At the fraction s of its length a rigid bar has the velocity v_1 (1 - s) + v_2 s. So its kinetic
energy is (a v_1^2 + 2 c v_1 . v_2 + b v_2^2) / 2, with a, c, b the integrals over its mass of
(1 - s)^2, s (1 - s) and s^2; spin about its axis is neglected. The height of its COM is linear in
the heights of its ends, so its weight rests on the ends as the masses a + c and c + b.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.geometric_stiffness import add_arms
from suspension_cli.scene.pose import Layout, Pose, point_jacobian
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Gravitational energy (...) of all bars relative to the nominal pose, J."""
    bars = scene.bars
    rise = (
        pose.shift[..., bars.body, 2]
        + ((pose.turn[..., bars.body, :, :] @ bars.point[..., None])[..., 2, 0])
    )
    return scene.gravity * (bars.loads * rise).sum((-2, -1))


def add_weight(
    scene: Scene,
    numbering: Layout,
    pose: Pose,
    gradient: Inexact[np.ndarray, "*batch coordinate"],
    outer: Inexact[np.ndarray, "*batch 1+body 3 3"],
) -> None:
    """Add the gradient of the energy of all bars, and F w^T of their weights, in place.

    `outer` collects the outer product of force and arm on each body, for `rotation_hessian`.
    """
    bars = scene.bars
    for end in (0, 1):
        body = bars.body[:, end]
        arm = pose.arms(body, bars.point[..., end, :])
        weight = scene.gravity * bars.loads[..., end, None] * np.array([0.0, 0.0, 1.0])
        jacobian = point_jacobian(numbering, pose, body, arm)
        gradient += (jacobian * weight[..., None, :, :]).sum((-2, -1))
        add_arms(outer, body, weight, arm)


def mass_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"]:
    """Mass matrix (..., N, N) of all bars."""
    bars = scene.bars
    first, second = (
        point_jacobian(
            numbering,
            pose,
            bars.body[:, end],
            pose.arms(bars.body[:, end], bars.point[..., end, :]),
        )
        for end in (0, 1)
    )
    a, c, b = (bars.inertia[..., None, :, n, None] for n in range(3))
    # (first, second) of each end times the row of the 2x2 inertia
    left = [a * first + c * second, c * first + b * second]
    flat = [part.reshape(*part.shape[:-2], -1) for part in (*left, first, second)]
    return flat[0] @ np.swapaxes(flat[2], -1, -2) + flat[1] @ np.swapaxes(flat[3], -1, -2)
