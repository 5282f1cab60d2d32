"""Motions that cost nothing in any pose: a body on a single point, with all below it, turns about the vertical through it."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.design.scene import Scene
from suspension_cli.mechanics import string
from suspension_cli.mechanics.pose import Layout, Pose


def free_to_spin(scene: Scene) -> list[tuple[int, int]]:
    """Stages that hang by a single point (one wire, or wires that meet in every scene of a batch): body and a wire that holds that point.

    Such a stage and all below it turn about the vertical through the point at no cost, in any pose, unless a wire resists twisting.
    """
    if scene.flex is not None:
        return []
    wires, found = scene.wires, []
    for body in range(1, len(scene.bodies.name) + 1):
        mine = np.flatnonzero(wires.lower == body)
        meet = any((points[..., mine, :] == points[..., mine[:1], :]).all() for points in (wires.upper_point, wires.lower_point)) if len(mine) else False
        if meet and not (scene.springs.lower == body).any() and not wires.torsion[..., mine].any():
            found.append((body, int(mine[0])))
    return found


def spins(scene: Scene, numbering: Layout, pose: Pose, free: list[tuple[int, int]]) -> Any:
    """The motions (..., N, r) of turning about the vertical that cost nothing."""
    result = np.zeros((*scene.batch, numbering.size, len(free)))
    place = scene.bodies.position + pose.shift
    parent = {int(low): int(up) for up, low in zip(scene.wires.upper, scene.wires.lower, strict=True)}
    parent |= {int(low): int(up) for up, low in zip(scene.springs.upper, scene.springs.lower, strict=True)}
    for column, (body, wire) in enumerate(free):
        pivot = place[..., body, :] + pose.arms(scene.wires.lower[[wire]], scene.wires.lower_point[..., [wire], :])[..., 0, :]
        if not (scene.wires.lower_point[..., scene.wires.lower == body, :] == scene.wires.lower_point[..., [wire], :]).all():
            pivot = pivot - string.state(scene, pose).direction[..., wire, :] * string.state(scene, pose).length[..., wire, None]
        carried = {body}
        for other in range(body + 1, len(scene.bodies.name) + 1):
            if parent[other] in carried:
                carried.add(other)
        for other in carried:
            arm = place[..., other, :] - pivot
            result[..., 6 * other, column], result[..., 6 * other + 1, column] = -arm[..., 1], arm[..., 0]
            result[..., 6 * other + 5, column] = 1.0
    return result[..., 6:, :]
