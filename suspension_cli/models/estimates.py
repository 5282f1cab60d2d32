"""Upper estimates of what wire bending and wire mass change, from the modes on strings.

By Rayleigh's principle small additions dK and dM change omega^2 = lambda of the mode v_i of unit
modal mass by A_ii = v_i^T (dK - lambda_i dM) v_i. Another mode v_j at the distance D = |lambda_i -
lambda_j| adds at most

    2 A_ij^2 / (D + sqrt(D^2 + 4 A_ij^2)),

by which two coupled levels repel each other (Landau and Lifshitz, Quantum Mechanics, section 79).
The sum of all these over 2 lambda_i is the relative change of the frequency.

Bending. A clamped wire under tension T acts like a hinge of stiffness sqrt(T EI) at the distance u
= sqrt(EI / T) from its clamp (Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)), turned by
the angle between the clamp and the line from end to end. For a wire of length l bent like an S by
two parallel clamps, which is the stiffer case, the stiffness is exactly

    T u t / (1 - 2 u t / l),    t = tanh(l / 2u),

by the deflection of a beam under tension. Torsion has the stiffness (G J + T I_p / A) / l; where
the design gives it, strings have it already. Where the design gives the effective bending points,
the remaining stiffness is EI / l (in a ribbon's stiff plane, plus the difference of the two
hinges). Bending brings loss: a fraction phi of the energy of stretching and twisting, and phi / 2
of that of hinges, as these go with sqrt(EI).

Mass. A wire whose ends move by a and b is a straight line in between, with the kinetic energy m
(a^2 + a.b + b^2) / 6 (any text on finite elements), if the frequency f is far below its first
violin mode f1; see `wire_mass` for where its ends are. Held above and moved below, its force is k L
/ sin(k L) times that of a massless wire, k L = pi f / f1, so the straight line neglects (pi f /
f1)^2 / 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.elements import loss
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models.wire_mass import FORCE, first_violin_of, hinge_distance
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import Fibre
from suspension_cli.scene.fibres import compose, explain_unsuitable
from suspension_cli.scene.scene import Scene

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
        return np.where(near < FAR, FORCE * near, np.inf)


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
        motion = _EndMotion(scene, found, made)
        groups = [wires.lower == n + 1 for n in hung]
        energy, lost = motion.bending_energy(made)
        stored = [sum(part[:, here] @ part[:, here].T for part in energy) for here in groups]
        bending = _over(_with_repulsion(stored, found) / 2, found.omega_squared)
        lossy = _over(
            np.stack([lost[:, here].sum(1) for here in groups], axis=1), found.omega_squared
        )
        if not unknown[True]:
            first = np.array(
                [first_violin_of(fibre, float(wires.tension[w])) for w, fibre in enumerate(made)]
            )
            violin = np.array([first[here].min() for here in groups])
            near = (
                np.abs(found.omega_squared)[:, None] / (2 * np.pi * np.maximum(violin, 1e-150)) ** 2
            )
            held = np.array([sum(s.mass * s.length for s in fibre.sections) for fibre in made])
            moved = [motion.kinetic_energy(held, here) for here in groups]
            kinetic = _with_repulsion(moved, found, found.omega_squared)
            mass = np.where(
                near < FAR, kinetic / 2 * (1 + FORCE * near), np.where(kinetic > 0, np.inf, 0.0)
            )
    return Estimates(tuple(design.stage[n].name for n in hung), bending, mass, lossy, violin)


def _over(energy: Any, omega_squared: Any) -> Any:
    """Energy (m, s) as a fraction of that of each mode (m,); 0 if both are 0."""
    stored = np.abs(omega_squared)[:, None]
    return np.where(
        stored > 0, energy / np.where(stored > 0, stored, 1.0), np.where(energy > 0, np.inf, 0.0)
    )


def repulsion(coupling: Any, distance: Any) -> Any:
    """Change of one of two coupled levels: 2 A^2 / (D + sqrt(D^2 + 4 A^2)).

    >>> float(repulsion(2.0, 3.0))
    1.0
    """
    apart = np.abs(distance)
    both = apart + np.sqrt(apart**2 + 4 * coupling**2)
    return 2 * coupling**2 / np.where(both > 0, both, 1.0)


def _with_repulsion(parts: list[Any], found: Modes, scale: Any = None) -> Any:
    """Diagonals (m, s) of matrices (m, m), one per stage, raised by what modes add to each other.

    With `scale` (m,), the matrices are fractions of that part of omega^2.
    """
    diagonal = np.stack([part.diagonal() for part in parts], axis=1)
    size = np.ones(len(diagonal)) if scale is None else np.abs(scale)
    coupling = size[:, None] * sum(parts)
    np.fill_diagonal(coupling, 0.0)
    apart = np.subtract.outer(found.omega_squared, found.omega_squared)
    added = repulsion(coupling, apart).sum(1) / np.where(size > 0, size, 1.0)
    total = diagonal.sum(1)
    return diagonal * (1 + added / np.where(total > 0, total, 1.0))[:, None]


class _EndMotion:
    """Motion of the ends of all wires in each mode: (m, w, 3)."""

    def __init__(self, scene: Scene, found: Modes, made: tuple[Fibre, ...]) -> None:
        wires, count = scene.wires, 6 * len(found.body)
        moves = np.concatenate(
            [np.zeros((len(found.shape), 6)), found.shape[:, :count]], axis=1
        ).reshape(len(found.shape), -1, 6)
        self.wires = wires
        self.along = wires.span / wires.length[:, None]
        self.turn = tuple(moves[:, body, 3:] for body in (wires.upper, wires.lower))
        reach = np.array(
            [hinge_distance(one, float(wires.tension[w])) for w, one in enumerate(made)]
        )
        self.reach = reach[:, None] * self.along
        points = (wires.upper_point, wires.lower_point)
        self.move = tuple(
            moves[:, body, :3] + np.cross(turn, point)
            for body, turn, point in zip((wires.upper, wires.lower), self.turn, points, strict=True)
        )
        self._move_tips(scene, found)

    def _move_tips(self, scene: Scene, found: Modes) -> None:
        """Add the motion of blade tips to that of upper ends.

        Where blades are in series with wires, a tip follows the stretching force F of its wires by
        F / k_blade.
        """
        wires, blades = scene.wires, scene.blades
        stretched = ((self.move[1] - self.move[0]) * self.along).sum(-1)
        for w in np.flatnonzero(wires.blade >= 0).tolist():
            blade = int(wires.blade[w])
            for axis in np.flatnonzero(blades.axes[blade]).tolist():
                name = f"{blades.label[blade]}.{DOFS[axis]}"
                if name in found.coordinate:
                    self.move[0][:, w, axis] += found.shape[:, found.coordinate.index(name)]
                    continue
                slope, spring = self.along[w, axis], float(blades.stiffness[blade, axis])
                on_it = int((wires.blade == blade).sum())
                series = 1 / (1 / wires.stiffness[w] + on_it * slope**2 / spring)
                self.move[0][:, w, axis] += on_it * slope * series / spring * stretched[:, w]

    def bending_energy(self, made: tuple[Fibre, ...]) -> tuple[list[Any], Any]:
        """Bending and twisting of all wires, and the imaginary part with that of stretching.

        Returns
        -------
        parts : list of (m, w) arrays
            Whose squares sum to v^T dK v.
        lost : (m, w) array
        """
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
        parts = [np.sqrt(np.where(given, 0.0, torsion)) * twisted]
        twist_lost = np.where(
            given,
            np.abs(angle[2] * sheared - wires.loss) * wires.torsion,
            angle[2] * sheared * torsion,
        )
        lost = (
            twist_lost * twisted**2 + np.abs(angle[1] - wires.loss) * wires.stiffness * stretched**2
        )
        first = np.array([fibre.plane for fibre in made])
        first = first - (first * self.along).sum(-1, keepdims=True) * self.along
        first = first / np.sqrt((first**2).sum(-1, keepdims=True))
        for end, turn in enumerate(self.turn):
            slope = np.cross(turn, self.along) - chord
            for plane, across in enumerate((first, np.cross(self.along, first))):
                turned = (slope * across).sum(-1)
                whole, extra = np.array(
                    [
                        _hinge(made[w], end, plane, float(wires.tension[w]), float(wires.length[w]))
                        for w in range(len(made))
                    ]
                ).T
                parts.append(np.sqrt(extra) * turned)
                lost = lost + angle[0] / 2 * whole * turned**2
        return parts, lost

    def kinetic_energy(self, mass: Any, here: Any) -> Any:
        """v^T dM v (m, m) of the wires `here` (w,), given the mass (w,) of all."""
        a, b = (
            ((move + sign * np.cross(turn, self.reach)) * np.sqrt(mass / 6)[:, None])[:, here]
            for move, turn, sign in zip(self.move, self.turn, (1, -1), strict=True)
        )
        a, b = a.reshape(len(a), -1), b.reshape(len(b), -1)
        cross = a @ b.T
        return 2 * a @ a.T + cross + cross.T + 2 * b @ b.T


def _hinge(
    fibre: Fibre, end: int, plane: int, tension: float, length: float
) -> tuple[float, float]:
    """Stiffness of a wire's end against turning, N m/rad, and the part of it that strings lack."""
    tension = max(tension, 0.0)
    section = fibre.sections[-end]
    reach = np.sqrt(section.rigidity[plane] / tension) if tension else np.inf
    near = [section] if reach < section.length else fibre.sections
    full, soft = (max(one.rigidity[n] for one in near) for n in (plane, 0))
    stiff = _between_clamps(full, tension, length)
    if not fibre.effective:
        return stiff, stiff
    return stiff, max(stiff - _between_clamps(soft, tension, length), 0.0) + soft / length


def _between_clamps(rigidity: float, tension: float, length: float) -> float:
    """Stiffness per end against turning of a beam bent like an S, N m/rad; 6 EI / l if slack."""
    u = np.sqrt(rigidity / tension) if tension > 0 else np.inf
    if u > 10 * length:
        return 6 * rigidity / length
    t = np.tanh(length / 2 / u)
    return float(tension * u * t / (1 - 2 * u * t / length))


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
