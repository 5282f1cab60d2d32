"""What many random builds say together: quantiles, share under a limit, and which imperfections matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.design.scene import Array

LEVELS = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are told."""
RANKED = 20_000
"""Builds (the first ones) that rank correlations are computed from: their error is below 1 %."""


@dataclass(frozen=True)
class Summary:
    """A finished set of random builds.

    Attributes
    ----------
    builds, good : int
        How many were made, and how many have an equilibrium on taut wires.
    failures : dict of str to int
        Builds by reason of failure.
    label : tuple of str
        Of the nominal modes.
    nominal : (m,) array
        Their frequencies, Hz.
    mean, spread : (m,) arrays
        Mean and standard deviation over the builds, Hz.
    quantiles : (m, 7) array
        At `LEVELS`, Hz.
    frequency : float
        At which the cross-coupling is told, Hz.
    limit : float
    under : float
        Share of the good builds whose |ratio| is below the limit.
    ratio_quantiles : (7,) array
    ratio_sorted : (b,) array
        |ratio| of good builds in ascending order, thinned to at most some thousand points.
    factor : tuple of str
        What scattered.
    ratio_rank : (factors,) array
        Rank correlation of |ratio| with the size of each deviation.
    mode_rank : (m, factors) array
        Rank correlation of each frequency with each deviation.
    sample : (b, m) array
        Frequencies of some builds over nominal less 1, for pictures.
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


def rank_correlation(a: Array, b: Array) -> Array:
    """Spearman's rank correlation of every column of a (p, n) with every column of b (p, m): (n, m).

    Equal values are ranked in their order; a column that does not vary correlates with nothing.
    """
    if not len(a):
        return np.zeros((a.shape[1], b.shape[1]))
    ranks = []
    for values in (a, b):
        order = np.argsort(np.argsort(values, axis=0, kind="stable"), axis=0).astype(float)
        order -= order.mean(0)
        norm = np.sqrt((order**2).sum(0))
        constant = values.max(0, initial=-np.inf) == values.min(0, initial=np.inf)
        ranks.append(np.where(constant, 0.0, order / np.where(norm > 0, norm, 1.0)))
    return ranks[0].T @ ranks[1]


def leading(correlation: Array, names: tuple[str, ...], count: int = 5) -> list[tuple[str, float]]:
    """The strongest correlations, by size."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [(names[n], float(correlation[n])) for n in order]
