"""Times that can be compared: every work warm, all in turns, several times over.

Machines are shared and noisy.  What counts is the processor's time, not the clock's, so waiting for a turn is left out; taking turns makes a drift
hit all works alike, so that ratios of medians hold where times themselves do not; quartiles say how far they do.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Sequence

import numpy as np

from suspension_cli.design.scene import Array

Work = Callable[[], object]

LEAST = 2e-3
"""Seconds that a sample takes at least: quick works are done several times in it."""
MOST = 200
"""Times that a work is done in one sample, at most."""
TRIES = 4
"""Times more that a quick work is done to find how many that are."""


def threads() -> int:
    """How many threads linear algebra was told to take, 0 if it was not."""
    told = [os.environ.get(f"{name}_NUM_THREADS", "") for name in ("OPENBLAS", "OMP", "MKL")]
    return max((int(value) for value in told if value.isdigit()), default=0)


def quartiles(works: Sequence[Work], repeat: int) -> Array:
    """Lower quartile, median and upper quartile of the time of each work, s: (w, 3).

    Parameters
    ----------
    works : sequence of callables
    repeat : int
        Samples of each.
    """
    if not works:
        return np.zeros((0, 3))
    times = [_calibrated(work) for work in works]
    samples = np.zeros((len(works), repeat))
    # the collector would charge one work with what another left behind
    enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        for sample in range(repeat):
            for n, (work, count) in enumerate(zip(works, times, strict=True)):
                samples[n, sample] = _timed(work, count)
    finally:
        if enabled:
            gc.enable()
    return np.quantile(samples, (0.25, 0.5, 0.75), axis=1).T


def _calibrated(work: Work) -> int:
    """How often a work is to be done in one sample; done at least twice for it, so that it is warm."""
    work()
    taken = _timed(work, 1)
    if taken < LEAST:  # one alone may have been held up
        taken = min(taken, *(_timed(work, 1) for _ in range(TRIES)))
    return int(np.clip(np.ceil(LEAST / max(taken, 1e-9)), 1, MOST))


def _timed(work: Work, count: int) -> float:
    """Seconds of the processor that a work takes, mean of so many."""
    begin = time.process_time()
    for _ in range(count):
        work()
    return (time.process_time() - begin) / count
