"""One random suspension: the error and the cost of what `auto` takes, and of the cheapest rung that would have done."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from choices.asked import TOP, Question

REPETITIONS = 3


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
    best : float
        The same of the cheapest rung whose error is within the tolerance, were it known beforehand.
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
    best: float
    seconds: float


def tried(seed: int, stages: int, quantity: str, tolerance: float, question: Question) -> Trial:
    """`auto` and every rung, in turns."""
    works: dict[str, Callable[[], Any]] = {"auto": question.decided}
    works |= {level: lambda level=level: question.on(level) for level in (*question.lower, TOP)}
    times: dict[str, list[float]] = {name: [] for name in works}
    answers = {name: work() for name, work in works.items()}
    for _ in range(REPETITIONS):
        for name, work in works.items():
            start = time.perf_counter()
            work()
            times[name].append(time.perf_counter() - start)
    cost = {name: float(np.median(row)) for name, row in times.items()}
    right = [cost[level] for level in question.lower if question.apart(answers[level]) <= tolerance]
    level, answer = answers["auto"]
    return Trial(seed, stages, quantity, tolerance, level, question.apart(answer), cost["auto"] / cost[TOP], min([*right, cost[TOP]]) / cost[TOP], cost[TOP])
