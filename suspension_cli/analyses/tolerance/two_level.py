"""Means over random builds, with linear fits as control variates, and their standard errors.

Any statistic follows from means of functions h of the results y of builds: a yield from h = 1 where
y is within limits, a quantile from the distribution function, h = 1 where y <= q. With a linear fit
f of y over the deviations of a build, whose mean of h is known from very many points that cost
next to nothing, the mean of h(y) over N builds that were solved is better estimated by

    mean h(y) - beta (mean h(f) - E h(f)),    beta = cov(h(y), h(f)) / var h(f).

The fit is of the results with their signs, also where h is not linear: a fit of a magnitude gains
nothing, the magnitude of a fit does. Each half of the builds is corrected with a fit to the other
half, so that the fit is independent of them: the estimate then has no bias but that of beta, of the
order 1/N, and the error is not understated. A fit that does not help has a beta near 0, so that
nothing has to be chosen. (P. W. Glynn, R. Szechtman, "Some new perspectives on the method of
control variates", Monte Carlo and Quasi-Monte Carlo Methods 2000, Springer (2002); A. B. Owen,
"Monte Carlo theory, methods and examples" (2013), section 8.9.)

Mean and variance of a fit are known exactly. Each batch of cheap points is shifted and scaled to
them, which divides the variance of the mean of |f| by 8 and leaves a bias of the order of 1/n, for
n points in a batch. The scatter between batches gives the standard error of E h(f).

Builds without a value (NaN, or failed) count with h - theta = 0, where theta is the mean over the
others, and all errors are divided by the fraction of builds with a value: to first order that is
the estimate of a ratio of two means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from suspension_cli.analyses.tolerance.linear_fit import fits_of_columns

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    Rows = Float[np.ndarray, "result build"]
    """Results of builds, a row for each."""
    Deviations = Float[np.ndarray, "build factor"]
    """Deviations of the numbers of builds."""

CHUNK = 1 << 14
"""Builds, or cheap points, that are evaluated at once."""
CHEAP = 50
"""Cheap points per build that was solved: they then add little to the error."""
BATCHES = 16, 64
"""Fewest and most batches of cheap points; the fewest let their scatter be estimated to 18 %."""


class Functions(Protocol):
    """Functions of the results of a build whose means are asked for."""

    def values(self, results: Rows) -> Float[np.ndarray, "function build"]:
        """Values of the functions; of no meaning for builds without a value."""
        ...

    def has_value(self, results: Rows) -> Bool[np.ndarray, " build"]:
        """Builds over which the means are taken."""
        ...


@dataclass(frozen=True)
class Means:
    """Means of some functions, their standard errors, and the plain means over the solved builds.

    `known` is the number of builds with a value; `is_controlled` says whether there were fits.
    """

    value: Float[np.ndarray, " function"]
    error: Float[np.ndarray, " function"]
    plain: Float[np.ndarray, " function"]
    known: int
    is_controlled: bool


@dataclass(frozen=True)
class Population:
    """Builds that were solved, and the distribution that they are drawn from.

    Attributes
    ----------
    count
        Number of builds that were solved.
    results
        Results of builds start to stop - 1, a row for each, as `Functions` take them.
    deviations, cheap
        Deviations of these builds, and of further points that are independent of them.
    scatter
        Exact standard deviations of the deviations, whose means are 0.
    from_signed
        Makes results from those that a linear fit is made of.
    """

    count: int
    results: Callable[[int, int], Rows]
    deviations: Callable[[int, int], Deviations]
    cheap: Callable[[int, int], Deviations]
    scatter: Float[np.ndarray, " factor"]
    from_signed: Callable[[Rows], Rows]


@dataclass(frozen=True)
class Control:
    """Linear fits of signed results to a half of the builds."""

    constant: Float[np.ndarray, "result 1"]
    slope: Float[np.ndarray, "result factor"]

    @staticmethod
    def of(signed: Float[np.ndarray, "build result"], deviations: Deviations) -> Control:
        """Fit the results; one that varies little or that too few builds have has no slope."""
        constant = np.zeros((signed.shape[1], 1))
        slope = np.zeros((signed.shape[1], deviations.shape[1]))
        for n, own, fit in fits_of_columns(signed, deviations):
            constant[n], slope[n] = fit.coefficients(signed[own, n])
        return Control(constant, slope)

    def at(self, deviations: Deviations) -> Rows:
        """Evaluate the fits."""
        return self.constant + self.slope @ deviations.T

    def at_batch(self, deviations: Deviations, scatter: Float[np.ndarray, " factor"]) -> Rows:
        """Evaluate the fits at random points, shifted and scaled to their mean and variance."""
        found = self.slope @ deviations.T
        found -= found.mean(1, keepdims=True)
        size = found.std(1)
        exact = np.sqrt(self.slope**2 @ scatter**2)
        found *= (exact / np.where(size > 0, size, 1.0))[:, None]
        return self.constant + found


def fit_halves(
    signed: Float[np.ndarray, "build result"], deviations: Deviations
) -> tuple[Control, ...]:
    """Fit signed results to the builds with odd numbers, and to those with even ones.

    Builds 0, 2, ... are to be corrected with the first fit. There is none if no result can be
    fitted.
    """
    pair = tuple(Control.of(signed[half::2], deviations[half::2]) for half in (1, 0))
    return pair if all(one.slope.any() for one in pair) else ()


def estimate_means(
    questions: Sequence[Functions], population: Population, controls: tuple[Control, ...]
) -> list[Means]:
    """Estimate the means of functions, with two controls or none."""
    parts = max(len(controls), 1)
    plain = _plain_means(questions, population)
    sums = [_Sums.of_none(parts, len(theta)) for theta, _ in plain]
    for start, results in _chunks(population):
        deviations = population.deviations(start, start + results.shape[1])
        for part in range(parts):
            own = slice(part, None, parts)  # chunks begin with an even number
            solved = results[:, own]
            fitted = None
            if controls:
                fitted = population.from_signed(controls[part].at(deviations[own]))
            for question, (theta, _), added in zip(questions, plain, sums, strict=True):
                known = question.has_value(solved)
                u = np.where(known, question.values(solved) - theta[:, None], 0.0)
                g = np.zeros_like(u)
                if fitted is not None:
                    g = question.values(fitted) - theta[:, None]
                added.add(part, u, g)
    expected = _means_of_fits(questions, plain, population, controls)
    return [
        _corrected(theta, known, population.count, added, batches)
        for (theta, known), added, batches in zip(plain, sums, expected, strict=True)
    ]


@dataclass(frozen=True)
class _Sums:
    """Sums over the builds of each half: of u = h(y) - theta, g = h(f) - theta, their products."""

    count: Float[np.ndarray, "part 1"]
    u: Float[np.ndarray, "part function"]
    g: Float[np.ndarray, "part function"]
    uu: Float[np.ndarray, "part function"]
    gg: Float[np.ndarray, "part function"]
    ug: Float[np.ndarray, "part function"]

    @staticmethod
    def of_none(parts: int, functions: int) -> _Sums:
        return _Sums(np.zeros((parts, 1)), *(np.zeros((parts, functions)) for _ in range(5)))

    def add(self, part: int, u: np.ndarray, g: np.ndarray) -> None:
        self.count[part] += u.shape[1]
        self.u[part] += u.sum(1)
        self.g[part] += g.sum(1)
        self.uu[part] += np.einsum("fb,fb->f", u, u)
        self.gg[part] += np.einsum("fb,fb->f", g, g)
        self.ug[part] += np.einsum("fb,fb->f", u, g)


def _chunks(population: Population) -> Iterator[tuple[int, Rows]]:
    """Yield the results of builds, with the number of the first."""
    for start in range(0, population.count, CHUNK):
        yield start, population.results(start, min(start + CHUNK, population.count))


def _plain_means(
    questions: Sequence[Functions], population: Population
) -> list[tuple[Float[np.ndarray, " function"], int]]:
    """Means over the builds with a value, and the number of these."""
    totals: list[float | np.ndarray] = [0.0] * len(questions)
    counts = [0] * len(questions)
    for _, results in _chunks(population):
        for n, question in enumerate(questions):
            known = question.has_value(results)
            totals[n] = totals[n] + question.values(results[:, known]).sum(1)
            counts[n] += int(known.sum())
    with np.errstate(invalid="ignore"):
        pairs = zip(totals, counts, strict=True)
        return [(np.divide(total, count), count) for total, count in pairs]


def _means_of_fits(
    questions: Sequence[Functions],
    plain: Sequence[tuple[Float[np.ndarray, " function"], int]],
    population: Population,
    controls: tuple[Control, ...],
) -> list[Float[np.ndarray, "batch part function"]]:
    """Means of h(f) - theta over each batch of cheap points; 0 without controls."""
    if not controls:
        return [np.zeros((2, 1, len(theta))) for theta, _ in plain]
    fewest, most = BATCHES
    batches = int(np.clip(CHEAP * population.count // CHUNK, fewest, most))
    found = [np.zeros((batches, len(controls), len(theta))) for theta, _ in plain]
    for batch in range(batches):
        deviations = population.cheap(batch * CHUNK, (batch + 1) * CHUNK)
        for part, control in enumerate(controls):
            results = population.from_signed(control.at_batch(deviations, population.scatter))
            for question, (theta, _), means in zip(questions, plain, found, strict=True):
                means[batch, part] = question.values(results).mean(1) - theta
    return found


def _corrected(
    theta: Float[np.ndarray, " function"],
    known: int,
    count: int,
    sums: _Sums,
    batches: Float[np.ndarray, "batch part function"],
) -> Means:
    """Correct plain means by the controls, and compute the standard errors."""
    n = sums.count
    weight = n / count
    per_known = count / known if known else np.nan
    mean_u = sums.u / n
    mean_g = sums.g / n
    with np.errstate(divide="ignore", invalid="ignore"):
        var_u = np.maximum(sums.uu / n - mean_u**2, 0.0)
        var_g = np.maximum(sums.gg / n - mean_g**2, 0.0)
        covariance = sums.ug / n - mean_u * mean_g
        beta = np.where(var_g > 0, covariance / np.where(var_g > 0, var_g, 1.0), 0.0)
        is_controlled = bool(var_g.any())
        fitted = 1 + is_controlled  # the mean, and beta
        left = np.maximum(var_u - beta * covariance, 0.0) / (n - fitted)
        of_builds = (weight**2 * left).sum(0)
        of_batches = (weight * beta * batches).sum(1)
        of_fits = of_batches.var(0, ddof=1) / len(of_batches)
        value = theta - ((weight * beta * mean_g).sum(0) - of_batches.mean(0)) * per_known
        error = np.sqrt(of_builds + of_fits) * per_known
    error = np.where(n.min() > fitted, error, np.nan)
    return Means(value, error, theta, known, is_controlled)
