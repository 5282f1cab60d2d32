"""Statistics of builds: quantiles, yields, rank correlations, Sobol indices."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are reported."""
RANKED = 20_000
"""Number of first builds for rank correlations, whose error is then below 0.01."""
LEVEL = 0.95
"""Probability that an interval contains the true value."""
SIGNIFICANT = 3.0
"""Least significant correlation, in standard deviations 1/sqrt(N) of N uncorrelated builds."""


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all, and its 95 % confidence interval.

    Failed builds do not meet it.
    """

    name: str
    fraction: float
    interval: tuple[float, float]

    @property
    def percent(self) -> str:
        """Fraction and interval as text."""
        low, high = self.interval
        return f"{100 * self.fraction:.3g} % ({100 * low:.3g} to {100 * high:.3g})"


def unit_ranks(values: Float[np.ndarray, "build column"]) -> Float[np.ndarray, "build column"]:
    """Ranks in each column, less their mean, as unit vectors; 0 for a constant column.

    Products of two such vectors are Spearman's rank correlations.
    """
    if not len(values):
        return np.zeros(values.shape)
    from scipy.stats import rankdata  # spearmanr is slower, as it tests significance

    apart = rankdata(values, axis=0) - (len(values) + 1) / 2
    size = np.sqrt((apart**2).sum(0))
    return apart / np.where(size > 0, size, 1.0)


def slopes(
    a: Float[np.ndarray, "build first"], b: Float[np.ndarray, "build second"]
) -> Float[np.ndarray, "first second"]:
    """Slopes of the least-squares lines of the columns of a over those of b.

    >>> slopes(np.array([[1.0], [3.0], [5.0]]), np.array([[0.0], [1.0], [2.0]]))
    array([[2.]])
    """
    if not len(a):
        return np.zeros((a.shape[1], b.shape[1]))
    apart = b - b.mean(0)
    square = (apart**2).sum(0)
    return (a - a.mean(0)).T @ apart / np.where(square > 0, square, 1.0)


def strongest(
    correlation: Float[np.ndarray, " factors"], count: int, least: float = 0.0
) -> list[int]:
    """Numbers of the strongest correlations above a least size, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [int(n) for n in order if abs(correlation[n]) > least]


def wilson_interval(count: int, builds: int) -> tuple[float, float]:
    """Estimate the confidence interval of a fraction: `count` of so many independent builds.

    After Wilson, J. Am. Stat. Assoc. 22, 209 (1927).

    >>> [round(end, 4) for end in wilson_interval(0, 100)]
    [0.0, 0.037]
    """
    from scipy.stats import binomtest

    if builds == 0:
        return np.nan, np.nan
    found = binomtest(count, builds).proportion_ci(LEVEL, method="wilson")
    return float(found.low), float(found.high)


def replicate_interval(
    met: Bool[np.ndarray, " build"], replicate: Int[np.ndarray, " build"]
) -> tuple[float, float]:
    """Estimate the confidence interval of a fraction from independent replicates.

    Student's t of the replicates' fractions; where all are 0 or 1, the wider interval of
    independent builds.
    """
    from scipy.stats import sem, t

    count, builds = int(met.sum()), len(met)
    parts = _means(met.astype(float), replicate)
    if len(parts) < 2 or count in (0, builds):
        return wilson_interval(count, builds)
    low, high = t.interval(LEVEL, len(parts) - 1, count / builds, sem(parts))
    return max(float(low), 0.0), min(float(high), 1.0)


def standard_error(
    values: Float[np.ndarray, " build"], replicate: Int[np.ndarray, " build"] | None = None
) -> float:
    """Estimate the standard error of a mean of independent values or replicates; NaN of one."""
    parts = values if replicate is None else _means(values, replicate)
    return float(parts.std(ddof=1) / np.sqrt(len(parts))) if len(parts) > 1 else np.nan


def _means(
    values: Float[np.ndarray, " build"], replicate: Int[np.ndarray, " build"]
) -> Float[np.ndarray, " replicate"]:
    """Compute the mean of the values of each replicate."""
    return np.array([values[replicate == number].mean() for number in np.unique(replicate)])


@dataclass(frozen=True)
class SobolIndices:
    """Sobol indices of results with respect to groups of numbers; NaN where a result does not vary.

    Attributes
    ----------
    first
        Fraction of the variance that each group causes alone.
    total
        Fraction that it causes alone or together with others.
    first_error, total_error
        Standard errors.
    """

    first: Float[np.ndarray, "group ..."]
    total: Float[np.ndarray, "group ..."]
    first_error: Float[np.ndarray, "group ..."]
    total_error: Float[np.ndarray, "group ..."]


def sobol_indices(
    values: Float[np.ndarray, "group+2 sample ..."], replicate: Int[np.ndarray, " sample"]
) -> SobolIndices:
    """Estimate Sobol indices from the results by block, see `sample_points.SamplePoints`.

    V_i = <f(B) (f(A_B^i) - f(A))> (Saltelli et al., Comput. Phys. Commun. 181, 259 (2010), table 2
    b) and V_Ti = <(f(A) - f(A_B^i))^2>/2 (Jansen, Comput. Phys. Commun. 117, 35 (1999)), over the
    variance of f in A and B; f less its mean, which only reduces the scatter. Rows in which one of
    the three failed (NaN) are left out. Errors are from the scatter of the replicates.

    >>> a, b = np.random.default_rng(1).random((2, 4096, 1))
    >>> found = sobol_indices(np.stack([a, b, b]), np.arange(4096) // 512)
    >>> found.first.round(1), found.total.round(1)
    (array([[1.]]), array([[1.]]))
    """
    parts = [values, *(values[:, replicate == number] for number in np.unique(replicate))]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # means of nothing
        (first, total), *scattered = map(_estimate, parts)
        errors = np.std(scattered, axis=0, ddof=1) / np.sqrt(len(scattered))
    return SobolIndices(first, total, *errors)


def _estimate(
    values: Float[np.ndarray, "group+2 sample ..."],
) -> tuple[Float[np.ndarray, "group ..."], Float[np.ndarray, "group ..."]]:
    """Estimate first-order and total indices."""
    variance, scale = np.nanvar(values[:2], axis=(0, 1)), np.nanmax(np.abs(values[:2]), (0, 1))
    # what rounding leaves is no variance
    variance = np.where(variance > (1e-12 * scale) ** 2, variance, np.nan)
    values = values - np.nanmean(values[:2], axis=(0, 1))
    a, b, mixed = values[0], values[1], values[2:]
    first = np.nanmean(b * (mixed - a), axis=1) / variance
    return first, np.nanmean((a - mixed) ** 2 / 2, axis=1) / variance
