"""Chebyshev series of several numbers, against the functions that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.studies.chebyshev import Box, coefficients, interpolate, nodes

BOX = Box((0.0, 1.0, 2.0), (1.0, 2.0, 20.0), (False, False, True))
PLACES = np.random.default_rng(1).uniform(size=(40, 3))
POINTS = np.array(BOX.low) + (np.array(BOX.high) - np.array(BOX.low)) * PLACES


def functions(points):
    first, second, third = points.T
    return np.stack([np.exp(first * second) / third, np.sin(first) + 1j * second], axis=1)


def test_a_known_series_has_its_coefficients():
    x = np.array(nodes(6))
    values = 3.0 - 2.0 * x + 0.5 * np.cos(5 * np.arccos(x))
    np.testing.assert_allclose(
        coefficients(values[:, None])[:, 0], [3.0, -2.0, 0, 0, 0, 0.5, 0], atol=1e-14
    )


@pytest.mark.parametrize("count", [4, 12, 48])
def test_points_are_among_those_of_twice_as_many(count):
    assert set(nodes(count)) <= set(nodes(2 * count))


def test_smooth_functions_of_three_numbers():
    found = interpolate(functions, BOX, most=20000)
    assert found is not None
    np.testing.assert_allclose(found.at(POINTS), functions(POINTS), rtol=1e-9)
    grid = found.on_grid([POINTS[:3, 0], POINTS[:4, 1], POINTS[:5, 2]])
    np.testing.assert_allclose(
        grid[2, 3, 4], functions(np.array([[POINTS[2, 0], POINTS[3, 1], POINTS[4, 2]]]))[0]
    )


def test_each_axis_has_the_points_that_it_needs():
    asked = []

    def sample(points):
        asked.append(len(points))
        return np.exp(3 * points[:, :1]) + points[:, 1:2]

    found = interpolate(sample, Box((0.0, 0.0), (2.0, 1.0), (False, False)), most=1000)
    assert found is not None
    rows, columns, _ = found.coefficient.shape
    assert columns == 5 and rows > 9
    assert found.points == rows * columns == sum(asked)


def test_a_step_and_a_missing_value_are_not_interpolated():
    box = Box((0.0,), (1.0,), (False,))
    assert interpolate(lambda p: np.abs(p - 0.3), box, most=200) is None
    assert interpolate(lambda p: np.where(p > 0.9, np.nan, p), box, most=200) is None
