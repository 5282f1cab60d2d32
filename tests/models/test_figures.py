"""Figures 3 and 4 of the paper against its equations, at every point that is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from suspension_cli.models.closed_form import longitudinal_tilt
from tools import figure3, figure4


@pytest.fixture(scope="module")
def tilts():
    return figure3.solved()


@pytest.fixture(scope="module")
def rotations():
    return figure4.solved()


def test_parameters_are_those_of_the_text(tilts, rotations):
    """Section 5a; E from section 4c."""
    k, blade = 1.7e11 * np.pi * 198e-6**2 / 0.18, 1300.0
    across = 6.0 * (3 * 0.09**2 + 0.10**2) / 12
    for curves, t in ((tilts, 0.0995), (rotations, 0.095)):
        for curve, stiffness in zip(curves, (k, 1 / (1 / k + 1 / blade)), strict=True):
            own = curve.wires
            assert [own.mass, own.l, own.t2, own.d, own.gravity] == [6.0, 0.18, t, 0.001, 9.81]
            assert own.inertia[1:] == pytest.approx((across, across), rel=1e-14)
            assert own.k == pytest.approx(stiffness, rel=1e-14)
    assert [curve.wires.s for curve in rotations] == [0.03, 0.03]


def test_figure_3_is_equations_10_to_14(tilts):
    for curve in tilts:
        found = (2 * np.pi * curve.frequency) ** 2
        squares = -np.linalg.eigvals(longitudinal_tilt(replace(curve.wires, s=curve.value)))
        away = np.abs(squares / found[:, None] - 1)
        assert away.min(1).max() < 1e-10
        assert curve.value[0] == 5e-5 and curve.value[-1] == 0.05
        # and it is the eigenvalue that is mostly tilt, but for what the coupling mixes next to the
        # longitudinal one
        clear = np.abs(squares[:, 0] / squares[:, 1] - 1) > 0.2
        tilt = -longitudinal_tilt(replace(curve.wires, s=curve.value))[:, 1, 1]
        assert (np.abs(tilt / found - 1)[clear] < 0.01).all()


def test_limits_of_figure_3(tilts):
    """At s = 0 an eigenvalue of A, at large s proportional to s."""
    for curve in tilts:
        squares = -np.linalg.eigvals(longitudinal_tilt(replace(curve.wires, s=0.0)))
        low = figure3.constant(curve.wires)
        assert (2 * np.pi * low) ** 2 == pytest.approx(squares.min(), rel=1e-12)
        assert curve.frequency[0] == pytest.approx(low, rel=0.01)
        one, ten = figure3.linear(curve.wires, np.array([0.005, 0.05]))
        assert ten == pytest.approx(10 * one, rel=1e-12)
    assert tilts[0].frequency[-1] == pytest.approx(figure3.linear(tilts[0].wires, 0.05), rel=1e-3)


def test_figure_4_is_equation_9(rotations):
    for curve in rotations:
        np.testing.assert_allclose(curve.frequency, figure4.equation_9(curve), rtol=1e-10)
    bare, soft = rotations
    assert (np.diff(soft.frequency) > 0).all(), (
        "with cantilevers rotation falls with the angle, for t1 < t2"
    )
    assert bare.frequency[0] > 9.0 > bare.frequency[figure4.POINTS // 3], "as docs/paper.md says"
