"""What can be asked of a design: what refinements would change of it, estimated from the simplest model's modes or sampled with and without them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from suspension_cli.analysis import modes, quality, response
from suspension_cli.analysis.estimates import BENDING, MASS, Estimates
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.scalars import Mode, Ratio, Scalar
from suspension_cli.analysis.signals import Signal
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.scene import Array
from suspension_cli.mechanics.model import LinearModel

SAMPLES = 12
"""Frequencies at which a response is sampled."""
NEAR = 0.05
"""Relative distance of a mode within which a response is not sampled: there a shift by delta changes it by 2 Q delta."""


class Asked(Protocol):
    """A quantity that is asked for.

    Attributes
    ----------
    settled : dict of str to pair of floats
        For each refinement, the multiples of the tolerance below which its estimate settles that it is left out, and above which that it is taken.
    """

    settled: ClassVar[dict[str, tuple[float, float]]]

    def estimated(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """About its relative change by bending and by mass of each stage's wires (s,)."""
        ...

    def change(self, without: LinearModel, refined: LinearModel) -> tuple[float, str]:
        """Its largest relative change from one model to a more refined one, and what of it changes so much."""
        ...


@dataclass(frozen=True)
class Frequencies:
    """The frequencies of all modes of the bodies.

    To first order they are estimated within a factor of 3.5 (`tests/test_estimates.py`).
    """

    settled: ClassVar[dict[str, tuple[float, float]]] = {BENDING: (0.25, 3.0), MASS: (0.25, 3.0)}

    def estimated(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Those of the mode that changes most."""
        return {BENDING: of.bending.max(0), MASS: of.mass.max(0)}

    def change(self, without: LinearModel, refined: LinearModel) -> tuple[float, str]:
        """Of the mode that changes most; modes are paired by their shapes."""
        new = modes.solve(refined)
        changes = _loaded(new, refined) if _massive(refined) else _shifted(modes.solve(without), new, refined)
        most = int(np.argmax(changes))
        return float(changes[most]), new.label[most]


@dataclass(frozen=True)
class Transfer:
    """Responses of outputs to inputs over frequencies (f,) in Hz.

    Their estimate is coarser.  Wires with mass cost no more than wires without: in doubt they are taken and nothing is sampled.
    """

    inputs: list[Signal]
    outputs: list[Signal]
    frequency: Array

    settled: ClassVar[dict[str, tuple[float, float]]] = {BENDING: (0.5, 1.0), MASS: (0.5, 0.5)}

    def estimated(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Far above all modes, a response has the square of each frequency that it touches as a factor, and the pull of each wire."""
        touched = self._touched(found)
        curved = of.curved(float(np.max(self.frequency)))
        bending = (2 * of.bending[touched] + of.loss[touched]).sum(0)
        return {BENDING: bending, MASS: 2 * of.mass[touched].sum(0) + curved}

    def _touched(self, found: Modes) -> Any:
        """Modes in the blocks in which a body moves and is watched: (m,) bool."""
        places = [found.coordinate.index(f"{one.body}.{DOFS[one.dof]}") for one in (*self.inputs, *self.outputs) if one.body != SUPPORT]
        blocks = found.block[(found.shape[:, places] != 0).any(1)]
        return np.isin(found.block, blocks)

    def change(self, without: LinearModel, refined: LinearModel) -> tuple[float, str]:
        """The largest at sampled frequencies away from all modes."""
        known = np.concatenate([modes.solve(model).frequency for model in (without, refined)])
        grid = np.asarray(self.frequency, dtype=float)
        away = grid[(np.abs(grid[:, None] / known[np.isfinite(known) & (known > 0)] - 1) > NEAR).all(1)]
        if not len(away):
            away = grid
        chosen = np.unique(away[np.linspace(0, len(away) - 1, min(SAMPLES, len(away))).astype(int)])
        old, new = (response.solve(model, chosen, self.inputs, self.outputs).value for model in (without, refined))
        # a zero of the response between samples must not decide: sizes are compared with the geometric mean about them
        size = np.maximum(np.abs(new), 0.1 * _smooth(np.abs(new)))
        different = np.where(size > 0, np.abs(old - new) / np.where(size > 0, size, 1.0), np.where(old == new, 0.0, np.inf))
        _, o, i = np.unravel_index(int(np.argmax(different)), different.shape)
        return float(different.max()), f"{self.outputs[int(o)].text}/{self.inputs[int(i)].text}"


@dataclass(frozen=True)
class Several:
    """Several numbers (`analysis.scalars`); what changes one of them most counts.

    Attributes
    ----------
    scalars : tuple of Scalar
    modes : Modes
        Those that numbers of modes are of.
    """

    scalars: tuple[Scalar, ...]
    modes: Modes

    settled: ClassVar[dict[str, tuple[float, float]]] = Frequencies.settled

    def estimated(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Those of the numbers that change most."""
        each = [self._estimated(item, found, of) for item in self.scalars]
        return {name: max((one[name] for one in each), key=lambda part: float(np.nansum(part))) for name in (BENDING, MASS)}

    def _estimated(self, item: Scalar, found: Modes, of: Estimates) -> dict[str, Array]:
        if isinstance(item, Mode):
            return {BENDING: of.bending[item.number], MASS: of.mass[item.number]}
        outputs = [item.over] if item.under is None else [item.over, item.under]
        return Transfer([item.input], outputs, np.array([item.frequency])).estimated(found, of)

    def change(self, without: LinearModel, refined: LinearModel) -> tuple[float, str]:
        """Of the number that changes most; modes are paired by their shapes."""
        new = modes.solve(refined)
        changes = _loaded(new, refined) if _massive(refined) else _shifted(modes.solve(without), new, refined)
        here = _pairs(self.modes, new, refined)
        each = [(float(changes[here[item.number]]) if isinstance(item, Mode) else _resized(item, without, refined), item.text) for item in self.scalars]
        return max(each)


def _resized(item: Ratio, without: LinearModel, refined: LinearModel) -> float:
    """Relative change of the size of a response, or of the ratio of two."""
    outputs = [item.over] if item.under is None else [item.over, item.under]
    old, new = (np.abs(response.solve(model, np.array([item.frequency]), [item.input], outputs).value[0, :, 0]) for model in (without, refined))
    if len(outputs) == 2:
        old, new = (np.array([size[0] / size[1] if size[1] else 0.0]) for size in (old, new))
    return abs(float(old[0] / new[0]) - 1) if new[0] else 0.0 if old[0] == 0 else float("inf")


def _massive(model: LinearModel) -> bool:
    return any(getattr(getattr(term, "strand", None), "massive", False) for term in model.terms)


def _shifted(old: Modes, new: Modes, refined: LinearModel) -> Any:
    """Relative change of each frequency of the refined of two static models, modes paired by their shapes."""
    columns = _pairs(new, old, refined)
    a, b = old.omega_squared[columns], new.omega_squared
    changes = np.where(b > 0, np.abs(np.sqrt(np.abs(a) / np.where(b > 0, b, 1.0)) - 1), 0.0)
    if old.stable != new.stable:
        changes[0] = np.inf
    return changes


def _pairs(rows: Modes, columns: Modes, model: LinearModel) -> Any:
    """For each mode of one model that of another whose shape is most like it."""
    count = 6 * len(model.body)
    return _paired(np.abs(rows.shape[:, :count] @ model.mass[6 : 6 + count, 6 : 6 + count] @ columns.shape[:, :count].T))


def _paired(overlap: Any) -> Any:
    """For each row its column, the largest overlaps first; shapes that are all but orthogonal leave no choice."""
    left, result = overlap.copy(), np.zeros(len(overlap), dtype=np.intp)
    for _ in range(len(left)):
        row, column = divmod(int(left.argmax()), left.shape[1])
        result[row] = column
        left[row], left[:, column] = -1.0, -1.0
    return result


def _loaded(found: Modes, model: LinearModel) -> Any:
    """Relative change of each frequency by the mass of wires, to first order: v^T (Z(omega) - K + omega^2 M) v / (2 omega^2)."""
    good = found.omega_squared > 0
    omega = np.sqrt(found.omega_squared[good])
    shapes = np.linalg.solve(model.basis, np.pad(found.shape[good], ((0, 0), (6, 0))).T)
    change = np.zeros(len(omega))
    for strand, ends in quality.ends_of(model, shapes.T):
        there = replace(strand, lossy=False).at(omega)
        for part, moved in ends.items():
            change += np.einsum("iwm,ijm,jwm->m", moved, there.stiffness(part) - strand.resting(part), moved)
    result = np.zeros(len(found.omega_squared))
    result[good] = np.abs(change / (2 * omega**2))
    return result


def _smooth(size: Any) -> Any:
    """Geometric mean of each size with its neighbours along the first axis."""
    logs = np.log(np.where(size > 0, size, 1e-300))
    padded = np.concatenate([logs[:1], logs, logs[-1:]])
    return np.where(size > 0, np.exp((padded[:-2] + padded[1:-1] + padded[2:]) / 3), 0.0)
