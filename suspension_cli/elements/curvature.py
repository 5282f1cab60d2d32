"""Integrals of squared curvature and squared displacement along a vibrating wire.

With the waves of `elements.beam`, x from the middle towards the lower end, C = cosh(alpha h),
t = tanh(alpha h), c = cos(beta h), s = sin(beta h),

    w_s'' = k1 cosh(alpha x)/C + k2 cos(beta x),
    k1 = alpha^2 (beta^2 (s/beta) W_s + c T_s) / D,   k2 = -beta^2 (alpha^2 (t/alpha) W_s - T_s) / D
    w_a'' = k3 sinh(alpha x)/C + k4 sin(beta x),
    k3 = alpha ((s/beta) T_a - c W_a) / N,            k4 = -beta (W_a - (t/alpha) T_a) / N,

so that over the upper or the lower half of the wire

    integral of |w''|^2 = sum over i, j of k_i I_ij conj(k_j),

where I_ij is the integral over 0 < x < h of the product of functions i and conj(j), and even-odd
products change sign in the upper half. The I_ij have closed forms for complex alpha and beta. The
power lost to bending is omega Im(EI) / 2 times this integral: a sum of squares, without
cancellation however small the loss. In a stiff, slow wire the closed forms cancel, but the
curvature is nearly a polynomial, for which Gauss-Legendre quadrature is exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.elements.beam import Waves
from suspension_cli.elements.functions import sin_cos, sinc_cos, sinhc, sinhc_minus_sinc

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    Factors = tuple[
        Inexact[np.ndarray, "motion frequency"],
        Inexact[np.ndarray, "motion frequency"],
        Inexact[np.ndarray, "motion frequency"],
        Inexact[np.ndarray, "motion frequency"],
    ]

POINTS = 12
"""Points of the quadrature, exact to order 23; the curvature of a slow wire has order 4 or so."""


def integrate_squared_curvature(
    wave: Waves, ends: Inexact[np.ndarray, "4 motion frequency"]
) -> tuple[Float[np.ndarray, "motion frequency"], Float[np.ndarray, "motion frequency"]]:
    """Integral of |w''|^2 over the upper and over the lower half of a wire.

    Parameters
    ----------
    ends
        W_s, T_s, W_a, T_a of r motions, in m and rad.

    Returns
    -------
    upper, lower
        1/m.
    """
    factors = _factors(wave, ends)
    with np.errstate(all="ignore"):  # slow wires, where this overflows, are replaced below
        total, cross = _closed_form(wave, factors)
    if np.any(wave.slow):
        total, cross = (
            np.where(wave.slow, quadrature, closed)
            for quadrature, closed in zip(_quadrature(wave, factors), (total, cross), strict=True)
        )
    return total - cross, total + cross


def integrate_squared_displacement(
    wave: Waves, ends: Inexact[np.ndarray, "4 motion frequency"]
) -> Float[np.ndarray, "motion frequency"]:
    """Integral (r, f) of |w|^2 over the whole wire, m^3, for the drag of a gas.

    Arguments as for `integrate_squared_curvature`. The waves cancel in a stiff, slow wire; there
    w(x) = W - (h - x) T + integral from x to h of (y - x) w''(y) dy, for the even and the odd
    motion.
    """
    factors = _factors(wave, ends)
    k1, k2, k3, k4 = factors
    with np.errstate(all="ignore"):
        total, _ = _closed_form(
            wave, (k1 / wave.alpha2, -k2 / wave.beta2, k3 / wave.alpha2, -k4 / wave.beta2)
        )
    if np.any(wave.slow):
        total = np.where(wave.slow, _displacement_quadrature(wave, factors, ends), total)
    return 2 * total


def _displacement_quadrature(
    wave: Waves, factors: Factors, ends: Inexact[np.ndarray, "4 motion frequency"]
) -> Float[np.ndarray, "motion frequency"]:
    """Integral of |w|^2 over half a stiff, slow wire."""
    h, (nodes, weights) = wave.half, np.polynomial.legendre.leggauss(POINTS)
    # values at the nodes -> their double integral from the end, through Legendre polynomials
    double = np.polynomial.legendre.legint(np.eye(POINTS), m=2, lbnd=1)
    double = np.polynomial.legendre.legval(nodes, double).T @ np.linalg.inv(
        np.polynomial.legendre.legvander(nodes, POINTS - 1)
    )
    total, curvatures = (
        np.zeros(ends.shape[1:]),
        _slow_curvature(wave, factors, (nodes + 1) * h / 2),
    )
    for (displacement, slope), bend in zip((ends[:2], ends[2:]), curvatures, strict=True):
        line = displacement - np.multiply.outer((1 - nodes) * h / 2, slope)
        w = line + np.tensordot(double * (h / 2) ** 2, bend, 1)
        total = total + np.einsum("x,xrf->rf", weights * h / 2, np.abs(w) ** 2)
    return total


def _factors(wave: Waves, ends: Inexact[np.ndarray, "4 motion frequency"]) -> Factors:
    """k1 to k4, (r, f) each."""
    even, even_slope, odd, odd_slope = ends
    alpha2, beta2 = wave.alpha2, wave.beta2
    return (
        (alpha2 * wave.over_even) * (beta2 * wave.sin * even + wave.cos * even_slope),
        (-beta2 * wave.over_even) * (alpha2 * wave.tanh * even - even_slope),
        (wave.alpha * wave.over_odd) * (wave.sin * odd_slope - wave.cos * odd),
        (-wave.beta * wave.over_odd) * (odd - wave.tanh * odd_slope),
    )


def _closed_form(
    wave: Waves, factors: Factors
) -> tuple[Float[np.ndarray, "motion frequency"], Float[np.ndarray, "motion frequency"]]:
    """Even plus odd part, and even-odd product, of the integral over half a wire."""
    k1, k2, k3, k4 = factors
    if "integrals" not in wave.cache:
        wave.cache["integrals"] = _integrals(wave)
    i11, i22, i33, i44, i12, i13, i14, i32, i24, i34 = wave.cache["integrals"]

    def product(
        x: Inexact[np.ndarray, "motion frequency"],
        weight: Inexact[np.ndarray, " frequency"],
        y: Inexact[np.ndarray, "motion frequency"],
    ) -> Float[np.ndarray, "motion frequency"]:
        return np.real(x * weight * np.conj(y))

    total = _abs2(k1) * i11 + _abs2(k2) * i22 + _abs2(k3) * i33 + _abs2(k4) * i44
    total = total + 2 * (product(k1, i12, k2) + product(k3, i34, k4))
    cross = (
        product(k1, i13, k3) + product(k1, i14, k4) + product(k3, i32, k2) + product(k2, i24, k4)
    )
    return total, 2 * cross


def _abs2(z: Inexact[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    return np.real(z) ** 2 + np.imag(z) ** 2


def _integrals(wave: Waves) -> tuple[Inexact[np.ndarray, " frequency"], ...]:
    """I_ij (f,) for ij = 11, 22, 33, 44, 12, 13, 14, 32, 24, 34.

    Hyperbolic functions are divided by C or |C|^2 against overflow.
    """
    h, alpha, beta = wave.half, wave.alpha, wave.beta
    ar, ai, br, bi = np.real(alpha), np.imag(alpha), np.real(beta), np.imag(beta)
    sech = 1 / np.cosh(np.minimum(2 * ar * h, 700.0))
    sinc, cos = sinc_cos(ai * h)
    norm = 1 / (1 + (2 * cos**2 - 1) * sech)  # cosh(2 Re alpha h) / (2 |C|^2)
    sinh, sin = np.tanh(2 * ar * h) / (2 * ar), h * sinc * cos * sech
    i11, i33 = (sinh + sin) * norm, (sinh - sin) * norm
    i13 = ((1 - sech) / (2 * ar) - 1j * (ai * h**2 * sinc**2 * sech)) * norm
    (sinc, cos), single = sinc_cos(br * h), sinhc(bi * h)
    sin, sinh = h * sinc * cos, h * sinhc(2 * bi * h)
    i22, i44 = (sinh + sin) / 2, h * sinhc_minus_sinc(2 * br * h, 2 * bi * h) / 2
    i24 = (br * h**2 * sinc**2 - 1j * (bi * h**2 * single**2)) / 2
    # the rest mixes functions of alpha and of conj(beta)
    b = np.conj(beta)
    bounded = np.minimum(ar * h, 700.0) + 1j * (ai * h)
    t, over_cosh = alpha * wave.tanh, 1 / sin_cos(1j * bounded)[1]  # cosh z = cos iz
    s, c, over = b * np.conj(wave.sin), np.conj(wave.cos), 1 / (wave.alpha2 + np.conj(wave.beta2))
    rest = c - over_cosh
    i12, i14 = (alpha * t * c + b * s) * over, (alpha * t * s - b * rest) * over
    i32, i34 = (alpha * rest + b * t * s) * over, (alpha * s - b * t * c) * over
    return i11, i22, i33, i44, i12, i13, i14, i32, i24, i34


def _quadrature(
    wave: Waves, factors: Factors
) -> tuple[Float[np.ndarray, "motion frequency"], Float[np.ndarray, "motion frequency"]]:
    """Even plus odd part, and even-odd product, for a stiff, slow wire."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    even, odd = _slow_curvature(wave, factors, (nodes + 1) * wave.half / 2)
    weight = weights * wave.half / 2
    total = np.einsum("x,xrf->rf", weight, np.abs(even) ** 2 + np.abs(odd) ** 2)
    return total, 2 * np.einsum("x,xrf->rf", weight, np.real(even * np.conj(odd)))


def _slow_curvature(
    wave: Waves, factors: Factors, at: Float[np.ndarray, " node"]
) -> tuple[
    Inexact[np.ndarray, "node motion frequency"], Inexact[np.ndarray, "node motion frequency"]
]:
    """Even and odd part (x, r, f) of the curvature at places (x,) of a stiff, slow wire."""
    k1, k2, k3, k4 = factors
    alpha, beta = np.where(wave.slow, wave.alpha, 0), np.where(wave.slow, wave.beta, 0)
    over_cosh, x = 1 / np.cosh(alpha * wave.half), at[:, None, None]
    even = k1 * (np.cosh(alpha * x) * over_cosh) + k2 * np.cos(beta * x)
    return even, k3 * (np.sinh(alpha * x) * over_cosh) + k4 * np.sin(beta * x)
