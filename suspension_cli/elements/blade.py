"""Cantilever blades, whose tips are coordinates of their own.

A tip moves along one to three axes of the body on which the blade is clamped. At a deflection q
from the nominal, loaded position the blade pulls its tip with load - k q, so it stores
-load . q + k q^2 / 2; a tip mass adds its weight and its inertia. Husman et al. (2000), section 3b:
"the cantilever positions are included as additional state variables".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Inexact


def tip_arms(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch blade 3"]:
    """Vector (..., b, 3) from the COM of each blade's body to its tip, global axes, m."""
    return pose.arms(scene.blades.body, scene.blades.tip + pose.deflection)


def tip_gradient(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch blade 3"]:
    """Gradient (..., b, 3) of the elastic energy with respect to the deflections, N."""
    return scene.blades.stiffness * pose.deflection - scene.blades.load


def energy(scene: Scene, pose: Pose) -> Inexact[np.ndarray, "*batch"]:
    """Elastic energy (...) of all blades relative to the nominal pose, J."""
    q = pose.deflection
    return (0.5 * scene.blades.stiffness * q**2 - scene.blades.load * q).sum((-2, -1))
