"""Trigonometric functions of complex arrays against mpmath."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from suspension_cli.elements import functions

REAL = [0.0, 1e-9, 0.3, 1.5707963267948966, 3.0, 3.141592653589793, 20.0, 400.0]
IMAG = [0.0, -1e-20, 1e-7, -0.4, 3.0, 30.0]


@pytest.mark.parametrize("turned", [False, True])
def test_against_mpmath(turned):
    """Near multiples of pi/2, for tiny and for large imaginary parts; relative to the value."""
    z = np.array([complex(a, b) for a in REAL for b in IMAG])
    z = 1j * z[np.abs(z) < 300] if turned else z
    sin, cos = functions.sin_cos(z)
    for name, found in (
        ("sin", sin),
        ("cos", cos),
        ("tan", functions.tan(z)),
        ("tanh", functions.tanh(z)),
        ("sinc", functions.sinc_cos(z)[0]),
    ):
        for argument, value in zip(z.tolist(), found.tolist(), strict=True):
            with mpmath.workdps(40):
                exact = complex(getattr(mpmath, name)(mpmath.mpc(argument)))
            # the zeros of cos z are computed to within a rounding error of 1
            slack = 1e-15 * (abs(exact) + (name in ("sin", "cos")))
            if name in ("tan", "tanh"):
                slack *= 1 + abs(exact)
            assert abs(value - exact) <= 2 * slack, (name, argument)


def test_of_reals_are_those_of_numpy():
    x = np.linspace(-50.0, 50.0, 2001)
    sin, cos = functions.sin_cos(x)
    assert np.abs(sin - np.sin(x)).max() < 5e-16
    assert np.abs(cos - np.cos(x)).max() < 5e-16
    small = np.array([0.0, 1e-300, 1e-9, 1e-3])
    np.testing.assert_allclose(functions.sin_cos(small)[0], np.sin(small), rtol=5e-16)
    np.testing.assert_array_equal(functions.sinc_cos(np.zeros(2))[0], 1.0)
