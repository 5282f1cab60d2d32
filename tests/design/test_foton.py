"""Foton strings: against coefficients that Foton made of them, formulas, scipy's digital designs
and an evaluation of their own; round trips, and errors with their column."""

from __future__ import annotations

import json

import numpy as np
import pytest
from numpy.polynomial import Chebyshev
from scipy import signal
from scipy.signal import freqs_zpk

from suspension_cli.design.foton import Filter, FotonError, find_turned, format_filter, parse
from tests.support.foton import sections, written_response
from tests.support.paths import DATA

F = 3.7
CASES = json.loads((DATA / "foton-cases.json").read_text())["cases"]
S = 2j * np.pi * F


def test_strings_are_the_coefficients_that_foton_made_of_them():
    """Within 1e-4 of the largest value (1e-6 is the error of what is known of Foton)."""
    far = {}
    for case in CASES:
        exact = np.array(case["re"]) + 1j * np.array(case["im"])
        value = parse(case["design"], case["rate"]).at(np.array(case["frequency"]))
        error = np.abs(value - exact).max() / np.abs(exact).max()
        if error > 1e-6:
            far[case["design"]] = error
    assert len(CASES) == 90
    assert not far


def test_a_string_without_rate_is_what_the_digital_filter_approaches():
    """The signs of all cases are the same without a rate, and values at low frequencies."""
    for case in CASES:
        frequency = np.array(case["frequency"])
        exact = np.array(case["re"]) + 1j * np.array(case["im"])
        value = parse(case["design"]).at(frequency)
        error = np.abs(value / exact - 1)[frequency < 1e-3 * case["rate"]]
        assert error.max(initial=0.0) < 0.05, case["design"]


def resonance(f, f0, q):
    return f0**2 - f**2 + 1j * f * f0 / q


def own_q(q, depth):
    """Of the poles of a notch: half of its width at -3 dB is where |f/f0 - f0/f| is twice that at
    f0 (1 +- 1 / 2 Q), on average."""
    edges = 1 - 1 / (2 * q), 1 + 1 / (2 * q)
    reach = sum(abs(edge - 1 / edge) for edge in edges)
    return np.sqrt(1 - 2 * 10 ** (-depth / 10)) / reach


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('zpk([0.1],[2;3],5,"n")', 5 * (1 + 1j * F / 0.1) / (1 + 1j * F / 2) / (1 + 1j * F / 3)),
        ('zpk([0],[],5,"n")', -5j * F),
        ('zpk([0;0;2],[1],5,"n")', 5 * (1j * F) ** 2 * (1 + 1j * F / 2) / (1 + 1j * F)),
        ('zpk([0;0;2;3],[1],5,"n")', 5 * F**2 * (1 + 0.5j * F) * (1 + 1j * F / 3) / (1 + 1j * F)),
        ('zpk([-2],[3],5,"n")', 5 * (1j * F / 2 - 1) / (1 + 1j * F / 3)),
        (
            'zpk([-2;-4;3],[3;3;3],5,"n")',
            5 * (1j * F / 2 - 1) * (1j * F / 4 - 1) / (1 + 1j * F / 3) ** 2,
        ),
        ('zpk([-1+i*2;-1-i*2],[3;3],5,"n")', (5 - F**2 - 2j * F) / (1 + 1j * F / 3) ** 2),
        ('zpk([2],[-3],5,"f")', 5 * (S - 4 * np.pi) / (S + 6 * np.pi)),
        ('zpk([],[0;1],5,"n")', 5 / (1j * F) / (1 + 1j * F)),
        ('zpk([-0.1],[-2;-3],5,"f")', 5 * (S + 0.2 * np.pi) / (S + 4 * np.pi) / (S + 6 * np.pi)),
        ('zpk([-0.1],[-2;-3],5,"s")', 5 * (S + 0.1) / (S + 2) / (S + 3)),
        ("zpk([], [-1-2*i, -1+i*2], 3e0)", 3 / ((S + 1) ** 2 + 4)),
        ('pole(2,"n")', 1 / (1 + 1j * F / 2)),
        ('pole(2, 7, "f")', 7 / (S + 4 * np.pi)),
        ('zero(2,"s") zero(0,"n")', (S + 2) * 1j * F),
        ('pole2(2,5,"n")', 1 / (1 + 1j * F / 10 - (F / 2) ** 2)),
        ('zero2(2,0.1,"f")', S**2 + 4 * np.pi * S / 0.1 + (4 * np.pi) ** 2),
        ('gain(2)*gain(20,"dB")gain(-1)', -20.0),
        (
            "notch(3,10,40)",
            resonance(F, 3, 100 * own_q(10, 40)) / resonance(F, 3, own_q(10, 40)),
        ),
        ("notch(3,0.7,40) resgain(3,0.7,40)", 1.0),
        (
            "resgain(3,10,20)",
            resonance(F, 3, own_q(10, 20)) / resonance(F, 3, 10 * own_q(10, 20)),
        ),
        ('2.5 pole(2,"n") * -2', -5 / (1 + 1j * F / 2)),
        ("rpoly([1;2],[3;0;4],5)", 5 * (S + 2) / (3 * S**2 + 4)),
        ('pole(2,"n") /. setgain(0,7)', 7 / (1 + 1j * F / 2)),
        ('gain(-1) pole(2,"n") setgain(2,7)', -7 * 2**0.5 / (1 + 1j * F / 2)),
    ],
)
def test_factors(text, value):
    assert parse(text).at(F) == pytest.approx(value, rel=1e-13)


def test_a_resonant_gain_of_foton():
    """Its coefficients have this gain."""
    assert abs(parse("resgain(2.75,10,30)", 16384.0).at(4.0)) == pytest.approx(1.034, abs=5e-4)


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ('ZPK([0],[1;2;],5,,"N");', 'zpk([0],[1;2],5,"n")'),
        ('zpk(,[1; ;2],5,"n") ;\n', 'zpk([],[1;2],5,"n")'),
        ('zpk([],[1],5,,"n")', 'zpk([],[1],5,"n")'),
        ('zpk([3],,5,"f")', 'zpk([3],[],5,"f")'),
        ('Gain(3,) * GAIN(-6,"DB")', 'gain(3)gain(-6,"dB")'),
        ('BUTTER("LOWPASS",2,1E1)', 'butter("LowPass",2,10)'),
        ('zpk([],[1+I*2;1-I*2],5,"n")', 'zpk([],[1+i*2;1-i*2],5,"n")'),
    ],
)
def test_strings_that_foton_keeps_too(text, same):
    assert parse(text) == parse(same)


def random_roots(random, most, sides):
    """Fewer than `most` pairs of either kind and real roots, of the sides, and roots 0."""
    result = []
    for _ in range(random.integers(most)):
        size = 10 ** random.uniform(-2, 2) * random.choice(sides)
        turn = np.exp(1j * random.uniform(0, np.pi / 2))
        kinds = [size * turn, size * turn.conjugate()], [complex(size)], [0j]
        result += kinds[random.integers(3)]
    return tuple(complex(root) for root in result)


@pytest.mark.parametrize("seed", range(40))
def test_what_is_written_reads_the_same_for_foton(seed):
    """Of continuous filters and of what digital ones are made of."""
    random, rate = np.random.default_rng(seed), 2048.0
    zeros, poles = random_roots(random, 6, [-1.0, 1.0]), random_roots(random, 5, [1.0])
    made, f = Filter(random.normal(), zeros, poles), np.geomspace(1e-3, 900.0, 60)
    text = format_filter(made)
    assert parse(text).at(f) == pytest.approx(made.at(f), rel=1e-11)
    assert written_response(text, f) == pytest.approx(made.at(f), rel=1e-11)
    digital = parse(text, rate)
    assert digital.at(f) == pytest.approx(written_response(text, f, rate), rel=1e-10)
    again = format_filter(digital)
    assert parse(again, rate).at(f) == pytest.approx(digital.at(f), rel=1e-10)
    assert written_response(again, f, rate) == pytest.approx(digital.at(f), rel=1e-10)


@pytest.mark.parametrize(
    "text",
    [
        'ellip("LowPass",2,1,100,20)',
        'cheby2("BandStop",3,40,20,900)',
        "comb(300,5,-40,3) resgain(1000,0.6,20)",
        'zpk([0;0;0],[],1e-3,"n") butter("HighPass",3,1000)',
        'sos(2,[0.3;0.7;2;1;0;0;2;1],"o")',
    ],
)
def test_digital_filters_are_written_as_their_designs(text):
    made, f = parse(text, 4096.0), np.geomspace(0.1, 2047.0, 99)
    written = format_filter(made)
    scale = np.abs(made.at(f))
    for found in (parse(written, 4096.0).at(f), written_response(written, f, 4096.0)):
        assert (np.abs(found - made.at(f)) <= 1e-8 * scale + 1e-13).all()


@pytest.mark.parametrize("rate", [64.0, 16384.0])
@pytest.mark.parametrize("kind", ["lowpass", "highpass", "bandpass", "bandstop"])
@pytest.mark.parametrize(
    ("name", "ripples"), [("butter", []), ("cheby1", [1]), ("cheby2", [40]), ("ellip", [1, 60])]
)
def test_designs_are_the_digital_ones_of_scipy(name, ripples, kind, rate):
    for order in (1, 2, 5):
        edges = [5.0, 9.0] if kind.startswith("band") else [5.0]
        rows = getattr(signal, name)(
            order, *ripples, edges if len(edges) > 1 else 5.0, kind, fs=rate, output="sos"
        )
        numbers = ",".join(map(repr, [order, *ripples, *edges]))
        f = np.geomspace(0.3, 31.0, 50)
        exact = signal.sosfreqz(rows, f, fs=rate)[1]
        found = parse(f'{name}("{kind.upper()}",{numbers})', rate).at(f)
        assert np.abs(found - exact).max() < 1e-9 * np.abs(exact).max()


def test_a_notch_is_down_by_3_db_at_its_width():
    """Also at a frequency comparable to the rate."""
    q, depth = 4.0, 30.0
    reach = sum(abs(edge - 1 / edge) for edge in (1 - 1 / (2 * q), 1 + 1 / (2 * q)))
    edges = 20 * (np.sqrt(1 + reach**2 / 4) + reach / 2 * np.array([-1, 1]))
    assert np.abs(parse(f"notch(20,{q},{depth})").at(edges)) == pytest.approx(0.5**0.5, rel=1e-12)
    assert np.abs(parse(f"resgain(20,{q},{depth})").at(edges)) == pytest.approx(2**0.5, rel=1e-12)
    assert abs(parse(f"notch(20,{q},{depth})").at(20.0)) == pytest.approx(10**-1.5, rel=1e-12)


def test_factors_whose_sign_foton_turns():
    text = (
        'zpk([0],[],5,"n") zpk([0;0],[],5,"n") ZPK([-2],[3],5,"N") zpk([-2],[],1,"n") pole(3,"n")'
    )
    assert find_turned(text) == ['zpk([0],[],5,"n")', 'ZPK([-2],[3],5,"N")']
    assert not find_turned(
        'zpk([2],[-3],5,"f") zero(3,"n") gain(-1) zpk([-2+i*3;-2-i*3],[3;4],5,"n")'
    )


def test_round_trip():
    """Also against scipy, in rad/s."""
    roots = (1.5 + 2.5j, 1.5 - 2.5j, 1 / 3, 0.0)
    made = Filter(-7.0 / 3, roots[2:], (*roots, 1e-3, 1e4))
    again = parse(format_filter(made))
    frequency = np.geomspace(1e-3, 1e4, 50)
    zeros, poles = (-2 * np.pi * np.array(some) for some in (made.zeros, made.poles))
    gain = made.gain * (2 * np.pi) ** (len(poles) - len(zeros))
    expected = freqs_zpk(zeros, poles, gain, 2 * np.pi * frequency)[1]
    np.testing.assert_allclose([again.at(f) for f in frequency], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("zpk([0],[20", "column 1: 'zpk([0],[20' is not understood"),
        ('zpk([0],[1+i*2],1,"n")', "column 1: zpk has no conjugate of the complex root 1+i*2; add"),
        ("zpk([0] [2],1)", "column 1: zpk has '[0] [2]' instead of a number"),
        ("gain(3) gain('a'+1)", "column 9: gain has \"'a'+1\" instead of a number"),
        ('zpk([0],[2],1,"z")', 'column 1: zpk has no plane "z"; write "s" or "f" or "n"'),
        ("zpk([0],[2],i)", "column 1: zpk takes real numbers here"),
        ("gain(2) % 3", "column 9: '% 3' is not understood"),
        ('bessel("LowPass",4,100)', "column 1: bessel is not known here"),
        ('butter("Low",4,100)', "column 1: butter takes a type, an order"),
        ('butter("LowPass",4,10,20)', "column 1: butter takes a type, an order"),
        ('cheby1("LowPass",4,-1,10)', "column 1: cheby1 cannot be designed: passband ripple"),
        ('ellip("LowPass",4,40,1,10)', "not a finite number"),
        ("resgain(1,2)", "column 1: resgain has a height of 0 dB, but its width is where its gain"),
        ("notch(1,2,3)", "column 1: notch has a depth of 3 dB, but its width is where its gain"),
        ("notch(1,0.5,30)", "column 1: notch takes a positive frequency and a Q above 0.5"),
        ("comb(60,30,-40)", "column 1: comb has no number of harmonics; give"),
        ("comb(60,30,-40,1000)", "column 1: comb has no number of harmonics; give"),
        ("notch(0,2)", "column 1: notch takes a positive frequency and a Q above 0.5"),
        ("rpoly([0],[1],1)", "column 1: rpoly has a polynomial that is 0"),
        ('pole(0,"n") /. setgain(0,1)', "column 16: setgain sets a gain where the filter is 0"),
        (
            'sos(1,[0;0;0;0],"o")',
            "column 1: sos is in z, which needs a sample rate; write filter =",
        ),
        ('pole(-1,"n")', "column 1: pole takes a positive frequency"),
        (
            'zpk([],[1],1,"f")',
            'right half plane, which grows; in plane "f" stable poles have negative',
        ),
        ("gain()", "column 1: gain takes 1 numbers, found 0"),
        ("", "column 1: is empty"),
        ("gain(1e308)gain(1e308)", "not a finite number"),
        ('gain(1e9,"dB")', "column 1: gain has numbers too large or too small"),
        ('pole2(1,1e-300,"n")', "column 1: pole2 has numbers too large or too small"),
        ('gain(2)*zpk([1e-200;1e-200],[1],1,"n")', "column 9: zpk has numbers too large"),
        ('pole2(1,1e-160,"n")', "not a finite number"),
        ('zpk([1e999],[1],1,"n")', "column 1: zpk has a number that is too large"),
    ],
)
def test_errors_name_the_column(text, says):
    with pytest.raises(FotonError) as caught:
        parse(text)
    assert says in str(caught.value)


def chebyshev(order, x):
    return Chebyshev.basis(order)(x)


EPSILON = 10**0.1 - 1
"""Square of the ripple of 1 dB."""


@pytest.mark.parametrize(
    ("text", "square"),
    [
        ('butter("LowPass",3,2)', lambda f: 1 / (1 + (f / 2) ** 6)),
        ('butter("HighPass",4,2)', lambda f: 1 / (1 + (2 / f) ** 8)),
        ('butter("BandPass",3,2,8)', lambda f: 1 / (1 + ((f - 16 / f) / 6) ** 6)),
        ('butter("BandStop",2,2,8)', lambda f: 1 / (1 + (6 / (f - 16 / f)) ** 4)),
        ('cheby1("LowPass",5,1,2)', lambda f: 1 / (1 + EPSILON * chebyshev(5, f / 2) ** 2)),
        ('cheby2("LowPass",4,40,2)', lambda f: 1 / (1 + 9999 / chebyshev(4, 2 / f) ** 2)),
    ],
)
def test_designs_have_their_closed_forms(text, square):
    f = np.geomspace(0.3, 30, 41)
    np.testing.assert_allclose(np.abs(parse(text).at(f)) ** 2, square(f), rtol=1e-9)


def test_published_coefficients_of_a_chebyshev_filter():
    """Of order 3 with ripples of 0.5 dB: s^3 + 1.252913 s^2 + 1.534895 s + 0.715694 (tables of
    filters, e.g. Weinberg, Network Analysis and Synthesis (1962))."""
    poles = np.array(parse(f'cheby1("LowPass",3,0.5,{1 / (2 * np.pi)!r})').poles)
    found = np.real(np.poly(-2 * np.pi * poles))
    np.testing.assert_allclose(found, [1, 1.252913, 1.534895, 0.715694], rtol=1e-6)


def test_an_elliptic_filter_has_ripples_of_equal_size():
    f = np.linspace(1e-3, 1, 20001)
    size = np.abs(parse('ellip("LowPass",5,1,60,1)').at(f))
    peaks = size[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]
    troughs = size[1:-1][(size[1:-1] < size[:-2]) & (size[1:-1] < size[2:])]
    assert len(peaks) == len(troughs) == 2
    np.testing.assert_allclose(peaks, 1.0, atol=1e-6)
    np.testing.assert_allclose([*troughs, size[-1]], 10**-0.05, rtol=1e-5)
    stopped = parse('ellip("LowPass",5,1,60,1)').at(np.geomspace(1.672, 100, 9999))
    assert np.abs(stopped).max() == pytest.approx(1e-3, rel=1e-3)


def test_a_comb():
    made, alone = parse("comb(3,10,20,3)"), [parse(f"resgain({f},10,20)") for f in (3, 6, 9)]
    assert made.at(F) == pytest.approx(np.prod([one.at(F) for one in alone]), rel=1e-12)
    assert abs(parse("resgain(3,10,20)").at(3.0)) == pytest.approx(10, rel=1e-12)
    assert abs(parse("notch(3,10,20)").at(3.0)) == pytest.approx(0.1, rel=1e-12)


def test_digital_filters_are_those_of_foton():
    """Numbers in the documentation of foton.py (GDS 3.0): second-order sections of two zeros and
    two poles at 16384 Hz, and the first samples of the impulse response of 4:0."""
    (b0, b1, b2, _, a1, a2) = sections(parse('zpk([4;40],[0;10],1,"n")', 16384.0))[0]
    found = [b0, b1, b2, a1, a2]
    published = [0.06290589, -0.12475772, 0.0618533, -1.99617238, 0.99617238]
    np.testing.assert_allclose(found, published, atol=5.1e-9)
    (b0, b1, _, _, a1, _) = sections(parse('zpk([4],[0],4,"n")', 16384.0))[0]
    np.testing.assert_allclose([b0, b1 - a1 * b0], [1.00076679, 0.00153398], atol=5.1e-9)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        (
            'sos(2,[-1.2;0.5;0.3;0.7],"o")',
            lambda y: 2 * (1 + 0.3 * y + 0.7 * y**2) / (1 - 1.2 * y + 0.5 * y**2),
        ),
        (
            "sos([2;0.3;0.7;-1.2;0.5])",
            lambda y: 2 * (1 + 0.3 * y + 0.7 * y**2) / (1 - 1.2 * y + 0.5 * y**2),
        ),
        ("biquad(2,1,3,-1.2,0.5)", lambda y: (2 + y + 3 * y**2) / (1 - 1.2 * y + 0.5 * y**2)),
        (
            "direct([2;1;3;1],[1.2;-0.5])",
            lambda y: (2 + y + 3 * y**2 + y**3) / (1 - 1.2 * y + 0.5 * y**2),
        ),
        ("zroots([-1;0],[0.9;0.5],3)", lambda y: 3 * (1 + y) / (1 - 0.9 * y) / (1 - 0.5 * y)),
    ],
)
def test_coefficients_in_z(text, value):
    f = np.array([0.01, 3.0, 30.0, 49.9])
    made = parse(text, 100.0)
    np.testing.assert_allclose(made.at(f), value(np.exp(-2j * np.pi * f / 100)), rtol=1e-11)
    assert made.at(51.0) == 0
    again = parse(format_filter(made), 100.0)
    np.testing.assert_allclose(again.at(f), made.at(f), rtol=1e-9)


def test_slow_roots_of_sections_keep_their_digits():
    """At 1e-7 of the sample rate, against the same coefficients in 40 digits."""
    from mpmath import exp, mp, mpc, mpf, pi

    a1, a2 = -1.9999993, 0.99999930000001
    found = parse(f'sos(1,[{a1!r};{a2!r};-2;1],"o")', 16384.0).at(1e-3)
    with mp.workdps(40):
        y = exp(-2 * mpc(0, 1) * pi * mpf(1e-3) / 16384)
        exact = complex((1 - y) ** 2 / (1 + mpf(a1) * y + mpf(a2) * y**2))
    assert found == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('sos(1,[1;2;3],"o")', "has 3 numbers beside the gain"),
        ('sos(1,[0;1.1;0;0],"o")', "has a pole outside the unit circle"),
        ('sos(1,[1;0;0;0],"o")', "or at half the sample rate"),
        ("zroots([0],[0.1;0.2])", "has 1 zeros and 2 poles"),
        ('pole(60,"n")', "has a frequency of 60 Hz, above half the sample rate of 100 Hz"),
        ('butter("LowPass",2,50)', "has a frequency of 50 Hz, above half the sample rate"),
        ("comb(20,9,-40,3)", "has a frequency of 60 Hz, above half the sample rate"),
        (
            'zero(2,"n")',
            "has more zeros than poles, which Foton's files show of zpk in plane n alone",
        ),
        ('zpk([-2],[],1,"f")', "write zeros and poles of a digital filter together"),
        ("rpoly([1;2;3],[1;4],1)", "has more zeros than poles"),
        ("biquad(0,1,1,0,0)", "numbers too large or too small"),
    ],
)
def test_errors_of_digital_filters(text, says):
    with pytest.raises(FotonError, match=says):
        parse(text, 100.0)


LONG = {
    "blanks": ("gain(1)" + " " * 1_000_000 + "x", "column 1000008: 'x' is not understood"),
    "commas": ("zpk(" + "1," * 500_000 + "1)", "zpk takes 3 numbers, found 500001"),
    "roots": ("zpk([" + "1;" * 500_000 + "1],[],1)", "zpk has 500001 zeros and poles"),
    "factors": ("pole(1)" * 100_000, "pole has 1001 zeros and poles"),
}


@pytest.mark.parametrize("kind", LONG)
def test_the_time_to_read_grows_as_the_length(kind):
    """If it grew as the square of the length, this would take hours."""
    text, problem = LONG[kind]
    with pytest.raises(FotonError, match=problem):
        parse(text)


def test_commas_in_brackets_separate_roots():
    assert parse('zpk([1,2],[3;4],5,"n")') == parse('zpk([1;2],[3,4],5,"n")')
