"""Massless coordinates are eliminated alike in doubles, in batches and in double-double."""

from __future__ import annotations

import numpy as np

from suspension_cli.linear import static_condensation


def test_springs_in_series():
    found = static_condensation.condense(
        np.array([[3.0, -3.0], [-3.0, 4.0]]), np.array([False, True])
    )
    assert found.matrix == 0.75
    assert found.follow == -0.75
    assert found.compliance == 0.25


def test_doubles_agree_with_double_double():
    rng = np.random.default_rng(4)
    matrix = rng.normal(size=(5, 6, 12)) + 1j * rng.normal(size=(5, 6, 12))
    matrix[..., 6:] += np.swapaxes(matrix[..., 6:], -1, -2) + 8 * np.eye(6)
    light = np.array([False, True, False, False, True, False])
    many = static_condensation.condense(matrix, light)
    for n, one in enumerate(matrix):
        whole, follow = static_condensation.condense_double_double(one, np.zeros_like(one), light)
        np.testing.assert_allclose(
            many.matrix[n], whole.real.value + 1j * whole.imag.value, rtol=1e-12
        )
        np.testing.assert_allclose(many.follow[n], follow, rtol=1e-12)
        assert np.array_equal(many.matrix[n][:, 6:], many.matrix[n][:, 6:].T)


def test_a_singular_one_leaves_the_others_alone():
    matrix = np.array([np.eye(2), np.diag([1.0, 0.0]), 2 * np.eye(2)])
    found = static_condensation.condense(matrix, np.array([False, True])).compliance[:, 0, 0]
    np.testing.assert_array_equal(found, [1.0, np.nan, 0.5])
