"""Several scenes of one topology as one scene with a batch axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Blades, Bodies, Flex, Scene, Springs, Wires

STATIC = {"name", "label", "upper", "lower", "blade", "body", "axes", "loss"}
"""What all scenes of a batch share."""


def stacked(scenes: Sequence[Scene], pick: Any = None) -> Scene:
    """One scene whose first axis runs over scenes.

    Parameters
    ----------
    scenes : sequence of Scene
        Without batch axes, of the same bodies, wires, blades and springs.
    pick : (p,) int array, optional
        Which scene each member of the batch is; default: each in turn.
    """
    order = np.arange(len(scenes)) if pick is None else pick

    def together(parts: list[Any]) -> Any:
        kind = type(parts[0])
        return kind(**{f.name: getattr(parts[0], f.name) if f.name in STATIC else np.stack([getattr(p, f.name) for p in parts])[order] for f in fields(kind)})

    first = scenes[0]
    groups: dict[str, type] = {"bodies": Bodies, "wires": Wires, "blades": Blades, "springs": Springs}
    drawn = [scene.drawn for scene in scenes if scene.drawn is not None]
    kept = stacked(drawn, pick) if len(drawn) == len(scenes) else None
    return replace(first, drawn=kept, **{name: together([getattr(scene, name) for scene in scenes]) for name in groups})


def picked(scene: Scene, which: Any) -> Scene:
    """The scenes of a batch for which `which` (a bool array of the batch's shape) holds, along one axis."""
    inner = {
        "mass": 1,
        "inertia": 3,
        "position": 2,
        "upper_point": 2,
        "lower_point": 2,
        "span": 2,
        "length": 1,
        "tension": 1,
        "torsion": 1,
        "tip": 2,
        "load": 2,
        "tip_mass": 1,
    }
    inner |= {"damping": 3, "preload": 2, "bend": 3, "twist": 1}
    stiffness = {Wires: 1, Blades: 2, Springs: 3}

    def chosen(part: Any) -> Any:
        axes = inner | {"stiffness": stiffness.get(type(part), 0)} | ({"upper": 3, "lower": 3} if isinstance(part, Flex) else {})
        values = {f.name: getattr(part, f.name) for f in fields(part)}
        batched = {name: value for name, value in values.items() if name not in STATIC or isinstance(part, Flex)}
        return replace(part, **{name: np.broadcast_to(v, scene.batch + v.shape[v.ndim - axes[name] :])[which] for name, v in batched.items()})

    drawn = scene.drawn if scene.drawn is None or not scene.drawn.batch else picked(scene.drawn, np.broadcast_to(which, scene.drawn.batch))
    groups: dict[str, Any] = {name: chosen(getattr(scene, name)) for name in ("bodies", "wires", "blades", "springs")}
    if scene.flex is not None:
        groups["flex"] = chosen(scene.flex)
    return replace(scene, drawn=drawn, **groups)


def blended(scene: Scene, share: float) -> Scene:
    """An imperfect scene with a share (0 to 1) of its imperfections: its numbers lie on the way from those of `scene.drawn`."""
    drawn = scene.drawn
    assert drawn is not None

    def between(old: Any, new: Any) -> Any:
        values = {f.name: getattr(new, f.name) for f in fields(new) if f.name not in STATIC}
        return replace(new, **{name: getattr(old, name) + share * (value - getattr(old, name)) for name, value in values.items()})

    wires = between(drawn.wires, scene.wires)
    return replace(
        scene,
        bodies=between(drawn.bodies, scene.bodies),
        wires=replace(wires, length=np.sqrt((wires.span**2).sum(-1))),
        blades=between(drawn.blades, scene.blades),
        springs=between(drawn.springs, scene.springs),
    )
