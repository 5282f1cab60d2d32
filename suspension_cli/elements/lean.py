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

import numpy as np
from numpy.polynomial import polynomial

from suspension_cli.elements.vectors import Matrix, Scalar, Vector, outer

_A = (-1.0) ** np.arange(15) / (2 * np.arange(15) + 1)
SERIES = np.array([np.pad(polynomial.polyder(_A, m), (0, m)) for m in range(3)])
"""Coefficients of A, A' and A'' in powers of t."""
SMALL = 0.05
"""Largest t for the series; above it differences in A'' lose at most four digits."""
_ACROSS = np.array([1.0, 1.0, 0.0])[:, None, None]
"""Components of a vector (3, leg, build) across a leg."""


def _factor(delta: Vector, length: Scalar) -> tuple[Scalar, Vector, Matrix]:
    """L f with its gradient and Hessian by delta."""
    x, y, z = delta[0], delta[1], length + delta[2]
    q = x * x + y * y
    n = z * z + q
    a, first, second = _derivatives(q / (z * z))
    f_q, f_qq = length * first / z**3, length * second / z**5
    f_z, f_qz, f_zz = -length / n, length / n**2, 2 * length * z / n**2
    xx, xy, yy = 2 * f_q + 4 * f_qq * x * x, 4 * f_qq * x * y, 2 * f_q + 4 * f_qq * y * y
    xz, yz = 2 * x * f_qz, 2 * y * f_qz
    curve = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, f_zz]])
    return length * a / z, np.array([2 * f_q * x, 2 * f_q * y, f_z]), curve


def angle(delta: Vector, length: Scalar) -> tuple[Vector, Matrix]:
    """Lean of legs (g, delta_z), m, with its derivatives by delta (output, input)."""
    f, slope, _ = _factor(delta, length)
    across = delta * _ACROSS
    rates = outer(across, slope)
    rates[0, 0] += f
    rates[1, 1] += f
    rates[2, 2] += 1.0
    lean = f * across
    lean[2] = delta[2]
    return lean, rates


def curvature(delta: Vector, length: Scalar, pull: Vector) -> Matrix:
    """Second derivatives of the lean by delta, times the gradient `pull` of the energy by it."""
    _, slope, curve = _factor(delta, length)
    flat = pull * _ACROSS
    return (flat * delta).sum(0) * curve + outer(flat, slope) + outer(slope, flat)


def _derivatives(t: Scalar) -> list[Scalar]:
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
