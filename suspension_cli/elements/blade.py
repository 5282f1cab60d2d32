"""Cantilever blades, whose tips are coordinates of their own.

A tip moves along one to three axes of the body that carries the blade. At a deflection q from the
nominal, loaded position the blade pulls its tip with load - k q, so it stores
-load . q + k q^2 / 2; a tip mass adds weight and inertia. Husman et al. (2000), section 3b: "the
cantilever positions are included as additional state variables".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.element import Derivatives, Element
from suspension_cli.rotations import cross_matrix
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def tip_arms(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch blade 3"]:
    """Vector (..., b, 3) from the COM of each blade's body to its tip, global axes, m."""
    return pose.arms(scene.blades.body, scene.blades.tip + pose.deflection)


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic energy (...) of all blades relative to the nominal pose, J."""
    q = pose.deflection
    return (0.5 * scene.blades.stiffness * q**2 - scene.blades.load * q).sum((-2, -1))


def add_derivatives(scene: Scene, numbering: Layout, pose: Pose, derivatives: Derivatives) -> None:
    """Add the derivatives of the energy of all blades, and of the forces on their tips.

    All these forces must have been added before.
    """
    blades, pulled, hessian = scene.blades, derivatives.on_tips, derivatives.hessian
    if not blades.label:
        return
    rotation, rows = pose.rotation[..., blades.body, :, :], numbering.blade[blades.axes]
    force = blades.stiffness * pose.deflection - blades.load
    force = force + (np.swapaxes(rotation, -1, -2) @ pulled[..., None])[..., 0]
    derivatives.gradient[..., rows] += force[..., blades.axes]
    hessian[..., rows, rows] += blades.stiffness[..., blades.axes]
    # the gradient F at a tip, deflected by q, adds F . (t x R q) = -t . [F] R q as its body rotates
    # by t
    block = -cross_matrix(pulled) @ rotation
    turn = (6 * blades.body[:, None] + np.arange(3, 6))[:, :, None] + np.zeros(3, dtype=np.intp)
    tip = numbering.blade[:, None, :] + np.zeros((3, 1), dtype=np.intp)
    hessian[..., turn, tip] += block
    hessian[..., tip, turn] += block


def loss_matrix(
    scene: Scene, numbering: Layout, pose: Pose
) -> Inexact[np.ndarray, "*batch coordinate coordinate"] | float:
    """Imaginary part (..., N, N) of the stiffness of all blades."""
    del pose
    if not scene.blades.loss.any():
        return 0.0
    blades, rows = scene.blades, numbering.blade[scene.blades.axes]
    result = np.zeros((*scene.batch, numbering.size, numbering.size))
    result[..., rows, rows] = (blades.stiffness * blades.loss[:, None])[..., blades.axes]
    return result


ELEMENT = Element(energy, add_derivatives, loss=loss_matrix, compiled=True)
