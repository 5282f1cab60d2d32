"""Tangent stiffness of a scene, split into the stretching of its wires and the rest."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import string
from suspension_cli.equilibrium.energy import gradient_and_stiffness
from suspension_cli.equilibrium.solve import Equilibrium
from suspension_cli.linear.double_double import DoubleDouble
from suspension_cli.linear.stretching import Stretching
from suspension_cli.linear.symmetry import Symmetry
from suspension_cli.scene.pose import Layout, Pose, rigid_motion
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int


TOGETHER = (0, 1, 2, 5)
"""Rigid motions in which no wire stretches: x, y, z and yaw."""


def separate_stretching(
    scene: Scene, numbering: Layout, balanced: Equilibrium, adapted: Symmetry
) -> Stretching:
    """Compute the tangent stiffness without the stretching of wires, and that stretching.

    In symmetry-adapted coordinates, for a scene without batch axes.
    """
    pose, wires = balanced.pose, scene.wires
    soft, form = soft_part(scene, numbering, pose)
    place = scene.bodies.position + pose.shift
    low = _low_parts(form, rigid_motion(numbering.size, place), wires.lower)
    return Stretching(
        form @ adapted.basis,
        low @ adapted.basis,
        wires.stiffness,
        adapted.allowed,
        adapted.apply(soft),
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


def _low_parts(
    form: Float[np.ndarray, "wire coordinate"],
    rigid: Float[np.ndarray, "coordinate 6"],
    body: Int[np.ndarray, " wire"],
) -> Float[np.ndarray, "wire coordinate"]:
    """Compute the low parts of linear forms that are 0 in rigid motion.

    The elements towards one `body` of each form follow from the others.
    """
    low, place = np.zeros_like(form), np.arange(len(form))[:, None]
    # translations do not depend on each other; yaw moves bodies sideways too
    for dofs in (np.array(TOGETHER[:3]), np.array(TOGETHER[3:])):
        column = 6 * body[:, None] + dofs
        others = np.arange(form.shape[1]) != column[..., None]
        terms = DoubleDouble(
            np.where(others, form[:, None], 0.0), np.where(others, low[:, None], 0.0)
        ) * DoubleDouble.of(np.broadcast_to(rigid[:, dofs].T, others.shape))
        total = DoubleDouble(np.moveaxis(terms.high, -1, 0), np.moveaxis(terms.low, -1, 0)).summed()
        low[place, column] = (-total - DoubleDouble.of(form[place, column])).value
    return low
