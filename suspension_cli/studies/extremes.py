"""Points of a study at which models are compared once it has been computed.

The error of a model is large where results are large, where a small shift of a resonance changes
them much, and where one of the models has no result: at the largest and smallest results, at
neighbours between which they change most, and at neighbours of which one failed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import chain, zip_longest
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

MOST = 12
"""Largest number of points, not counting those beside failed ones."""
STEEP = 4
"""Pairs of neighbours per result, of absolute and of relative changes each."""
FAILED = 2
"""Pairs of neighbours of which one failed."""
TOGETHER = 1 << 16
"""Points whose neighbours are compared at once."""


def find_extremes(
    value: Inexact[np.ndarray, "*grid result"], most: int = MOST
) -> Int[np.ndarray, " point"]:
    """Find points, by their numbers in the grid, with extreme and fast changing results.

    At most `most`, not counting those beside failed points, which are NaN. Those of results that
    vary most over the grid are first.

    >>> resonance = 1 / np.abs(np.linspace(0.9, 1.2, 31) - 1.003)
    >>> find_extremes(resonance[:, None]).tolist()[:5]
    [8, 9, 10, 11, 12]
    """
    shape = value.shape[:-1]
    count = value.shape[-1]
    flat = value.reshape(-1, count)
    ranked = _in_turn([_ranked(flat[:, n], shape) for n in _by_range(flat)])
    known = np.asarray(np.isfinite(flat).any(1))
    beside = [pair[:, known[pair[0]] != known[pair[1]]] for pair in _neighbours(shape)]
    pairs = np.concatenate([np.zeros((2, 0), dtype=int), *beside], axis=1)
    last = pairs.shape[1] - 1
    some = pairs[:, np.linspace(0, last, min(FAILED, last + 1)).astype(int)]
    return np.unique(np.array([*ranked[:most], *some.ravel()], dtype=int))


def find_largest(
    results: Iterable[Inexact[np.ndarray, " point"]],
) -> Int[np.ndarray, " point"]:
    """Find points without neighbours at which results are largest, and smallest.

    Results are taken one after another, as there may be many points.
    """
    found = []
    for value in results:
        size = np.abs(value)
        known = np.flatnonzero(np.isfinite(size))
        order = known[np.argsort(-size[known], kind="stable")]
        ends = [*order[:1].tolist(), *order[-1:].tolist(), *order[1:STEEP].tolist()]
        found.append((_range(size), ends))
    lists = [ends for _, ends in sorted(found, key=lambda one: -one[0])]
    return np.unique(np.array(_in_turn(lists)[:MOST], dtype=int))


def _in_turn(lists: list[list[int]]) -> list[int]:
    """The first members of all lists, then the second ones, ..., each number once."""
    mixed = chain.from_iterable(zip_longest(*lists))
    return [*dict.fromkeys(n for n in mixed if n is not None)]


def _neighbours(shape: tuple[int, ...]) -> Iterator[Int[np.ndarray, "2 pair"]]:
    """Numbers of all points of a grid that have a next one along an axis, and of these, in parts.

    A grid of a million points needs no memory for all its pairs.
    """
    count = int(np.prod(shape, dtype=int))
    for axis, length in enumerate(shape):
        step = int(np.prod(shape[axis + 1 :], dtype=int))
        for start in range(0, count, TOGETHER):
            low = np.arange(start, min(start + TOGETHER, count))
            low = low[low // step % length < length - 1]
            yield np.stack([low, low + step])


def _by_range(value: Inexact[np.ndarray, "point result"]) -> list[int]:
    """Numbers of the results, that with the largest ratio of its extremes first."""
    ranges = [-_range(np.abs(value[:, n])) for n in range(value.shape[1])]
    return np.argsort(ranges, kind="stable").tolist()


def _range(size: Float[np.ndarray, " point"]) -> float:
    """Ratio of the largest size of a result to the smallest; -1 without any."""
    low = np.fmin.reduce(size)
    high = np.fmax.reduce(size)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(high / low, nan=-1.0))


def _ranked(value: Inexact[np.ndarray, " point"], shape: tuple[int, ...]) -> list[int]:
    """Points of one result, in turn largest, steepest, smallest, and steepest on a log scale."""
    size = np.abs(value)
    known = np.flatnonzero(np.isfinite(size))
    if not len(known):
        return []
    steep: list[Steep] = []
    steep_log: list[Steep] = []
    for low, high in _neighbours(shape):
        with np.errstate(divide="ignore", invalid="ignore"):
            change = np.abs(value[high] - value[low])
            relative = np.abs(np.log(size[high] / size[low]))
        steep = _steepest(steep, change, low, high)
        steep_log = _steepest(steep_log, relative, low, high)
    largest = known[np.argmax(size[known])]
    smallest = known[np.argmin(size[known])]
    both = zip_longest(steep, steep_log, fillvalue=(0.0, ()))
    pairs = [pair for two in both for _, pair in two]
    first = chain.from_iterable(pairs[:2])
    others = chain.from_iterable(pairs[2:])
    return [int(largest), *first, int(smallest), *others]


Steep = tuple[float, tuple[int, int]]
"""Change of a result between two neighbours, and these."""


def _steepest(
    known: list[Steep],
    change: Float[np.ndarray, " pair"],
    low: Int[np.ndarray, " pair"],
    high: Int[np.ndarray, " pair"],
) -> list[Steep]:
    """Pairs of neighbours between which a result changes most, of those known and further ones."""
    change = np.where(np.isfinite(change), change, -1.0)
    order = np.argsort(-change, kind="stable")[:STEEP].tolist()
    more = [(float(change[n]), (int(low[n]), int(high[n]))) for n in order if change[n] > 0]
    return sorted([*known, *more], key=lambda one: -one[0])[:STEEP]
