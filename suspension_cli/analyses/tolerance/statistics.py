"""Statistics of builds: quantiles, yields, rank correlations."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.studies.sobol_indices import SobolIndices

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are reported."""
RANKED = 20_000
"""Number of first builds for rank correlations, whose error is then below 0.01."""
SIGNIFICANT = 3.0
"""Least significant correlation, in standard deviations 1/sqrt(N) of N uncorrelated builds."""


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all; failed builds do not.

    `low` and `high` are the ends of the 95 % confidence interval.
    """

    name: str
    fraction: float
    low: float
    high: float

    @property
    def percent(self) -> str:
        """Fraction and interval as text."""
        low, high = 100 * self.low, 100 * self.high
        return f"{100 * self.fraction:.4g} % (95 % confidence: {low:.3g} to {high:.3g} %)"


@dataclass(frozen=True)
class Spread:
    """Distribution of results over the builds.

    Attributes
    ----------
    mean, error, deviation
        Mean, its standard error, and standard deviation.
    quantiles
        At `QUANTILES`.
    rank
        Rank correlations with the deviations of numbers.
    slope
        Change per unit of each deviation (least squares).
    sample
        Values of some builds, for figures.
    """

    name: tuple[str, ...]
    unit: tuple[str, ...]
    mean: Float[np.ndarray, " result"]
    error: Float[np.ndarray, " result"]
    deviation: Float[np.ndarray, " result"]
    quantiles: Float[np.ndarray, "result quantile"]
    rank: Float[np.ndarray, "result factor"]
    slope: Float[np.ndarray, "result factor"]
    sample: Float[np.ndarray, "build result"]


@dataclass(frozen=True)
class Summary:
    """Statistics of random builds.

    Attributes
    ----------
    builds, good
        Number of builds, and of those with an equilibrium on taut wires.
    independent
        Number of first builds in the statistics: all, or two blocks of those for Sobol indices.
    failures
        Number of builds by reason of failure.
    label, nominal
        Labels and frequencies (Hz) of the nominal modes.
    mean, mean_error, spread, quantiles
        Mean of each frequency, its standard error, standard deviation, and quantiles at
        `QUANTILES`, Hz.
    mode_rank, mode_slope
        Rank correlation of each frequency with each deviation, and its change, Hz per unit.
    sample
        Frequencies of some builds over nominal less 1, for figures.
    ratio, frequency, limit
        Name of the cross-coupling, ``test.x / test.z``, its frequency in Hz, and its limit.
    under, under_interval
        Fraction of good builds with |ratio| below the limit, and its 95 % confidence interval.
    ratio_quantiles, ratio_sorted
        Quantiles of |ratio|, and ascending values of some good builds.
    factor, factor_unit
        Numbers that vary, and units of their deviations.
    ratio_rank
        Rank correlation of |ratio| with the absolute value of each deviation.
    signed_rank, signed_slope
        Rank correlation of the `signed` ratio with each deviation, and its change per unit of that
        (least squares).
    ranked
        Number of builds in the correlations.
    static, required
        Displacements (m) and rotations (rad) of the stages, and quantities with requirements.
    limits, required_place
        Of each requirement: least value, largest value and whether of the magnitude; and the number
        of its quantity in `required`.
    yields, joint
        Of each requirement, and of all together.
    sampling
        ``random`` or ``sobol``.
    group, indexed, indices
        Names of tolerances and of results with Sobol indices, and these.
    """

    builds: int
    good: int
    independent: int
    failures: dict[str, int]
    label: tuple[str, ...]
    nominal: Float[np.ndarray, " mode"]
    mean: Float[np.ndarray, " mode"]
    mean_error: Float[np.ndarray, " mode"]
    spread: Float[np.ndarray, " mode"]
    quantiles: Float[np.ndarray, "mode quantile"]
    frequency: float
    limit: float
    under: float
    under_interval: tuple[float, float]
    ratio_quantiles: Float[np.ndarray, " quantile"]
    ratio_sorted: Float[np.ndarray, " sorted"]
    factor: tuple[str, ...]
    factor_unit: tuple[str, ...]
    ratio_rank: Float[np.ndarray, " factors"]
    signed_rank: Float[np.ndarray, " factors"]
    signed_slope: Float[np.ndarray, " factors"]
    mode_rank: Float[np.ndarray, "mode factors"]
    mode_slope: Float[np.ndarray, "mode factors"]
    ranked: int
    sample: Float[np.ndarray, "build mode"]
    static: Spread
    required: Spread
    limits: tuple[tuple[float, float, bool], ...]
    required_place: tuple[int, ...]
    yields: tuple[Yield, ...]
    joint: Yield | None
    ratio: str
    seed: int
    sampling: str
    group: tuple[str, ...] = ()
    indexed: tuple[str, ...] = ()
    indices: SobolIndices | None = None

    @property
    def significant(self) -> float:
        """Least significant rank correlation, 3/sqrt(N) of N builds."""
        return SIGNIFICANT / np.sqrt(self.ranked) if self.ranked else np.inf


def rank_correlation(
    a: Float[np.ndarray, "build first"], b: Float[np.ndarray, "build second"]
) -> Float[np.ndarray, "first second"]:
    """Spearman's rank correlations of the columns of a and b; 0 for a constant column.

    >>> rank_correlation(np.array([[1.0], [2.0], [4.0]]), np.array([[3.0], [2.0], [0.0]]))
    array([[-1.]])
    """
    return unit_ranks(a).T @ unit_ranks(b)


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


def signed(ratio: Complex[np.ndarray, " build"]) -> Float[np.ndarray, " build"]:
    """Parts of complex numbers along the phase in which they vary most.

    Small imperfections add up with their signs, which magnitudes hide. Real ratios are unchanged.

    >>> signed(np.array([2.0, -1.0, 0.5]) * (1 + 0j))
    array([ 2. , -1. ,  0.5])
    """
    if not len(ratio):
        return np.zeros(0)
    phase = np.angle(((ratio - ratio.mean()) ** 2).sum()) / 2
    return (ratio * np.exp(-1j * phase)).real


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


def leading(
    correlation: Float[np.ndarray, " factors"], names: tuple[str, ...], count: int = 5
) -> list[tuple[str, float]]:
    """List names and values of the strongest correlations, strongest first."""
    return [(names[n], float(correlation[n])) for n in strongest(correlation, count)]


def strongest(
    correlation: Float[np.ndarray, " factors"], count: int, least: float = 0.0
) -> list[int]:
    """Numbers of the strongest correlations above a least size, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [int(n) for n in order if abs(correlation[n]) > least]
