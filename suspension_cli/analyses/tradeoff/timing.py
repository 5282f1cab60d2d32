"""Comparable processor times of several functions on a shared machine.

Processor time excludes waiting. Functions run in turns, which spreads drifts over all of them, so
that ratios of medians are more reproducible than times. Quartiles show the remaining scatter.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float

Found = TypeVar("Found")
Work = Callable[[], object]

LEAST = 1e-3
"""Least duration of a sample, s; fast functions are repeated."""
BUDGET = 0.05
"""Processor time after which sampling of a function ends, s."""
LONG = 10
"""Duration of the first call, in budgets, above which it is the only sample."""
MOST = 200
"""Most repetitions in a sample."""
RESOLUTION = time.get_clock_info("process_time").resolution
"""Step of the clock and least time, s, as others are divided by it."""
TRIES = 4
"""Calls of a fast function to determine its repetitions."""


def threads() -> int:
    """Number of threads of linear algebra in the environment; 0 if not set."""
    given = [os.environ.get(f"{name}_NUM_THREADS", "") for name in ("OPENBLAS", "OMP", "MKL")]
    return max((int(value) for value in given if value.isdigit()), default=0)


def quartiles(
    works: Sequence[Work], repeat: int, known: Sequence[float] = (), budget: float = BUDGET
) -> Float[np.ndarray, "work 3"]:
    """Measure the lower quartile, median and upper quartile of the times of functions, s.

    Parameters
    ----------
    repeat : int
        Samples per function; fewer where they take longer than the processor time `budget`, s.
    known : sequence of float
        Times of earlier calls of the first functions, s; one above `LONG` budgets is not repeated.
    """
    if not works:
        return np.zeros((0, 3))
    samples: list[list[float]] = [[taken] if taken > LONG * budget else [] for taken in known]
    samples += [[] for _ in works[len(samples) :]]
    times = [1 if taken else _repetitions(work) for work, taken in zip(works, samples, strict=True)]
    # garbage collection would charge one function for the objects of another
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for _ in range(repeat):
            for work, count, taken in zip(works, times, samples, strict=True):
                if not taken or sum(taken) * count < budget:
                    taken.append(_mean_time(work, count))
    finally:
        if enabled:
            gc.enable()
    return np.array([np.quantile(taken, (0.25, 0.5, 0.75)) for taken in samples])


def call(work: Callable[[], Found]) -> tuple[Found, float]:
    """Return the result of a function, and its processor time, s."""
    begin = time.process_time()
    found = work()
    return found, max(time.process_time() - begin, RESOLUTION)


def _repetitions(work: Work) -> int:
    """Determine the repetitions per sample; the first call fills caches."""
    _, taken = call(work)
    if taken < LEAST:  # a single time may be an outlier
        taken = min(_mean_time(work, 1) for _ in range(TRIES))
    return int(np.clip(np.ceil(LEAST / max(taken, 1e-9)), 1, MOST))


def _mean_time(work: Work, count: int) -> float:
    """Measure the mean processor time of `count` calls, s."""
    begin = time.process_time()
    for _ in range(count):
        work()
    return max(time.process_time() - begin, RESOLUTION) / count
