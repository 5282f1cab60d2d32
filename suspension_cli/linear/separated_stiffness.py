"""Tangent stiffness of a scene, split into the stretching of its wires and the rest."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import string
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.linear.stretching import Stretching
from suspension_cli.linear.symmetry import Symmetry
from suspension_cli.scene.pose import Layout, Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def separate_stretching(
    scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry
) -> Stretching:
    """Compute the tangent stiffness without the stretching of wires, and that stretching.

    In symmetry-adapted coordinates, for a scene without batch axes.
    """
    soft, form = soft_part(scene, numbering, balanced.pose)
    return Stretching(
        form @ adapted.basis, scene.wires.stiffness, adapted.allowed, adapted.apply(soft)
    )


def soft_part(
    scene: Scene, numbering: Layout, pose: Pose
) -> tuple[
    Inexact[np.ndarray, "*batch coordinate coordinate"],
    Inexact[np.ndarray, "*batch wire coordinate"],
]:
    """Compute the tangent stiffness if wires kept their lengths, and their elongations.

    The latter per coordinate; any batch axes.
    """
    now = string.state(scene, pose)
    form = (string.span_jacobian(scene, numbering, pose, now) * now.direction[..., None, :, :]).sum(
        -1
    )
    slack = replace(scene.wires, tension=now.tension, stiffness=np.zeros_like(now.tension))
    soft = gradient_and_stiffness(replace(scene, wires=slack), numbering, pose)[1]
    return soft, np.swapaxes(form, -1, -2)
