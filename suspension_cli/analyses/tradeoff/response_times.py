"""Times of a first response, and of next ones with the same preparation.

A session prepares a method and computes a response three times: twice on the same frequencies, then
on others.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tradeoff import high_precision, timing, transfer_functions
from suspension_cli.analyses.tradeoff.result import COUNTS, ResponseTime, ResponseTimes
from suspension_cli.analyses.tradeoff.subject import MODEL_NAMES, STRING, Answer, Prepare, Subject
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float

BAND = (0.1, 1000.0)
"""Range of the frequencies, Hz."""
CHECKED = 200
"""Frequencies at which methods are compared with 50 digits."""
OTHER = 1 + 1e-4
"""Ratio of the frequencies of the other grid to those of the first."""

Begin = Callable[[], Callable[[], Answer]]
"""Prepares a session outside the measured time, and returns the function that begins it."""


def measure(subject: Subject, compares: str, repeat: int, budget: float) -> ResponseTimes:
    """Measure the times of all models, or of all methods on the string model.

    Sessions per method and number of frequencies end after `repeat`, or the processor time
    `budget`, s.
    """
    if compares == "models":
        start, error = "from the design to the result", {}
        begins = {
            (level, "chain"): _from_design(subject, level)
            for level in MODEL_NAMES
            if not subject.unsuited[level]
        }
    else:
        start, error = "from the matrices to the result", _errors(subject)
        begins = {
            (STRING, name): _from_matrices(subject, prepare)
            for name, prepare in transfer_functions.METHODS.items()
        }
    times = np.stack(
        [_times(list(begins.values()), count, repeat, budget) for count in COUNTS], axis=2
    )
    entries = tuple(
        ResponseTime(*name, error.get(name[1], np.nan), time)
        for name, time in zip(begins, times, strict=True)
    )
    return ResponseTimes(compares, start, entries)


def _from_design(subject: Subject, level: str) -> Begin:
    def start() -> Answer:
        model = registry.by_name(level).system(subject.design)
        return transfer_functions.chained(model, *subject.forms(model))

    return lambda: start


def _from_matrices(subject: Subject, prepare: Prepare) -> Begin:
    def begin() -> Callable[[], Answer]:
        model = subject.fresh(STRING)
        forms = subject.forms(model)
        return lambda: prepare(model, *forms)

    return begin


def _errors(subject: Subject) -> dict[str, float]:
    """Compute the largest relative error of each method over the band."""
    model, omega = subject.model(STRING), 2 * np.pi * np.geomspace(*BAND, CHECKED)
    forms = subject.forms(model)
    exact = high_precision.response(model, omega, *forms)
    size = np.where(exact == 0, 1.0, np.abs(exact))
    return {
        name: float((np.abs(subject.prepared(prepare)(omega) - exact) / size).max())
        for name, prepare in transfer_functions.METHODS.items()
    }


def _times(
    begins: list[Begin], count: int, repeat: int, budget: float
) -> Float[np.ndarray, "session occasion quartile"]:
    """Measure the quartiles of the times of sessions, in turns."""
    grid = 2 * np.pi * np.geomspace(*BAND, count)
    grids = (grid, grid, grid * OTHER)
    samples: list[list[Array]] = [[] for _ in begins]
    for turn in range(repeat + 1):
        for begin, taken in zip(begins, samples, strict=True):
            if turn == 1 and np.nansum(taken) < timing.LONG * budget:
                taken.clear()  # the first session filled caches
            if not taken or np.nansum(taken) < budget:
                taken.append(_session(begin(), grids, timing.LONG * budget))
    return np.stack([np.quantile(taken, (0.25, 0.5, 0.75), axis=0).T for taken in samples])


def _session(
    start: Callable[[], Answer], grids: tuple[Array, ...], most: float
) -> Float[np.ndarray, " occasion"]:
    """Measure processor times, s; those of next responses are NaN if the first exceeds `most`."""

    def first() -> tuple[Answer, np.ndarray]:
        answer = start()
        return answer, answer(grids[0])

    (answer, _), taken = timing.call(first)
    if taken > most:
        return np.array([taken, np.nan, np.nan])
    following = (timing.call(lambda grid=grid: answer(grid))[1] for grid in grids[1:])
    return np.array([taken, *following])
