"""Trigonometric functions of real and complex arrays, and differences in which they cancel.

For complex arguments numpy's take several times as long.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

TERMS = 9
"""Terms of a power series whose next one is below a rounding error."""


def sin_cos(
    z: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """sin(z) and cos(z); from tan(z/2) for real z, with an error of about 2^-52."""
    if np.iscomplexobj(z):
        sin, cos = sin_cos(np.real(z))
        sinh, cosh = np.sinh(np.imag(z)), np.cosh(np.imag(z))
        return _join(sin * cosh, cos * sinh), _join(cos * cosh, -sin * sinh)
    half = np.tan(0.5 * z)
    square = half * half
    scale = 1 / (1 + square)
    return 2 * half * scale, (1 - square) * scale


def tan(z: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """tan(z), for real or complex z."""
    if not np.iscomplexobj(z):
        return np.tan(z)
    a, b = np.tan(np.real(z)), np.tanh(np.imag(z))
    a2, b2 = a * a, b * b
    scale = 1 / (1 + a2 * b2)
    return _join(a * (1 - b2) * scale, b * (1 + a2) * scale)


def tanh(z: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """tanh(z), for real or complex z."""
    if not np.iscomplexobj(z):
        return np.tanh(z)
    turned = tan(_join(-np.imag(z), np.real(z)))  # tan(iz) = i tanh(z)
    return _join(np.imag(turned), -np.real(turned))


def _join(
    real: Float[np.ndarray, "*shape"], imag: Float[np.ndarray, "*shape"]
) -> Inexact[np.ndarray, "*shape"]:
    result = np.empty(np.shape(real), dtype=complex)
    result.real, result.imag = real, imag
    return result


def sinc_cos(
    z: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """sin(z)/z and cos(z), for real or complex z.

    `numpy.sinc` takes z/pi, whose rounding counts at large z.
    """
    sin, cos = sin_cos(z)
    zero = z == 0
    return np.where(zero, 1.0, sin / np.where(zero, 1.0, z)) if np.any(zero) else sin / z, cos


def tanhc(
    u: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """tanh(u)/u and (1 - tanh(u)/u) / u^2, without cancellation, for Re u >= 0."""
    near = np.abs(u) < 1
    some = np.any(near)
    far = np.where(near, 1.0, u) if some else u
    ratio = tanh(far) / far
    gap = (1 - ratio) / far**2
    if some:
        u = np.broadcast_to(u, ratio.shape)[near]
        gap[near] = _gap_series(u * u) / np.cosh(u)
        ratio[near] = 1 - u * u * gap[near]
    return ratio, gap


def sinc_gap(
    u: Inexact[np.ndarray, "*shape"],
    sinc: Inexact[np.ndarray, "*shape"],
    cos: Inexact[np.ndarray, "*shape"],
) -> Inexact[np.ndarray, "*shape"]:
    """sin(u)/u - cos(u), from both and, where they cancel, from u."""
    near, result = np.abs(u) < 1, sinc - cos
    if np.any(near):
        square = u[near] ** 2
        result[near] = square * _gap_series(-square)
    return result


def _gap_series(square: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """(cosh u - sinh(u)/u) / u^2, the sum of 2k u^(2k-2) / (2k + 1)!, for |u| < 1."""
    total = np.zeros_like(square)
    for k in range(TERMS, 0, -1):
        total = total * square + 2 * k / math.factorial(2 * k + 1)
    return total
