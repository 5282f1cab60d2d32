"""Massless coordinates are eliminated, of one system or many."""

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


def test_a_singular_one_leaves_the_others_alone():
    matrix = np.array([np.eye(2), np.diag([1.0, 0.0]), 2 * np.eye(2)])
    found = static_condensation.condense(matrix, np.array([False, True])).compliance[:, 0, 0]
    np.testing.assert_array_equal(found, [1.0, np.nan, 0.5])
