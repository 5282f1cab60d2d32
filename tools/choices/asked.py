"""What can be asked of a random suspension, by `auto` or on any rung, and how far an answer is from that of the top rung."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import msgspec
import numpy as np
from numpy.random import Generator
from scipy.optimize import linear_sum_assignment

from choices import designs
from suspension_cli.analysis import auto, coupling, modes, response, rungs, signals, thermal, wire_modes
from suspension_cli.analysis.asked import Frequencies, Transfer
from suspension_cli.analysis.axes import Axis
from suspension_cli.analysis.coupling import Sweep
from suspension_cli.conventions import DOFS
from suspension_cli.design import reader
from suspension_cli.design.schema import Design
from suspension_cli.models import fidelity, wire_mass
from suspension_cli.models.fidelity import Choice

TOP = "violin"
BUILDS = (41, 5)
"""Of a sweep of couplings, as `pendsus xcouple` takes them by default."""
POINTS = 1000
"""Frequencies of a response or a noise."""
CHECKED = 60
"""Of these, how many are compared with the top rung."""
ABOUT = np.geomspace(1e-7, 0.3, 80)
"""Relative distances from each resonance at which the top rung is looked at, besides `EVERYWHERE` points."""
EVERYWHERE = 2000
WIDE = 10.0
"""Tolerances by which frequency may seem to be shifted."""
ALIKE = 0.7
"""Overlap of two modes that are one and the same; a body's mode that mixes with a wire's has no partner."""


@dataclass(frozen=True)
class Question:
    """What is asked of one design.

    Attributes
    ----------
    lower : tuple of str
        Rungs below the top one that have an answer.
    decided : callable
        The rung that `auto` takes, and its answer.
    on : callable
        The answer on a rung, from the design.
    apart : callable
        Relative error of an answer.
    """

    lower: tuple[str, ...]
    decided: Callable[[], tuple[str, Any]]
    on: Callable[[str], Any]
    apart: Callable[[Any], float]


def frequencies(design: Design, _: Generator, tolerance: float) -> Question:
    """The modes of the bodies."""

    def listed(model: Any, level: str) -> Any:
        still = modes.solve(model)
        return model, wire_modes.solve(model, float(np.nanmax(still.frequency))) if level == TOP else still

    def decided() -> tuple[str, Any]:
        decision = auto.decide(design, lambda _: Frequencies(), tolerance)
        return decision.choice.level, listed(decision.model, decision.choice.level)

    def on(level: str) -> Any:
        return listed(fidelity.linear_model(design, level), level)

    def apart(quick: Any) -> float:
        model, slow = on(TOP)
        count = 6 * len(design.stage)
        overlap = np.abs(slow.shape[:, :count] @ model.mass[6 : 6 + count, 6 : 6 + count] @ quick[1].shape[:, :count].T)
        rows, columns = linear_sum_assignment(-overlap)
        good = (overlap[rows, columns] > ALIKE) & (slow.frequency[rows] > 0)
        return float(np.abs(quick[1].frequency[columns] / np.where(good, slow.frequency[rows], 1.0) - 1)[good].max(initial=0.0))

    return Question((fidelity.choose(design).level, "beam"), decided, on, apart)


def responses(design: Design, rng: Generator, tolerance: float) -> Question:
    """From one motion of the support, or a force on the first body, to a motion of the last."""
    dof = int(rng.integers(6))
    first, last = design.stage[0].name, design.stage[-1].name
    drive = f"support.{DOFS[dof]}" if rng.random() < 0.5 else f"{first}.{signals.FORCES[dof]}"
    grid = _grid(rng)

    def asked(model: Any) -> Transfer:
        known = signals.bodies(model)
        return Transfer([signals.drive(drive, known)], [signals.motion(f"{last}.{DOFS[dof]}", known)], grid)

    def solved(model: Any, frequency: Any) -> Any:
        one = asked(model)
        return response.solve(model, frequency, one.inputs, one.outputs).value[:, 0, 0]

    def decided() -> tuple[str, Any]:
        decision = auto.decide(design, asked, tolerance)
        return decision.choice.level, solved(decision.model, grid)

    def on(level: str) -> Any:
        return solved(fidelity.linear_model(design, level), grid)

    def apart(quick: Any) -> float:
        model = fidelity.linear_model(design, TOP)
        return shifted(rng, grid, quick, _dense(model, grid, tolerance), partial(solved, model))

    return Question((fidelity.choose(design).level, "beam"), decided, on, apart)


def noises(design: Design, rng: Generator, tolerance: float) -> Question:
    """Thermal noise of a motion of the last body."""
    output, grid = f"{design.stage[-1].name}.{rng.choice(['x', 'x', 'y', 'z', 'pitch', 'yaw'])}", _grid(rng)

    def solved(level: str, frequency: Any) -> Any:
        model = fidelity.linear_model(design, level)
        signal, row = thermal.observed(model, output)
        return thermal.solve(model, frequency, row, signal, design.constants.temperature).amplitude

    def decided() -> tuple[str, Any]:
        level = wire_mass.choose(design, "auto", float(grid[-1]), tolerance).level
        return level, solved(level, grid)

    def apart(quick: Any) -> float:
        return shifted(rng, grid, quick, _dense(fidelity.linear_model(design, TOP), grid, tolerance), partial(solved, TOP))

    return Question(("beam",), decided, partial(solved, frequency=grid), apart)


def couplings(design: Design, rng: Generator, tolerance: float) -> Question:
    """From vertical motion of the support to the last body's, x over z a little below its centre, as one wire's stiffness and upper end are off."""
    last, text = design.stage[-1].name, reader.dump(msgspec.to_builtins(design))
    model = fidelity.linear_model(design, "string")
    known, wire = signals.bodies(model), model.wire.index(f"{last}.1")
    motions = (signals.motion(f"{last}.{dof}@0,0,-0.001", known) for dof in "xz")
    asked = coupling.Question(wire, len(design.stage), "loaded-length", signals.drive("support.z", known), *motions, (float(_grid(rng)[-1]),))
    offset = min(1e-3, 0.1 * designs.stretched(design)) * np.linspace(-1, 1, BUILDS[1])
    job = Sweep(text, (Axis("k", tuple(np.linspace(0.9, 1.1, BUILDS[0]))), Axis("offset", tuple(offset))), asked)

    def decided() -> tuple[str, Any]:
        taken, choice, _ = rungs.weighed(job, Choice("string", "given"), tolerance)
        return choice.level, taken.compute(0, job.count)["ratio"]

    def on(level: str) -> Any:
        return replace(job, level=level).compute(0, job.count)["ratio"]

    def apart(quick: Any) -> float:
        exact = on(TOP)
        hung = np.isfinite(exact)
        if (np.isfinite(quick) != hung).any():
            return float("inf")
        largest = np.abs(exact[hung]).max(initial=0.0)
        return float(np.abs(quick - exact)[hung].max(initial=0.0) / largest) if largest else 0.0

    return Question(("string", "beam"), decided, on, apart)


QUANTITIES = {"modes": frequencies, "response": responses, "thermal noise": noises, "couplings": couplings}
"""What can be asked for."""


def shifted(rng: Generator, grid: Any, quick: Any, dense: Any, exact: Callable[[Any], Any]) -> float:
    """How far an answer is from the exact one in size, or in frequency if that is nearer: the largest of some places of the grid.

    Near a resonance a frequency that is off by delta changes a response by Q delta; what is right to a tolerance is what is exact at a frequency that
    is right to it.  Between the frequencies that are looked at, the exact answer is a straight line.
    """
    at = np.sort(rng.choice(len(grid), CHECKED, replace=False))
    value = exact(dense)
    shift = dense / grid[at, None] - 1
    start, size = value[:-1], np.maximum(np.abs(value[:-1]), np.abs(value[1:]))
    wanted, step = quick[at, None] - start, np.diff(value)
    along = np.clip((wanted * step.conj()).real / np.maximum(np.abs(step) ** 2, 1e-300), 0.0, 1.0)
    moved = np.abs(shift[:, :-1] + along * np.diff(shift, axis=1))
    off = np.where(size > 0, np.abs(wanted - along * step) / np.maximum(size, 1e-300), np.where(wanted == 0, 0.0, np.inf))
    return float(np.maximum(off, moved).min(1).max())


def _dense(model: Any, grid: Any, tolerance: float) -> Any:
    """Frequencies all over a grid and beyond its ends, crowded about resonances."""
    room = 1 + WIDE * tolerance
    known = modes.solve(model).frequency
    known = known[known > 0]
    about = np.concatenate([known[:, None] * (1 - ABOUT), known[:, None], known[:, None] * (1 + ABOUT)], axis=1).ravel()
    every = np.union1d(np.union1d(np.geomspace(grid[0] / room, grid[-1] * room, EVERYWHERE), grid), about)
    return every[(every >= grid[0] / room) & (every <= grid[-1] * room)]


def _grid(rng: Generator) -> Any:
    highest = float(np.exp(rng.uniform(np.log(1.0), np.log(100.0))))
    return np.geomspace(0.1, highest, POINTS)
