"""Stress of wires and blades as a fraction of their strength, and depth of bodies.

The stress of a wire under tension T is T/A at its smallest cross-section A. That of a blade is the
bending stress at its base, moment F L over section modulus b h^2/6: 6 F L/(b h^2) for load F at the
tip, length L, width b at the base, thickness h and any taper (Torrie, PhD thesis, University of
Glasgow (2001)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.sections import thinnest
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet
from suspension_cli.elements import string
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Part:
    """A wire or blade; one stands for all of a perfect symmetric set.

    Attributes
    ----------
    member, place : int
        Number in the stage and in the scene, from 0.
    missing : str
        Key that the design lacks to give the stress; "" if none.
    """

    stage: str
    blade: bool
    member: int
    place: int
    label: str
    missing: str


def parts(design: Design) -> list[Part]:
    """List the wires and blades of a design."""
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
                missing = (_unknown_blade if kind else _unknown_wire)(
                    design, whole or single[n], key
                )
                found.append(Part(stage.name, bool(kind), n, before[kind] + n, label, missing))
            before[kind] += count
    return found


def _tables(stage: Stage, blade: bool) -> tuple[Any, list[Any]]:
    """Symmetric set of a stage, and its single wires or blades."""
    return (stage.blades, stage.blade) if blade else (stage.wires, stage.wire)


def _unknown_wire(design: Design, wire: WireSet | Wire, key: str) -> str:
    if thinnest(wire) is None:
        return f"{key}.radius"
    return _unknown_strength(design, _materials(wire), key)


def _unknown_blade(design: Design, blade: BladeSet | Blade, key: str) -> str:
    return (
        f"{key}.geometry"
        if blade.geometry is None
        else _unknown_strength(design, {blade.geometry.material}, key)
    )


def _unknown_strength(design: Design, names: set[str], key: str) -> str:
    for name in sorted(names):
        if materials.resolve(design, name).tensile_strength is None:
            return f"materials.{name}.tensile_strength"
    return "" if names else f"{key}.material"


def _materials(wire: WireSet | Wire) -> set[str]:
    named = [wire.material, *(piece.material for piece in wire.sections or ())]
    return {name for name in named if name}


def _strength(design: Design, names: set[str]) -> float:
    known = [materials.resolve(design, name).tensile_strength or np.nan for name in sorted(names)]
    return min(known)


def force(scene: Scene, pose: Pose, part: Part) -> Float[np.ndarray, "*batch"]:
    """Compute the tension of a wire, or the load of a blade, in a pose, N."""
    n = part.place
    if part.blade:
        blades = scene.blades
        return blades.load[..., n, 2] - blades.stiffness[..., n, 2] * pose.deflection[..., n, 2]
    return string.state(scene, pose).tension[..., n]


def stress_per_force(design: Design, part: Part) -> float:
    """Compute the stress of a part over its tensile strength, per newton; NaN if unknown."""
    stage = next(item for item in design.stage if item.name == part.stage)
    whole, single = _tables(stage, part.blade)
    table = whole or single[part.member]
    if part.blade:
        shape = table.geometry
        section = shape.base_width * shape.thickness**2
        return 6 * shape.length / section / _strength(design, {shape.material})
    area = thinnest(table)
    return np.nan if area is None else 1 / area / _strength(design, _materials(table))


def stress(design: Design, scene: Scene, pose: Pose, part: Part) -> float:
    """Compute the stress of a part over its tensile strength in a pose; NaN if unknown."""
    return float(force(scene, pose, part) * stress_per_force(design, part))


def depth(scene: Scene, pose: Pose, stage: str) -> Float[np.ndarray, "*batch"]:
    """Compute the depth of the COM of a stage below the suspension point, m."""
    n = scene.bodies.name.index(stage) + 1
    return -(scene.bodies.position[..., n, 2] + pose.shift[..., n, 2])
