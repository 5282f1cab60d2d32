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

    The fractions p for which the observed one is within z sqrt(p (1 - p)/n) of p (Wilson, J. Am.
    Stat. Assoc. 22, 209 (1927)).

    >>> [round(float(end), 4) for end in wilson_interval(0, 100)]
    [0.0, 0.037]
    """
    from scipy.special import ndtri

    if builds == 0:
        return np.nan, np.nan
    z = float(ndtri((1 + LEVEL) / 2))
    fraction, extra = count / builds, z**2 / builds
    middle = (fraction + extra / 2) / (1 + extra)
    half = z * np.sqrt(fraction * (1 - fraction) / builds + extra / (4 * builds)) / (1 + extra)
    # exactly 0 and 1 at the ends
    low = 0.0 if count == 0 else max(middle - half, 0.0)
    return low, 1.0 if count == builds else min(middle + half, 1.0)


def replicate_interval(
    met: Bool[np.ndarray, " build"], replicate: Int[np.ndarray, " build"]
) -> tuple[float, float]:
    """Estimate the confidence interval of a fraction from independent replicates.

    Student's t of the replicates' fractions; where all are 0 or 1, the wider interval of
    independent builds.
    """
    from scipy.special import stdtrit

    count, builds = int(met.sum()), len(met)
    parts = _means(met.astype(float), replicate)
    if len(parts) < 2 or count in (0, builds):
        return wilson_interval(count, builds)
    t = float(stdtrit(len(parts) - 1, (1 + LEVEL) / 2))
    half = t * parts.std(ddof=1) / np.sqrt(len(parts))
    return max(count / builds - half, 0.0), min(count / builds + half, 1.0)


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
