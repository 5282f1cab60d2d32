"""Points of a study at which models are compared once it has been computed.

The error of a model is large where results are large, where a small shift of a resonance changes
them much, and where one of the models has no result: at the largest and smallest results, at
neighbours between which they change most, and at neighbours of which one failed.
"""

from __future__ import annotations

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
    low, high = _neighbours(shape)
    ranked = _in_turn([_ranked(flat[:, n], low, high) for n in _by_range(np.abs(flat))])
    known = np.asarray(np.isfinite(flat).any(1))
    beside = np.flatnonzero(known[low] != known[high])
    some = beside[np.linspace(0, len(beside) - 1, min(FAILED, len(beside))).astype(int)]
    return np.unique(np.array([*ranked[:most], *low[some], *high[some]], dtype=int))


def find_largest(value: Inexact[np.ndarray, "point result"]) -> Int[np.ndarray, " point"]:
    """Find points without neighbours at which results are largest, and smallest."""
    size = np.abs(value)
    lists = []
    for n in _by_range(size):
        known = np.flatnonzero(np.isfinite(size[:, n]))
        order = known[np.argsort(-size[known, n], kind="stable")].tolist()
        lists.append([*order[:1], *order[-1:], *order[1:STEEP]])
    return np.unique(np.array(_in_turn(lists)[:MOST], dtype=int))


def _in_turn(lists: list[list[int]]) -> list[int]:
    """The first members of all lists, then the second ones, ..., each number once."""
    mixed = chain.from_iterable(zip_longest(*lists))
    return [*dict.fromkeys(n for n in mixed if n is not None)]


def _neighbours(
    shape: tuple[int, ...],
) -> tuple[Int[np.ndarray, " pair"], Int[np.ndarray, " pair"]]:
    """Numbers of all points of a grid that have a next one along an axis, and of these."""
    number = np.arange(np.prod(shape, dtype=int)).reshape(shape)
    axes = range(len(shape))
    low = [np.take(number, np.arange(shape[n] - 1), axis=n).ravel() for n in axes]
    high = [np.take(number, np.arange(1, shape[n]), axis=n).ravel() for n in axes]
    return np.concatenate(low), np.concatenate(high)


def _by_range(size: Float[np.ndarray, "point result"]) -> list[int]:
    """Numbers of the results, that with the largest ratio of its extremes first."""
    low = np.fmin.reduce(size, axis=0)
    high = np.fmax.reduce(size, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        spread = np.nan_to_num(high / low, nan=-1.0)
    return np.argsort(-spread, kind="stable").tolist()


def _ranked(
    value: Inexact[np.ndarray, " point"],
    low: Int[np.ndarray, " pair"],
    high: Int[np.ndarray, " pair"],
) -> list[int]:
    """Points of one result, in turn largest, steepest, smallest, and steepest on a log scale."""
    size = np.abs(value)
    known = np.flatnonzero(np.isfinite(size))
    if not len(known):
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.abs(value[high] - value[low])
        relative = np.abs(np.log(size[high] / size[low]))
    steep, steep_log = (_largest_pairs(one, low, high) for one in (change, relative))
    largest = known[np.argmax(size[known])]
    smallest = known[np.argmin(size[known])]
    pairs = [pair for both in zip_longest(steep, steep_log, fillvalue=()) for pair in both]
    first = chain.from_iterable(pairs[:2])
    others = chain.from_iterable(pairs[2:])
    return [int(largest), *first, int(smallest), *others]


def _largest_pairs(
    change: Float[np.ndarray, " pair"],
    low: Int[np.ndarray, " pair"],
    high: Int[np.ndarray, " pair"],
) -> list[tuple[int, int]]:
    """Pairs of neighbours between which a result changes most."""
    change = np.where(np.isfinite(change), change, -1.0)
    order = np.argsort(-change, kind="stable")[:STEEP]
    return [(int(low[n]), int(high[n])) for n in order if change[n] > 0]
