"""A beam under tension against arithmetic of many digits, against textbooks, and its resonances
counted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from suspension_cli.elements import beam, joined_sections, rod
from tests.support import beam_mp
from tests.support.beam_mp import MP
from tests.support.references import kept

ROUNDINGS = 16 * np.finfo(float).eps
"""A relative error e of the frequency alone changes an element by c e: what is computed may be
wrong by (1 + c) times a few roundings. c is of order 1 but near poles and zeros of the element, and
there and above it is what no double precision can be better than."""
AWAY = 2e4
"""Elements with less c are away from their poles and zeros: (1 + c) ROUNDINGS < 1e-10."""


EVEN_WW, EVEN_WT, EVEN_TT, ODD_WW, ODD_WT, ODD_TT = range(6)


@dataclass(frozen=True)
class Wire:
    rigidity: complex
    tension: float
    mass: complex
    length: float

    def found(self, omega):
        """(6, f)"""
        with np.errstate(all="raise", under="ignore"):
            wave = beam.waves(
                self.rigidity, self.tension, self.mass, self.length / 2, np.atleast_1d(omega)
            )
            found = beam.stiffness(self.rigidity, wave)
        return beam_mp.of_ends(found, self.tension, self.length)

    def ends(self, omega):
        """(4, 4, f) on w1, w1', w2, w2'."""
        found = self.found(omega)
        whole = np.zeros((4, 4, found.shape[-1]), dtype=found.dtype)
        for (i, j), value in zip(beam.ELEMENT_PLACES, found, strict=True):
            whole[i, j] = whole[j, i] = value
        return joined_sections.to_ends(whole)

    def below(self, omega):
        with np.errstate(all="raise", under="ignore"):
            return beam.resonances_below(
                beam.waves(
                    self.rigidity, self.tension, self.mass, self.length / 2, np.asarray(omega)
                )
            )


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
        pairs = [(exact[i, j], nudged[i, j]) for i, j in beam.ELEMENT_PLACES]
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


@pytest.mark.parametrize("slenderness", 10.0 ** np.arange(-6, 5))
def test_stiffness_of_wires_without_mass(slenderness):
    """The even displacement costs nothing then."""
    wire = random_wire(np.random.default_rng(3), slenderness, False)
    arguments = (wire.rigidity, wire.tension, 0.0, wire.length, 0.0)
    exact = (
        beam_mp.even_odd(beam_mp.bent(*arguments))
        if slenderness < 3e3
        else beam_mp.even_odd(beam_mp.held(*arguments[:2], wire.length))
    )
    found = Wire(wire.rigidity, wire.tension, 0.0, wire.length).found(0.0)[:, 0]
    for (i, j), value in zip(beam.ELEMENT_PLACES, found, strict=True):
        assert abs(value - float(exact[i, j])) <= ROUNDINGS * abs(float(exact[i, j])) + 1e-50, (
            i,
            j,
        )
    assert found[EVEN_WW] == 0 and found[EVEN_WT] == 0


def test_nothing_overflows():
    """Every lambda L, frequency and loss at once: finite, and no floating point error on the way
    (but for underflow to 0, which is right)."""
    frequency = np.concatenate([[0.0], 10.0 ** np.linspace(-3, 5, 400)])
    for angle in (0.0, 1e-12, 1e-3, 0.1):
        for slenderness in 10.0 ** np.linspace(-6, 4, 21):
            for mass in (0.0, 1e-6, 0.1):
                rigidity = 100.0 / slenderness**2 * (1 + 1j * angle if angle else 1)
                found = Wire(
                    rigidity, 100.0, mass * (1 - 1j * angle) if angle else mass, 1.0
                ).found(2 * np.pi * frequency)
                assert np.isfinite(found).all()
                if not angle:
                    Wire(rigidity, 100.0, mass, 1.0).below(2 * np.pi * frequency)


def test_a_limp_wire_is_a_taut_string():
    """But for a share of order 1/(lambda L), from the two clamped ends that bend: at rest they take
    1/lambda off the length each."""
    tension, mass, length, omega = 50.0, 2e-3, 0.7, np.array([0.0, 10.0, 900.0, 5000.0])
    string = rod.stiffness(tension, mass, length / 2, omega)
    assert string[1, 0] / 4 == pytest.approx(tension / (2 * length / 2), rel=1e-14)
    slenderness = np.array([1e6, 1e7, 1e8])
    found = np.array(
        [
            Wire(tension * length**2 / each**2, tension, mass, length).found(omega)
            for each in slenderness
        ]
    )
    odd = (found[:, ODD_WW] / string[1] - 1) * slenderness[:, None]
    even = (found[:, EVEN_WW, 1:] / string[0, 1:] - 1) * slenderness[:, None]
    assert odd[:, 0] == pytest.approx(2, rel=1e-5)
    for share in (odd, even):
        assert np.abs(share / share[-1] - 1).max() < 0.05
    for turned in (EVEN_TT, ODD_TT, EVEN_WT, ODD_WT):
        assert (np.abs(found[-1, turned]) < 1e-5 * tension * length).all()


def test_a_beam_without_tension_at_rest_is_the_textbooks():
    rigidity, length = 3.7, 0.6
    for mass in (0.0, 1.0):
        found = Wire(rigidity, 0.0, mass, length).ends(0.0)[..., 0]
        w, t = 6 / length**2, 2 / length
        book = rigidity * np.array(
            [
                [2 * w / length, w, -2 * w / length, w],
                [w, 2 * t, -w, t],
                [-2 * w / length, -w, 2 * w / length, -w],
                [w, t, -w, 2 * t],
            ]
        )
        assert np.abs(found / book - 1).max() < 1e-13


@pytest.mark.parametrize("slenderness", [1e-6, 1e-3, 0.1, 1.0, 10.0, 1e3, 1e4])
def test_slow_motion_with_mass_is_static(slenderness):
    """omega -> 0: every element but the inertia -mu L omega^2 of the whole wire."""
    length, tension, mass = 0.6, 100.0, 5e-3
    rigidity = tension * length**2 / slenderness**2
    omega = 1e-7 * np.pi / length * np.sqrt((tension + rigidity * (np.pi / length) ** 2) / mass)
    still, slow = (Wire(rigidity, tension, each, length).found(omega)[:, 0] for each in (0.0, mass))
    rest = [EVEN_TT, ODD_WW, ODD_WT, ODD_TT]
    assert np.abs(slow[rest] / still[rest] - 1).max() < 1e-12
    assert slow[EVEN_WW] == pytest.approx(-mass * length * omega**2, rel=1e-12)


@pytest.mark.parametrize("slenderness", [0.1, 1.0, 30.0, 700.0, 1e4])
def test_static_stiffness_of_a_clamped_wire(slenderness):
    """T/(L - tanh(lambda L)/lambda) with the lower end free to turn (Gonzalez and Saulson 1994);
    T/(L - 2 tanh(lambda L/2)/lambda) if it may not."""
    length, tension = 0.4, 13.0
    found = Wire(tension * length**2 / slenderness**2, tension, 0.0, length).ends(0.0)[..., 0]
    wave = slenderness / length
    tolerance = 1e-13 * max(1.0, slenderness**-2)  # of the closed forms
    assert found[2, 2] - found[2, 3] ** 2 / found[3, 3] == pytest.approx(
        tension / (length - np.tanh(slenderness) / wave), rel=10 * tolerance
    )
    assert found[2, 2] == pytest.approx(
        tension / (length - 2 * np.tanh(slenderness / 2) / wave), rel=10 * tolerance
    )


def jumps(wire, count):
    """The first frequencies where the number of resonances below jumps, by bisection to the last
    digit."""
    result = []
    for n in range(count):
        low, high = 0.0, 1.0
        while wire.below(np.array([high]))[0] <= n:
            low, high = high, 2 * high
        for _ in range(80):
            middle = (low + high) / 2
            low, high = (middle, high) if wire.below(np.array([middle]))[0] <= n else (low, middle)
        result.append(high)
    return np.array(result)


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


def test_resonances_below_many_frequencies_at_once():
    wire = random_wire(np.random.default_rng(5), 100.0, False)
    found = jumps(wire, 30)
    assert np.array_equal(wire.below(found * (1 + 1e-13)), np.arange(1, 31))
    assert np.array_equal(wire.below(found * (1 - 1e-13)), np.arange(30))
    assert wire.below(np.array([0.0]))[0] == 0
    assert np.array_equal(Wire(1.0, 1.0, 0.0, 1.0).below(found), np.zeros(30))


def test_resonances_of_a_beam_without_tension():
    found = np.sqrt(jumps(Wire(2.0, 0.0, 3.0, 0.5), 4) * np.sqrt(1.5)) * 0.5
    assert found == pytest.approx(
        [4.730040744862704, 7.853204624095838, 10.995607838001671, 14.137165491257464], rel=1e-13
    )


def test_violin_series_of_a_stiff_string():
    """omega_n = n pi/L sqrt(T/mu) (1 + 2 e + (4 + n^2 pi^2/2) e^2 + O(e^3)), e = sqrt(EI/T)/L
    (Morse, Vibration and Sound; Fletcher 1964)."""
    tension, mass, length, n = 100.0, 5e-3, 0.6, np.arange(1, 6)
    left = []
    for e in (2e-3, 1e-3, 5e-4):
        ratio = jumps(Wire(tension * (e * length) ** 2, tension, mass, length), 5) / (
            n * np.pi / length * np.sqrt(tension / mass)
        )
        assert (ratio - 1) / (2 * e) == pytest.approx(1, abs=(5 + n.max() ** 2 * 5) * e)
        left.append(np.abs(ratio - 1 - 2 * e - (4 + n**2 * np.pi**2 / 2) * e**2))
    order = np.log2(np.array(left[:-1]) / np.array(left[1:]))
    assert np.abs(order - 3).max() < 0.2
