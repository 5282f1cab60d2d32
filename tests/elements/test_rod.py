"""Rods that are stretched or twisted: stiffness, resonances and where they are strained."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.elements import rod
from tests.support import beam_mp
from tests.support.beam_mp import MP

LENGTH = 0.6
APART = np.array([[1.0, -1.0], [1.0, 1.0]])
"""(u1, u2) of (U_s, U_a)."""


def draws(lossy):
    """Rigidity, mass a length and omega: from creeping to dozens of waves on the rod."""
    rng = np.random.default_rng(lossy)
    for turns in 10.0 ** np.linspace(-9, 2, 23):
        rigidity, mass = (
            np.exp(rng.uniform(*np.log((1e-3, 1e5)))),
            np.exp(rng.uniform(*np.log((1e-9, 1e-1)))),
        )
        omega = turns / LENGTH * np.sqrt(rigidity / mass)
        yield (
            (
                rigidity * (1 + 1j * np.exp(rng.uniform(*np.log((1e-12, 0.1)))))
                if lossy
                else rigidity
            ),
            mass,
            omega,
        )


@pytest.mark.parametrize("lossy", [False, True])
def test_stiffness_keeps_all_digits(lossy):
    """But for (1 + c) roundings, where a relative change e of the frequency changes an element by c
    e."""
    form = MP.matrix(APART.tolist())
    for rigidity, mass, omega in draws(lossy):
        with np.errstate(all="raise"):
            found = rod.stiffness(rigidity, mass, LENGTH / 2, np.array([omega]))[:, 0]
        with beam_mp.exact():
            exact, nudged = (
                form.T
                * beam_mp.Strained(
                    rigidity, mass, LENGTH, beam_mp.number(omega) * (1 + MP.mpf(nudge))
                ).stiffness()
                * form
                for nudge in (0, "1e-20")
            )
            for n in (0, 1):
                condition = abs(nudged[n, n] / exact[n, n] - 1) * MP.mpf(10) ** 20
                assert abs(beam_mp.number(found[n]) / exact[n, n] - 1) < 1e-15 * (1 + condition)


def test_a_rod_without_mass_is_a_spring():
    found = rod.stiffness(7.0, 0.0, LENGTH / 2, np.array([0.0, 1e5]))
    assert np.array_equal(found[0], [0, 0])
    assert found[1] / 4 == pytest.approx(7.0 / LENGTH, rel=1e-15)


def test_resonances_are_at_whole_half_waves():
    rigidity, mass, n = 3.1, 2e-3, np.arange(1, 1000)
    exact = n * np.pi / LENGTH * np.sqrt(rigidity / mass)  # n c / 2 L
    assert np.array_equal(rod.resonances_below(rigidity, mass, LENGTH / 2, exact * (1 + 1e-13)), n)
    assert np.array_equal(
        rod.resonances_below(rigidity, mass, LENGTH / 2, exact * (1 - 1e-13)), n - 1
    )
    assert rod.resonances_below(rigidity, mass, LENGTH / 2, 0.0) == 0
    assert np.array_equal(rod.resonances_below(rigidity, 0.0, LENGTH / 2, exact), 0 * n)


@pytest.mark.parametrize("angle", [1e-12, 1e-3, 0.1])
@pytest.mark.parametrize("turns", [1e-3, 0.01, 1.0, 7.0, 40.0])
def test_loss_keeps_its_digits(turns, angle):
    """Im of both stiffnesses against that in many digits, however small."""
    rigidity, mass = 20.0 * (1 + 1j * angle), 1e-3
    omega = turns / LENGTH * np.sqrt(20.0 / mass)
    found = rod.stiffness(rigidity, mass, LENGTH / 2, np.array([omega]))[:, 0]
    with beam_mp.exact(40):
        ends = beam_mp.Strained(rigidity, mass, LENGTH, beam_mp.number(omega)).stiffness()
        even, odd = 2 * (ends[0, 0] + ends[0, 1]), 2 * (ends[0, 0] - ends[0, 1])
        assert abs(found[0].imag / float(even.imag) - 1) < 1e-13 / min(turns, 1.0) ** 2
        assert abs(found[1].imag / float(odd.imag) - 1) < 1e-12
