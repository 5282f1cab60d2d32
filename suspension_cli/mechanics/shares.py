"""What the forces and torques left over in an equilibrium are shares of: what each body carries, and how far from its COM it is held."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics.pose import Layout

LEAST_ARM = 1e-4
"""m; lever arm of a body whose attachments lie at its COM."""


def lever_arm(scene: Scene) -> Any:
    """Largest distance of an attachment from a COM along an axis, m, at least 1 mm; shape ``batch``."""
    points = (scene.wires.upper_point, scene.wires.lower_point, scene.springs.lower_point)
    largest = [np.abs(p).max((-2, -1), initial=1e-3) for p in points]
    return np.broadcast_to(np.maximum.reduce(np.broadcast_arrays(*largest)), scene.batch)


def units(scene: Scene, numbering: Layout) -> Any:
    """What a residual is a share of, (..., N - 6): for forces the load of the body (or of the body below, on a blade), for torques that times its lever arm."""
    load, arm = loads(scene), lever_arms(scene)
    bodies = np.stack([np.stack([load] * 3, -1), np.stack([load * arm] * 3, -1)], -2)
    result = np.ones((*scene.batch, numbering.size + 1)) * scene.weight[..., None]
    result[..., 6 : 6 * load.shape[-1] + 6] = bodies.reshape(*load.shape[:-1], -1)
    for wire in np.flatnonzero(scene.wires.blade >= 0):
        result[..., numbering.blade[scene.wires.blade[wire]]] = load[..., scene.wires.lower[wire] - 1, None]
    return result[..., 6:-1]


def loads(scene: Scene) -> Any:
    """What each body carries (..., n): its own weight and that of all that hangs on it, N."""
    wires, springs, bodies = scene.wires, scene.springs, scene.bodies
    result = np.array(np.broadcast_to(scene.gravity * bodies.mass, (*scene.batch, len(bodies.name))))
    for number, body in enumerate(scene.blades.body.tolist()):
        if body > 0:
            result[..., body - 1] += scene.gravity * scene.blades.tip_mass[..., number]
    parent = {low: up for part in (springs, wires) for up, low in zip(part.upper.tolist(), part.lower.tolist(), strict=True)}
    for body in range(len(bodies.name), 0, -1):
        if parent.get(body, 0) > 0:
            result[..., parent[body] - 1] += result[..., body - 1]
    return result


def lever_arms(scene: Scene) -> Any:
    """Largest distance of an attachment of each body (..., n) from its COM along an axis, m, at least `LEAST_ARM`."""
    wires, springs = scene.wires, scene.springs
    result = np.full((*scene.batch, len(scene.bodies.name) + 1), LEAST_ARM)
    ends = ((wires.upper, wires.upper_point), (wires.lower, wires.lower_point), (springs.lower, springs.lower_point))
    for body, points in ends:
        place: Any = (..., body)
        np.maximum.at(result, place, np.abs(points).max(-1))
    return result[..., 1:]
