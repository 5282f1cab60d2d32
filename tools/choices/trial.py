"""Error and cost of `auto` for one random suspension, and cost of the cheapest accurate model."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tools.choices.quantities import REFERENCE, Question

REPETITIONS = 3


@dataclass(frozen=True)
class Trial:
    """Result for one random suspension.

    Attributes
    ----------
    seed : int
    stages : int
    quantity : str
    tolerance : float
    level : str
        Model that `auto` chose.
    error : float
        Relative, against the reference model.
    cost : float
        Time of `auto`, choice included, over that of the reference model: medians of repetitions.
    best : float
        The same for the cheapest model within the tolerance, if that were known beforehand.
    seconds : float
        Time of the reference model.
    """

    seed: int
    stages: int
    quantity: str
    tolerance: float
    level: str
    error: float
    cost: float
    best: float
    seconds: float


def run_trial(seed: int, stages: int, quantity: str, tolerance: float, question: Question) -> Trial:
    """Run `auto` and all models in turns."""
    works: dict[str, Callable[[], Any]] = {"auto": question.solve_auto}
    works |= {
        level: lambda level=level: question.solve_on(level)
        for level in (*question.cheaper, REFERENCE)
    }
    times: dict[str, list[float]] = {name: [] for name in works}
    results = {name: work() for name, work in works.items()}
    for _ in range(REPETITIONS):
        for name, work in works.items():
            start = time.perf_counter()
            work()
            times[name].append(time.perf_counter() - start)
    cost = {name: float(np.median(row)) for name, row in times.items()}
    accurate = [
        cost[level] for level in question.cheaper if question.error(results[level]) <= tolerance
    ]
    level, result = results["auto"]
    return Trial(
        seed,
        stages,
        quantity,
        tolerance,
        level,
        question.error(result),
        cost["auto"] / cost[REFERENCE],
        min([*accurate, cost[REFERENCE]]) / cost[REFERENCE],
        cost[REFERENCE],
    )
