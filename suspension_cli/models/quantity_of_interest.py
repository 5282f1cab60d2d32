"""Quantities of interest, and their relative change by a refinement of the model.

The change is estimated from the modes of the simplest model, or computed from the linear systems
with and without the refinement.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.linear import eigenmodes, quality, response
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode, Ratio, Scalar
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import BENDING, MASS
from suspension_cli.models.estimates import Estimates
from suspension_cli.scene.arrays import Array

SAMPLES = 12
"""Frequencies at which a response is sampled."""
NEAR = 0.05
"""Relative distance from a mode within which a response is not sampled: there a shift by delta
changes it by 2 Q delta."""


class QuantityOfInterest(Protocol):
    """A result of a command, whose error decides on the model.

    Attributes
    ----------
    effect : str
        Verb and noun for the change: "shifts the modes".
    thresholds : dict of str to pair of floats
        By refinement (`base.BENDING`, `base.MASS`): an estimate below the first, as a multiple of
        the tolerance, is negligible without further computation; one above the second is not.
    """

    effect: ClassVar[str]
    thresholds: ClassVar[dict[str, tuple[float, float]]]

    def estimate(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Estimate its relative change by bending and by mass of each stage's wires, (s,) each."""
        ...

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute its largest relative change from one model to a refined one, and where it is."""
        ...


@dataclass(frozen=True)
class Frequencies:
    """The frequencies of all modes of the bodies.

    First-order estimates of their change are right within a factor of 3.5
    (`tests/models/test_estimates.py`).
    """

    effect: ClassVar[str] = "shifts the modes"
    thresholds: ClassVar[dict[str, tuple[float, float]]] = {BENDING: (0.25, 3.0), MASS: (0.25, 3.0)}

    def estimate(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Estimate the change of the mode that changes most."""
        return {BENDING: of.bending.max(0), MASS: of.mass.max(0)}

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute that of the mode that changes most; modes are paired by their shapes."""
        new = eigenmodes.solve(refined)
        changes = (
            _loaded(new, refined)
            if _massive(refined)
            else _shifted(eigenmodes.solve(without), new, refined)
        )
        most = int(np.argmax(changes))
        return float(changes[most]), new.label[most]


@dataclass(frozen=True)
class Transfer:
    """Responses of outputs to inputs at frequencies (f,) in Hz.

    Estimates of their change are coarser. Responses of wires with mass cost no more than without:
    if the estimate is not small, mass is included and nothing is sampled.
    """

    inputs: list[Signal]
    outputs: list[Signal]
    frequency: Array

    effect: ClassVar[str] = "changes the response"
    thresholds: ClassVar[dict[str, tuple[float, float]]] = {BENDING: (0.5, 1.0), MASS: (0.5, 0.5)}

    def estimate(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Estimate the change far above all modes.

        There a response is proportional to the square of the frequency of every mode in its
        blocks, and to the force of each wire.
        """
        touched = self._touched(found)
        curved = of.curved(float(np.max(self.frequency)))
        bending = (2 * of.bending[touched] + of.loss[touched]).sum(0)
        return {BENDING: bending, MASS: 2 * of.mass[touched].sum(0) + curved}

    def _touched(self, found: Modes) -> Any:
        """Modes in the blocks of the inputs and outputs: (m,) bool."""
        places = [
            found.coordinate.index(f"{one.body}.{DOFS[one.dof]}")
            for one in (*self.inputs, *self.outputs)
            if one.body != SUPPORT
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
        old, new = (
            response.solve(model, chosen, self.inputs, self.outputs).value
            for model in (without, refined)
        )
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
    scalars : tuple of Scalar
    modes : Modes
        To which mode numbers refer.
    """

    scalars: tuple[Scalar, ...]
    modes: Modes

    effect: ClassVar[str] = "changes the results"
    thresholds: ClassVar[dict[str, tuple[float, float]]] = Frequencies.thresholds

    def estimate(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Estimate the change of the scalar that changes most."""
        each = [self._estimate(item, found, of) for item in self.scalars]
        return {
            name: max((one[name] for one in each), key=lambda part: float(np.nansum(part)))
            for name in (BENDING, MASS)
        }

    def _estimate(self, item: Scalar, found: Modes, of: Estimates) -> dict[str, Array]:
        if isinstance(item, Mode):
            return {BENDING: of.bending[item.number], MASS: of.mass[item.number]}
        outputs = [item.over] if item.under is None else [item.over, item.under]
        return Transfer([item.input], outputs, np.array([item.frequency])).estimate(found, of)

    def change(self, without: LinearSystem, refined: LinearSystem) -> tuple[float, str]:
        """Compute that of the scalar that changes most; modes are paired by their shapes."""
        new = eigenmodes.solve(refined)
        changes = (
            _loaded(new, refined)
            if _massive(refined)
            else _shifted(eigenmodes.solve(without), new, refined)
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


def _resized(item: Ratio, without: LinearSystem, refined: LinearSystem) -> float:
    """Relative change of the magnitude of a response, or of the ratio of two."""
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
    return any(getattr(getattr(term, "strand", None), "massive", False) for term in model.terms)


def _shifted(old: Modes, new: Modes, refined: LinearSystem) -> Any:
    """Relative change of each frequency of the refined model, modes paired by their shapes."""
    columns = _pairs(new, old, refined)
    a, b = old.omega_squared[columns], new.omega_squared
    changes = np.where(b > 0, np.abs(np.sqrt(np.abs(a) / np.where(b > 0, b, 1.0)) - 1), 0.0)
    if old.stable != new.stable:
        changes[0] = np.inf
    return changes


def _pairs(rows: Modes, columns: Modes, model: LinearSystem) -> Any:
    """Mode of one model that each mode of another is paired with by its shape."""
    count = 6 * len(model.body)
    mass = model.mass[6 : 6 + count, 6 : 6 + count]
    return pair_by_overlap(body_overlap(rows.shape, columns.shape, mass))


def _loaded(found: Modes, model: LinearSystem) -> Any:
    """First-order relative change of each frequency by wire mass, v^T (Z - K + omega^2 M) v.

    Over 2 omega^2, with the dynamic stiffness Z(omega) of wires with mass.
    """
    good = found.omega_squared > 0
    omega = np.sqrt(found.omega_squared[good])
    shapes = np.linalg.solve(model.basis, np.pad(found.shape[good], ((0, 0), (6, 0))).T)
    change = np.zeros(len(omega))
    for strand, ends in quality.end_motions(model, shapes.T):
        there = replace(strand, lossy=False).at(omega)
        for part, moved in ends.items():
            change += np.einsum(
                "iwm,ijm,jwm->m", moved, there.stiffness(part) - strand.resting(part), moved
            )
    result = np.zeros(len(found.omega_squared))
    result[good] = np.abs(change / (2 * omega**2))
    return result


def _smooth(size: Any) -> Any:
    """Geometric mean of each size with its neighbours along the first axis."""
    logs = np.log(np.where(size > 0, size, 1e-300))
    padded = np.concatenate([logs[:1], logs, logs[-1:]])
    return np.where(size > 0, np.exp((padded[:-2] + padded[1:-1] + padded[2:]) / 3), 0.0)
