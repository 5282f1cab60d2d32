"""Quadratic forms of losses."""

from __future__ import annotations

import numpy as np

import suspension_cli as sus
from suspension_cli.linear.terms import quadratic_form


def test_a_form_is_not_negative_by_rounding_alone():
    """A spring between points that move alike, of a rounded matrix; and one that gives power."""
    rounded = np.array([[1.0, -1.0], [-1.0, 1.0 - 2.0**-53]])
    motion = np.array([[1.0, 1.0], [1.0, -1.0]])
    np.testing.assert_array_equal(quadratic_form(rounded, motion), [0.0, 4.0])
    active = np.array([[1.0, 0.0], [0.0, -1e-3]])
    np.testing.assert_array_equal(quadratic_form(active, motion[:, :1]), [1.0 - 1e-3])
    np.testing.assert_array_equal(quadratic_form(active, np.array([[0.0], [1.0]])), [-1e-3])


def test_rounding_of_a_tower_gives_no_power_back():
    """Near 1.64 Hz springs of a keystone lose less than rounding errors of what they store."""
    design = sus.example("built/kagra-typea")
    found = sus.thermal(design, frequency=np.geomspace(0.1, 1000, 3000)[1200:1250])
    assert (found.amplitude > 0).all()
