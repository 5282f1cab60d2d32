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
"""Number of first builds that rank correlations are computed from, with an error below 0.01."""
SIGNIFICANT = 3.0
"""Smallest correlation that is shown, in standard deviations, 1/sqrt(N), of that of N builds of
uncorrelated numbers."""


@dataclass(frozen=True)
class Yield:
    """Fraction of builds that meet a requirement, or all.

    Attributes
    ----------
    name
        The requirement.
    fraction
        Builds without equilibrium count as not meeting it.
    low, high
        Ends of the 95 % confidence interval.
    """

    name: str
    fraction: float
    low: float
    high: float

    @property
    def percent(self) -> str:
        """The fraction and its interval in words."""
        low, high = 100 * self.low, 100 * self.high
        return f"{100 * self.fraction:.4g} % (95 % confidence: {low:.3g} to {high:.3g} %)"


@dataclass(frozen=True)
class Spread:
    """Distribution of some results over the builds: r results, f numbers that vary.

    Attributes
    ----------
    mean, error, deviation
        Mean, its standard error, and standard deviation.
    quantiles
        At `QUANTILES`.
    rank
        Rank correlations with the deviations of the numbers.
    slope
        Change per unit of each deviation: that of the least-squares line.
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
    """Statistics of a set of random builds: m modes, f numbers that vary.

    Attributes
    ----------
    builds, good
        Number of builds, and of those with an equilibrium on taut wires.
    independent
        Number of first builds that statistics are of: all, but with Sobol indices two blocks.
    failures
        Number of builds by reason of failure.
    label, nominal
        Labels and frequencies (Hz) of the nominal modes.
    mean, mean_error, spread, quantiles
        Mean of each frequency over the builds, its standard error, standard deviation, and
        quantiles at `QUANTILES`, Hz.
    mode_rank, mode_slope
        Rank correlation of each frequency with each deviation, and its change, Hz per unit.
    sample
        Frequencies of some builds over nominal less 1, for figures.
    ratio, frequency, limit
        Name of the cross-coupling, ``test.x / test.z``, its frequency in Hz, and its limit.
    under, under_interval
        Fraction of the good builds with |ratio| below the limit, and its 95 % confidence interval.
    ratio_quantiles, ratio_sorted
        Of |ratio|: quantiles, and ascending values of good builds, thinned to a few thousand.
    factor, factor_unit
        Names of the numbers that vary, and the units of their deviations.
    ratio_rank
        Rank correlation of |ratio| with the absolute value of each deviation.
    signed_rank, signed_slope
        Rank correlation of the ratio with its sign, see `signed`, with each deviation, and its
        change per unit of that (least squares).
    ranked
        Number of builds that correlations are of.
    static, required
        Displacements (m) and rotations (rad) of the stages, and quantities with requirements.
    limits
        Of each requirement: least and largest value, and whether of the magnitude.
    required_place
        Number of the quantity of each requirement in `required`.
    yields, joint
        Of each requirement, and of all together.
    seed, sampling
        Seed of the random numbers, and ``random`` or ``sobol``.
    group, indexed, indices
        Names of the tolerances and of the results of the Sobol indices, and these.
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
        """Smallest rank correlation that is shown, 3/sqrt(N) of N builds."""
        return SIGNIFICANT / np.sqrt(self.ranked) if self.ranked else np.inf


def rank_correlation(
    a: Float[np.ndarray, "build first"], b: Float[np.ndarray, "build second"]
) -> Float[np.ndarray, "first second"]:
    """Spearman's rank correlations (n, m) of the columns of a (p, n) and of b (p, m).

    Those of a constant column are 0.

    >>> rank_correlation(np.array([[1.0], [2.0], [4.0]]), np.array([[3.0], [2.0], [0.0]]))
    array([[-1.]])
    """
    if not len(a):
        return np.zeros((a.shape[1], b.shape[1]))
    from scipy.stats import rankdata  # spearmanr ranks each column apart, and tests significance

    both = np.hstack([a, b])
    varies = both.max(0) > both.min(0)
    result = np.zeros((both.shape[1], both.shape[1]))
    if varies.sum() > 1:
        ranks = rankdata(both[:, varies], axis=0)
        result[np.ix_(varies, varies)] = np.corrcoef(ranks, rowvar=False)
    return result[: a.shape[1], a.shape[1] :]


def signed(ratio: Complex[np.ndarray, " build"]) -> Float[np.ndarray, " build"]:
    """Real numbers (p,) that stand for complex ones: parts along the phase in which most vary.

    Small imperfections add up with their signs, which magnitudes hide. A real ratio is kept.

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
    """Slopes (n, m) of the least-squares lines of the columns of a (p, n) over those of b (p, m).

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
    """List names and values of the `count` strongest correlations, strongest first."""
    return [(names[n], float(correlation[n])) for n in strongest(correlation, count)]


def strongest(
    correlation: Float[np.ndarray, " factors"], count: int, least: float = 0.0
) -> list[int]:
    """Numbers of the `count` strongest correlations above a least size, strongest first."""
    order = np.argsort(-np.abs(correlation), kind="stable")[:count]
    return [int(n) for n in order if abs(correlation[n]) > least]
