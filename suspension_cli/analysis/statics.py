"""What a suspension carries where it hangs: tensions, stretch, stress, and how far imperfections moved it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.expand import expand
from suspension_cli.design.schema import Design
from suspension_cli.design.sections import thinnest
from suspension_cli.mechanics.equilibrium import solve as balance


@dataclass(frozen=True)
class WireLoad:
    """One wire: tension in N, stretch in m, stress in Pa (None where only k is known)."""

    label: str
    tension: float
    stretch: float
    stress: float | None


@dataclass(frozen=True)
class BodyPose:
    """Where one body hangs, from its nominal pose: m and rad."""

    name: str
    shift: tuple[float, float, float]
    rotation: tuple[float, float, float]


@dataclass(frozen=True)
class Carried:
    """The static answer for one design; `residual` is a share of the weight."""

    wires: tuple[WireLoad, ...]
    bodies: tuple[BodyPose, ...]
    residual: float


def solve(design: Design) -> Carried:
    """Solve the equilibrium of a design.

    Raises
    ------
    InputError
        If it cannot balance or a wire is slack.
    """
    scene = expand(design)
    balanced = balance(scene)
    balanced.demand(scene)
    sections = [w and thinnest(w) for stage in design.stage for w in (stage.wire or [stage.wires] * (stage.wires.count if stage.wires else 0))]
    wires = tuple(
        WireLoad(label, float(tension), float(tension / k), float(tension / section) if section else None)
        for label, tension, k, section in zip(scene.wires.label, balanced.tension, scene.wires.stiffness, sections, strict=True)
    )
    bodies = tuple(
        BodyPose(name, _vector(balanced.pose.shift[n]), _vector(_axis_angle(balanced.pose.rotation[n]))) for n, name in enumerate(scene.bodies.name, 1)
    )
    return Carried(wires, bodies, float(balanced.residual))


def _axis_angle(rotation: np.ndarray) -> np.ndarray:
    """Rotation vector of a rotation matrix (by less than pi), rad."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]) / 2
    sine = np.sqrt((skew**2).sum())
    angle = np.arctan2(sine, (np.trace(rotation) - 1) / 2)
    return skew * (angle / sine if sine > 0 else 1.0)


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    return (float(values[0]), float(values[1]), float(values[2]))
