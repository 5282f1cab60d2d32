"""Double-double arithmetic: real numbers as unevaluated sums of two doubles, about 32 digits.

Error-free transformations of whole arrays in double arithmetic, identical on every machine:

- a + b = s + e exactly, with s = fl(a + b) (Knuth, The Art of Computer Programming, vol. 2,
  section 4.2.2);
- a b = p + e exactly, with p = fl(a b), by cutting each factor into halves of 26 bits (Dekker,
  Numer. Math. 18, 224, 1971).

The error of a sum is about 2^-104 of its largest terms, however much of them cancels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

CUT = 134217729.0
"""2^27 + 1, the factor of `cut`."""
LARGE = 100_000
"""Multiplications in a matrix product above which it is computed in slices."""
SLICES = 5
"""Slices of each factor of a matrix product whose products are exact."""


@dataclass(frozen=True, slots=True)
class DoubleDouble:
    """Numbers high + low, arrays of one shape; low is about a rounding error of high's terms."""

    high: Float[np.ndarray, "*shape"]
    low: Float[np.ndarray, "*shape"]

    @staticmethod
    def of(value: Float[np.ndarray, "*shape"]) -> DoubleDouble:
        """Convert doubles; their low parts are 0."""
        value = np.asarray(value, dtype=float)
        return DoubleDouble(value, np.zeros_like(value))

    @staticmethod
    def concatenated(parts: list[DoubleDouble]) -> DoubleDouble:
        """Concatenate along the first axis."""
        return DoubleDouble(
            np.concatenate([part.high for part in parts]),
            np.concatenate([part.low for part in parts]),
        )

    def __getitem__(self, index: Any) -> DoubleDouble:
        return DoubleDouble(self.high[index], self.low[index])

    def __neg__(self) -> DoubleDouble:
        return DoubleDouble(-self.high, -self.low)

    def __add__(self, other: DoubleDouble) -> DoubleDouble:
        high, error = two_sum(self.high, other.high)
        return _normalise(high, error + (self.low + other.low))

    def __sub__(self, other: DoubleDouble) -> DoubleDouble:
        return self + (-other)

    def __mul__(self, other: DoubleDouble) -> DoubleDouble:
        high, error = two_product(self.high, other.high)
        return DoubleDouble(high, error + (self.high * other.low + self.low * other.high))

    def __matmul__(self, other: DoubleDouble) -> DoubleDouble:
        """Matrix product (r, k) of (r, q) and (q, k)."""
        if other.is_selection:
            return DoubleDouble(self.high @ other.high, self.low @ other.high)
        if self.high.size * other.high.shape[1] > LARGE:
            return _sliced_product(self, other)
        return (self[:, :, None] * other[None]).total()

    @property
    def is_selection(self) -> bool:
        """Whether each column is 0 but for at most one 1, so that products by it are exact."""
        ones = self.high == 1.0
        return bool(
            (ones.sum(0) <= 1).all() and (ones | (self.high == 0.0)).all() and not self.low.any()
        )

    @property
    def value(self) -> Float[np.ndarray, "*shape"]:
        """The nearest doubles."""
        return self.high + self.low

    def total(self) -> DoubleDouble:
        """Sum over the second axis."""
        return DoubleDouble(self.high.swapaxes(0, 1), self.low.swapaxes(0, 1)).summed()

    def summed(self) -> DoubleDouble:
        """Sum over the first axis."""
        high, low = self.high, self.low
        if not len(high):
            return DoubleDouble.of(np.zeros(high.shape[1:]))
        while (count := len(high)) > 1:
            half = count // 2
            summed, error = two_sum(high[:half], high[half : 2 * half])
            error += low[:half]
            error += low[half : 2 * half]
            if count % 2:
                summed, error = (
                    np.concatenate([summed, high[-1:]]),
                    np.concatenate([error, low[-1:]]),
                )
            high, low = summed, error
        return _normalise(high[0], low[0])


def two_sum(
    a: Inexact[np.ndarray, "*#shape"], b: Inexact[np.ndarray, "*#shape"]
) -> tuple[Inexact[np.ndarray, "*shape"], Inexact[np.ndarray, "*shape"]]:
    """Add doubles: the rounded sum and its exact error."""
    total = a + b
    b_rounded = total - a
    if np.ndim(total) == 0:
        return total, (a - (total - b_rounded)) + (b - b_rounded)
    error = total - b_rounded  # in place: memory access takes longer than arithmetic
    np.subtract(a, error, out=error)
    np.subtract(b, b_rounded, out=b_rounded)
    error += b_rounded
    return total, error


def two_product(
    a: Float[np.ndarray, "*#shape"], b: Float[np.ndarray, "*#shape"]
) -> tuple[Float[np.ndarray, "*shape"], Float[np.ndarray, "*shape"]]:
    """Multiply doubles: the rounded product and its error (exact between 1e-290 and 1e300)."""
    product = a * b
    a1, b1 = cut(a), cut(b)
    a2, b2 = a - a1, b - b1
    return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2


def cut(a: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Cut off the lower half of the bits of doubles; what is cut off is a double exactly."""
    big = CUT * a
    return big - (big - a)


def _sliced_product(a: DoubleDouble, b: DoubleDouble) -> DoubleDouble:
    """Matrix product (r, k) of (r, q) and (q, k) from products of doubles that are exact.

    Each row of a and column of b is cut into slices of so few bits, relative to its largest
    element, that products of two slices have no rounding error, in any order of summation; the rest
    is multiplied in doubles (Ozaki et al., Numer. Algorithms 59, 95, 2012). The error is about
    2^-160 of the largest elements of row and column, or 2^-104 of the sum.
    """
    bits = (52 - math.ceil(math.log2(max(a.high.shape[1], 2)))) // 2
    first, second = _slices(a, 1, bits), _slices(b, 0, bits)
    parts = [first[m] @ second[n - m] for n in range(SLICES) for m in range(n + 1)]
    remainder, behind = first[SLICES] @ b.value, second[SLICES].copy()
    for m in range(SLICES):
        remainder = remainder + first[m] @ behind
        behind += second[SLICES - 1 - m]
    parts.append(remainder)
    return DoubleDouble(np.stack(parts), np.zeros((len(parts), *remainder.shape))).summed()


def _slices(matrix: DoubleDouble, axis: int, bits: int) -> list[Float[np.ndarray, "row column"]]:
    """Cut a matrix into slices of `bits` bits, relative to the largest along an axis, and the rest.

    They add up to the matrix.
    """
    high, low = matrix.high, matrix.low
    largest = np.abs(high).max(axis, keepdims=True, initial=0.0)
    unit = np.exp2(np.frexp(largest)[1] - bits)
    result = []
    for _ in range(SLICES):
        shift = 1.5 * 2.0**52 * unit  # rounds to whole units
        result.append((high + shift) - shift)
        high, low = two_sum(high - result[-1], low)
        unit = unit * 2.0**-bits
    return [*result, high + low]


def _normalise(high: Float[np.ndarray, "*shape"], low: Float[np.ndarray, "*shape"]) -> DoubleDouble:
    """Normalise, so that low is at most a rounding error of high."""
    total = high + low
    return DoubleDouble(total, low - (total - high))


def solve(matrix: DoubleDouble, right: DoubleDouble, steps: int = 4) -> DoubleDouble:
    """Solve one system (n, n) for (n, k) in double-double, by refinement; NaN if it is singular."""
    result = DoubleDouble.of(np.full(right.high.shape, np.nan))
    if not np.isfinite(matrix.high).all() or not matrix.high.size:
        return result
    # scaled to elements of at most about 1: coordinates in m and rad differ by orders
    scale = 1.0 / np.sqrt(np.maximum(np.abs(matrix.high).max(1), np.finfo(float).tiny))
    scaled = matrix.high * scale[:, None] * scale
    result = DoubleDouble.of(np.zeros(right.high.shape))
    for _ in range(steps):
        residual = (right - matrix @ result).value
        try:
            result = result + DoubleDouble.of(
                scale[:, None] * np.linalg.solve(scaled, scale[:, None] * residual)
            )
        except np.linalg.LinAlgError:
            return DoubleDouble.of(np.full(right.high.shape, np.nan))
    return result
