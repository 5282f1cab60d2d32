"""Real numbers as unevaluated sums of two doubles, some 32 digits: for residuals, which are what double precision rounds away.

Error-free transformations on whole arrays, in plain double arithmetic, so alike on every machine:

    a + b = s + e exactly, with s = fl(a + b) (Knuth, The Art of Computer Programming, vol. 2, section 4.2.2),
    a b = p + e exactly, with p = fl(a b), by cutting each factor in two halves of 26 bits (Dekker, Numer. Math. 18, 224, 1971).

A sum keeps some 2^-104 of the sizes of its terms, however much of them cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

CUT = 134217729.0
"""2^27 + 1."""


@dataclass(frozen=True, slots=True)
class Twofold:
    """high + low, arrays of one shape; low is of the order of a rounding of what high was made of."""

    high: Any
    low: Any

    @staticmethod
    def of(value: Any) -> Twofold:
        """Doubles as they stand."""
        value = np.asarray(value, dtype=float)
        return Twofold(value, np.zeros_like(value))

    @staticmethod
    def stacked(parts: list[Twofold]) -> Twofold:
        """Joined along the first axis."""
        return Twofold(np.concatenate([part.high for part in parts]), np.concatenate([part.low for part in parts]))

    def __getitem__(self, index: Any) -> Twofold:
        return Twofold(self.high[index], self.low[index])

    def __neg__(self) -> Twofold:
        return Twofold(-self.high, -self.low)

    def __add__(self, other: Twofold) -> Twofold:
        high, error = two_sum(self.high, other.high)
        return _normal(high, error + (self.low + other.low))

    def __sub__(self, other: Twofold) -> Twofold:
        return self + (-other)

    def __mul__(self, other: Twofold) -> Twofold:
        high, error = two_product(self.high, other.high)
        return Twofold(high, error + (self.high * other.low + self.low * other.high))

    def __matmul__(self, other: Twofold) -> Twofold:
        """Matrix product (r, k) of (r, q) and (q, k)."""
        return (self[:, :, None] * other[None]).total()

    @property
    def value(self) -> Any:
        """The nearest doubles."""
        return self.high + self.low

    def total(self) -> Twofold:
        """Sum over the second axis, in pairs."""
        return Twofold(self.high.swapaxes(0, 1), self.low.swapaxes(0, 1)).summed()

    def summed(self) -> Twofold:
        """Sum over the first axis, in pairs."""
        high, low = self.high, self.low
        if not len(high):
            return Twofold.of(np.zeros(high.shape[1:]))
        while (count := len(high)) > 1:
            half = count // 2
            summed, error = two_sum(high[:half], high[half : 2 * half])
            error += low[:half]
            error += low[half : 2 * half]
            if count % 2:
                summed, error = np.concatenate([summed, high[-1:]]), np.concatenate([error, low[-1:]])
            high, low = summed, error
        return _normal(high[0], low[0])


@dataclass(frozen=True, slots=True)
class Halved:
    """Twofold numbers whose high parts are cut in halves, once for all products."""

    high: Any
    upper: Any
    lower: Any
    low: Any

    @staticmethod
    def of(value: Twofold) -> Halved:
        """The same numbers."""
        upper = cut(value.high)
        return Halved(value.high, upper, value.high - upper, value.low)

    def take(self, index: Any) -> Halved:
        """Some along the first axis."""
        return Halved(*(part.take(index, axis=0) for part in (self.high, self.upper, self.lower, self.low)))

    def __mul__(self, other: Halved) -> Twofold:
        product, error = self.high * other.high, self.upper * other.upper
        error -= product
        term = np.empty_like(error)
        for a, b in ((self.upper, other.lower), (self.lower, other.upper), (self.lower, other.lower), (self.high, other.low), (self.low, other.high)):
            error += np.multiply(a, b, out=term)
        return Twofold(product, error)


def two_sum(a: Any, b: Any) -> tuple[Any, Any]:
    """The rounded sum and its error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def two_product(a: Any, b: Any) -> tuple[Any, Any]:
    """The rounded product and its error (exact unless it is beyond 1e300 or below 1e-290)."""
    product = a * b
    a1, b1 = cut(a), cut(b)
    a2, b2 = a - a1, b - b1
    return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


def cut(a: Any) -> Any:
    """The upper half of the digits; the rest is exact too."""
    big = CUT * a
    return big - (big - a)


def _normal(high: Any, low: Any) -> Twofold:
    """The same sum with low a rounding of high."""
    total = high + low
    return Twofold(total, low - (total - high))


def solve(matrix: Twofold, right: Twofold, steps: int = 4) -> Twofold:
    """Solution (n, k) of one system (n, n) with right sides (n, k), refined to twofold precision; NaN if it is singular."""
    result = Twofold.of(np.full(right.high.shape, np.nan))
    if not np.isfinite(matrix.high).all() or not matrix.high.size:
        return result
    scale = 1.0 / np.sqrt(np.maximum(np.abs(matrix.high).max(1), np.finfo(float).tiny))  # coordinates in m and rad
    scaled = matrix.high * scale[:, None] * scale
    result = Twofold.of(np.zeros(right.high.shape))
    for _ in range(steps):
        rest = (right - matrix @ result).value
        try:
            result = result + Twofold.of(scale[:, None] * np.linalg.solve(scaled, scale[:, None] * rest))
        except np.linalg.LinAlgError:
            return Twofold.of(np.full(right.high.shape, np.nan))
    return result
