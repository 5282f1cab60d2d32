"""Tree of the bodies of a scene: which hangs from which."""

from __future__ import annotations

import numpy as np

from suspension_cli.scene.arrays import Index
from suspension_cli.scene.scene import Scene


def parents(scene: Scene) -> Index:
    """Body (n + 1,) from which each body hangs, always of lower number; 0 is the support."""
    result = np.zeros(len(scene.bodies.name) + 1, dtype=np.intp)
    springs, wires = scene.springs, scene.wires
    # a stage's own springs stand before links between any two bodies
    for part in (*scene.added.values(), springs):
        result[part.lower[::-1]] = part.upper[::-1]
    result[wires.lower] = wires.upper
    return result


def chain_tops(scene: Scene) -> tuple[int, ...]:
    """Number (from 0) of the body that hangs from the support in the chain of each body."""
    result: list[int] = []
    for body, parent in enumerate(parents(scene)[1:]):
        result.append(result[parent - 1] if parent else body)
    return tuple(result)


def subtree(scene: Scene, body: int) -> list[int]:
    """A body and all that hang from it, directly or not, in ascending order."""
    members, parent = [body], parents(scene)
    for other in range(body + 1, len(parent)):
        if parent[other] in members:
            members.append(other)
    return members
