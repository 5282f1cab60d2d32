"""Quantities of interest, and their relative change by a refinement of the model.

It is estimated from the modes of the simplest model, or computed from the systems with and without
the refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Protocol

import numpy as np

from suspension_cli.conventions import DOFS, GROUND, SUPPORT
from suspension_cli.linear import eigenmodes, quality
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.frequency_terms import is_massive
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode, Ratio, Scalar
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import BENDING, MASS
from suspension_cli.models.estimates import HIGHER, Estimates, repulsion
from suspension_cli.models.wire_mass import MassiveWires
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

SAMPLES = 12
"""Frequencies at which a response is sampled."""
NEAR = 0.05
"""Relative distance from a mode within which a response is not sampled: a shift of the mode by
delta changes it there by 2 Q delta."""


class QuantityOfInterest(Protocol):
    """A result of a command, whose error decides on the model.

    Attributes
    ----------
    effect
        Verb and noun for the change: "shifts the modes".
    computed
        Refinements (`base.BENDING`, `base.MASS`) whose effect is computed where its estimate
        exceeds the tolerance; others are included.
    """

    effect: ClassVar[str]
    computed: ClassVar[tuple[str, ...]]

    def estimate(self, physics: str, found: Modes, of: Estimates) -> Array:
        """Estimate its relative change (s,) by `BENDING` or `MASS` of each stage's wires."""
        ...

    def mass_bound(self, wires: Callable[[], MassiveWires]) -> float:
        """Upper estimate of its change by wire mass, without modes; 0 where they are needed."""
        ...

    def zeros(self, model: LinearSystem) -> Bool[np.ndarray, " _"]:
        """Which parts of it symmetry makes exactly 0 in a model."""
        ...

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute its largest relative change from one model to a refined one, and where it is."""
        ...


@dataclass(frozen=True)
class Frequencies:
    """The frequencies of all modes of the bodies.

    The modes of the beam model cost as much as computing how bending changes them. Violin modes,
    counted one by one, cost far more than the change by wire mass.
    """

    effect: ClassVar[str] = "shifts the modes"
    computed: ClassVar[tuple[str, ...]] = (MASS,)

    def estimate(self, physics: str, found: Modes, of: Estimates) -> Array:
        """Estimate the change of the mode that changes most."""
        del found
        change = of.bending if physics == BENDING else of.mass
        return change[change.sum(1).argmax()]

    def mass_bound(self, wires: Callable[[], MassiveWires]) -> float:
        """Return 0: the effect of mass differs too much between modes."""
        del wires
        return 0.0

    def zeros(self, model: LinearSystem) -> Bool[np.ndarray, " _"]:
        """Return False: the frequencies of a pendulum are not 0."""
        del model
        return np.array([False])

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the change of the mode that changes most; modes are paired by their shapes."""
        new = eigenmodes.solve(refined.constant)
        changes = (
            _loaded(new, refined)
            if _massive(refined)
            else _shifted(eigenmodes.solve(without.constant), new, refined)
        )
        most = int(np.argmax(changes))
        return float(changes[most]), new.label[most]


@dataclass(frozen=True)
class Transfer:
    """Responses of outputs to inputs at frequencies (f,) in Hz.

    Beside a resonance an error counts as the equivalent shift of frequency. Wire mass makes
    responses no slower, so it is included where its estimate is not small.
    """

    inputs: list[Signal]
    outputs: list[Signal]
    frequency: Array

    effect: ClassVar[str] = "changes the response"
    computed: ClassVar[tuple[str, ...]] = ()

    def estimate(self, physics: str, found: Modes, of: Estimates) -> Array:
        """Estimate the change far above all modes.

        There a response is proportional to the square of the frequency of every mode in its
        blocks, and to the force of each wire.
        """
        touched = self._touched(found)
        if physics == BENDING:
            return (2 * of.bending[touched] + of.loss[touched]).sum(0)
        return 2 * of.mass[touched].sum(0) + of.curved(float(np.max(self.frequency)))

    def mass_bound(self, wires: Callable[[], MassiveWires]) -> float:
        """Upper estimate for any response at these frequencies, without modes."""
        return wires().effect_on_response(float(np.max(self.frequency))).error

    def zeros(self, model: LinearSystem) -> Bool[np.ndarray, " _"]:
        """Which of these responses symmetry forbids: no block links the input to the output."""
        from suspension_cli.linear import response

        return np.array(
            [
                SUPPORT not in (out.body, out.against)
                and not response.solve(model, np.zeros(0), [into], [out]).blocks
                for out in self.outputs
                for into in self.inputs
            ]
        )

    def signals(self) -> list[Signal]:
        """List the signals whose blocks matter."""
        return [*self.inputs, *self.outputs]

    def values(
        self, model: LinearSystem, frequency: Array
    ) -> Complex[np.ndarray, "frequency output input"]:
        """Solve for the responses at frequencies in Hz."""
        from suspension_cli.linear import response

        return response.solve(model, frequency, self.inputs, self.outputs).value

    def _touched(self, found: Modes) -> Bool[np.ndarray, " mode"]:
        """Which modes are in the blocks of the inputs and outputs."""
        places = [
            found.coordinate.index(f"{one.body}.{DOFS[one.dof]}")
            for one in self.signals()
            if one.body not in (SUPPORT, GROUND)
        ]
        blocks = found.block[(found.shape[:, places] != 0).any(1)]
        return np.isin(found.block, blocks)

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the largest change at sampled frequencies away from all modes."""
        known = np.concatenate([eigenmodes.solve(model).frequency for model in (without, refined)])
        grid = np.asarray(self.frequency, dtype=float)
        away = grid[
            (np.abs(grid[:, None] / known[np.isfinite(known) & (known > 0)] - 1) > NEAR).all(1)
        ]
        if not len(away):
            away = grid
        chosen = np.unique(away[np.linspace(0, len(away) - 1, min(SAMPLES, len(away))).astype(int)])
        old, new = (self.values(model, chosen) for model in (without, refined))
        # next to a zero of the response its relative change is large but irrelevant, so it is
        # taken relative to a smoothed magnitude
        size = np.maximum(np.abs(new), 0.1 * _smooth(np.abs(new)))
        different = np.where(
            size > 0,
            np.abs(old - new) / np.where(size > 0, size, 1.0),
            np.where(old == new, 0.0, np.inf),
        )
        _, o, i = np.unravel_index(int(np.argmax(different)), different.shape)
        return float(different.max()), f"{self.outputs[int(o)].text}/{self.inputs[int(i)].text}"


@dataclass(frozen=True)
class Several:
    """Several scalar results (`linear.named_results`); the one that changes most decides.

    Attributes
    ----------
    modes
        To which mode numbers refer.
    """

    scalars: tuple[Scalar, ...]
    modes: Modes

    effect: ClassVar[str] = "changes the results"
    computed: ClassVar[tuple[str, ...]] = (BENDING, MASS)

    def estimate(self, physics: str, found: Modes, of: Estimates) -> Array:
        """Estimate the change of the scalar that changes most."""
        each = [self._estimate(item, physics, found, of) for item in self.scalars]
        return max(each, key=lambda part: float(np.nansum(part)))

    def mass_bound(self, wires: Callable[[], MassiveWires]) -> float:
        """Return 0: the scalars may be modes."""
        del wires
        return 0.0

    def zeros(self, model: LinearSystem) -> Bool[np.ndarray, " _"]:
        """Which of the scalars are responses that symmetry forbids."""
        return np.array(
            [
                isinstance(item, Ratio)
                and bool(Transfer([item.input], [item.over], np.zeros(0)).zeros(model).all())
                for item in self.scalars
            ]
        )

    def _estimate(self, item: Scalar, physics: str, found: Modes, of: Estimates) -> Array:
        if isinstance(item, Mode):
            return (of.bending if physics == BENDING else of.mass)[item.number]
        outputs = [item.over] if item.under is None else [item.over, item.under]
        one = Transfer([item.input], outputs, np.array([item.frequency]))
        return one.estimate(physics, found, of)

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute the change of the scalar that changes most; modes are paired by their shapes."""
        new = eigenmodes.solve(refined.constant)
        changes = (
            _loaded(new, refined)
            if _massive(refined)
            else _shifted(eigenmodes.solve(without.constant), new, refined)
        )
        here = _pairs(self.modes, new, refined)
        each = [
            (
                float(changes[here[item.number]])
                if isinstance(item, Mode)
                else _resized(item, without, refined),
                item.text,
            )
            for item in self.scalars
        ]
        return max(each)


@dataclass(frozen=True)
class Differentiated(Several):
    """Several scalar results and their derivatives.

    Bending may change a derivative more than its result, so it is included where its estimate is
    not small.
    """

    computed: ClassVar[tuple[str, ...]] = (MASS,)


def _resized(item: Ratio, without: LinearSystem, refined: LinearSystem) -> float:
    """Relative change of the magnitude of a response, or of the ratio of two."""
    from suspension_cli.linear import response

    outputs = [item.over] if item.under is None else [item.over, item.under]
    old, new = (
        np.abs(
            response.solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]
        )
        for model in (without, refined)
    )
    if len(outputs) == 2:
        old, new = (np.array([size[0] / size[1] if size[1] else 0.0]) for size in (old, new))
    return abs(float(old[0] / new[0]) - 1) if new[0] else 0.0 if old[0] == 0 else float("inf")


def _massive(model: LinearSystem) -> bool:
    return any(is_massive(term) for term in model.terms)


def _shifted(old: Modes, new: Modes, refined: LinearSystem) -> Float[np.ndarray, " mode"]:
    """Relative change of each frequency of the refined model, modes paired by their shapes."""
    columns = _pairs(new, old, refined)
    a, b = old.omega_squared[columns], new.omega_squared
    changes = np.where(b > 0, np.abs(np.sqrt(np.abs(a) / np.where(b > 0, b, 1.0)) - 1), 0.0)
    if old.stable != new.stable:
        changes[0] = np.inf
    return changes


def _pairs(rows: Modes, columns: Modes, model: LinearSystem) -> Int[np.ndarray, " mode"]:
    """Mode of one model that each mode of another is paired with by its shape."""
    count = 6 * len(model.body)
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    return pair_by_overlap(body_overlap(rows.shape, columns.shape, mass))


def _loaded(found: Modes, model: LinearSystem) -> Float[np.ndarray, " mode"]:
    """Upper bound on the relative change of each frequency by wire mass.

    With the dynamic stiffness Z(omega) of wires with mass, omega^2 of the mode v_i is a root of x =
    omega_i^2 + A_ii(x), A_ij = v_i^T (Z - K + omega^2 M) v_j. Except at violin modes A_ii falls
    with x (its slope is minus the wires' kinetic energy), so a root lies between omega_i^2 and
    omega_i^2 + A_ii(omega_i^2). Other modes of the bodies add their repulsion
    (`estimates.repulsion`).
    """
    good = found.omega_squared > 0
    omega = np.sqrt(found.omega_squared[good])
    shapes = np.linalg.solve(model.basis, np.pad(found.shape, ((0, 0), (6, 0))).T)
    coupling = np.zeros((len(omega), len(good)))
    for strand, ends in quality.end_motions(model, shapes.T):
        there = replace(strand, lossy=False).at(omega)
        for part, moved in ends.items():
            force = np.einsum(
                "ijm,iwm->jwm", there.stiffness(part) - strand.resting(part), moved[..., good]
            )
            count = len(good)
            coupling += force.reshape(-1, len(omega)).T @ moved.reshape(-1, count)
    itself = np.flatnonzero(good)
    own = coupling[range(len(omega)), itself].copy()
    coupling[range(len(omega)), itself] = 0.0
    apart = np.subtract.outer(omega**2, found.omega_squared)
    result = np.zeros(len(good))
    fraction = HIGHER * (np.abs(own) + repulsion(coupling, apart).sum(1)) / omega**2
    result[good] = np.where(fraction < 1, 1 / np.sqrt(np.maximum(1 - fraction, 1e-30)) - 1, np.inf)
    return result


def _smooth(
    size: Float[np.ndarray, "frequency output input"],
) -> Float[np.ndarray, "frequency output input"]:
    """Geometric mean of each size with its neighbours along the first axis."""
    logs = np.log(np.where(size > 0, size, 1e-300))
    padded = np.concatenate([logs[:1], logs, logs[-1:]])
    return np.where(size > 0, np.exp((padded[:-2] + padded[1:-1] + padded[2:]) / 3), 0.0)
