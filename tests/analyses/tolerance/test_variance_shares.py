"""Shares of variance against closed forms, and the scatter of their estimates over seeds."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import suspension_cli as sus
from suspension_cli.analyses.tolerance.variance_shares import fit

GROUPS = [0, 1, 1, 2]
SLOPES = np.array([3.0, 2.0, -1.0, 0.0])
SPREADS = np.array([1.0, 2.0, 1.0, 5.0])
EXACT = np.array([9.0, 16.0 + 1.0, 0.0]) / 26.0


def drawn(seed, count=400):
    """Independent deviations, two normal and two uniform."""
    rng = np.random.default_rng(seed)
    normal, uniform = rng.normal(size=(count, 2)), rng.uniform(-1, 1, (count, 2)) * 3**0.5
    return np.hstack([normal, uniform]) * SPREADS


def test_a_linear_function():
    x = drawn(1, 100_000)
    found = fit((x @ SLOPES)[:, None], x, GROUPS)
    assert found.r_squared == pytest.approx([1.0], abs=1e-12)
    np.testing.assert_allclose(found.share[0], EXACT, atol=0.01)
    assert (np.abs(found.share[0] - EXACT) <= 4 * found.error[0] + 1e-12).all()


def test_a_curved_function():
    """y = 2 u + u v + v^2 with independent u, v of variance 1: of 4 + 1 + 2, a line finds 4."""
    rng = np.random.default_rng(3)
    x = rng.normal(size=(100_000, 2))
    u, v = x.T
    found = fit((2 * u + u * v + v**2)[:, None], x, [0, 1])
    assert found.r_squared == pytest.approx([4 / 7], abs=0.02)
    np.testing.assert_allclose(found.share[0], [4 / 7, 0.0], atol=0.02)


def test_standard_errors_are_the_scatter_over_seeds():
    """Of a function with curvature and noise; of no bias, also where a tolerance causes nothing."""
    shares, errors = [], []
    for seed in range(300):
        x = drawn(seed)
        noise = np.random.default_rng([seed, 1]).normal(size=len(x))
        y = x @ SLOPES + 0.3 * (x[:, 0] ** 2 + x[:, 1] * x[:, 2]) + 2 * noise
        found = fit(y[:, None], x, GROUPS)
        shares.append(found.share[0])
        errors.append(found.error[0])
    variance = 26 + 0.09 * (2 + 4 * 1) + 4
    expected = np.array([9, 17, 0]) / variance
    scatter = np.std(shares, axis=0)
    np.testing.assert_allclose(np.mean(shares, axis=0), expected, atol=4 * scatter.max() / 300**0.5)
    ratio = np.mean(errors, axis=0) / scatter
    assert ratio[:2] == pytest.approx(1.0, abs=0.15)
    assert 0.9 < ratio[2] < 1.5  # of the square of a slope that is 0


def test_values_that_are_missing_or_do_not_vary():
    x = drawn(5)
    y = np.column_stack([x @ SLOPES, np.full(len(x), 3.0), x @ SLOPES])
    y[:100, 2] = np.nan
    found = fit(y, x, GROUPS)
    rest = fit(y[100:, 2:], x[100:], GROUPS)
    assert np.isnan(found.share[1]).all() and np.isnan(found.r_squared[1])
    np.testing.assert_allclose(found.share[2], rest.share[0], rtol=1e-12)
    assert np.isnan(fit(y[:12], x[:12], GROUPS).share).all()  # too few


def test_a_fit_that_explains_nothing_is_said_in_words():
    """No negative fraction of the variance is printed, and no shares of it."""
    found = sus.tolerance(sus.example("triple-tolerance"), builds=24, fidelity="string")
    poor = dataclasses.replace(found, r_squared=np.full_like(found.r_squared, -0.3))
    text = str(poor)
    assert "a linear fit explains nothing of the spread of coupling with its sign" in text
    assert "-0.3" not in text
    good = dataclasses.replace(found, r_squared=np.full_like(found.r_squared, 0.9))
    assert "explains nothing" not in str(good)
    assert "0.900" in str(good)
