"""Principal planes of wires, and their static stiffness against bending and twisting."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements import resting
from suspension_cli.rotations import cross
from suspension_cli.scene.composition import Fibre, Section
from suspension_cli.scene.scene import Flex, Scene

if TYPE_CHECKING:
    from jaxtyping import Inexact


def principal_planes(
    plane: Inexact[np.ndarray, "*wire 3"], clamp: Inexact[np.ndarray, "*wire 3"]
) -> Inexact[np.ndarray, "*wire 2 3"]:
    """Unit vectors (..., 2, 3) of both principal planes, across a clamp (..., 3)."""
    first = plane - (plane * clamp).sum(-1, keepdims=True) * clamp
    first = first / np.sqrt((first**2).sum(-1, keepdims=True))
    return np.stack([first, cross(clamp, first)], axis=-2)


def with_planes(scene: Scene) -> Scene:
    """Fill `flex` of a scene with the principal planes of its wires, without stiffness."""
    assert scene.fibres is not None
    planes = np.array([fibre.plane for fibre in scene.fibres.wire]).reshape(-1, 3)
    clamps = np.array([fibre.clamp for fibre in scene.fibres.wire]).reshape(-1, 2, 3)
    upper, lower = (principal_planes(planes, clamps[:, end]) for end in (0, 1))
    bend, twist = np.zeros((len(planes), 2, 3)), np.zeros(len(planes))
    return replace(scene, flex=Flex(upper, lower, bend, twist))


def wire_resistance(scene: Scene) -> Flex | None:
    """Bending and torsional stiffness of wires, or the given torsion of strings; or None."""
    wires = scene.wires
    if scene.flex is not None or not wires.torsion.any():
        return scene.flex
    along = wires.span / wires.length[..., None]
    across = np.where(
        np.abs(along[..., :1]) < 0.9, np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    )
    planes = principal_planes(across, along)
    return Flex(planes, planes, None, wires.torsion)


def resistance(
    fibres: tuple[Fibre, ...],
    length: Inexact[np.ndarray, "wire build"],
    tension: Inexact[np.ndarray, "wire build"],
    torsion: Inexact[np.ndarray, "wire build"],
) -> tuple[Inexact[np.ndarray, "2 3 wire build"], Inexact[np.ndarray, "wire build"]]:
    """Stiffness of wires against slopes in both planes, and against twist, see `resting`."""
    shape, dtype = length.shape, np.result_type(length, tension, torsion)
    bend, twist = np.empty((2, 3, *shape), dtype=dtype), np.empty(shape, dtype=dtype)
    for sections, which in _alike(tuple(fibre.sections for fibre in fibres)):
        own = (number[which] for number in (length, tension, torsion))
        bend[:, :, which], twist[which] = resting.resistance(sections, *own)
    return bend, twist


@lru_cache(maxsize=64)
def _alike(
    sections: tuple[tuple[Section, ...], ...],
) -> list[tuple[tuple[Section, ...], list[int]]]:
    """Wires of equal sections."""
    return [
        (own, [n for n, other in enumerate(sections) if other == own])
        for own in dict.fromkeys(sections)
    ]
