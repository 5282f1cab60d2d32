"""What the refinements of a model would change, from the modes of the simplest one: to first order, before any of them is built.

By Rayleigh's principle a small addition of energy to a mode v of unit modal mass changes its frequency by

    d omega / omega = (v^T dK v / omega^2 - v^T dM v) / 2.

Bending.  A clamped wire under tension T pushes back like a hinge of stiffness sqrt(T EI) at the distance u = sqrt(EI / T) from its clamp (Gonzalez and
Saulson, J. Acoust. Soc. Am. 96, 207 (1994)), which the angle turns between the clamp and the line from end to end; a twist takes
(G J + T I_p / A) / l, unless the design gives the torsion, which is there already.  Where a design tells the points at which wires seem to bend, what
is left of it is smaller by u / l (and, in a ribbon's stiff plane, by how much stiffer that is).
With bending comes loss: a share phi of what is stored in stretching and twisting, phi / 2 of what is stored in hinges, as these go with sqrt(EI).

Mass.  A wire whose ends move by a and b moves between them as a straight line: m (a^2 + a.b + b^2) / 6 of kinetic energy (any text on finite
elements), as long as the frequency is far below its first violin mode f1; held above and moved below, it answers with k L / sin(k L) times its tension,
k L = pi f / f1, so (pi f / f1)^2 / 6 is what that straight line leaves out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis.modes import Modes
from suspension_cli.design.fibres import Fibre, fibres, unsuited
from suspension_cli.design.scene import Array, Scene
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import loss
from suspension_cli.mechanics.nominal import expand
from suspension_cli.models.wire_mass import first_violin_of

SERIES, BENDING, MASS = "blades as coordinates", "bending and torsion of wires", "mass of wires"
REFINEMENTS = {SERIES: "string", BENDING: "beam", MASS: "violin"}
"""What the rungs of the ladder add, and the rung that has it."""
CURVED = np.pi**2 / 6
"""Relative change of a wire's pull by its mass, over (f / f1)^2."""
FAR = 0.5
"""Of (f / f1)^2; above it a wire is no straight line, and nothing is estimated."""
RANGE = 2 * np.pi * np.geomspace(0.1, 1e4, 6)
"""Angular frequencies at which loss angles are looked up; the largest counts."""


@dataclass(frozen=True)
class Estimates:
    """Relative changes by the wires of each stage (s), for each mode (m).

    Attributes
    ----------
    stage : tuple of str
        Stages that hang on wires.
    bending, mass : (m, s) arrays
        Of its frequency.  Infinite for a mode that costs nothing without; NaN where the design does not say enough.
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
        """What the mass of each stage's wires changes of their pull at a frequency (Hz): (s,)."""
        near = (highest / np.maximum(self.violin, 1e-150)) ** 2
        return np.where(near < FAR, CURVED * near, np.inf)


def estimates(design: Design, found: Modes) -> Estimates:
    """What bending and mass of wires would change, from the modes of a model without them."""
    scene = expand(design)
    wires = scene.wires
    hung = [n for n in range(len(design.stage)) if (wires.lower == n + 1).any()]
    shape = (len(found.omega_squared), len(hung))
    unknown = {massive: bool(unsuited(design, massive=massive)) for massive in (False, True)}
    bending, mass, lossy, violin = (*(np.full(shape, np.nan) for _ in range(3)), np.full(len(hung), np.nan))
    made = () if unknown[False] else fibres(design).wire
    if made:
        moved = _Moved(scene, found)
        stored, lost = moved.bent(made)
        first = np.array([first_violin_of(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)])
        near = np.abs(found.omega_squared)[:, None] / (2 * np.pi * np.maximum(first, 1e-150)) ** 2
        carried = moved.carried(np.array([sum(s.mass * s.length for s in fibre.sections) for fibre in made]))
        heavy = np.where(near < FAR, carried / 2 * (1 + CURVED * near), np.where(carried > 0, np.inf, 0.0))
        for column, n in enumerate(hung):
            here = wires.lower == n + 1
            bending[:, column] = _over(stored[:, here].sum(1) / 2, found.omega_squared)
            lossy[:, column] = _over(lost[:, here].sum(1), found.omega_squared)
            if not unknown[True]:
                mass[:, column] = heavy[:, here].sum(1)
                violin[column] = first[here].min()
    return Estimates(tuple(design.stage[n].name for n in hung), bending, mass, lossy, violin)


def _over(energy: Any, omega_squared: Any) -> Any:
    """A share of what each mode (m,) stores; nothing of nothing is nothing."""
    stored = np.abs(omega_squared)
    return np.where(stored > 0, energy / np.where(stored > 0, stored, 1.0), np.where(energy > 0, np.inf, 0.0))


class _Moved:
    """How the ends of all wires move in each mode: (m, w, 3)."""

    def __init__(self, scene: Scene, found: Modes) -> None:
        wires, count = scene.wires, 6 * len(found.body)
        moves = np.concatenate([np.zeros((len(found.shape), 6)), found.shape[:, :count]], axis=1).reshape(len(found.shape), -1, 6)
        self.wires = wires
        self.along = wires.span / wires.length[:, None]
        self.turn = tuple(moves[:, body, 3:] for body in (wires.upper, wires.lower))
        points = (wires.upper_point, wires.lower_point)
        self.move = tuple(moves[:, body, :3] + np.cross(turn, point) for body, turn, point in zip((wires.upper, wires.lower), self.turn, points, strict=True))

    def bent(self, made: tuple[Fibre, ...]) -> tuple[Any, Any]:
        """v^T dK v of bending and twisting, and its lossy part with that of stretching: (m, w) each."""
        wires = self.wires
        chord = (self.move[1] - self.move[0]) / wires.length[:, None]
        stretched = (chord * self.along).sum(-1) * wires.length
        twisted = ((self.turn[1] - self.turn[0]) * self.along).sum(-1)
        angle = np.array([_angles(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)]).T
        torsion, sheared = np.array([_torsion(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)]).reshape(-1, 2).T
        given = wires.torsion > 0
        stored = np.where(given, 0.0, torsion) * twisted**2
        twist_lost = np.where(given, np.abs(angle[2] * sheared - wires.loss) * wires.torsion, angle[2] * sheared * torsion)
        lost = twist_lost * twisted**2 + np.abs(angle[1] - wires.loss) * wires.stiffness * stretched**2
        for end, turn in enumerate(self.turn):
            slope = np.cross(turn, self.along) - chord
            bent = (slope**2).sum(-1) - (slope * self.along).sum(-1) ** 2
            whole, left = np.array([_hinge(made[w], end, float(wires.tension[w]), float(wires.length[w])) for w in range(len(made))]).T
            stored = stored + left * bent
            lost = lost + angle[0] / 2 * whole * bent
        return stored, lost

    def carried(self, mass: Any) -> Any:
        """v^T dM v (m, w) of the mass (w,) of wires."""
        a, b = self.move
        return mass / 3 * (a**2 + a * b + b**2).sum(-1)


def _hinge(fibre: Fibre, end: int, tension: float, length: float) -> tuple[float, float]:
    """Stiffness of a wire's end against turning, N m/rad, and what of it a string does not have."""
    tension = max(tension, 0.0)
    section = fibre.sections[-end]
    stiff, soft = (float(np.sqrt(tension * rigidity)) for rigidity in (max(section.rigidity), section.rigidity[0]))
    if not fibre.effective:
        return stiff, stiff
    return stiff, stiff - soft + section.rigidity[0] / length


def _torsion(fibre: Fibre, tension: float) -> tuple[float, float]:
    """Torsional stiffness of a wire, N m/rad, and the share of its energy that is in shear."""
    whole = [(section, section.twisting + max(tension, 0.0) * section.polar_area) for section in fibre.sections]
    compliance = sum(section.length / stiff for section, stiff in whole)
    return 1 / compliance, sum(section.length * section.twisting / stiff**2 for section, stiff in whole) / compliance


def _angles(fibre: Fibre, tension: float) -> tuple[float, float, float]:
    """The largest loss angles of bending, stretching and twisting of any section."""
    kinds = (
        lambda s: loss.bending_angle(s, 0, RANGE, tension, max(fibre.temperature)),
        lambda s: loss.stretching_angle(s, RANGE),
        lambda s: loss.twisting_angle(s, RANGE),
    )
    each = [max(float(np.max(kind(section))) for section in fibre.sections) for kind in kinds]
    return each[0], each[1], each[2]
