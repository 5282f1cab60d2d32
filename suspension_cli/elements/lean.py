"""Lean of a leg as an angle, from the displacement of its top.

The leg of an inverted pendulum stands along z with the length L. With its top displaced by delta it
points along p = (x, y, z) = delta + (0, 0, L): it leans by the angle atan(sqrt(q) / z), q = x^2 +
y^2, towards (x, y). Its flexures resist this angle. The components of the angle times L,

    g = L f (x, y),   f = A(q / z^2) / z,   A(t) = atan(sqrt(t)) / sqrt(t) = 1 - t/3 + t^2/5 - ...,

are the displacement for small angles. With A' = (1 / (1 + t) - A) / (2 t) and its derivative, and
with n = z^2 + q,

    f_q = A' / z^3,   f_qq = A'' / z^5,   f_z = -1 / n,   f_qz = 1 / n^2,   f_zz = 2 z / n^2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import polynomial

if TYPE_CHECKING:
    from jaxtyping import Inexact

_A = (-1.0) ** np.arange(15) / (2 * np.arange(15) + 1)
SERIES = np.array([np.pad(polynomial.polyder(_A, m), (0, m)) for m in range(3)])
"""Coefficients of A, A' and A'' in powers of t."""
SMALL = 0.05
"""Largest t for the series; above it differences in A'' lose at most four digits."""


def angle(
    delta: Inexact[np.ndarray, "*batch spring 3"], length: Inexact[np.ndarray, "*batch spring"]
) -> tuple[
    Inexact[np.ndarray, "*batch spring 3"],
    Inexact[np.ndarray, "*batch spring 3 3"],
    Inexact[np.ndarray, "*batch spring 3 3 3"],
]:
    """Lean of legs (g, delta_z), m, with first (output, input) and second derivatives by delta."""
    across, z = delta * [1.0, 1.0, 0.0], length + delta[..., 2]
    q = (across**2).sum(-1)
    t, n = q / z**2, z**2 + q
    a, first, second = _derivatives(t)
    unit, flat = np.array([0.0, 0.0, 1.0]), np.diag([1.0, 1.0, 0.0])

    def times(value: Inexact[np.ndarray, "*shape"], count: int) -> Inexact[np.ndarray, "*other"]:
        return value.reshape(*value.shape, *(1,) * count)

    f_q, along = times(first / z**3, 1), across[..., :, None] * unit
    slope = 2 * f_q * across - times(1 / n, 1) * unit
    curve = 2 * f_q[..., None] * flat + times(2 * z / n**2, 2) * np.outer(unit, unit)
    curve = curve + times(4 * second / z**5, 2) * across[..., :, None] * across[..., None, :]
    curve = curve + times(2 / n**2, 2) * (along + np.swapaxes(along, -1, -2))
    f, size = times(a / z, 1), times(length, 1)
    value = size * f * across + delta * unit
    outer = across[..., :, None] * slope[..., None, :]
    rates = size[..., None] * (f[..., None] * flat + outer) + np.outer(unit, unit)
    mixed = flat[:, :, None] * slope[..., None, None, :]
    bends = mixed + np.swapaxes(mixed, -1, -2) + across[..., :, None, None] * curve[..., None, :, :]
    return value, rates, size[..., None, None] * bends


def _derivatives(t: Inexact[np.ndarray, "*shape"]) -> list[Inexact[np.ndarray, "*shape"]]:
    """Return A(t), A'(t) and A''(t)."""
    small = np.abs(t) < SMALL
    far, near = np.where(small, 1.0, t), np.where(small, t, 0.0)
    a = np.arctan(np.sqrt(far)) / np.sqrt(far)
    first = (1 / (1 + far) - a) / (2 * far)
    closed = a, first, -(1 / (1 + far) ** 2 + 3 * first) / (2 * far)
    return [
        np.where(small, polynomial.polyval(near, row), value)
        for row, value in zip(SERIES, closed, strict=True)
    ]
