"""Statistics of random builds: quantiles, fraction below a limit, rank correlations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.scene.arrays import Array

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are reported."""
RANKED = 20_000
"""Number of first builds that rank correlations are computed from, with an error below 0.01."""


@dataclass(frozen=True)
class Summary:
    """Statistics of a set of random builds: m modes.

    Attributes
    ----------
    builds, good : int
        Number of builds, and of those with an equilibrium on taut wires.
    failures : dict of str to int
        Number of builds by reason of failure.
    label : tuple of str
        Labels of the nominal modes.
    nominal : (m,) array
        Their frequencies, Hz.
    mean, spread : (m,) arrays
        Mean and standard deviation over the builds, Hz.
    quantiles : (m, 7) array
        Quantiles of the frequencies at `QUANTILES`, Hz.
    frequency : float
        Frequency of the cross-coupling, Hz.
    limit : float
        Limit on the cross-coupling.
    under : float
        Fraction of the good builds with |ratio| below the limit.
    ratio_quantiles : (7,) array
        Quantiles of |ratio| at `QUANTILES`.
    ratio_sorted : (b,) array
        |ratio| of good builds in ascending order, thinned to a few thousand points.
    factor : tuple of str
        Names of the numbers that vary.
    ratio_rank : (factors,) array
        Rank correlation of |ratio| with the absolute value of each deviation.
    mode_rank : (m, factors) array
        Rank correlation of each frequency with each deviation.
    sample : (b, m) array
        Frequencies of some builds over nominal less 1, for figures.
    ratio : str
        Name of the cross-coupling, ``test.x / test.z``.
    seed : int
        Seed of the random numbers.
    """

    builds: int
    good: int
    failures: dict[str, int]
    label: tuple[str, ...]
    nominal: Array
    mean: Array
    spread: Array
    quantiles: Array
    frequency: float
    limit: float
    under: float
    ratio_quantiles: Array
    ratio_sorted: Array
    factor: tuple[str, ...]
    ratio_rank: Array
    mode_rank: Array
    sample: Array
    ratio: str
    seed: int


def rank_correlation(a: Array, b: Array) -> Array:
    """Spearman's rank correlations (n, m) of the columns of a (p, n) and of b (p, m).

    Those of a constant column are 0.

    >>> rank_correlation(np.array([[1.0], [2.0], [4.0]]), np.array([[3.0], [2.0], [0.0]]))
    array([[-1.]])
    """
    if not len(a):
        return np.zeros((a.shape[1], b.shape[1]))
    from scipy.stats import spearmanr

    both = np.hstack([a, b])
    varies = both.max(0) > both.min(0)
    result = np.zeros((both.shape[1], both.shape[1]))
    if varies.sum() > 1:
        found: Any = spearmanr(both[:, varies])[0]  # a scalar for two columns
        result[np.ix_(varies, varies)] = found
    return result[: a.shape[1], a.shape[1] :]


def leading(correlation: Array, names: tuple[str, ...], count: int = 5) -> list[tuple[str, float]]:
    """List names and values of the `count` strongest correlations, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [(names[n], float(correlation[n])) for n in order]
