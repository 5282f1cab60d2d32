"""First-order estimates of what wire bending and wire mass change, from the modes on strings.

By Rayleigh's principle a small addition of energy to a mode v of unit modal mass changes its
frequency by

    d omega / omega = (v^T dK v / omega^2 - v^T dM v) / 2.

Bending. A clamped wire under tension T acts like a hinge of stiffness sqrt(T EI) at the distance u
= sqrt(EI / T) from its clamp (Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)), turned by
the angle between the clamp and the line from end to end. Torsion has the stiffness (G J + T I_p /
A) / l; where the design gives it, strings have it already. Where the design gives the effective
bending points, the remaining stiffness is EI / l (in a ribbon's stiff plane, plus the difference of
the two hinges). Bending brings loss: a fraction phi of the energy of stretching and twisting, and
phi / 2 of that of hinges, as these go with sqrt(EI).

Mass. A wire whose ends move by a and b is a straight line in between, with the kinetic energy m
(a^2 + a.b + b^2) / 6 (any text on finite elements), if the frequency f is far below its first
violin mode f1. Held above and moved below, its force is k L / sin(k L) times that of a massless
wire, k L = pi f / f1, so the straight line neglects (pi f / f1)^2 / 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.elements import loss
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models.wire_mass import first_violin_of
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import Fibre
from suspension_cli.scene.fibres import compose, explain_unsuitable
from suspension_cli.scene.scene import Scene

CURVED = np.pi**2 / 6
"""Relative change of a wire's force by its mass, over (f / f1)^2."""
FAR = 0.5
"""Largest (f / f1)^2 at which a wire is about a straight line; above it nothing is estimated."""
RANGE = 2 * np.pi * np.geomspace(0.1, 1e4, 6)
"""Angular frequencies at which loss angles are evaluated; the largest is used."""


@dataclass(frozen=True)
class Estimates:
    """Relative changes by the wires of each stage (s), for each mode (m).

    Attributes
    ----------
    stage : tuple of str
        Stages that hang on wires.
    bending, mass : (m, s) arrays
        Of the mode's frequency. Infinite for a mode without restoring force on strings; NaN where
        the design lacks the wires' properties.
    loss : (m, s) array
        Imaginary part of the relative change of omega^2 that comes with bending.
    violin : (s,) array
        The lowest first violin mode of each stage's wires, Hz; infinite for wires without mass.
    """

    stage: tuple[str, ...]
    bending: Array
    mass: Array
    loss: Array
    violin: Array

    def curved(self, highest: float) -> Array:
        """Relative change (s,) of each stage's wire force by wire mass, at a frequency in Hz."""
        near = (highest / np.maximum(self.violin, 1e-150)) ** 2
        return np.where(near < FAR, CURVED * near, np.inf)


def estimates(design: Design, found: Modes) -> Estimates:
    """Estimate the changes by wire bending and wire mass from the modes of a model without them."""
    scene = expand(design)
    wires = scene.wires
    hung = [n for n in range(len(design.stage)) if (wires.lower == n + 1).any()]
    shape = (len(found.omega_squared), len(hung))
    unknown = {
        massive: bool(explain_unsuitable(design, massive=massive)) for massive in (False, True)
    }
    bending, mass, lossy, violin = (
        *(np.full(shape, np.nan) for _ in range(3)),
        np.full(len(hung), np.nan),
    )
    made = () if unknown[False] else compose(design).wire
    if made:
        motion = _EndMotion(scene, found)
        stored, lost = motion.bending_energy(made)
        first = np.array(
            [first_violin_of(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)]
        )
        near = np.abs(found.omega_squared)[:, None] / (2 * np.pi * np.maximum(first, 1e-150)) ** 2
        kinetic = motion.kinetic_energy(
            np.array([sum(s.mass * s.length for s in fibre.sections) for fibre in made])
        )
        heavy = np.where(
            near < FAR, kinetic / 2 * (1 + CURVED * near), np.where(kinetic > 0, np.inf, 0.0)
        )
        for column, n in enumerate(hung):
            here = wires.lower == n + 1
            bending[:, column] = _over(stored[:, here].sum(1) / 2, found.omega_squared)
            lossy[:, column] = _over(lost[:, here].sum(1), found.omega_squared)
            if not unknown[True]:
                mass[:, column] = heavy[:, here].sum(1)
                violin[column] = first[here].min()
    return Estimates(tuple(design.stage[n].name for n in hung), bending, mass, lossy, violin)


def _over(energy: Any, omega_squared: Any) -> Any:
    """Energy as a fraction of that of each mode (m,); 0 if both are 0."""
    stored = np.abs(omega_squared)
    return np.where(
        stored > 0, energy / np.where(stored > 0, stored, 1.0), np.where(energy > 0, np.inf, 0.0)
    )


class _EndMotion:
    """Motion of the ends of all wires in each mode: (m, w, 3)."""

    def __init__(self, scene: Scene, found: Modes) -> None:
        wires, count = scene.wires, 6 * len(found.body)
        moves = np.concatenate(
            [np.zeros((len(found.shape), 6)), found.shape[:, :count]], axis=1
        ).reshape(len(found.shape), -1, 6)
        self.wires = wires
        self.along = wires.span / wires.length[:, None]
        self.turn = tuple(moves[:, body, 3:] for body in (wires.upper, wires.lower))
        points = (wires.upper_point, wires.lower_point)
        self.move = tuple(
            moves[:, body, :3] + np.cross(turn, point)
            for body, turn, point in zip((wires.upper, wires.lower), self.turn, points, strict=True)
        )

    def bending_energy(self, made: tuple[Fibre, ...]) -> tuple[Any, Any]:
        """v^T dK v (m, w) of bending and twisting, and its imaginary part with stretching's."""
        wires = self.wires
        chord = (self.move[1] - self.move[0]) / wires.length[:, None]
        stretched = (chord * self.along).sum(-1) * wires.length
        twisted = ((self.turn[1] - self.turn[0]) * self.along).sum(-1)
        angle = np.array(
            [_angles(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)]
        ).T
        torsion, sheared = (
            np.array([_torsion(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)])
            .reshape(-1, 2)
            .T
        )
        given = wires.torsion > 0
        stored = np.where(given, 0.0, torsion) * twisted**2
        twist_lost = np.where(
            given,
            np.abs(angle[2] * sheared - wires.loss) * wires.torsion,
            angle[2] * sheared * torsion,
        )
        lost = (
            twist_lost * twisted**2 + np.abs(angle[1] - wires.loss) * wires.stiffness * stretched**2
        )
        for end, turn in enumerate(self.turn):
            slope = np.cross(turn, self.along) - chord
            across = (slope**2).sum(-1) - (slope * self.along).sum(-1) ** 2
            whole, extra = np.array(
                [
                    _hinge(made[w], end, float(wires.tension[w]), float(wires.length[w]))
                    for w in range(len(made))
                ]
            ).T
            stored = stored + extra * across
            lost = lost + angle[0] / 2 * whole * across
        return stored, lost

    def kinetic_energy(self, mass: Any) -> Any:
        """v^T dM v (m, w) of the mass (w,) of wires."""
        a, b = self.move
        return mass / 3 * (a**2 + a * b + b**2).sum(-1)


def _hinge(fibre: Fibre, end: int, tension: float, length: float) -> tuple[float, float]:
    """Stiffness of a wire's end against turning, N m/rad, and the part of it that strings lack."""
    tension = max(tension, 0.0)
    section = fibre.sections[-end]
    stiff, soft = (
        float(np.sqrt(tension * rigidity))
        for rigidity in (max(section.rigidity), section.rigidity[0])
    )
    if not fibre.effective:
        return stiff, stiff
    return stiff, stiff - soft + section.rigidity[0] / length


def _torsion(fibre: Fibre, tension: float) -> tuple[float, float]:
    """Torsional stiffness of a wire, N m/rad, and the fraction of its energy that is in shear."""
    whole = [
        (section, section.twisting + max(tension, 0.0) * section.polar_area)
        for section in fibre.sections
    ]
    compliance = sum(section.length / stiff for section, stiff in whole)
    return 1 / compliance, sum(
        section.length * section.twisting / stiff**2 for section, stiff in whole
    ) / compliance


def _angles(fibre: Fibre, tension: float) -> tuple[float, float, float]:
    """Largest loss angles of bending, stretching and twisting of any section, rad."""
    kinds = (
        lambda s: loss.bending_angle(s, 0, RANGE, tension, max(fibre.temperature)),
        lambda s: loss.stretching_angle(s, RANGE),
        lambda s: loss.twisting_angle(s, RANGE),
    )
    each = [max(float(np.max(kind(section))) for section in fibre.sections) for kind in kinds]
    return each[0], each[1], each[2]
