"""Several scenes of one topology as one scene with a batch axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from suspension_cli.design.scene import Blades, Bodies, Scene, Springs, Wires

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
    return replace(first, **{name: together([getattr(scene, name) for scene in scenes]) for name in groups})
