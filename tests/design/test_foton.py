"""Foton strings: planes against their formulas, round trips, and errors with their column."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import freqs_zpk

from suspension_cli.design.foton import Filter, FotonError, format_filter, parse

F = 3.7
S = 2j * np.pi * F


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('zpk([0.1],[2;3],5,"n")', 5 * (1 + 1j * F / 0.1) / (1 + 1j * F / 2) / (1 + 1j * F / 3)),
        ('zpk([0],[],5,"n")', 5j * F),
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
    ],
)
def test_planes(text, value):
    assert parse(text).at(F) == pytest.approx(value, rel=1e-13)


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
        ('ellip("LowPass",4,1,40,100)', "column 1: ellip is not known here"),
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
