"""`auto`: the lowest rung of the ladder whose error in what is asked for is under the tolerance.

Three refinements can be left out: blades as coordinates (`force` takes them in series), bending, torsion and loss of wires (`beam` has them), the mass
of wires (`violin`).  What they would change is estimated from the modes of the simplest model (`analysis.estimates`), before any other is built.  What is
far below the tolerance is left out and what is far above is taken; in between the asked quantity itself is sampled with and without the refinement.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

from suspension_cli.analysis import modes, response
from suspension_cli.analysis.estimates import BENDING, MASS, REFINEMENTS, SERIES, Estimates, estimates
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.signals import Signal
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.mechanics import dispersive, distributed
from suspension_cli.mechanics.model import LinearModel
from suspension_cli.models import fidelity, force
from suspension_cli.models.fidelity import Choice

TOLERANCE = 1e-3
"""Relative error that `auto` allows by default."""
MARGIN = 0.8
"""Share of the tolerance that all refinements which are left out may be seen to change."""
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

    def change(self, without: LinearModel, refined: LinearModel) -> float:
        """Its largest relative change from one model to a more refined one."""
        ...


@dataclass(frozen=True)
class Refinement:
    """What one refinement does to what is asked for.

    Attributes
    ----------
    name : str
        One of `estimates.REFINEMENTS`.
    indicator : float
        Estimated relative change of what is asked for; NaN where the design does not say enough.
    stage : str
        The stage that has most of it.
    change : float or None
        The relative change, sampled; None where the estimate settled it.
    taken : bool
    """

    name: str
    indicator: float
    stage: str
    change: float | None
    taken: bool

    @property
    def estimate(self) -> float:
        """Relative change of the asked quantity, sampled or estimated."""
        return self.indicator if self.change is None else self.change


@dataclass(frozen=True)
class Decision:
    """A rung, its model, and what was weighed."""

    choice: Choice
    model: LinearModel
    refinements: tuple[Refinement, ...]


@dataclass(frozen=True)
class Frequencies:
    """The frequencies of all modes of the bodies.

    To first order they are estimated within a factor of 3.5 (`tests/test_estimates.py`).
    """

    settled: ClassVar[dict[str, tuple[float, float]]] = {BENDING: (0.25, 3.0), MASS: (0.25, 3.0)}

    def estimated(self, found: Modes, of: Estimates) -> dict[str, Array]:
        """Those of the mode that changes most."""
        return {BENDING: of.bending.max(0), MASS: of.mass.max(0)}

    def change(self, without: LinearModel, refined: LinearModel) -> float:
        """Largest relative change of a frequency; modes are paired by their shapes."""
        old = modes.solve(without)
        if not _massive(refined):
            return _shifted(old, without, modes.solve(refined), refined)
        return _loaded(modes.solve(refined), refined)


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

    def change(self, without: LinearModel, refined: LinearModel) -> float:
        """Largest relative change at sampled frequencies away from all modes."""
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
        return float(different.max())


def decide(design: Design, make: Callable[[LinearModel], Asked], tolerance: float = TOLERANCE) -> Decision:
    """The lowest rung on which what is asked for is right to a relative tolerance.

    Where a design does not say what its wires are made of, their bending and mass cannot be known, and are left out.

    Parameters
    ----------
    design : Design
    make : callable
        What is asked for, given the simplest model.
    tolerance : float
    """
    base = fidelity.choose(design)
    build = _Builder(design)
    asked = make(build(base.level))
    found = modes.solve(build(base.level))
    of = estimates(design, found)
    expected = asked.estimated(found, of)
    refinements: list[Refinement] = []
    for name in (SERIES, BENDING, MASS):
        if name != SERIES:
            refinements.append(_weigh(name, of.stage, expected[name], asked, build, tolerance, _room(refinements, tolerance)))
        elif base.level == "force" and fidelity.approximate(design):
            change = asked.change(build("force"), build("string"))
            refinements.append(Refinement(SERIES, 1.0, force.series_is_approximate(design)[0], change, taken=not change <= _room([], tolerance)))
    level = next((REFINEMENTS[item.name] for item in reversed(refinements) if item.taken), base.level)
    error = float(sum(item.estimate for item in _left(refinements, level)))
    return Decision(Choice(level, _reason(base, level, refinements, tolerance), error), build(level), tuple(refinements))


def _weigh(name: str, stages: tuple[str, ...], expected: Array, asked: Asked, build: Callable[[str], LinearModel], tolerance: float, room: float) -> Refinement:
    """Whether a refinement is taken, of which `room` is left for what it changes."""
    total = float(expected.sum())
    stage = stages[int(np.argmax(expected))] if stages else ""
    low, high = asked.settled[name]
    if np.isnan(total) or total < low * tolerance:
        return Refinement(name, total, stage, None, taken=False)
    if total > high * tolerance:
        return Refinement(name, total, stage, None, taken=True)
    change = asked.change(build({BENDING: "string", MASS: "beam"}[name]), build(REFINEMENTS[name]))  # one refinement at a time
    return Refinement(name, total, stage, change, taken=not change <= room)


def _room(refinements: list[Refinement], tolerance: float) -> float:
    """What the next refinement may change if it is left out too."""
    level = next((REFINEMENTS[item.name] for item in reversed(refinements) if item.taken), "")
    return MARGIN * tolerance - float(np.nansum([item.estimate for item in _left(refinements, level)]))


def _left(refinements: list[Refinement], level: str) -> list[Refinement]:
    """What a rung does not have; it has what it was not taken for too, if a lower rung has that."""
    rungs = list(REFINEMENTS.values())
    return [item for item in refinements if level not in rungs or rungs.index(REFINEMENTS[item.name]) > rungs.index(level)]


class _Builder:
    """Builds the model of each rung once."""

    def __init__(self, design: Design) -> None:
        self._design = design
        self._known: dict[str, LinearModel] = {}

    def __call__(self, level: str) -> LinearModel:
        if level not in self._known:
            lighter = self._known.get("beam") if level == "violin" else None
            self._known[level] = fidelity.linear_model(self._design, level) if lighter is None else distributed.loaded(lighter)
        return self._known[level]


def _massive(model: LinearModel) -> bool:
    return any(getattr(getattr(term, "strand", None), "massive", False) for term in model.terms)


def _shifted(old: modes.Modes, without: LinearModel, new: modes.Modes, refined: LinearModel) -> float:
    """Largest relative change of a frequency between two static models, modes paired by their shapes."""
    if old.stable != new.stable:
        return float("inf")
    count = 6 * len(without.body)
    mass = refined.mass[6 : 6 + count, 6 : 6 + count]
    columns = _paired(np.abs(new.shape[:, :count] @ mass @ old.shape[:, :count].T))
    a, b = np.abs(old.omega_squared[columns]), np.abs(new.omega_squared)
    return float(np.abs(np.sqrt(a / np.where(b == 0, 1.0, b)) - 1)[b > 0].max(initial=0.0))


def _paired(overlap: Any) -> Any:
    """For each row its column, the largest overlaps first; shapes that are all but orthogonal leave no choice."""
    left, result = overlap.copy(), np.zeros(len(overlap), dtype=np.intp)
    for _ in range(len(left)):
        row, column = divmod(int(left.argmax()), left.shape[1])
        result[row] = column
        left[row], left[:, column] = -1.0, -1.0
    return result


def _loaded(found: modes.Modes, model: LinearModel) -> float:
    """Largest relative change of a frequency by the mass of wires, to first order: v^T (Z(omega) - K + omega^2 M) v / (2 omega^2)."""
    good = found.omega_squared > 0
    omega = np.sqrt(found.omega_squared[good])
    shapes = np.linalg.solve(model.basis, np.pad(found.shape[good], ((0, 0), (6, 0))).T)
    change = np.zeros(len(omega))
    for block in dispersive.blocks(model):
        there = block.at(omega, lossy=False)
        own = shapes[block.keep]
        static = block.constant[:, 6:, None] - omega**2 * block.mass[:, 6:, None]
        change += np.einsum("im,ijm,jm->m", own, there.matrix[:, 6:] - static.real, own)
    return float(np.abs(change / (2 * omega**2)).max(initial=0.0))


def _smooth(size: Any) -> Any:
    """Geometric mean of each size with its neighbours along the first axis."""
    logs = np.log(np.where(size > 0, size, 1e-300))
    padded = np.concatenate([logs[:1], logs, logs[-1:]])
    return np.where(size > 0, np.exp((padded[:-2] + padded[1:-1] + padded[2:]) / 3), 0.0)


def _reason(base: Choice, level: str, refinements: list[Refinement], tolerance: float) -> str:
    """One line: what was left out, and why."""
    left = _left(refinements, level)
    unknown = [item.name for item in left if np.isnan(item.indicator)]
    small = [f"{item.name} ({item.estimate:.1g})" for item in left if not np.isnan(item.indicator)]
    taken = [f"{item.name} ({item.estimate:.1g}, {item.stage})" for item in refinements if item.taken]
    parts = [base.reason] if level == base.level else [f"for {', '.join(taken)}"]
    if small:
        parts.append(f"left out: {', '.join(small)}; tolerance {tolerance:g}")
    if unknown:
        parts.append(f"unknown, as wires lack material or cross-section: {', '.join(unknown)}")
    return "; ".join(parts)
