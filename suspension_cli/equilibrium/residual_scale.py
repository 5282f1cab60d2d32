"""Scales of the residual of an equilibrium: weight that each body carries, and its lever arm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.elements.weight import masses
from suspension_cli.equilibrium.tree import parents
from suspension_cli.scene.arrays import frames
from suspension_cli.scene.pose import Layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float

ROUNDINGS = 16
"""Most rounding errors of a displacement that add up in the forces on a body."""
LEAST_ARM = 1e-4
"""Lever arm of a body whose attachments lie at its COM, m."""


def largest_lever_arm(scene: Scene) -> Float[np.ndarray, "*batch"]:
    """Largest distance (...) of any attachment from a COM along an axis, m, at least 1 mm."""
    return np.maximum(lever_arms(scene).max(-1), 1e-3)


def residual_scale(scene: Scene, numbering: Layout) -> Float[np.ndarray, "*batch moving"]:
    """Scale (..., N - 6) of the residual in each coordinate but the support's.

    For forces the weight that the body (on a blade: the body below) carries, N; for torques that
    times the lever arm of the body, N m.
    """
    load, arm = carried_weights(scene), lever_arms(scene)[..., 1:]
    bodies = np.stack([np.stack([load] * 3, -1), np.stack([load * arm] * 3, -1)], -2)
    result = np.ones((*scene.batch, numbering.size + 1)) * scene.weight[..., None]
    result[..., 6 : 6 * load.shape[-1] + 6] = bodies.reshape(*load.shape[:-1], -1)
    for wire in np.flatnonzero(scene.wires.blade >= 0):
        body = scene.wires.lower[wire]
        result[..., numbering.blade[scene.wires.blade[wire]]] = load[..., body - 1, None]
    return result[..., 6:-1]


def carried_weights(scene: Scene) -> Float[np.ndarray, "*batch body"]:
    """Weight (..., n) of each body with all that hangs from it, N."""
    bodies, parent = scene.bodies, parents(scene)
    shape = (*scene.batch, len(bodies.name))
    result = np.array(np.broadcast_to(scene.gravity * bodies.mass, shape))
    for group in masses(scene):
        for body, moments in zip(group.body, group.moment, strict=True):
            load: Any = scene.gravity * sum(moments)
            for number in np.flatnonzero(body).tolist():
                result[..., body[number] - 1] += load[..., number]
    for body in range(len(bodies.name), 0, -1):
        if parent[body] > 0:
            result[..., parent[body] - 1] += result[..., body - 1]
    return result


def lever_arms(scene: Scene) -> Float[np.ndarray, "*batch 1+body"]:
    """Largest distance (..., n + 1) of an attachment of each body from its COM along an axis, m.

    At least `LEAST_ARM`; the support comes first.
    """
    springs = scene.springs
    result = np.full((*scene.batch, len(scene.bodies.name) + 1), LEAST_ARM)
    ends = [(springs.lower, springs.lower_point)]
    for part in (scene.wires, *scene.added.values()):
        points = frames(type(part)).items()
        ends += [(getattr(part, body), getattr(part, point)) for point, body in points]
    for body, points in ends:
        place: Any = (..., body)
        np.maximum.at(result, place, np.abs(points).max(-1))
    return result
