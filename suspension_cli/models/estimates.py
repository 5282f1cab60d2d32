"""Upper estimates of the changes by wire bending and wire mass, from the modes on strings.

By Rayleigh's principle small additions dK and dM change omega^2 = lambda of the mode v_i of unit
modal mass by A_ii = v_i^T (dK - lambda_i dM) v_i. Another mode v_j at the distance D = |lambda_i -
lambda_j| adds at most

    2 A_ij^2 / (D + sqrt(D^2 + 4 A_ij^2)),

the repulsion of two coupled levels (Landau and Lifshitz, Quantum Mechanics, section 79). The sum of
all over 2 lambda_i is the relative change of the frequency.

Bending. A clamped wire under tension T acts like a hinge of stiffness sqrt(T EI) at the distance u
= sqrt(EI / T) from its clamp (Gonzalez and Saulson, J. Acoust. Soc. Am. 96, 207 (1994)), turned by
the angle between the clamp and the chord. For a wire of length l bent like an S by two parallel
clamps, the stiffer case, the stiffness is exactly

    T u t / (1 - 2 u t / l),    t = tanh(l / 2u),

from the deflection of a beam under tension. Torsion has the stiffness (G J + T I_p / A) / l; where
the design gives it, strings have it already. Where the design gives effective bending points, the
remaining stiffness is EI / l (plus, in a ribbon's stiff plane, the difference of the two hinges).
The loss is a fraction phi of the energy of stretching and twisting, and phi / 2 of that of hinges,
which goes with sqrt(EI).

Mass. Wires act on their ends (placed as in `wire_mass`) like strings and rods with mass at the
frequency of the mode. Far below the first violin mode they are straight lines with the kinetic
energy m (a^2 + a.b + b^2) / 6 for ends that move by a and b.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.elements import loss
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models.wire_mass import (
    FORCE,
    as_hanging,
    expand_with_fibres,
    first_violin_of,
    hinge_distance,
    moments,
)
from suspension_cli.rotations import cross
from suspension_cli.scene.arrays import Array
from suspension_cli.scene.composition import Fibre
from suspension_cli.scene.fibres import explain_unsuitable
from suspension_cli.scene.scene import Scene

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

T = TypeVar("T")

FAR = 0.5
"""Largest (f / f1)^2 at which the series for responses is valid."""
SMALL = 1e-3
"""Wave number times length below which waves on a wire are negligible."""
HIGHER = 1.1
"""Safety factor for orders beyond the second."""
RANGE = 2 * np.pi * np.geomspace(0.1, 1e4, 6)
"""Angular frequencies at which loss angles are evaluated; the largest is used."""


class Estimates:
    """Relative changes by the wires of each stage (s), for each mode (m).

    Attributes
    ----------
    stage : tuple of str
        Stages that hang on wires.
    """

    def __init__(self, design: Design, found: Modes, scene: Scene | None = None) -> None:
        """Take a design, and its modes without bending and mass of wires.

        The scene is from `expand_with_fibres` and `as_hanging`, if it is known already.
        """
        self._scene = scene = scene or as_hanging(expand_with_fibres(design))
        self._found = found
        below = scene.wires.lower
        hung = [n for n in range(len(design.stage)) if (below == n + 1).any()]
        self._groups = [below == n + 1 for n in hung]
        self._made = () if scene.fibres is None else scene.fibres.wire
        self._weighable = not explain_unsuitable(design, massive=True)
        self.stage = tuple(design.stage[n].name for n in hung)

    @cached_property
    def bending(self) -> Float[np.ndarray, "mode stage"]:
        """Relative change of the mode's frequency by bending.

        Infinite for a mode without restoring force on strings; all NaN if the design lacks the
        wires' properties.
        """
        if not self._made:
            return self._unknown
        stored = (
            np.sum([part[:, here] @ part[:, here].T for part in self._motion.bent], axis=0)
            for here in self._groups
        )
        return _relative_to_mode(
            _with_repulsion(stored, self._found) / 2, self._found.omega_squared
        )

    @cached_property
    def loss(self) -> Float[np.ndarray, "mode stage"]:
        """Imaginary part of the relative change of omega^2 by bending."""
        if not self._made:
            return self._unknown
        lost = self._motion.lost()
        return _relative_to_mode(
            np.stack([lost[:, here].sum(1) for here in self._groups], axis=1),
            self._found.omega_squared,
        )

    @cached_property
    def mass(self) -> Float[np.ndarray, "mode stage"]:
        """Relative change of the mode's frequency by wire mass."""
        if not (self._made and self._weighable):
            return self._unknown
        squared = np.abs(self._found.omega_squared)[:, None]
        moved = (self._motion.inertia(here) for here in self._groups)
        change = _with_repulsion(moved, self._found) / np.maximum(squared, 1e-300)
        whole = change.sum(1, keepdims=True)
        slower = np.where(whole < 1, 1 / np.sqrt(np.maximum(1 - whole, 1e-30)) - 1, np.inf)
        with np.errstate(invalid="ignore"):  # no change of a stage, infinite as a whole
            part = slower * change / np.where((whole > 0) & np.isfinite(whole), whole, 1.0)
        return np.where(change > 0, part, 0.0)

    @cached_property
    def violin(self) -> Float[np.ndarray, " stage"]:
        """The lowest first violin mode of each stage's wires, Hz; infinite without wire mass."""
        if not (self._made and self._weighable):
            return np.full(len(self.stage), np.nan)
        tension = self._scene.wires.tension.tolist()
        first = [first_violin_of(one, t) for one, t in zip(self._made, tension, strict=True)]
        return np.array([np.array(first)[here].min() for here in self._groups])

    def curved(self, highest: float) -> Array:
        """Relative change (s,) of each stage's wire force by wire mass, at a frequency in Hz."""
        near = (highest / np.maximum(self.violin, 1e-150)) ** 2
        return np.where(near < FAR, FORCE * near, np.inf)

    @property
    def _unknown(self) -> Float[np.ndarray, "mode stage"]:
        return np.full((len(self._found.omega_squared), len(self.stage)), np.nan)

    @cached_property
    def _motion(self) -> _EndMotion:
        return _EndMotion(self._scene, self._found, self._made)


def _relative_to_mode(
    energy: Float[np.ndarray, "mode stage"], omega_squared: Float[np.ndarray, " mode"]
) -> Float[np.ndarray, "mode stage"]:
    """Energy relative to that of each mode; 0 if both are 0."""
    stored = np.abs(omega_squared)[:, None]
    return np.where(
        stored > 0, energy / np.where(stored > 0, stored, 1.0), np.where(energy > 0, np.inf, 0.0)
    )


def repulsion(
    coupling: Float[np.ndarray, "*shape"] | float, distance: Float[np.ndarray, "*shape"] | float
) -> Float[np.ndarray, "*shape"]:
    """Change of one of two coupled levels: 2 A^2 / (D + sqrt(D^2 + 4 A^2)).

    >>> float(repulsion(2.0, 3.0))
    1.0
    """
    apart = np.abs(distance)
    both = apart + np.sqrt(apart**2 + 4 * coupling**2)
    return 2 * coupling**2 / np.where(both > 0, both, 1.0)


def _with_repulsion(
    parts: Iterable[Float[np.ndarray, "mode mode"]], found: Modes
) -> Float[np.ndarray, "mode stage"]:
    """Diagonals of one matrix per stage, raised by the repulsion of modes."""
    diagonals, coupling = [], np.zeros((len(found.omega_squared),) * 2)
    for part in parts:  # one at a time: hundreds of stages would fill the memory
        diagonals.append(part.diagonal().copy())
        coupling += part
    diagonal = np.stack(diagonals, axis=1)
    np.fill_diagonal(coupling, 0.0)
    apart = np.subtract.outer(found.omega_squared, found.omega_squared)
    finite = np.isfinite(coupling).all(1)
    added = np.full(len(apart), np.inf)
    added[finite] = repulsion(coupling[finite], apart[finite]).sum(1)
    total = diagonal.sum(1)
    plain = (total > 0) & np.isfinite(total)
    factor = HIGHER * (1 + np.where(plain, added / np.where(plain, total, 1.0), 0.0))
    return np.where(np.isfinite(total)[:, None], diagonal * factor[:, None], np.inf)


class _EndMotion:
    """Motion of the ends of all wires in each mode (m, w, 3)."""

    def __init__(self, scene: Scene, found: Modes, made: tuple[Fibre, ...]) -> None:
        wires, count = scene.wires, 6 * len(found.body)
        moves = np.concatenate(
            [np.zeros((len(found.shape), 6)), found.shape[:, :count]], axis=1
        ).reshape(len(found.shape), -1, 6)
        self.wires, self.made = wires, made
        self.omega = np.sqrt(np.abs(found.omega_squared))
        self.along = wires.span / wires.length[:, None]
        self.turn = tuple(moves[:, body, 3:] for body in (wires.upper, wires.lower))
        reach = np.array(
            [hinge_distance(one, float(wires.tension[w])) for w, one in enumerate(made)]
        )
        self.reach = reach[:, None] * self.along
        points = (wires.upper_point, wires.lower_point)
        self.move = tuple(
            moves[:, body, :3] + cross(turn, point)
            for body, turn, point in zip((wires.upper, wires.lower), self.turn, points, strict=True)
        )
        self._move_tips(scene, found)

    def _move_tips(self, scene: Scene, found: Modes) -> None:
        """Add the motion of blade tips to that of upper ends.

        Where blades are in series with wires, the tip balances its stiffness and the stretching of
        its wires.
        """
        wires, blades = scene.wires, scene.blades
        stretched = ((self.move[1] - self.move[0]) * self.along).sum(-1)
        for blade, label in enumerate(blades.label):
            on_it = np.flatnonzero(wires.blade == blade)
            for axis in np.flatnonzero(blades.axes[blade]).tolist():
                name = f"{label}.{DOFS[axis]}"
                slope = self.along[on_it, axis]
                pull = wires.stiffness[on_it] * slope
                tip = (
                    found.shape[:, found.coordinate.index(name)]
                    if name in found.coordinate
                    else stretched[:, on_it] @ pull / (blades.stiffness[blade, axis] + pull @ slope)
                )
                self.move[0][:, on_it, axis] += tip[:, None]

    @cached_property
    def bent(self) -> list[Float[np.ndarray, "mode wire"]]:
        """Parts whose squares sum to v^T dK v, by bending and twisting of all wires."""
        torsion, _ = self._torsion
        parts = [np.sqrt(np.where(self.wires.torsion > 0, 0.0, torsion)) * self._twisted]
        for end, plane, turned in self._turned:
            parts.append(np.sqrt(self._hinges[end, plane, :, 1]) * turned)
        return parts

    def lost(self) -> Float[np.ndarray, "mode wire"]:
        """Imaginary part of v^T dK v, by bending, twisting and stretching of all wires."""
        wires, (torsion, sheared) = self.wires, self._torsion
        angle = np.array(self._per_wire(lambda fibre, tension, _: _angles(fibre, tension))).T
        stretched = (self._chord * self.along).sum(-1) * wires.length
        twist_lost = np.where(
            wires.torsion > 0,
            np.abs(angle[2] * sheared - wires.loss) * wires.torsion,
            angle[2] * sheared * torsion,
        )
        lost = (
            twist_lost * self._twisted**2
            + np.abs(angle[1] - wires.loss) * wires.stiffness * stretched**2
        )
        for end, plane, turned in self._turned:
            lost = lost + angle[0] / 2 * self._hinges[end, plane, :, 0] * turned**2
        return lost

    def _per_wire(self, function: Callable[[Fibre, float, float], T]) -> list[T]:
        """Evaluate a function of composition, tension and length of each wire, once if equal."""
        known: dict[Hashable, T] = {}
        found = []
        numbers = zip(self.wires.tension.tolist(), self.wires.length.tolist(), strict=True)
        for fibre, (tension, length) in zip(self.made, numbers, strict=True):
            kind = (fibre.sections, fibre.temperature, fibre.effective, tension, length)
            if kind not in known:
                known[kind] = function(fibre, tension, length)
            found.append(known[kind])
        return found

    @cached_property
    def _chord(self) -> Float[np.ndarray, "mode wire 3"]:
        return (self.move[1] - self.move[0]) / self.wires.length[:, None]

    @cached_property
    def _twisted(self) -> Float[np.ndarray, "mode wire"]:
        return ((self.turn[1] - self.turn[0]) * self.along).sum(-1)

    @cached_property
    def _torsion(self) -> Float[np.ndarray, "two wire"]:
        """Stiffness of torsion, and the fraction that is in shear."""
        return np.array(self._per_wire(lambda fibre, tension, _: _torsion(fibre, tension))).T

    @cached_property
    def _hinges(self) -> Float[np.ndarray, "end plane wire two"]:
        """Stiffness of ends against turning, and the part of it that strings lack."""
        found = self._per_wire(
            lambda fibre, tension, length: [
                [_hinge(fibre, end, plane, tension, length) for plane in (0, 1)] for end in (0, 1)
            ]
        )
        return np.moveaxis(np.array(found), 0, 2)

    @cached_property
    def _turned(self) -> list[tuple[int, int, Float[np.ndarray, "mode wire"]]]:
        """Angle between each end (0, 1) and its chord, in both planes (0, 1) of the wire."""
        first = np.array([fibre.plane for fibre in self.made])
        first = first - (first * self.along).sum(-1, keepdims=True) * self.along
        first = first / np.sqrt((first**2).sum(-1, keepdims=True))
        planes = (first, cross(self.along, first))
        found = []
        for end, turn in enumerate(self.turn):
            slope = cross(turn, self.along) - self._chord
            found += [(end, n, (slope * across).sum(-1)) for n, across in enumerate(planes)]
        return found

    def inertia(self, here: Bool[np.ndarray, " wire"]) -> Float[np.ndarray, "mode mode"]:
        """Magnitudes of v_i^T (Z - K) v_j by the mass of the wires `here` at omega_i.

        Infinite if omega_i is too close to a violin mode.
        """
        forces, motions = (part[:, here].reshape(len(part), -1) for part in self._wave_forces)
        result = forces @ motions.T
        return np.where(np.isnan(result), np.inf, np.abs(result))

    @cached_property
    def _wave_forces(self) -> tuple[Float[np.ndarray, "mode wire 12"], ...]:
        """Forces on the ends of all wires by their mass, and the motions of these ends."""
        first, mixed, last, reach = np.array(
            self._per_wire(
                lambda fibre, tension, _: (*moments(fibre), hinge_distance(fibre, tension))
            )
        ).T
        whole = first + 2 * mixed + last
        mass = np.where(whole > 0, 3 * np.maximum(first, last), 0.0)  # the denser half counts
        a, b = (
            move + sign * cross(turn, self.reach)
            for move, turn, sign in zip(self.move, self.turn, (1, -1), strict=True)
        )
        stretched = [(end * self.along).sum(-1, keepdims=True) * self.along for end in (a, b)]
        across = [end - own for end, own in zip((a, b), stretched, strict=True)]
        wires, forces, motions = self.wires, [], []
        for (u, v), stiffness, shorter in (
            (stretched, wires.stiffness, np.zeros(len(mass))),
            (across, wires.tension / wires.length, 2 * reach / wires.length),
        ):
            one, both = (part[..., None] for part in _waves(self.omega, mass, stiffness, shorter))
            forces += [one * u + both * v, one * v + both * u]
            motions += [u, v]
        return np.concatenate(forces, axis=-1), np.concatenate(motions, axis=-1)


def _waves(
    omega: Float[np.ndarray, " mode"],
    mass: Float[np.ndarray, " wire"],
    stiffness: Float[np.ndarray, " wire"],
    shorter: Float[np.ndarray, " wire"],
) -> tuple[Float[np.ndarray, "mode wire"], Float[np.ndarray, "mode wire"]]:
    """Stiffness that mass adds to strings or rods, for one end and between their ends.

    With X = omega sqrt(mass / stiffness), the stiffness times X cot X - 1 and 1 - X / sin X (any
    text on vibrations). A clamped wire vibrates on a length that is less by the fraction `shorter`:
    the larger magnitude of both counts; NaN where a resonance lies in between.
    """
    ratio = np.where(stiffness > 0, mass / np.where(stiffness > 0, stiffness, 1.0), 0.0)
    full = omega[:, None] * np.sqrt(ratio)
    part = full * (1 - 1.5 * shorter)
    found = []
    for x in (full, part):
        some = np.where(x > SMALL, x, 1.0)
        found.append(
            (
                np.where(x > SMALL, some / np.tan(some) - 1, -(x**2) / 3),
                np.where(x > SMALL, 1 - some / np.sin(some), -(x**2) / 6),
            )
        )
    between = np.floor(full / np.pi) != np.floor(part / np.pi)
    larger = np.abs(found[1][0]) > np.abs(found[0][0])
    one, both = (np.where(larger, found[1][n], found[0][n]) for n in (0, 1))
    return np.where(between, np.nan, stiffness * one), np.where(between, np.nan, stiffness * both)


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
