"""Numbers that carry exact first and second derivatives with respect to N coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np


class Jet:
    """A value with its gradient (N,) and Hessian (N, N)."""

    def __init__(self, value: float, gradient: Any, hessian: Any) -> None:
        self.value, self.gradient, self.hessian = value, gradient, hessian

    def _of(self, other: Any) -> Jet:
        if isinstance(other, Jet):
            return other
        return Jet(float(other), np.zeros_like(self.gradient), np.zeros_like(self.hessian))

    def __add__(self, other: Any) -> Jet:
        o = self._of(other)
        return Jet(self.value + o.value, self.gradient + o.gradient, self.hessian + o.hessian)

    def __mul__(self, other: Any) -> Jet:
        o = self._of(other)
        cross = np.outer(self.gradient, o.gradient)
        return Jet(
            self.value * o.value,
            self.value * o.gradient + o.value * self.gradient,
            self.value * o.hessian + o.value * self.hessian + cross + cross.T,
        )

    def __pow__(self, power: float) -> Jet:
        f = self.value**power
        first = power * self.value ** (power - 1)
        second = power * (power - 1) * self.value ** (power - 2)
        square = np.outer(self.gradient, self.gradient)
        return Jet(f, first * self.gradient, first * self.hessian + second * square)

    __radd__, __rmul__ = __add__, __mul__

    def __neg__(self) -> Jet:
        return self * -1.0

    def __sub__(self, other: Any) -> Jet:
        return self + -self._of(other)

    def __rsub__(self, other: Any) -> Jet:
        return -self + other

    def __truediv__(self, other: Any) -> Jet:
        return self * self._of(other) ** -1


def coordinates(count: int) -> list[Jet]:
    """The coordinates themselves, at 0."""
    return [Jet(0.0, row, np.zeros((count, count))) for row in np.eye(count)]


def rotation(t: Any) -> Any:
    """Rotation matrix (3, 3) of a rotation vector (3,) of jets near 0: Rodrigues' formula."""
    square = t @ t
    sine, cosine = 1 - square / 6, 0.5 - square / 24
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    return np.eye(3) + cross * sine + (cross @ cross) * cosine


def length(vector: Any) -> Any:
    """Length of a vector (3,) of jets."""
    return (vector @ vector) ** 0.5
