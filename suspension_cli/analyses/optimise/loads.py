"""Stress of wires and blades as a fraction of their strength, and depth of bodies.

The stress of a wire under tension T is T/A at its smallest cross-section A. A cantilever of length
L, width b at its base and thickness h with the load F at its tip has its largest bending stress at
the base: moment F L over section modulus b h^2/6, so 6 F L/(b h^2) for any taper (any text on
beams; Torrie, PhD thesis, University of Glasgow (2001), for these blades). All functions accept
complex numbers, for derivatives by complex steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design import materials
from suspension_cli.design.schema import Design, Stage
from suspension_cli.design.sections import thinnest
from suspension_cli.design.wires import Blade, BladeSet, Wire, WireSet
from suspension_cli.elements import string
from suspension_cli.scene.pose import Pose
from suspension_cli.scene.scene import Scene


@dataclass(frozen=True)
class Part:
    """A wire or blade; one represents all of a perfect symmetric set.

    Attributes
    ----------
    stage : str
    blade : bool
        Whether it is a blade.
    member : int
        Number in the stage, from 0.
    place : int
        Number in the scene, from 0.
    label : str
        Name to print.
    missing : str
        Key that the design must give for the stress to be known; "" if it is known.
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
    """Return the symmetric set of a stage, and its single wires or blades."""
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
    """Name the materials of a wire and its sections."""
    named = [wire.material, *(piece.material for piece in wire.sections or ())]
    return {name for name in named if name}


def _strength(design: Design, names: set[str]) -> complex:
    known = [materials.resolve(design, name).tensile_strength or np.nan for name in sorted(names)]
    return min(known, key=np.real)


def stress(design: Design, scene: Scene, pose: Pose, part: Part) -> complex:
    """Compute the stress of a part as a fraction of its tensile strength, NaN if that is unknown.

    Parameters
    ----------
    design : Design
    scene : Scene
    pose : Pose
        Equilibrium of the design.
    part : Part
    """
    stage = next(item for item in design.stage if item.name == part.stage)
    whole, single = _tables(stage, part.blade)
    table, n = whole or single[part.member], part.place
    if part.blade:
        shape = table.geometry
        load = scene.blades.load[n, 2] - scene.blades.stiffness[n, 2] * pose.deflection[n, 2]
        return (
            6
            * load
            * shape.length
            / (shape.base_width * shape.thickness**2)
            / _strength(design, {shape.material})
        )
    return (
        string.state(scene, pose).tension[n]
        / thinnest(table)
        / _strength(design, _materials(table))
    )


def depth(scene: Scene, pose: Pose, stage: str) -> complex:
    """Compute the depth of the COM of a stage below the suspension point, m."""
    n = scene.bodies.name.index(stage) + 1
    return -(scene.bodies.position[n, 2] + pose.shift[n, 2])
