"""Outlines of bodies: the boxes and cylinders that drawings show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Body, Design
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float
    from numpy.typing import ArrayLike

SMALLEST = 0.012
"""Least half extent of a body that can be seen, relative to the size of the suspension."""
ROUND = 97
"""Points on a circle, the first one included twice."""


@dataclass(frozen=True)
class Outline:
    """Shape of a body in its own frame, with the COM at the origin.

    Attributes
    ----------
    half : (3,) array
        Half extents along x, y, z, m.
    axis
        The axis (0, 1, 2) of a cylinder; None for a box.
    inner
        Radius of a cylinder's bore, m.
    turn : (3, 3) array or None
        Rotation matrix from the shape to the frame of the body; None for none.
    """

    half: Array
    axis: int | None = None
    inner: float = 0.0
    turn: Array | None = None

    def section(self, normal: int) -> Array:
        """Section of the body through its COM, across the axis `normal` (0, 1, 2).

        A closed line (p, 3), m: a circle across the axis of a cylinder, else a rectangle.
        """
        first, second = (axis for axis in range(3) if axis != normal)
        if self.axis == normal:
            angle = np.linspace(0, 2 * np.pi, ROUND)
            u, v = np.cos(angle), np.sin(angle)
        else:
            u, v = np.array([1.0, -1.0, -1.0, 1.0, 1.0]), np.array([1.0, 1.0, -1.0, -1.0, 1.0])
        line = np.zeros((len(u), 3))
        line[:, first], line[:, second] = u * self.half[first], v * self.half[second]
        return line if self.turn is None else line @ self.turn.T

    def bore(self, normal: int) -> Array | None:
        """Edge (p, 3) of a cylinder's bore, m, in a section across its axis; else None."""
        if self.axis != normal or not self.inner:
            return None
        return self.section(normal) * (self.inner / float(np.max(np.delete(self.half, normal))))

    def nearest(self, point: ArrayLike) -> Array:
        """Points (..., 3) of the body nearest to given points (..., 3), in its frame, m."""
        point = np.asarray(point, dtype=float)
        if self.turn is not None:
            return replace(self, turn=None).nearest(point @ self.turn) @ self.turn.T
        result = np.clip(point, -self.half, self.half)
        if self.axis is not None:
            across = [axis for axis in range(3) if axis != self.axis]
            distance = np.linalg.norm(point[..., across], axis=-1, keepdims=True)
            radius = self.half[across[0]]
            result[..., across] = point[..., across] * np.minimum(
                1.0, radius / np.maximum(distance, 1e-300)
            )
        return result


def outline(
    body: Body, mass: float, inertia: Float[np.ndarray, "3 3"], least: float = 0.0
) -> Outline:
    """Outline of one body, with half extents of at least `least`, m.

    The cylinder or box of the design; for a body given by its inertia (3, 3), kg m^2 about the COM,
    the homogeneous box of the same mass (kg) and moments, Lx^2 = 6 (Iy + Iz - Ix) / m, or 0 where
    that is negative.
    """
    if body.shape == "box":
        assert body.size is not None
        return Outline(np.maximum(np.array(body.size) / 2, least))
    if body.shape == "cylinder":
        assert body.radius is not None and body.length is not None
        axis = "xyz".index(body.axis or "x")
        half = np.full(3, max(body.radius, least))
        half[axis] = max(body.length / 2, least)
        return Outline(half, axis, body.inner_radius or 0.0)
    moments = np.diagonal(np.asarray(inertia, dtype=float))
    squares = np.maximum(6 * (moments.sum() - 2 * moments) / mass, 0.0)
    return Outline(np.maximum(np.sqrt(squares) / 2, least))


def outlines(design: Design, scene: Scene) -> list[Outline]:
    """Outlines of all bodies of a scene without batch axes, large enough to be seen."""
    bodies = scene.bodies
    least = SMALLEST * suspension_size(scene)
    return [
        outline(stage.body, float(m), i, least)
        for stage, m, i in zip(design.stage, bodies.mass, bodies.inertia, strict=True)
    ]


def suspension_size(scene: Scene) -> float:
    """Size of a suspension without batch axes, m.

    The largest of its height, half its width and the radius of gyration of its bodies.
    """
    wires, position = scene.wires, scene.bodies.position
    points = np.concatenate(
        [
            position,
            position[wires.upper] + wires.upper_point,
            position[wires.lower] + wires.lower_point,
        ]
    )
    gyration = np.sqrt(np.trace(scene.bodies.inertia, axis1=-2, axis2=-1) / scene.bodies.mass)
    return float(max((np.ptp(points, axis=0) * (0.5, 0.5, 1.0)).max(), gyration.max()))
