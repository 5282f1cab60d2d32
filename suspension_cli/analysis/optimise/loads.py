"""What wires and blades carry, as a share of what breaks them, and how deep bodies hang; also with complex steps.

A wire of cross-section A under tension T is strained by T/A where it is thinnest.  A cantilever of length L, width b at its base and thickness h with
the load F at its tip has its largest bending stress at the base: moment F L over section modulus b h^2/6, so 6 F L/(b h^2), whatever its taper (any text
on beams; Torrie, PhD thesis, University of Glasgow (2001), for these blades).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.scene import Scene
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.sections import thinnest
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet
from suspension_cli.mechanics import string
from suspension_cli.mechanics.pose import Pose


@dataclass(frozen=True)
class Part:
    """A wire or blade; of a symmetric set that is built as drawn, one stands for all.

    Attributes
    ----------
    stage : str
    blade : bool
        Whether it is a blade.
    member : int
        Which one of the stage's, from 0.
    place : int
        Which one of the scene's.
    label : str
    missing : str
        Key that the design would have to give for its stress to be known; "" if it is known.
    """

    stage: str
    blade: bool
    member: int
    place: int
    label: str
    missing: str


def parts(design: Design) -> list[Part]:
    """All wires and blades of a design."""
    found: list[Part] = []
    before = [0, 0]
    for stage in design.stage:
        for kind, word in enumerate(("wire", "blade")):
            whole, single = _tables(stage, bool(kind))
            count = len(single) if whole is None else whole.count
            alike = whole is not None and not design.perturbation
            for n in range(1 if alike else count):
                name = n + 1 if whole is not None or not kind else single[n].name
                label = f"{stage.name} {word}s" if alike else f"{word} {stage.name}.{name}"
                key = f"stage.{stage.name}.{word}" + ("s" if whole is not None else f".{name}")
                missing = (_unknown_blade if kind else _unknown_wire)(design, whole or single[n], key)
                found.append(Part(stage.name, bool(kind), n, before[kind] + n, label, missing))
            before[kind] += count
    return found


def _tables(stage: Stage, blade: bool) -> tuple[Any, list[Any]]:
    """The symmetric set of a stage, and its single wires or blades."""
    return (stage.blades, stage.blade) if blade else (stage.wires, stage.wire)


def _unknown_wire(design: Design, wire: WireSet | Wire, key: str) -> str:
    if thinnest(wire) is None:
        return f"{key}.radius"
    return _unknown_strength(design, _weakest(design, wire), key)


def _unknown_blade(design: Design, blade: BladeSet | Blade, key: str) -> str:
    return f"{key}.geometry" if blade.geometry is None else _unknown_strength(design, {blade.geometry.material}, key)


def _unknown_strength(design: Design, names: set[str], key: str) -> str:
    for name in sorted(names):
        if materials.resolve(design, name).tensile_strength is None:
            return f"materials.{name}.tensile_strength"
    return "" if names else f"{key}.material"


def _weakest(design: Design, wire: WireSet | Wire) -> set[str]:
    """Materials of a wire."""
    own = {wire.material} if wire.material else set()
    return own if wire.sections is None else {piece.material for piece in wire.sections if piece.material} | own


def _strength(design: Design, names: set[str]) -> Any:
    known = [materials.resolve(design, name).tensile_strength or np.nan for name in sorted(names)]
    return min(known, key=np.real)


def stress(design: Design, scene: Scene, pose: Pose, part: Part) -> Any:
    """Stress as a share of what breaks the part, where that is known.

    Parameters
    ----------
    design : Design
        Whose numbers the part's are read from.
    scene, pose
        Of that design.
    part : Part
    """
    stage = next(item for item in design.stage if item.name == part.stage)
    whole, single = _tables(stage, part.blade)
    table, n = whole or single[part.member], part.place
    if part.blade:
        shape = table.geometry
        load = scene.blades.load[n, 2] - scene.blades.stiffness[n, 2] * pose.deflection[n, 2]
        return 6 * load * shape.length / (shape.base_width * shape.thickness**2) / _strength(design, {shape.material})
    return string.state(scene, pose).tension[n] / thinnest(table) / _strength(design, _weakest(design, table))


def depth(scene: Scene, pose: Pose, stage: str) -> Any:
    """How far below the suspension point the COM of a stage hangs, m."""
    n = scene.bodies.name.index(stage) + 1
    return -(scene.bodies.position[n, 2] + pose.shift[n, 2])
