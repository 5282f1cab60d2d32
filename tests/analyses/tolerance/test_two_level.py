"""Statistics with linear fits as control variates: closed forms, scatter over seeds, builds.

The standard errors that are stated are compared with the scatter of the estimates themselves.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from suspension_cli.analyses.tolerance import two_level
from suspension_cli.analyses.tolerance.build_statistics import confidence_interval
from suspension_cli.analyses.tolerance.estimates import (
    QUANTILES,
    Met,
    SpreadOfResult,
    Statistics,
    yields_of,
)
from suspension_cli.analyses.tolerance.two_level import (
    Means,
    Population,
    estimate_means,
    fit_halves,
)

SLOPES = np.array([0.6, 0.5, -0.4, 0.48])
"""Of a linear function of four normal numbers, whose variance is then nearly 1."""
SIGMA = np.sqrt((SLOPES**2).sum())
LIMITS = 1.0, 1.5


def linear(x):
    return x @ SLOPES


def curved(x):
    f = linear(x)
    return f + 0.1 * x[:, 0] * x[:, 1] + 0.02 * f**3


def noisy(x):
    """As much of it is no linear function of the deviations."""
    return linear(x) + 3 * np.sin(7 * x[:, 0])


def failing(x):
    """The curved function, where the build hangs."""
    return np.where(np.abs(x[:, 0] - 0.5) < 1.5, curved(x), np.nan)


def estimated(function, seed, count, controlled=True):
    """Statistics of a result and of its magnitude, and two yields: values and standard errors."""
    x = np.random.default_rng([seed, 0]).normal(size=(count, len(SLOPES)))
    size = two_level.CHUNK

    def cheap(start, stop):
        return np.random.default_rng([seed, 1, start]).normal(size=(size, len(SLOPES)))

    def from_signed(rows):
        return np.vstack([rows, np.abs(rows[:1])])

    y = function(x)[None]
    results = from_signed(y)
    population = Population(
        count,
        lambda start, stop: results[:, start:stop],
        lambda start, stop: x[start:stop],
        cheap,
        np.ones(len(SLOPES)),
        from_signed,
    )
    finite = [row[np.isfinite(row)] for row in results]
    spreads = [SpreadOfResult.of(row, values) for row, values in enumerate(finite)]
    met = Met(lambda rows: [rows[1] < LIMITS[0], rows[0] < LIMITS[1]])
    controls = fit_halves(y.T, x) if controlled else ()
    *means, yields = estimate_means([*spreads, met], population, controls)
    found = [
        Statistics.of(spread, one, count, values)
        for spread, one, values in zip(spreads, means, finite, strict=True)
    ]
    values = [(one.mean, one.std, *one.quantiles) for one in found]
    errors = [(one.error, one.std_error, *one.quantile_errors) for one in found]
    of_yields = yields_of(yields)
    values.append(tuple(one.fraction for one in of_yields))
    errors.append(tuple(one.error for one in of_yields))
    return np.concatenate(values), np.concatenate(errors)


@pytest.fixture
def few_points(monkeypatch):
    """Fewer cheap points: they are then a part of the error that can be seen."""
    monkeypatch.setattr(two_level, "CHUNK", 1024)


def test_a_linear_function_has_the_closed_form(few_points):
    """Of normal deviations: mean and standard deviation exactly, also of few builds; the magnitude,
    quantiles and yields within five standard errors, which are far below those of the builds."""
    value, error = estimated(linear, 3, 2000)
    _, plain = estimated(linear, 3, 2000, controlled=False)
    normal = stats.norm(scale=SIGMA)
    folded = stats.halfnorm(scale=SIGMA)
    exact = [0.0, SIGMA, *normal.ppf(QUANTILES)]
    exact += [folded.mean(), folded.std(), *folded.ppf(QUANTILES)]
    exact += [folded.cdf(LIMITS[0]), normal.cdf(LIMITS[1])]
    np.testing.assert_allclose(value[:2], exact[:2], atol=1e-12)
    assert (np.abs(value - exact)[2:] < 5 * error[2:]).all()
    magnitude, of_mean = 9, 0
    assert error[of_mean] < 1e-12
    assert error[magnitude] < 0.12 * plain[magnitude]
    assert (error[-2:] < 0.25 * plain[-2:]).all()


@pytest.mark.parametrize("function", [curved, noisy, failing])
def test_stated_errors_are_the_scatter_over_seeds(function, few_points):
    """Never too small: of 120 seeds about 68 % lie within one standard error of the truth, and the
    mean over them has no bias. A fit that does not help, as of noise, does no harm."""
    seeds, count = 120, 800
    pairs = [estimated(function, seed, count) for seed in range(seeds)]
    values, errors = (np.array(column) for column in zip(*pairs, strict=True))
    x = np.random.default_rng(5).normal(size=(1_000_000, len(SLOPES)))
    y = function(x)
    finite = y[np.isfinite(y)]
    truth = []
    for one in (finite, np.abs(finite)):
        truth += [one.mean(), one.std(), *np.quantile(one, QUANTILES)]
    with np.errstate(invalid="ignore"):
        truth += [(np.abs(y) < LIMITS[0]).mean(), (y < LIMITS[1]).mean()]
    scatter = values.std(0, ddof=1)
    said = np.sqrt((errors**2).mean(0)) / scatter
    # the scatter of 120 is known to 6.5 %; errors of quantiles are cautious
    assert (said > 0.83).all(), said
    assert (said < 1.9).all(), said
    smooth = [0, 1, 9, 10, -2, -1]
    assert (said[smooth] < 1.2).all(), said
    covered = (np.abs(values - truth) < errors).mean(0)
    assert (covered > 0.55).all(), covered
    assert 0.62 < covered[smooth].mean() < 0.75
    bias = (values.mean(0) - truth) / scatter
    inner = [0, 1, *range(3, 8), 9, 10, *range(12, 17), -2, -1]  # not the outermost quantiles
    assert (np.abs(bias[inner]) < 5 / np.sqrt(seeds)).all(), bias
    _, plain = zip(
        *(estimated(function, seed, count, controlled=False) for seed in range(10)), strict=True
    )
    assert (errors.mean(0)[inner] < 1.15 * np.mean(plain, axis=0)[inner]).all()


def test_yields_without_failures_have_the_interval_of_the_builds(few_points):
    """A fit that says that no build fails is no proof."""
    x = np.random.default_rng(1).normal(size=(900, len(SLOPES)))
    y = linear(x)[None]
    population = Population(
        900,
        lambda start, stop: y[:, start:stop],
        lambda start, stop: x[start:stop],
        lambda start, stop: np.random.default_rng(start).normal(size=(stop - start, len(SLOPES))),
        np.ones(len(SLOPES)),
        lambda rows: rows,
    )
    met = Met(lambda rows: [rows[0] < 9.0, rows[0] < 2.8, rows[0] < -9.0])
    [means] = estimate_means([met], population, fit_halves(y.T, x))
    for one, count in zip(yields_of(means), (900, int((y < 2.8).sum()), 0), strict=True):
        assert one.fraction == count / 900
        expected = stats.binomtest(count, 900).proportion_ci(method="wilson")
        assert one.interval == pytest.approx(tuple(expected), abs=1e-12)
        assert one.error > 0.4 / 900


def test_yields_that_a_fit_moves_out_of_range_are_those_of_the_builds():
    """Ten builds of a million meet a requirement, and a fit says that fewer than none do."""
    count = 1_000_000
    plain = np.array([10.0, count - 10.0]) / count
    means = Means(np.array([-1e-9, 1 + 1e-9]), np.full(2, 1e-6), plain, count, is_controlled=True)
    for one, fraction in zip(yields_of(means), plain, strict=True):
        expected = stats.binomtest(round(fraction * count), count).proportion_ci(method="wilson")
        assert one.fraction == fraction
        assert one.interval == pytest.approx(tuple(expected), abs=1e-12)
        assert one.error > 0


@pytest.mark.parametrize(("met", "count"), [(0, 1), (1, 1), (3, 7), (999, 1000), (50, 100)])
def test_wilson_intervals(met, count):
    expected = stats.binomtest(met, count).proportion_ci(method="wilson")
    assert confidence_interval(met / count, count) == pytest.approx(tuple(expected), abs=1e-12)
