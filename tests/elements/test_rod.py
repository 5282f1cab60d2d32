"""Rods that are stretched or twisted: stiffness, resonances and where they are strained."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.elements import rod
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

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


def integrate_squares(rigidity, mass, half, omega, ends):
    """Integrals of |u'|^2 and |u|^2 for even and odd motions of the ends, (r, f) each."""
    even, odd = np.abs(ends) ** 2
    integrals = rod.square_integrals(rigidity, mass, half, omega)
    return [even * of_even + odd * of_odd for of_even, of_odd in integrals]


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-3, 0.1])
@pytest.mark.parametrize("turns", [1e-6, 0.01, 1.0, 7.0, 40.0])
def test_strain_is_that_of_the_shape(turns, angle):
    """Against quadrature; and with loss, all that the ends lose is lost there: Im(S) times it is
    x^H Im(F) x."""
    rng = np.random.default_rng(4)
    rigidity, mass = 20.0 * (1 + 1j * angle if angle else 1), 1e-3
    omega = turns / LENGTH * np.sqrt(20.0 / mass)
    motions = np.vstack([np.eye(2), rng.normal(size=(3, 2)) + 1j * rng.normal(size=(3, 2))])
    ends = np.linalg.solve(APART, motions.T)
    with np.errstate(all="raise"):
        found, _ = (
            part[:, 0]
            for part in integrate_squares(
                rigidity, mass, LENGTH / 2, np.array([omega]), ends[:, :, None]
            )
        )
    strained = integrals(rigidity, mass, omega, motions)
    with beam_mp.exact(40):
        one = beam_mp.Strained(rigidity, mass, LENGTH, beam_mp.number(omega))
        stiffness = one.stiffness()
        for motion, value, integral in zip(motions, found, strained, strict=True):
            assert abs(value / integral - 1) < 1e-12
            if angle:
                x = MP.matrix([beam_mp.number(v) for v in motion])
                lost = (x.H * stiffness * x)[0].imag
                assert abs(one.rigidity.imag * value / lost - 1) < 1e-12


@kept
def integrals(rigidity, mass, omega, motions):
    """Of the squared strain over the rod, by quadrature."""
    with beam_mp.exact(40):
        one = beam_mp.Strained(rigidity, mass, LENGTH, beam_mp.number(omega))
        cells = [one.length * n / 8 for n in range(9)]
        slopes = [one.slope(motion) for motion in motions]
        return [float(MP.quad(lambda x: abs(slope(x)) ** 2, cells)) for slope in slopes]  # noqa: B023


def test_what_dies_away_along_the_rod():
    """Far above any overflow of sinh: both integrals are those of an exponential from each end,
    |kappa|^2 / (2 Im kappa) and 1 / (2 Im kappa)."""
    rigidity, mass, omega = 20.0 * (1 + 0.5j), 1e-3, np.array([1e5, 1e7, 1e9])
    kappa = np.sqrt(mass * omega**2 / rigidity)
    ends = np.array([[[0.5]], [[-0.5]]]) * np.ones(3)  # only the upper end moves, by 1
    with np.errstate(all="raise"):
        strained, moved = integrate_squares(rigidity, mass, LENGTH / 2, omega, ends)
    np.testing.assert_allclose(
        strained[0], np.abs(kappa) ** 2 / (2 * np.abs(kappa.imag)), rtol=1e-12
    )
    np.testing.assert_allclose(moved[0], 1 / (2 * np.abs(kappa.imag)), rtol=1e-12)
