"""Pose of a scene, and the numbering of its generalised coordinates.

The coordinates are, in this order: six of the support, six of every body (displacement of the COM
in m and rotation vector in rad, along the global axes, from the current pose), one for every
direction in which a blade's tip can move (m, along the axes of the blade's body).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.conventions import DOF_UNITS, DOFS, SUPPORT
from suspension_cli.rotations import rotation_minus_identity
from suspension_cli.scene.arrays import inner
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact, Int


@dataclass(frozen=True)
class Layout:
    """Numbering of the coordinates of a scene."""

    size: int  # number N of coordinates, the support's six included
    blade: Int[np.ndarray, "blade 3"]  # of its tip along each axis; N where it is rigid
    name: tuple[str, ...]  # ``support.x``, ..., ``test.yaw``, ``upper.blade1.z``
    unit: tuple[str, ...]  # m or rad


def layout(scene: Scene) -> Layout:
    """Number the coordinates of a scene."""
    bodies = [f"{body}.{dof}" for body in (SUPPORT, *scene.bodies.name) for dof in DOFS]
    axes = scene.blades.axes
    size = len(bodies) + int(axes.sum())
    blade = np.full(axes.shape, size, dtype=np.intp)
    blade[axes] = np.arange(len(bodies), size)
    tips = [
        f"{label}.{DOFS[axis]}"
        for label, row in zip(scene.blades.label, axes, strict=True)
        for axis in np.flatnonzero(row)
    ]
    units = len(bodies) // len(DOFS) * DOF_UNITS + len(tips) * ("m",)
    return Layout(size, blade, (*bodies, *tips), units)


@dataclass(frozen=True)
class Pose:
    """A configuration of a scene.

    `shift` is the displacement of each COM from its nominal position, m; row 0 is the support.
    `turn` are rotation matrices from body to global axes, minus the unit matrix: added to it, a
    rotation by 1e-9 rad would keep only seven digits. `deflection` is that of each blade's tip,
    along the axes of its body, m.
    """

    shift: Inexact[np.ndarray, "*batch 1+body 3"] = field(metadata=inner(3))
    turn: Inexact[np.ndarray, "*batch 1+body 3 3"] = field(metadata=inner(3, 3))
    deflection: Inexact[np.ndarray, "*batch blade 3"] = field(metadata=inner(3))

    @cached_property
    def rotation(self) -> Inexact[np.ndarray, "*batch 1+body 3 3"]:
        """Rotation matrices (..., n + 1, 3, 3) from body to global axes."""
        return np.eye(3) + self.turn

    def arms(
        self, body: Int[np.ndarray, " point"], point: Inexact[np.ndarray, "... point 3"]
    ) -> Inexact[np.ndarray, "*batch point 3"]:
        """Global axes of vectors (..., k, 3) from the COMs of bodies to points in them."""
        return point + (self.turn[..., body, :, :] @ point[..., None])[..., 0]


def nominal_pose(scene: Scene) -> Pose:
    """Make the nominal pose of a scene."""
    count = len(scene.bodies.name) + 1
    return Pose(
        np.zeros((*scene.batch, count, 3)),
        np.zeros((*scene.batch, count, 3, 3)),
        np.zeros((*scene.batch, len(scene.blades.label), 3)),
    )


def displace(numbering: Layout, pose: Pose, step: Inexact[np.ndarray, "*batch coordinate"]) -> Pose:
    """Move a pose by a finite step (..., N) in the generalised coordinates.

    Translations add, rotations multiply.
    """
    bodies = pose.shift.shape[-2]
    motion = step[..., : 6 * bodies].reshape(*step.shape[:-1], bodies, 6)
    padded = np.concatenate([step, np.zeros_like(step[..., :1])], axis=-1)
    turn = rotation_minus_identity(motion[..., 3:])
    return replace(
        pose,
        shift=pose.shift + motion[..., :3],
        turn=turn + pose.turn + turn @ pose.turn,
        deflection=pose.deflection + padded[..., numbering.blade],
    )
