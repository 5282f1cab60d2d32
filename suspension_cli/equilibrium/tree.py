"""Tree of the bodies of a scene: which hangs from which, and the weight that each carries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.configuration import SceneArrays, batch_first
from suspension_cli.elements.weight import masses
from suspension_cli.scene.arrays import Index, frames
from suspension_cli.scene.pose import layout
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float

LEAST_ARM = 1e-4
"""Lever arm of a body whose attachments lie at its COM, m."""


def parents(scene: Scene) -> Index:
    """Body (n + 1,) from which each body hangs, always of lower number; 0 is the support."""
    result = np.zeros(len(scene.bodies.name) + 1, dtype=np.intp)
    springs = scene.springs
    wires = scene.wires
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


def spinning_bodies(scene: Scene) -> list[int]:
    """Bodies that turn freely about gravity: that hang at a single point, and all below.

    The upper or lower ends of their wires coincide in every scene of a batch, no wire resists
    twisting, and no spring or added element holds them.
    """
    if scene.flex is not None or not (scene.field is None or scene.field.is_uniform):
        return []
    wires = scene.wires
    parent = parents(scene)
    result = set[int]()
    for body in range(1, len(parent)):
        own = np.flatnonzero(wires.lower == body)
        points = (wires.upper_point[..., own, :], wires.lower_point[..., own, :])
        single = any((end == end[..., :1, :]).all() for end in points)
        if not len(own) or not single or wires.torsion[..., own].any():
            continue
        members = [body]
        for other in range(body + 1, len(parent)):
            if parent[other] in members:
                members.append(other)
        springs = scene.springs
        elastic = springs.stiffness.any((-2, -1)) | springs.preload.any(-1)
        held = (np.isin(springs.upper, members) != np.isin(springs.lower, members)) & elastic
        others = (
            np.isin(p.upper, members) != np.isin(p.lower, members) for p in scene.added.values()
        )
        if not held.any() and not any(leaving.any() for leaving in others):
            result.update(members)
    return sorted(result)


def largest_lever_arm(arrays: SceneArrays) -> Float[np.ndarray, " build"]:
    """Largest distance of any attachment from a COM along an axis, m, at least 1 mm."""
    return np.maximum(_lever_arms(arrays).max(0), 1e-3)


def residual_scale(arrays: SceneArrays) -> Float[np.ndarray, "moving build"]:
    """Scale of the residual in each coordinate but the support's.

    For forces the weight that the body (on a blade: the body below) carries, N; for torques that
    times the lever arm of the body, N m.
    """
    load = _carried_weights(arrays)
    arm = _lever_arms(arrays)
    numbering = arrays.numbering
    wires = arrays.wires
    result = np.empty((numbering.size + 1, arrays.count))
    result[:] = load[0]
    bodies = result[: 6 * len(load)].reshape(len(load), 6, -1)
    bodies[:, :3] = load[:, None]
    bodies[:, 3:] = (load * arm)[:, None]
    for wire in np.flatnonzero(wires.blade >= 0):
        result[numbering.blade[wires.blade[wire]]] = load[wires.lower[wire]]
    return result[6:-1]


def carried_weights(scene: Scene) -> Float[np.ndarray, "*batch body"]:
    """Weight of each body with all that hangs from it, N."""
    loads = _carried_weights(SceneArrays.of(scene, layout(scene)))
    return batch_first(loads[1:], scene.batch)


def _carried_weights(arrays: SceneArrays) -> Float[np.ndarray, "1+body build"]:
    """Weight of each body with all that hangs from it, N; all of it hangs from the support."""
    parent = parents(arrays.scene)
    result = np.zeros((len(parent), arrays.count))
    result[1:] = np.real(arrays.bodies.mass)
    for group in masses(arrays)[0]:
        for body, own in zip(group.ends.upper, np.real(group.mass), strict=True):
            result[body] += own
    for body in range(len(parent) - 1, 0, -1):
        result[parent[body]] += result[body]
    return arrays.scene.gravity * result


def _lever_arms(arrays: SceneArrays) -> Float[np.ndarray, "1+body build"]:
    """Largest distance of an attachment of each body from its COM along an axis, m.

    At least `LEAST_ARM`; the support comes first.
    """
    springs = arrays.springs
    result = np.full((len(arrays.bodies.name) + 1, arrays.count), LEAST_ARM)
    ends = [(springs.lower, springs.lower_point)]
    for name in ("wires", *arrays.scene.added):
        part = arrays.parts[name]
        points = frames(type(part)).items()
        ends += [(getattr(part, body), getattr(part, point)) for point, body in points]
    for body, points in ends:
        size = np.abs(points).max(0)
        for number, own in zip(body.tolist(), size, strict=True):
            np.maximum(result[number], own, out=result[number])
    return result
