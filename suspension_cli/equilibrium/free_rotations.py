"""Rotations without restoring torque, of a body hung at a single point with all below it.

Such a body rotates about the direction of gravity through that point at constant energy, in any
pose (not in a field with a gradient).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.configuration import Configuration
from suspension_cli.elements.vectors import cross
from suspension_cli.equilibrium.tree import subtree
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact


def single_point_stages(scene: Scene) -> list[tuple[int, int]]:
    """Stages that hang at a single point: pairs of body and one of its wires.

    By wires whose upper or lower ends coincide in every scene of a batch, not if a spring holds the
    body or a wire resists twisting.
    """
    if scene.flex is not None or not (scene.field is None or scene.field.is_uniform):
        return []
    wires, result = scene.wires, []
    for body in range(1, len(scene.bodies.name) + 1):
        own = np.flatnonzero(wires.lower == body)
        if not len(own) or wires.torsion[..., own].any() or _is_held(scene, body):
            continue
        if _coincide(wires.upper_point[..., own, :]) or _coincide(wires.lower_point[..., own, :]):
            result.append((body, int(own[0])))
    return result


def _is_held(scene: Scene, body: int) -> bool:
    """Whether a spring or added element joins a body, or one that hangs from it, to another."""
    springs, members = scene.springs, subtree(scene, body)

    def leaves(part: Any) -> Any:
        return np.isin(part.upper, members) != np.isin(part.lower, members)

    elastic = springs.stiffness.any((-2, -1)) | springs.preload.any(-1)
    held = (leaves(springs) & elastic).any()
    return bool(held or any(leaves(part).any() for part in scene.added.values()))


def _coincide(points: Inexact[np.ndarray, "... point 3"]) -> bool:
    """Whether points (..., k, 3) are the same for all k."""
    return bool((points == points[..., :1, :]).all())


def free_rotations(
    now: Configuration, stages: list[tuple[int, int]]
) -> Float[np.ndarray, "moving free build"]:
    """Motion of the coordinates per rotation of each stage, m/rad and rad/rad.

    `stages` are those of `single_point_stages`.
    """
    scene, wires = now.arrays.scene, now.arrays.wires
    result = np.zeros((now.arrays.numbering.size, len(stages), now.arrays.count))
    axis = np.array([[0.0], [0.0], [1.0]])
    if scene.field is not None:
        down = np.real(scene.field.vector)
        axis = -down[:, None] / np.sqrt(down @ down)
    for column, (body, wire) in enumerate(stages):
        pivot = now.place[:, body] + now.wires.lower_arm[:, wire]
        if not _coincide(scene.wires.lower_point[..., wires.lower == body, :]):
            pivot = pivot - now.wires.direction[:, wire] * now.wires.length[wire]
        for member in subtree(scene, body):
            arm = now.place[:, member] - pivot
            result[6 * member : 6 * member + 3, column] = cross(axis, arm)
            result[6 * member + 3 : 6 * member + 6, column] = axis
    return result[6:]
