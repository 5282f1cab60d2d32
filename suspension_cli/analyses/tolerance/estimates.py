"""Mean, spread and quantiles of results of random builds, and yields, with their standard errors.

All follow from means of functions of the results (`two_level`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.tolerance.build_statistics import Yield, along_variation
from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.analyses.tolerance.two_level import (
    Means,
    Population,
    estimate_means,
    fit_halves,
)
from suspension_cli.files.mapped_arrays import copy_column, release
from suspension_cli.studies import sampling
from suspension_cli.studies.builds import GOOD

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

    from suspension_cli.analyses.tolerance.two_level import Rows

QUANTILES = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
"""Quantiles that are reported."""
FITTED = 20_000
"""Number of first builds to which results are fitted: more change a fit by less than it leaves."""
STATED = {"5 % point": 0.05, "median": 0.5, "95 % point": 0.95}
"""Quantiles whose standard errors count as those that a run has reached."""
ROUND = 512
"""Builds are added in multiples of this number."""
GROWTH = 4.0
"""Most that one round multiplies the builds by: errors of few builds are uncertain themselves."""
SURPLUS = 1.1
"""Builds that a round computes over those that are expected to suffice."""
FEW = 10
"""Builds that meet a requirement, or that fail it, below which a yield is counted alone: how often
a fit is wrong about builds of which there are few is not known."""


@dataclass(frozen=True)
class SpreadOfResult:
    """Functions of one result whose means give its spread: y, (y - c)^2, and y <= q.

    `centre` c and `levels` q are mean and quantiles of the builds that were solved.
    """

    row: int
    centre: float
    levels: Float[np.ndarray, " quantile"]

    @staticmethod
    def of(row: int, values: Float[np.ndarray, " build"]) -> SpreadOfResult:
        """Ask for the spread of a result with these finite values in the builds."""
        if not len(values):
            return SpreadOfResult(row, np.nan, np.full(len(QUANTILES), np.nan))
        return SpreadOfResult(row, float(values.mean()), np.quantile(values, QUANTILES))

    def values(self, results: Rows) -> Float[np.ndarray, "function build"]:
        """Values of the functions."""
        y = results[self.row]
        found = np.empty((2 + len(self.levels), len(y)))
        with np.errstate(invalid="ignore"):  # of infinite values, which do not count
            found[0] = y
            found[1] = (y - self.centre) ** 2
            found[2:] = y <= self.levels[:, None]
        return found

    def has_value(self, results: Rows) -> Bool[np.ndarray, " build"]:
        """Builds with a finite value."""
        return np.isfinite(results[self.row])


@dataclass(frozen=True)
class Met:
    """Whether builds meet requirements. Those of `row` with a value count, or all (None)."""

    tests: Callable[[Rows], Sequence[Bool[np.ndarray, " build"]]]
    row: int | None = None

    def values(self, results: Rows) -> Float[np.ndarray, "function build"]:
        """1 for builds that meet each requirement, 0 for others."""
        found = self.tests(results)
        return np.array(found, dtype=float).reshape(len(found), results.shape[1])

    def has_value(self, results: Rows) -> Bool[np.ndarray, " build"]:
        """Builds that count."""
        if self.row is None:
            return np.ones(results.shape[1], dtype=bool)
        return ~np.isnan(results[self.row])


@dataclass(frozen=True)
class Statistics:
    """Mean, standard deviation and quantiles of one result, each with its standard error."""

    mean: float
    error: float
    std: float
    std_error: float
    quantiles: Float[np.ndarray, " quantile"]
    quantile_errors: Float[np.ndarray, " quantile"]

    @staticmethod
    def of(
        asked: SpreadOfResult, means: Means, count: int, values: Float[np.ndarray, " build"]
    ) -> Statistics:
        """Compute them from means over `count` builds, and the finite values in these.

        A quantile at p, where the distribution function is F(q) instead of the fraction p' of the
        solved builds, is their quantile at p - (F(q) - p'). Its standard error is half the distance
        between those at levels one standard error higher and lower (Woodruff, J. Am. Stat. Assoc.
        47, 635 (1952)). The levels have the errors of F, of one build that is counted wrongly, and
        of the builds between the two levels.
        """
        if not len(values):
            none = np.full(len(QUANTILES), np.nan)
            return Statistics(np.nan, np.nan, np.nan, np.nan, none, none)
        mean = float(means.value[0])
        variance = float(means.value[1]) - (mean - asked.centre) ** 2
        error = float(means.error[0])
        std = float(np.sqrt(max(variance, 0.0)))
        std_error = float(means.error[1]) / (2 * std) if std > 0 else float(means.error[1])
        shift = means.value[2:] - means.plain[2:]
        errors = np.sqrt(means.error[2:] ** 2 + 1 / count**2 + np.abs(shift) / count)
        level = np.sort(np.array(QUANTILES) - shift)  # a distribution function rises
        if np.isnan(errors).any():  # of a single build
            quantiles = np.quantile(values, QUANTILES)
            return Statistics(mean, error, std, std_error, quantiles, np.full(len(level), np.nan))
        half = np.minimum(errors, 0.5)
        middle = np.clip(level, half, 1 - half)  # the interval does not shrink at its ends
        levels = np.clip([level, middle - half, middle + half], 0.0, 1.0)
        quantiles, below, above = np.quantile(values, levels)
        return Statistics(mean, error, std, std_error, quantiles, (above - below) / 2)

    @staticmethod
    def columns(rows: Sequence[Statistics]) -> dict[str, np.ndarray]:
        """Arrays of each statistic of several results."""
        names = [one.name for one in fields(Statistics)]
        return {name: np.array([getattr(one, name) for one in rows]) for name in names}


def yields_of(means: Means) -> list[Yield]:
    """Compute yields from the fractions of builds that meet requirements.

    Intervals are Wilson's: without a control variate for the number of builds, with one for the
    number that would give its standard error.
    """
    found = []
    columns = means.value, means.error, means.plain
    for value, error, plain in zip(*(column.tolist() for column in columns), strict=True):
        met = plain * means.known
        has_enough = FEW <= met <= means.known - FEW
        # a fit that says 0 or 1 contradicts the builds
        if not (means.is_controlled and has_enough and 0 < value < 1):
            found.append(Yield.of("", plain, means.known))
            continue
        # one build about which the fit is wrong, beside those that there were
        variance = error**2 + 1 / means.known**2
        found.append(Yield.of("", value, value * (1 - value) / variance))
    return found


@dataclass(frozen=True)
class Estimates:
    """Statistics of all results of a job, and yields.

    `results` are those of the quantities of the job, and of the coupling with its sign; `met` of
    each requirement, and of all together; `under` of the limit on the coupling.
    """

    results: list[Statistics]
    met: list[Yield]
    under: Yield

    def largest_error(self, job: RandomBuilds) -> tuple[float, str]:
        """Largest standard error over the spread of its quantity, or of a yield, and of what it is.

        Of the coupling, the quantities of requirements and those that are asked for: of their mean,
        standard deviation and the quantiles `STATED`.
        """
        asked = dict.fromkeys((job.coupling, *job.required, *job.others))
        found = [(one.error, "a yield") for one in (*self.met, self.under)]
        for quantity in asked:
            one = self.results[job.quantities.index(quantity)]
            if not one.std > 0:
                continue
            errors = {"mean": one.error, "standard deviation": one.std_error}
            for name, level in STATED.items():
                errors[name] = float(one.quantile_errors[QUANTILES.index(level)])
            for name, error in errors.items():
                found.append((error / one.std, f"{name} of {quantity.text}, over its spread"))
        return max(found, key=lambda pair: np.inf if np.isnan(pair[0]) else pair[0])


def builds_needed(job: RandomBuilds, largest_error: float, precision: float) -> int:
    """Number of builds after the next round, if standard errors must not exceed `precision`."""
    if largest_error <= precision:
        return job.count
    ratio = largest_error / precision
    growth = min(SURPLUS * ratio**2, GROWTH) if np.isfinite(ratio) else GROWTH
    return ROUND * -(-int(growth * job.count) // ROUND)


def estimate(columns: Mapping[str, Any], job: RandomBuilds, limit: float) -> Estimates:
    """Estimate statistics and yields from the results of the builds of a job.

    `limit` is one on the cross-coupling.
    """
    builds = _Builds.of(columns, job)
    population = Population(
        job.count,
        builds.results,
        job.deviations,
        job.further_deviations,
        sampling.standard_deviations(job.factors),
        builds.from_signed,
    )
    first = min(FITTED, job.count)
    controls = fit_halves(builds.signed(first), job.deviations(0, first))
    rows = range(len(job.quantities) + 1)
    spreads = [SpreadOfResult.of(row, builds.finite(row)) for row in rows]
    below = Met(lambda results: [results[builds.coupling] < limit], builds.coupling)
    met = Met(builds.met)
    *means, under, required = estimate_means([*spreads, below, met], population, controls)
    results = [
        Statistics.of(spread, one, job.count, builds.finite(spread.row))
        for spread, one in zip(spreads, means, strict=True)
    ]
    return Estimates(results, yields_of(required), yields_of(under)[0])


@dataclass(frozen=True)
class _Builds:
    """Results of the builds of a job: of its quantities, and last the coupling with its sign.

    `turned` is the coupling, with its sign as the real part.
    """

    job: RandomBuilds
    value: Float[np.ndarray, "build quantity"]
    turned: Complex[np.ndarray, " build"]
    coupling: int

    @staticmethod
    def of(columns: Mapping[str, Any], job: RandomBuilds) -> _Builds:
        turned = signed_coupling(columns)
        return _Builds(job, columns["value"], turned, job.quantities.index(job.coupling))

    def finite(self, row: int) -> Float[np.ndarray, " build"]:
        """Finite values of one result."""
        is_quantity = row < self.value.shape[1]
        values = copy_column(self.value, row) if is_quantity else np.real(self.turned)
        return values[np.isfinite(values)]

    def results(self, start: int, stop: int) -> Rows:
        """Results of builds start to stop - 1."""
        found = np.vstack([self.value[start:stop].T, np.real(self.turned[start:stop])])
        release(self.value)
        return found

    def signed(self, stop: int) -> Float[np.ndarray, "build result"]:
        """Results with signs of the first builds: both parts of the coupling for its magnitude."""
        found = np.column_stack([self.value[:stop], np.imag(self.turned[:stop])])
        found[:, self.coupling] = np.real(self.turned[:stop])
        return found

    def from_signed(self, signed: Rows) -> Rows:
        """Results of builds whose results with signs are known."""
        found = signed.copy()
        found[self.coupling] = np.hypot(signed[self.coupling], signed[-1])
        found[-1] = signed[self.coupling]
        return found

    def met(self, results: Rows) -> list[Bool[np.ndarray, " build"]]:
        """Whether builds meet each requirement, and all of them; empty without requirements."""
        pairs = zip(self.job.requirements, self.job.required, strict=True)
        each = [one.is_met(results[self.job.quantities.index(own)]) for one, own in pairs]
        return [*each, np.logical_and.reduce(each)] if each else []


def signed_coupling(columns: Mapping[str, Any]) -> Complex[np.ndarray, " build"]:
    """Cross-coupling at its last frequency (`along_variation`); NaN where a build failed."""
    good = columns["status"] == GOOD
    return along_variation(np.where(good, columns["ratio"][:, -1], complex(np.nan, np.nan)))
