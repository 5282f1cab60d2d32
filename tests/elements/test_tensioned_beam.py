"""A beam under tension against arithmetic of many digits, and its resonances counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from suspension_cli.elements import tensioned_beam
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

ROUNDINGS = 16 * np.finfo(float).eps
"""A relative error e of the frequency alone changes an element by c e: what is computed may be
wrong by (1 + c) times a few roundings. c is of order 1 but near poles and zeros of the element, and
there and above it is what no double precision can be better than."""
AWAY = 2e4
"""Elements with less c are away from their poles and zeros: (1 + c) ROUNDINGS < 1e-10."""


@dataclass(frozen=True)
class Wire:
    rigidity: complex
    tension: float
    mass: complex
    length: float

    def waves(self, omega):
        return tensioned_beam.waves(self.rigidity, self.tension, self.mass, self.length / 2, omega)

    def found(self, omega):
        """(6, f), on (W_s, T_s, W_a, T_a)."""
        with np.errstate(all="raise", under="ignore"):
            elements = tensioned_beam.stiffness(self.rigidity, self.waves(np.atleast_1d(omega)))
        ww, wt, tt, pp, pd, dd = elements
        h = self.length / 2
        odd = (pp + self.tension * self.length - 2 * pd + dd) / h**2
        return np.array([ww, wt, tt, odd, (pd - dd) / h, dd])

    def below(self, omega):
        with np.errstate(all="raise", under="ignore"):
            return tensioned_beam.resonances_below(self.waves(np.asarray(omega)))


def random_wire(rng, slenderness, lossy):
    """A wire of given lambda L = sqrt(T/EI) L; 0 without tension."""
    length, tension, mass = (
        np.exp(rng.uniform(*np.log(span))) for span in ((0.05, 2.0), (0.1, 1e4), (1e-6, 0.1))
    )
    rigidity = (
        tension * length**2 / slenderness**2
        if slenderness
        else np.exp(rng.uniform(*np.log((1e-6, 1e2))))
    )
    angle, drag = np.exp(rng.uniform(*np.log((1e-10, 0.1)), 2)) if lossy else (0.0, 0.0)
    return Wire(
        rigidity * (1 + 1j * angle) if lossy else rigidity,
        tension if slenderness else 0.0,
        mass * (1 - 1j * drag) if lossy else mass,
        length,
    )


def compared(wire, omega):
    """Relative error and condition c of the six elements."""
    exact, condition = elements(wire.rigidity, wire.tension, wire.mass, wire.length, omega)
    with beam_mp.exact():
        error = [
            float(abs(beam_mp.number(got) - one) / abs(one))
            for one, got in zip(exact, wire.found(omega)[:, 0], strict=True)
        ]
    return np.array([error, condition])


@kept
def elements(rigidity, tension, mass, length, omega):
    """The six elements, and the condition c of each: what a relative change of the frequency does
    to it."""
    exact, nudged = (
        beam_mp.even_odd(beam_mp.bent(rigidity, tension, mass, length, omega, nudge=nudge))
        for nudge in (0, "1e-25")
    )
    with beam_mp.exact():
        pairs = [(exact[i, j], nudged[i, j]) for i, j in tensioned_beam.ELEMENT_PLACES]
        return [one for one, _ in pairs], [
            float(abs(other - one) / abs(one) * MP.mpf(10) ** 25) for one, other in pairs
        ]


@pytest.mark.parametrize("lossy", [False, True], ids=["lossless", "lossy"])
@pytest.mark.parametrize("slenderness", [0.0, *(10.0 ** np.arange(-6, 4))])
def test_stiffness_keeps_all_digits(slenderness, lossy):
    """lambda L to 1e3, at 1e-3 Hz to 100 kHz."""
    rng = np.random.default_rng([int(10 + np.log10(slenderness or 1e-10)), lossy])
    found = []
    for frequency in 10.0 ** np.linspace(-3, 5, 9):
        wire = random_wire(rng, slenderness, lossy)
        # an element whose wire is longer than 1000 waves is left to the next test: it takes
        # thousands of digits
        turns = (
            np.sqrt(np.sqrt(abs(wire.mass / wire.rigidity)) * 2 * np.pi * frequency) * wire.length
        )
        if turns < 1000:
            found.append(compared(wire, 2 * np.pi * frequency))
    assert len(found) > 5
    error, condition = np.moveaxis(np.array(found), 1, 0)
    assert (error <= ROUNDINGS * (1 + condition)).all()
    away = condition < AWAY
    assert away.mean() > 0.8
    assert error[away].max() < 1e-10


@pytest.mark.parametrize(("frequency", "lossy"), [(0.01, True), (1e5, False), (9.7e4, True)])
def test_stiffness_of_the_most_slender_wires(frequency, lossy):
    rng = np.random.default_rng([int(frequency), 1])
    error, condition = compared(random_wire(rng, 1e4, lossy), 2 * np.pi * frequency)
    assert (error <= ROUNDINGS * (1 + condition)).all()
    assert error[condition < AWAY].max() < 1e-10


def test_far_from_the_real_axis_there_is_no_number_and_no_warning():
    """Where a search for poles strays."""
    found = tensioned_beam.sinc_cos(np.array([1000j, 1.0]))
    assert [np.isfinite(one).tolist() for one in found] == [[False, True]] * 2


def test_nothing_overflows():
    """Every lambda L, frequency and loss at once: finite, and no floating point error on the way
    (but for underflow to 0, which is right)."""
    frequency = np.concatenate([[0.0], 10.0 ** np.linspace(-3, 5, 400)])
    for angle in (0.0, 1e-12, 0.1):
        for slenderness in 10.0 ** np.linspace(-6, 4, 21):
            for mass in (0.0, 1e-6, 0.1):
                rigidity = 100.0 / slenderness**2 * (1 + 1j * angle if angle else 1)
                wire = Wire(rigidity, 100.0, mass * (1 - 1j * angle) if angle else mass, 1.0)
                assert np.isfinite(wire.found(2 * np.pi * frequency)).all()
                if not angle:
                    wire.below(2 * np.pi * frequency)


def jumps(wire, count):
    """The first frequencies where the number of resonances below jumps, by bisection to the last
    digit."""
    low, high = np.zeros(count), np.full(count, 1.0)
    number = np.arange(1, count + 1)
    while wire.below(high)[-1] < count:
        high *= 2
    for _ in range(80):
        middle = (low + high) / 2
        above = wire.below(middle) >= number
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return high


@pytest.mark.parametrize("slenderness", [0.0, 1.0, 60.0, 1e3])
def test_resonances_are_those_of_the_transcendental_equation(slenderness):
    """2 alpha beta (1 - cosh alpha L cos beta L) + (alpha^2 - beta^2) sinh alpha L sin beta L = 0,
    solved in 60 digits: each, to 1e-12."""
    wire = random_wire(np.random.default_rng(int(slenderness)), slenderness, False)
    length = wire.length

    def equation(omega):
        bent = beam_mp.Bent(wire.rigidity, wire.tension, wire.mass, length, omega)
        a, b = bent.alpha, bent.beta
        return (
            2 * a * b * (1 / MP.cosh(a * length) - MP.cos(b * length))
            + (a * a - b * b) * MP.tanh(a * length) * MP.sin(b * length)
        ) / (a * a + b * b)

    found = jumps(wire, 12)
    assert (np.diff(found) > 0).all()
    with beam_mp.exact():
        for omega in found:
            root = MP.findroot(
                equation,
                (MP.mpf(omega) * (1 - MP.mpf("1e-9")), MP.mpf(omega) * (1 + MP.mpf("1e-9"))),
            )
            assert abs(root / omega - 1) < 1e-12
        grid = [found[-1] * (1 + n) / 240 for n in range(240)]
        signs = np.sign(
            [float(equation(MP.mpf(omega))) for omega in [*grid, found[-1] * (1 + 1e-9)]]
        )
        assert (signs[1:] != signs[:-1]).sum() == 12
