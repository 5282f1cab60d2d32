"""Hyperbolic and trigonometric functions over their arguments, and differences that would cancel.

All are for real and complex arrays.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact

TERMS = 9
"""Terms of a power series whose next one is below a rounding error."""


def sinc_cos(
    z: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """sin(z)/z and cos(z); `numpy.sinc` takes z/pi, whose rounding counts at large z."""
    zero = z == 0
    return np.where(zero, 1.0, np.sin(z) / np.where(zero, 1.0, z)), np.cos(z)


def tanhc(
    u: Inexact[np.ndarray, "*shape"],
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """tanh(u)/u and (1 - tanh(u)/u) / u^2, without cancellation, for Re u >= 0."""
    near = np.abs(u) < 1
    far = np.where(near, 1.0, u)
    ratio = np.tanh(far) / far
    gap = (1 - ratio) / far**2
    if np.any(near):
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
