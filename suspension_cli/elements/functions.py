"""sin(z)/z, sinh(z)/z and their difference, accurate where they are near 1."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact


def sinc(z: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """sin(z)/z, for real or complex z of any shape.

    Unlike `numpy.sinc` it does not pass through z/pi, whose rounding counts at large z.
    """
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sin(safe) / safe)


def sinhc(z: Inexact[np.ndarray, "*shape"]) -> Inexact[np.ndarray, "*shape"]:
    """sinh(z)/z, for real or complex z of any shape."""
    safe = np.where(z == 0, 1.0, z)
    return np.where(z == 0, 1.0, np.sinh(safe) / safe)


def sinhc_minus_sinc(
    x: Float[np.ndarray, " frequency"], y: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """sinh(y)/y - sin(x)/x for real arrays (f,), without cancellation where both are near 1."""
    p, n = y * y, -x * x
    result = sinhc(y) - np.sinc(x / np.pi)
    near = p - n < 0.5
    if np.any(near):
        result[near] = _sinhc_minus_one(p[near]) - _sinhc_minus_one(n[near])
    return result


def _sinhc_minus_one(z: Float[np.ndarray, " frequency"]) -> Float[np.ndarray, " frequency"]:
    """sinh(sqrt z)/sqrt z - 1 for small z, by its power series."""
    total = np.zeros_like(z)
    for k in range(8, 0, -1):
        total = (total + 1 / math.factorial(2 * k + 1)) * z
    return total
