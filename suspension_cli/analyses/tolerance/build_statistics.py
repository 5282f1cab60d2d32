"""Statistics of numbers of independent builds: rank correlations, slopes, fractions, errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

LEVEL = 0.95
"""Probability that an interval contains the true value."""


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all, and its 95 % confidence interval."""

    name: str
    fraction: float
    interval: tuple[float, float]

    @staticmethod
    def of(name: str, met: Bool[np.ndarray, " build"]) -> Yield:
        """Count the builds that meet a requirement of that name."""
        fraction = float(met.mean()) if len(met) else np.nan
        return Yield(name, fraction, confidence_interval(fraction, len(met)))

    @property
    def percent(self) -> str:
        """Fraction and interval as text."""
        low, high = self.interval
        return f"{100 * self.fraction:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def with_sign(ratio: Complex[np.ndarray, " build"]) -> Float[np.ndarray, " build"]:
    """Parts of complex numbers along the phase in which they vary most; NaN of NaN.

    Small imperfections add up with their signs, which magnitudes hide. Real ratios are unchanged.

    >>> with_sign(np.array([2.0, -1.0, 0.5]) * (1 + 0j))
    array([ 2. , -1. ,  0.5])
    """
    known = ratio[np.isfinite(ratio)]
    if not len(known):
        return np.full(len(ratio), np.nan)
    phase = np.angle(((known - known.mean()) ** 2).sum()) / 2
    return (ratio * np.exp(-1j * phase)).real


def unit_ranks(values: Float[np.ndarray, "build column"]) -> Float[np.ndarray, "build column"]:
    """Ranks in each column, less their mean, as unit vectors; 0 for a constant column.

    Equal values have the mean of their ranks. Products of two such vectors are Spearman's rank
    correlations.

    >>> unit_ranks(np.array([[1.0], [1.0], [7.0]]))[:, 0].round(3)
    array([-0.408, -0.408,  0.816])
    """
    apart = np.zeros(values.shape)
    for n, column in enumerate(values.T):
        _, place, count = np.unique(column, return_inverse=True, return_counts=True)
        mean_rank = np.cumsum(count) - (count - 1) / 2
        apart[:, n] = mean_rank[place] - (len(column) + 1) / 2
    size = np.sqrt((apart**2).sum(0))
    return apart / np.where(size > 0, size, 1.0)


def slopes(
    a: Float[np.ndarray, " build"], b: Float[np.ndarray, "build factor"]
) -> Float[np.ndarray, " factor"]:
    """Slopes of the least-squares lines of values over the columns of b.

    >>> slopes(np.array([1.0, 3.0, 5.0]), np.array([[0.0], [1.0], [2.0]]))
    array([2.])
    """
    if not len(a):
        return np.zeros(b.shape[1])
    apart = b - b.mean(0)
    square = (apart**2).sum(0)
    return (a - a.mean()) @ apart / np.where(square > 0, square, 1.0)


def strongest(
    correlation: Float[np.ndarray, " factors"], count: int, least: float = 0.0
) -> list[int]:
    """Numbers of the strongest correlations above a least size, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [int(n) for n in order if abs(correlation[n]) > least]


def confidence_interval(fraction: float, count: float) -> tuple[float, float]:
    """Estimate the confidence interval of a fraction of independent builds.

    After Wilson, J. Am. Stat. Assoc. 22, 209 (1927).

    >>> [round(end, 4) for end in confidence_interval(0.0, 100)]
    [0.0, 0.037]
    """
    from scipy.special import ndtri  # scipy.stats takes half a second to import

    if not count > 0:
        return np.nan, np.nan
    z = float(ndtri((1 + LEVEL) / 2))
    middle = fraction + z**2 / (2 * count)
    half = z * math.sqrt(fraction * (1 - fraction) / count + (z / (2 * count)) ** 2)
    scale = 1 + z**2 / count
    return max((middle - half) / scale, 0.0), min((middle + half) / scale, 1.0)


def standard_error(values: Float[np.ndarray, " build"]) -> float:
    """Estimate the standard error of a mean of independent values; NaN of one."""
    if len(values) < 2:
        return np.nan
    return float(values.std(ddof=1) / np.sqrt(len(values)))
