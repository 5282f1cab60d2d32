"""Hyper-dual numbers: exact second derivatives of any formula, for many pairs at once.

A number a + b e1 + c e2 + d e1 e2 with e1^2 = e2^2 = 0 carries f, df/dx_i, df/dx_j and
d2f/dx_i dx_j (Fike and Alonso, AIAA paper 2011-886); each part is an array over the pairs (i, j).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Hyper:
    a: Any
    b: Any
    c: Any
    d: Any

    @staticmethod
    def of(value: Any) -> Hyper:
        return value if isinstance(value, Hyper) else Hyper(value, 0.0, 0.0, 0.0)

    def __add__(self, other: Any) -> Hyper:
        o = Hyper.of(other)
        return Hyper(self.a + o.a, self.b + o.b, self.c + o.c, self.d + o.d)

    __radd__ = __add__

    def __neg__(self) -> Hyper:
        return Hyper(-self.a, -self.b, -self.c, -self.d)

    def __sub__(self, other: Any) -> Hyper:
        return self + (-Hyper.of(other))

    def __rsub__(self, other: Any) -> Hyper:
        return Hyper.of(other) + (-self)

    def __mul__(self, other: Any) -> Hyper:
        o = Hyper.of(other)
        return Hyper(
            self.a * o.a,
            self.a * o.b + self.b * o.a,
            self.a * o.c + self.c * o.a,
            self.a * o.d + self.b * o.c + self.c * o.b + self.d * o.a,
        )

    __rmul__ = __mul__

    def of_function(self, f: Any, first: Any, second: Any) -> Hyper:
        return Hyper(f, first * self.b, first * self.c, first * self.d + second * self.b * self.c)

    def sqrt(self) -> Hyper:
        root = np.sqrt(self.a)
        return self.of_function(root, 0.5 / root, -0.25 / (root * self.a))


def variables(count: int) -> tuple[list[Hyper], Any, Any]:
    """Variables (count) at 0, one entry per pair i <= j; and the pairs."""
    i, j = np.triu_indices(count)
    zero = np.zeros(len(i))
    return [Hyper(zero, (i == n) * 1.0, (j == n) * 1.0, zero) for n in range(count)], i, j


def hessian(energy: Any, count: int) -> tuple[Any, Any]:
    """Gradient (n,) and Hessian (n, n) of a function of a list of n variables, at 0."""
    x, i, j = variables(count)
    value = energy(x)
    result = np.zeros((count, count))
    result[i, j] = result[j, i] = value.d
    gradient = np.zeros(count)
    gradient[i] = value.b
    return gradient, result


def rotation(t: list[Any]) -> list[list[Any]]:
    """Rotation matrix of a rotation vector near 0, to second order: 1 + [t] + [t]^2 / 2."""
    x, y, z = t
    skew = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    square = product(skew, skew)
    return [
        [(1.0 if r == c else 0.0) + skew[r][c] + 0.5 * square[r][c] for c in range(3)]
        for r in range(3)
    ]


def product(a: Any, b: Any) -> list[list[Any]]:
    return [[sum(a[r][k] * b[k][c] for k in range(3)) for c in range(3)] for r in range(3)]


def transposed(a: Any) -> list[list[Any]]:
    return [[a[c][r] for c in range(3)] for r in range(3)]


def apply(matrix: Any, vector: Any) -> list[Any]:
    return [sum(matrix[r][k] * vector[k] for k in range(3)) for r in range(3)]
