"""Where a wire bends and how far it moves, against quadrature and against what its ends lose."""

from __future__ import annotations

import numpy as np
import pytest

from suspension_cli.elements import beam, curvature
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

LENGTH, TENSION, MASS = 0.6, 100.0, 5e-3
SPLIT = np.linalg.inv(np.array(beam_mp.ALIKE, dtype=float))
MOTIONS = np.vstack(
    [
        np.eye(4),
        (lambda rng: rng.normal(size=(2, 4)) + 1j * rng.normal(size=(2, 4)))(
            np.random.default_rng(9)
        ),
    ]
)
"""w1, w1', w2, w2': each end alone, and all at once."""


def wire(slenderness, angle):
    rigidity = TENSION * LENGTH**2 / slenderness**2
    return (
        (rigidity * (1 + 1j * angle), TENSION, MASS * (1 - 0.1j * angle), LENGTH)
        if angle
        else (rigidity, TENSION, MASS, LENGTH)
    )


def found(arguments, omega, motions=MOTIONS):
    """Upper, lower and displaced (3, r)."""
    rigidity, tension, mass, length = arguments
    ends = (SPLIT @ motions.T)[..., None]
    with np.errstate(all="raise", under="ignore"):
        now = beam.waves(rigidity, tension, mass, length / 2, np.array([omega]))
        return np.array(
            [
                *curvature.integrate_squared_curvature(now, ends),
                curvature.integrate_squared_displacement(now, ends),
            ]
        )[..., 0]


def summed(arguments, omega, motions=MOTIONS):
    """The same (3, r) from integrals of products of exponentials."""
    return np.array(_summed(arguments, omega, motions))


@kept
def _summed(arguments, omega, motions):
    with beam_mp.exact(60 + beam_mp.digits_for(*arguments, omega)):
        one = beam_mp.Bent(*arguments, beam_mp.number(omega))
        h = one.length / 2
        return [
            [float(one.squared(motion, *task)) for motion in motions]
            for task in ((2, 0, h), (2, h, 2 * h), (0, 0, 2 * h))
        ]


@kept
def quadrature(arguments, omega, motions):
    """The same from the shape, split where the wire bends."""
    with beam_mp.exact(40 + beam_mp.digits_for(*arguments, omega)):
        one = beam_mp.Bent(*arguments, beam_mp.number(omega))
        h, result = one.length / 2, []
        cells = [h * n / 4 for n in range(5)]
        for motion in motions:
            w, bend = one.shape(motion), one.shape(motion, 2)
            with beam_mp.exact(30):
                upper, lower, both = ([start + x for x in cells] for start in (0, h, 0))
                square = [
                    MP.quad(lambda x, bend=bend: abs(bend(x)) ** 2, half, maxdegree=4)
                    for half in (upper, lower)
                ]
                result.append(
                    [
                        *map(float, square),
                        float(
                            MP.quad(
                                lambda x, w=w: abs(w(x)) ** 2, [2 * x for x in both], maxdegree=4
                            )
                        ),
                    ]
                )
    return result


@pytest.mark.parametrize(
    ("slenderness", "omega"), [(0.01, 30.0), (1.0, 500.0), (20.0, 1.0), (20.0, 7000.0)]
)
@pytest.mark.parametrize("angle", [0.0, 0.05])
def test_integrals_are_those_of_the_shape(slenderness, omega, angle):
    """Quadrature of |w''|^2 over each half and of |w|^2, split where the wire bends."""
    arguments = wire(slenderness, angle)
    expected = np.array(quadrature(arguments, omega, MOTIONS[[1, 4]])).T
    assert np.abs(summed(arguments, omega, MOTIONS[[1, 4]]) / expected - 1).max() < 1e-13
    assert np.abs(found(arguments, omega, MOTIONS[[1, 4]])[:2] / expected[:2] - 1).max() < 1e-12


@pytest.mark.parametrize("angle", [0.0, 1e-3])
@pytest.mark.parametrize("slenderness", [*(10.0 ** np.arange(-6, 3)), 300.0])
def test_curvature_of_every_wire(slenderness, angle):
    """1e-3 Hz to 100 kHz. One end of a limp wire moved alone bends the other half by 1/(lambda L)^2
    of what it bends its own: of such a half, digits are left in the sum with the other."""
    for frequency in (1e-3, 1.3, 57.0, 1.1e3, 1.2e4, 1e5):
        omega, arguments = 2 * np.pi * frequency, wire(slenderness, angle)
        if np.sqrt(np.sqrt(MASS / abs(arguments[0])) * omega) * LENGTH > 300:
            continue
        motions = MOTIONS[[0, 1, 3, 4]]
        got, exact = found(arguments, omega, motions)[:2], summed(arguments, omega, motions)[:2]
        turns = omega * LENGTH * np.sqrt(MASS / TENSION)
        tolerance = 2e-14 * (
            1 + 10 * min(turns, np.sqrt(np.sqrt(MASS / abs(arguments[0])) * omega) * LENGTH)
        )
        assert (np.abs(got - exact) <= tolerance * exact.sum(0)).all(), frequency
        assert np.abs(got / exact - 1).max() <= tolerance * max(1.0, slenderness) ** 2, frequency


@pytest.mark.parametrize("angle", [0.0, 1e-3])
@pytest.mark.parametrize("slenderness", [*(10.0 ** np.arange(-6, 3)), 300.0])
def test_displacement_of_every_wire(slenderness, angle):
    for frequency in (1e-3, 1.3, 57.0, 1.1e3, 1.2e4, 1e5):
        omega, arguments = 2 * np.pi * frequency, wire(slenderness, angle)
        if np.sqrt(np.sqrt(MASS / abs(arguments[0])) * omega) * LENGTH > 300:
            continue
        motions = MOTIONS[[0, 1, 4]]
        got, exact = found(arguments, omega, motions)[2], summed(arguments, omega, motions)[2]
        assert np.abs(got / exact - 1).max() < 1e-10, frequency


@pytest.mark.parametrize("angle", [1e-12, 1e-9, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("slenderness", [1e-6, 1e-3, 1.0, 30.0, 1e3])
def test_all_that_the_ends_lose_is_lost_along_the_wire(slenderness, angle):
    """x^H Im(F) x = Im(EI) integral |w''|^2 - omega^2 Im(mu) integral |w|^2, the left side in many
    digits."""
    arguments = wire(slenderness, angle)
    for omega in (0.1, 300.0, 2e4):
        if np.sqrt(np.sqrt(MASS / abs(arguments[0])) * omega) * LENGTH > 1000:
            continue
        upper, lower, moved = found(arguments, omega)
        lost = arguments[0].imag * (upper + lower) - omega**2 * arguments[2].imag * moved
        exact = beam_mp.bent(*arguments, omega)
        for motion, value in zip(MOTIONS, lost, strict=True):
            with beam_mp.exact(60 + beam_mp.digits_for(*arguments, omega)):
                x = MP.matrix([beam_mp.number(v) for v in motion])
                assert abs(value / (x.H * exact * x)[0].imag - 1) < 1e-10
