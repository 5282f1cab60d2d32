"""What is asked of a random suspension, its answer by `auto` and by the top rung, how far they are apart and what they cost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator
from scipy.optimize import linear_sum_assignment

from suspension_cli.analysis import auto, modes, response, signals, thermal, wire_modes
from suspension_cli.conventions import DOFS
from suspension_cli.design.schema import Design
from suspension_cli.models import fidelity, wire_mass

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
REPETITIONS = 3

Answer = tuple[str, Any]
"""A rung and what was found."""


@dataclass(frozen=True)
class Trial:
    """One scene.

    Attributes
    ----------
    seed : int
    stages : int
    quantity : str
    tolerance : float
    level : str
        The rung that `auto` took.
    error : float
        Against the top rung, relative.
    cost : float
        Of `auto`, decision and all, over that of the top rung: medians of turns.
    seconds : float
        Of the top rung.
    """

    seed: int
    stages: int
    quantity: str
    tolerance: float
    level: str
    error: float
    cost: float
    seconds: float


def compared(
    seed: int, quantity: str, design: Design, tolerance: float, ours: Callable[[], Answer], top: Callable[[], Answer], apart: Callable[..., float]
) -> Trial:
    """Both answers, in turns."""
    times: tuple[list[float], list[float]] = ([], [])
    answers: list[Answer] = [ours(), top()]
    for _ in range(REPETITIONS):
        for n, work in enumerate((ours, top)):
            start = time.perf_counter()
            answers[n] = work()
            times[n].append(time.perf_counter() - start)
    middle = [float(np.median(row)) for row in times]
    return Trial(seed, len(design.stage), quantity, tolerance, answers[0][0], apart(answers[0][1], answers[1][1]), middle[0] / middle[1], middle[1])


def frequencies(design: Design, _: Generator, tolerance: float) -> tuple[Callable[[], Answer], Callable[[], Answer], Callable[..., float]]:
    """The modes of the bodies."""

    def listed(model: Any) -> Any:
        return wire_modes.solve(model, float(np.nanmax(modes.solve(model).frequency)))

    def ours() -> Answer:
        decision = auto.decide(design, lambda _: auto.Frequencies(), tolerance)
        level = decision.choice.level
        return level, (decision.model, listed(decision.model) if level == "violin" else modes.solve(decision.model))

    def top() -> Answer:
        model = fidelity.linear_model(design, "violin")
        return "violin", (model, listed(model))

    def apart(quick: Any, slow: Any) -> float:
        count = 6 * len(design.stage)
        mass = slow[0].mass[6 : 6 + count, 6 : 6 + count]
        overlap = np.abs(slow[1].shape[:, :count] @ mass @ quick[1].shape[:, :count].T)
        rows, columns = linear_sum_assignment(-overlap)
        good = (overlap[rows, columns] > ALIKE) & (slow[1].frequency[rows] > 0)
        return float(np.abs(quick[1].frequency[columns] / np.where(good, slow[1].frequency[rows], 1.0) - 1)[good].max(initial=0.0))

    return ours, top, apart


def responses(design: Design, rng: Generator, tolerance: float) -> tuple[Callable[[], Answer], Callable[[], Answer], Callable[..., float]]:
    """From one motion of the support, or a force on the first body, to a motion of the last."""
    dof = int(rng.integers(6))
    first, last = design.stage[0].name, design.stage[-1].name
    drive = f"support.{DOFS[dof]}" if rng.random() < 0.5 else f"{first}.{signals.FORCES[dof]}"
    grid = _grid(rng)

    def asked(model: Any) -> auto.Transfer:
        known = signals.bodies(model)
        return auto.Transfer([signals.drive(drive, known)], [signals.motion(f"{last}.{DOFS[dof]}", known)], grid)

    def solved(model: Any, frequency: Any) -> Any:
        one = asked(model)
        return response.solve(model, frequency, one.inputs, one.outputs).value[:, 0, 0]

    def ours() -> Answer:
        decision = auto.decide(design, asked, tolerance)
        return decision.choice.level, solved(decision.model, grid)

    def top() -> Answer:
        return "violin", solved(fidelity.linear_model(design, "violin"), grid)

    def apart(quick: Any, _: Any) -> float:
        model = fidelity.linear_model(design, "violin")
        return shifted(rng, grid, quick, _dense(model, grid, tolerance), partial(solved, model), tolerance)

    return ours, top, apart


def noises(design: Design, rng: Generator, tolerance: float) -> tuple[Callable[[], Answer], Callable[[], Answer], Callable[..., float]]:
    """Thermal noise of a motion of the last body."""
    output, grid = f"{design.stage[-1].name}.{rng.choice(['x', 'x', 'y', 'z', 'pitch', 'yaw'])}", _grid(rng)

    def solved(level: str, frequency: Any) -> Any:
        model = fidelity.linear_model(design, level)
        signal, row = thermal.observed(model, output)
        return thermal.solve(model, frequency, row, signal, design.constants.temperature).amplitude

    def ours() -> Answer:
        level = wire_mass.choose(design, "auto", float(grid[-1]), tolerance).level
        return level, solved(level, grid)

    def apart(quick: Any, _: Any) -> float:
        dense = _dense(fidelity.linear_model(design, "violin"), grid, tolerance)
        return shifted(rng, grid, quick, dense, partial(solved, "violin"), tolerance)

    return ours, lambda: ("violin", solved("violin", grid)), apart


def shifted(rng: Generator, grid: Any, quick: Any, dense: Any, exact: Callable[[Any], Any], tolerance: float) -> float:
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


QUANTITIES = {"modes": frequencies, "response": responses, "thermal noise": noises}
"""What can be asked for."""
