"""Static pose of every body of imperfect builds, relative to the design as drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.rotations import rotation_vector
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float


def static_displacements(scene: Scene, pose: Pose) -> Float[np.ndarray, "build body 6"]:
    """Compute the static displacements and rotations of bodies in the equilibria of builds.

    The displacement (x, y, z, m) is that of the point of a body where its COM is as drawn: where
    an imperfection moves the COM by c in a body that turns by R, u - (R - 1) c with u that of the
    COM. The rotation (roll, pitch, yaw, rad) is a rotation vector.

    Parameters
    ----------
    scene
        With the builds as its one batch axis.
    pose
        Their equilibrium.
    """
    drawn = scene.drawn or scene
    offset = (scene.bodies.position - drawn.bodies.position)[..., 1:, :]
    shift, turn = pose.shift[..., 1:, :], pose.turn[..., 1:, :, :]
    moved = shift - (turn @ offset[..., None])[..., 0]
    rotation = rotation_vector(turn)
    shape = np.broadcast_shapes(moved.shape, rotation.shape, (*scene.batch, 1, 3))
    return np.concatenate(
        [np.broadcast_to(moved, shape), np.broadcast_to(rotation, shape)], axis=-1
    )
