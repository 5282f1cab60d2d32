"""Comparable processor times of several functions.

Machines are shared and noisy. Processor time excludes waiting; running the functions in turns
spreads drifts over all of them, so that ratios of medians are more reproducible than times.
Quartiles show the remaining scatter.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Sequence

import numpy as np

from suspension_cli.scene.arrays import Array

Work = Callable[[], object]

LEAST = 2e-3
"""Shortest duration of a sample, s; it repeats fast functions."""
MOST = 200
"""Most repetitions in a sample."""
TRIES = 4
"""Additional calls of a fast function to determine the repetitions."""


def threads() -> int:
    """Number of threads that the environment sets for linear algebra; 0 if it sets none."""
    given = [os.environ.get(f"{name}_NUM_THREADS", "") for name in ("OPENBLAS", "OMP", "MKL")]
    return max((int(value) for value in given if value.isdigit()), default=0)


def quartiles(works: Sequence[Work], repeat: int) -> Array:
    """Measure the lower quartile, median and upper quartile of the times of functions, (w, 3), s.

    Parameters
    ----------
    works : sequence of callables
    repeat : int
        Samples per function.
    """
    if not works:
        return np.zeros((0, 3))
    times = [_repetitions(work) for work in works]
    samples = np.zeros((len(works), repeat))
    # garbage collection would charge one function for the objects of another
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for sample in range(repeat):
            for n, (work, count) in enumerate(zip(works, times, strict=True)):
                samples[n, sample] = _mean_time(work, count)
    finally:
        if enabled:
            gc.enable()
    return np.quantile(samples, (0.25, 0.5, 0.75), axis=1).T


def _repetitions(work: Work) -> int:
    """Repetitions of a function per sample; calls it at least twice, which fills its caches."""
    work()
    taken = _mean_time(work, 1)
    if taken < LEAST:  # a single time may be an outlier
        taken = min(taken, *(_mean_time(work, 1) for _ in range(TRIES)))
    return int(np.clip(np.ceil(LEAST / max(taken, 1e-9)), 1, MOST))


def _mean_time(work: Work, count: int) -> float:
    """Mean processor time of `count` calls, s."""
    begin = time.process_time()
    for _ in range(count):
        work()
    return (time.process_time() - begin) / count
