"""Error and cost of `auto` for one random suspension, and cost of the cheapest accurate model."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from tools.choices.quantities import REFERENCE, Question

REPETITIONS = 5
"""Number of times that work is timed, after once to compile and to fill caches."""
SLOW = 0.2
"""Seconds from which it is timed once."""
ROUNDING = 1e-8
"""Errors below this are those of the comparison."""


@dataclass(frozen=True)
class Trial:
    """Result for one random suspension.

    Attributes
    ----------
    generator : str
    seed : int
    design : str
    stages : int
    quantity : str
    tolerance : float
    level : str
        Model that `auto` chose.
    error : float
        Relative, against the reference model.
    estimate : float
        The error that `auto` reports; NaN if unknown.
    cost : float
        Processor time of `auto`, choice included, over that of the reference model: the shortest
        of the repetitions.
    best : float
        The same for the cheapest model within the tolerance, if that were known beforehand.
    seconds : float
        Time of the reference model.
    """

    generator: str
    seed: int
    design: str
    stages: int
    quantity: str
    tolerance: float
    level: str
    error: float
    estimate: float
    cost: float
    best: float
    seconds: float

    @property
    def miss(self) -> float:
        """Error over the tolerance."""
        return self.error / self.tolerance

    @property
    def excess(self) -> float:
        """Error over its estimate; 0 if it is unknown or rounding."""
        if not self.error > ROUNDING or np.isnan(self.estimate):
            return 0.0
        return self.error / self.estimate if self.estimate else float("inf")

    @property
    def overhead(self) -> float:
        """Cost over that of the cheapest model within the tolerance."""
        return self.cost / self.best


def run_trial(
    generator: str, seed: int, design: Design, quantity: str, tolerance: float, question: Question
) -> Trial:
    """Run `auto` and all models in turns."""
    works: dict[str, Callable[[], Any]] = {"auto": question.solve_auto}
    works |= {
        level: lambda level=level: question.solve_on(level)
        for level in (*question.cheaper, REFERENCE)
    }
    results = {name: _attempted(work) for name, work in works.items()}
    works = {name: work for name, work in works.items() if results[name] is not None}
    cost = dict.fromkeys(works, np.inf)
    for _ in range(REPETITIONS):
        for name, work in works.items():
            if SLOW < cost[name] < np.inf:
                continue
            start = time.process_time()
            work()
            cost[name] = min(cost[name], time.process_time() - start)
    accurate = [
        cost[level]
        for level in question.cheaper
        if level in works and question.error(results[level]) <= tolerance
    ]
    choice, result = results["auto"]
    return Trial(
        generator,
        seed,
        design.design.name,
        len(design.stage),
        quantity,
        tolerance,
        choice.level,
        question.error(result),
        choice.error,
        cost["auto"] / cost[REFERENCE],
        min([*accurate, cost[REFERENCE]]) / cost[REFERENCE],
        cost[REFERENCE],
    )


def _attempted(work: Callable[[], Any]) -> Any:
    """Result of a model; None if the design has no equilibrium in it."""
    try:
        return work()
    except InputError:
        return None
