"""Batches of scenes of one topology: stack scenes, select some, scale their imperfections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.scene.arrays import change_arrays
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Bool, Int


def stack_scenes(scenes: Sequence[Scene], pick: Int[np.ndarray, " build"] | None = None) -> Scene:
    """Stack scenes into one whose first axis runs over them.

    The scenes are without batch axes, of the same topology; labels, losses and the like are those
    of the first. `pick` has the number of the scene of each member of the batch; by default each in
    turn.
    """
    order = np.arange(len(scenes)) if pick is None else pick
    drawn = [scene.drawn for scene in scenes if scene.drawn is not None]
    together = stack_scenes(drawn, pick) if len(drawn) == len(scenes) else None
    first, *others = scenes
    return replace(first.map(lambda _, *values: np.stack(values)[order], *others), drawn=together)


def select_scenes(
    scene: Scene, which: Bool[np.ndarray, "*batch"] | Int[np.ndarray, " build"] | int
) -> Scene:
    """Select scenes of a batch, along one axis: by a bool array of its shape, or by numbers."""

    def selected(axes: int, value: np.ndarray) -> np.ndarray:
        return np.broadcast_to(value, scene.batch + value.shape[value.ndim - axes :])[which]

    drawn = scene.drawn
    if drawn is not None and drawn.batch:
        drawn = select_scenes(drawn, which)
    flex = scene.flex and change_arrays(selected, scene.flex)
    return replace(scene.map(selected), drawn=drawn, flex=flex)


def scale_imperfections(scene: Scene, fraction: float) -> Scene:
    """Scale the imperfections of a scene, its differences from `scene.drawn`, by a fraction (0 to
    1).
    """
    assert scene.drawn is not None
    scaled = scene.map(lambda _, new, old: old + fraction * (new - old), scene.drawn)
    length = np.sqrt((scaled.wires.span**2).sum(-1))
    return replace(scaled, wires=replace(scaled.wires, length=length))
