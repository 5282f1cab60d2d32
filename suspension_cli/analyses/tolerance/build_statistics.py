"""Statistics of numbers of independent builds: rank correlations, slopes, fractions, errors."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

LEVEL = 0.95
"""Probability that an interval contains the true value."""


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all.

    With its 95 % confidence interval, and its standard error: that of a normal distribution with
    such an interval, which is not 0 where no build fails.
    """

    in_json: ClassVar = Layout(names={"name": "requirement", "fraction": "yield"})
    name: str
    fraction: float
    interval: tuple[float, float]
    error: float

    @staticmethod
    def of(name: str, fraction: float, count: float) -> Yield:
        """Fraction of so many independent builds.

        >>> round(Yield.of("coupling < 0.001", 0.5, 400.0).error, 4)
        0.0249
        """
        low, high = confidence_interval(fraction, count)
        return Yield(name, fraction, (low, high), (high - low) / (2 * normal_quantile()))

    @property
    def percent(self) -> str:
        """Fraction and interval as text."""
        low, high = self.interval
        return f"{100 * self.fraction:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def along_variation(ratio: Complex[np.ndarray, " build"]) -> Complex[np.ndarray, " build"]:
    """Turn complex numbers so that they vary most along the real axis; NaN of NaN.

    Small imperfections add up with their signs, which magnitudes hide: the real part has them. Real
    ratios are unchanged.

    >>> along_variation(np.array([2.0, -1.0, 0.5]) * (1 + 0j)).real
    array([ 2. , -1. ,  0.5])
    """
    known = ratio[np.isfinite(ratio)]
    if not len(known):
        return np.full(len(ratio), complex(np.nan, np.nan))
    phase = np.angle(((known - known.mean()) ** 2).sum()) / 2
    return ratio * np.exp(-1j * phase)


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
    if not count > 0:
        return np.nan, np.nan
    z = normal_quantile()
    middle = fraction + z**2 / (2 * count)
    half = z * math.sqrt(fraction * (1 - fraction) / count + (z / (2 * count)) ** 2)
    scale = 1 + z**2 / count
    return max((middle - half) / scale, 0.0), min((middle + half) / scale, 1.0)


def normal_quantile() -> float:
    """Half width of the interval of a normal distribution, in standard deviations: 1.96."""
    from scipy.special import ndtri  # scipy.stats takes half a second to import

    return float(ndtri((1 + LEVEL) / 2))
