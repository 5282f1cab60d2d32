"""Filters of control loops, and stability margins of loops known from textbooks."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.analyses.damp import closed_loop_poles, control, margins
from tests.support import plants, scenes

GRID = np.geomspace(0.05, 50, 41)


def margins_of(numerator, denominator):
    def gain(frequency):
        s = 2j * np.pi * frequency
        return (np.polyval(numerator, s) / np.polyval(denominator, s))[:, None]

    roots = np.abs(np.concatenate([np.roots(numerator), np.roots(denominator)])) / (2 * np.pi)
    return margins.compute_margins(gain, np.append(roots, 1.0))[0]


def test_margins_of_a_textbook_loop():
    """k / (s (s + 1) (s + 2)) at k = 1: gain margin 6 at sqrt 2 rad/s, phase margin 53.4 degrees at
    0.446 rad/s."""
    found = margins_of([1.0], [1, 3, 2, 0])
    (crossing,) = (np.sqrt(root.real) for root in np.roots([1, 5, 4, -1]) if root.real > 0)
    assert found.gain_up == pytest.approx(6.0, rel=1e-12)
    assert found.gain_down == 0.0
    assert found.phase == pytest.approx(
        90 - np.degrees(np.arctan(crossing) + np.arctan(crossing / 2)), rel=1e-12
    )
    assert found.phase == pytest.approx(53.4, abs=0.05)
    assert found.phase_frequency == pytest.approx(crossing / (2 * np.pi), rel=1e-12)


def test_margins_of_a_conditionally_stable_loop():
    """2 (s + 1)^2 / s^3 crosses -180 degrees at 1 rad/s with a gain of 4: it may fall fourfold, and
    grow without limit."""
    found = margins_of([2, 4, 2], [1, 0, 0, 0])
    assert found.gain_up == np.inf
    assert found.gain_down == pytest.approx(0.25, rel=1e-12)


def test_margins_without_crossings():
    found = margins_of([0.3], [1, 1])
    assert (found.phase, found.gain_up, found.gain_down) == (np.inf, np.inf, 0.0)
    assert np.isnan(found.phase_frequency)
    assert found.distance == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    "how",
    [
        {"gain": 5.0},
        {"gain": -2.0, "poles": [3.0]},
        {"gain": 3e4, "zeros": [0.0, 0.8], "poles": [30.0, [12.0, 9.0]]},
        {"gain": 1e3, "zeros": [[0.3, 4.0]], "poles": [[0.1, 7.0], 0.0]},
        {
            "gain": 1e3,
            "zeros": [0.01, [0.1, 3.0], [0.2, 7.0]],
            "poles": [0.001, [1.0, 2.0], [10.0, 30.0], 100.0],
        },
    ],
)
def test_filters(how):
    """H(f) = gain times the product of (i f + z) over that of (i f + p), a pair standing for both
    conjugates; and its state space."""
    table = {"name": "a", "sensor": "upper.x", "actuator": "upper.force_x", **how}
    one = scenes.design_of(plants.raw("triple") | {"control": {"loop": [table]}}).control.loop[0]
    expected = np.full(GRID.shape, how["gain"], dtype=complex)
    for key, power in (("zeros", 1), ("poles", -1)):
        for root in how.get(key, []):
            for value in (
                [complex(*root), complex(*root).conjugate()] if isinstance(root, list) else [root]
            ):
                expected *= (1j * GRID + value) ** power
    np.testing.assert_allclose(control.evaluate_filter(one, GRID), expected, rtol=1e-14)
    made = closed_loop_poles.realise(one)
    a, b, c, d = made.A, made.B, made.C, made.D
    assert all(np.isrealobj(matrix) for matrix in (a, b, c, d))
    s = 2j * np.pi * GRID
    found = [(c @ np.linalg.solve(x * np.eye(len(a)) - a, b) + d)[0, 0] for x in s]
    np.testing.assert_allclose(found, expected, rtol=1e-10)
