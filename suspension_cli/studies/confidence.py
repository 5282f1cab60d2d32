"""Confidence intervals of fractions of builds, and standard errors of means."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

LEVEL = 0.95
"""Probability that an interval contains the true value."""


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
