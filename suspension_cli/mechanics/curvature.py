"""Where along a wire it bends: integrals of its squared curvature and of its squared displacement.

With the waves of `mechanics.beam`, x from the middle towards the lower end and C = cosh(alpha h),

    w_s'' = k1 cosh(alpha x) / C + k2 cos(beta x),        k1 = alpha^2 (beta^2 (s/beta) W_s + c T_s) / D,   k2 = -beta^2 (alpha^2 (t/alpha) W_s - T_s) / D
    w_a'' = k3 sinh(alpha x) / C + k4 sin(beta x),        k3 = alpha ((s/beta) T_a - c W_a) / N,            k4 = -beta (W_a - (t/alpha) T_a) / N,

so that over either half of the wire, upper (-) and lower (+),

    integral of |w''|^2 = sum over i, j of k_i I_ij conj(k_j), the even-odd products with the sign of the half,

with I_ij the integrals over 0 < x < h of the products of those four functions, one of them conjugated: closed forms for any complex alpha
and beta.  Power lost to bending is omega Im(EI) times this over 2: a sum of squares, where nothing cancels however small the loss.
In a stiff, slow wire the closed forms cancel, but its curvature is all but a polynomial: Gauss-Legendre quadrature is exact there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from suspension_cli.mechanics.beam import Waves

POINTS = 12
"""Of the quadrature; exact for polynomials of order 23, where the curvature is one of order 4 or so."""


def squared(found: Waves, ends: Any) -> tuple[Any, Any]:
    """Integral of |w''|^2 over the upper and the lower half of a wire.

    Parameters
    ----------
    found : Waves
        At frequencies (f,).
    ends : (4, r, f) complex array
        W_s, T_s, W_a, T_a of r motions, in m and rad.

    Returns
    -------
    upper, lower : (r, f) arrays
        1/m.
    """
    factors = _factors(found, ends)
    with np.errstate(all="ignore"):  # where it is stiff and slow, what does not hold is replaced
        total, across = _closed(found, factors)
    if np.any(found.slow):
        total, across = (np.where(found.slow, quick, old) for quick, old in zip(_quadrature(found, factors), (total, across), strict=True))
    return total - across, total + across


def displaced(found: Waves, ends: Any) -> Any:
    """Integral (r, f) of |w|^2 over the whole wire, m^3; for the drag of a gas.

    In a stiff, slow wire the waves cancel; there w is its ends' line and slope plus twice the integral of its curvature:
    w(x) = W - (h - x) T + integral from x to h of (y - x) w''(y) dy, for the even and for the odd motion.
    """
    factors = _factors(found, ends)
    k1, k2, k3, k4 = factors
    with np.errstate(all="ignore"):
        total, _ = _closed(found, (k1 / found.alpha2, -k2 / found.beta2, k3 / found.alpha2, -k4 / found.beta2))
    if np.any(found.slow):
        total = np.where(found.slow, _moved(found, factors, ends), total)
    return 2 * total


def _moved(found: Waves, factors: tuple[Any, Any, Any, Any], ends: Any) -> Any:
    """Integral of |w|^2 over half a stiff, slow wire."""
    h, (nodes, weights) = found.half, np.polynomial.legendre.leggauss(POINTS)
    twice = np.polynomial.legendre.legint(np.eye(POINTS), m=2, lbnd=1)  # of each Legendre polynomial, from the end
    twice = np.polynomial.legendre.legval(nodes, twice).T @ np.linalg.inv(np.polynomial.legendre.legvander(nodes, POINTS - 1))
    total, bend = 0.0, _bend(found, factors, (nodes + 1) * h / 2)
    for (place, turn), curved in zip((ends[:2], ends[2:]), bend, strict=True):
        line = place - np.multiply.outer((1 - nodes) * h / 2, turn)
        total = total + np.einsum("x,xrf->rf", weights * h / 2, np.abs(line + np.tensordot(twice * (h / 2) ** 2, curved, 1)) ** 2)
    return total


def _factors(found: Waves, ends: Any) -> tuple[Any, Any, Any, Any]:
    """k1 to k4, (r, f) each."""
    even, even_turn, odd, odd_turn = ends
    a2, b2 = found.alpha2, found.beta2
    return (
        a2 * (b2 * found.sin * even + found.cos * even_turn) / found.even,
        -b2 * (a2 * found.tanh * even - even_turn) / found.even,
        found.alpha * (found.sin * odd_turn - found.cos * odd) / found.odd,
        -found.beta * (odd - found.tanh * odd_turn) / found.odd,
    )


def _closed(found: Waves, factors: tuple[Any, Any, Any, Any]) -> tuple[Any, Any]:
    """Even plus odd part, and even-odd product, of the integral over half a wire."""
    k1, k2, k3, k4 = factors
    if "integrals" not in found.memo:
        found.memo["integrals"] = _integrals(found)
    i11, i22, i33, i44, i12, i13, i14, i32, i24, i34 = found.memo["integrals"]

    def product(x: Any, weight: Any, y: Any) -> Any:
        return (x * weight * np.conj(y)).real

    total = _square(k1) * i11 + _square(k2) * i22 + _square(k3) * i33 + _square(k4) * i44
    total = total + 2 * (product(k1, i12, k2) + product(k3, i34, k4))
    mixed = product(k1, i13, k3) + product(k1, i14, k4) + product(k3, i32, k2) + product(k2, i24, k4)
    return total, 2 * mixed


def _square(z: Any) -> Any:
    return z.real**2 + z.imag**2


def _integrals(found: Waves) -> tuple[Any, ...]:
    """I_ij (f,): 11, 22, 33, 44, 12, 13, 14, 32, 24, 34."""
    h, alpha, beta = found.half, found.alpha, found.beta
    across = np.conj(beta)
    ar, ai, br, bi = alpha.real, alpha.imag, beta.real, beta.imag
    sech = 1 / np.cosh(np.minimum(2 * ar * h, 700.0))
    norm = 1 + np.cos(2 * ai * h) * sech  # 2 |C|^2 / cosh(2 Re alpha h)
    long, turn = np.tanh(2 * ar * h) / (2 * ar), h * np.sinc(2 * ai * h / np.pi) * sech
    i11, i33 = (long + turn) / norm, (long - turn) / norm
    i13 = ((1 - sech) / (2 * ar) - 1j * ai * h**2 * np.sinc(ai * h / np.pi) ** 2 * sech) / norm
    wave, swell = h * np.sinc(2 * br * h / np.pi), h * sinhc(2 * bi * h)
    i22, i44 = (swell + wave) / 2, h * gap(2 * br * h, 2 * bi * h) / 2
    i24 = (br * h**2 * np.sinc(br * h / np.pi) ** 2 - 1j * bi * h**2 * sinhc(bi * h) ** 2) / 2
    t, short = alpha * found.tanh, 1 / _cosh(alpha * h)
    s, c, over = across * np.conj(found.sin), np.conj(found.cos), found.alpha2 + np.conj(found.beta2)
    i12, i14 = (alpha * t * c + across * s) / over, (alpha * t * s - across * (c - short)) / over
    i32, i34 = (alpha * (c - short) + across * t * s) / over, (alpha * s - across * t * c) / over
    return i11, i22, i33, i44, i12, i13, i14, i32, i24, i34


def _quadrature(found: Waves, factors: tuple[Any, Any, Any, Any]) -> tuple[Any, Any]:
    """The same by quadrature: for wires that are stiff and slow."""
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    even, odd = _bend(found, factors, (nodes + 1) * found.half / 2)
    weight = weights * found.half / 2
    total = np.einsum("x,xrf->rf", weight, np.abs(even) ** 2 + np.abs(odd) ** 2)
    return total, 2 * np.einsum("x,xrf->rf", weight, (even * np.conj(odd)).real)


def _bend(found: Waves, factors: tuple[Any, Any, Any, Any], at: Any) -> tuple[Any, Any]:
    """Even and odd part (x, r, f) of the curvature at places (x,) of a stiff, slow wire."""
    k1, k2, k3, k4 = factors
    alpha, beta = np.where(found.slow, found.alpha, 0), np.where(found.slow, found.beta, 0)
    over, x = 1 / np.cosh(alpha * found.half), at[:, None, None]
    even = k1 * (np.cosh(alpha * x) * over) + k2 * np.cos(beta * x)
    return even, k3 * (np.sinh(alpha * x) * over) + k4 * np.sin(beta * x)


def gap(x: Any, y: Any) -> Any:
    """sinh(y)/y - sin(x)/x, also where both are all but 1."""
    p, n = y * y, -x * x
    result = sinhc(y) - np.sinc(x / np.pi)
    near = p - n < 0.5
    if np.any(near):
        p, n = p[near], n[near]
        result[near] = _one_more(p) - _one_more(n)
    return result


def _one_more(z: Any) -> Any:
    """sinh(sqrt z) / sqrt z - 1 for small z, by its series."""
    total = np.zeros_like(z)
    for k in range(8, 0, -1):
        total = (total + 1 / math.factorial(2 * k + 1)) * z
    return total


def sinhc(z: Any) -> Any:
    """sinh(z)/z."""
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sinh(safe) / safe)


def _cosh(z: Any) -> Any:
    """cosh, held below overflow: only its inverse is used."""
    return np.cosh(np.where(z.real > 700, 700.0, z))
