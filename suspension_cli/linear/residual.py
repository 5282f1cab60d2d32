"""Residuals of the equations of motion of a block, to twice the digits of doubles.

The rounding errors of a solution v of D v = b follow from its residual b - D v, a small difference
of large terms that needs more digits than the solution has (Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed., chapter 12). With D = K + i omega C - omega^2 M and b a polynomial in
omega it is one product of a constant matrix A = (-K, -iC, M, b_0, b_2) and the columns
y = (v, omega v, omega^2 v, 1, omega^2). Both are cut into slices of few bits on a common scale,

    A = A_1 + A_2 + A_3,   y = y_1 + y_2 + y_3,
    A y = A_1 y_1 + (A_1 y_2 + A_2 y_1) + (A_1 y_3 + A_2 (y_2 + y_3) + A_3 y),

so that all but the last bracket are free of rounding errors, whatever the order of summation, and
ordinary matrix products compute them (Ozaki, Ogita, Oishi and Rump, Numer. Algorithms 59, 95
(2012)). The scale of each column of A is the largest element of y at a few neighbouring
frequencies; where all terms of a row are far below it, the frequency is computed with its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear.double_double import DoubleDouble, two_product

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

COARSE, FINE = 3, 4
"""Number of slices: errors of some 2^-95 and 2^-115 of the largest terms."""
WIDTH = 64
"""Neighbouring frequencies with common scales."""
SMALL = 2.0**-15
"""Size of the terms of a row, relative to its scale, below which its frequency is computed with
scales of its own."""


@dataclass(frozen=True)
class Loads:
    """Right-hand sides b, as polynomials in omega.

    Attributes
    ----------
    terms : tuple of (int, DoubleDouble)
        Power of omega and its coefficients (r, k).
    single : bool
        Whether k is the number of frequencies, each with one input, instead of that of inputs.
    """

    terms: tuple[tuple[int, DoubleDouble], ...]
    single: bool = False

    def some(
        self, which: Int[np.ndarray, " some"] | Bool[np.ndarray, " frequency"] | slice
    ) -> Loads:
        """Select the inputs of single frequencies."""
        return Loads(tuple((power, value[:, which]) for power, value in self.terms), single=True)


@dataclass(frozen=True)
class Equations:
    """Equations of motion D v = b of a block, D = K + i omega C - omega^2 M, as r real rows.

    Complex equations become rows of real and of imaginary parts.

    Attributes
    ----------
    support : tuple of (int, DoubleDouble)
        Power of omega, and its coefficients (r, 6) towards the support.
    own : tuple of (int, (n,) int array, DoubleDouble)
        Power of omega, the coordinates that it multiplies and its coefficients (r, n).
    split : bool
        Whether v is complex.
    """

    support: tuple[tuple[int, DoubleDouble], ...]
    own: tuple[tuple[int, Int[np.ndarray, " _"], DoubleDouble], ...]
    split: bool

    def loads(
        self, moves: Float[np.ndarray, "6 input"], forces: Inexact[np.ndarray, "coordinate input"]
    ) -> Loads:
        """Compute right-hand sides b = f - E s for support motions (6, k) and forces (c, k)."""
        forces = (
            np.concatenate([np.real(forces), np.imag(forces)]) if self.split else np.real(forces)
        )
        terms = []
        for power, coupling in self.support:
            value = -(coupling @ DoubleDouble.of(moves))
            if power == 0:
                value = DoubleDouble.of(forces) + value
            if value.high.any() or value.low.any():
                terms.append((power, value))
        return Loads(tuple(terms))

    def residual(
        self,
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        high: Inexact[np.ndarray, "coordinate input frequency"],
        low: Inexact[np.ndarray, "coordinate input frequency"] | None = None,
        *,
        slices: int = COARSE,
    ) -> Inexact[np.ndarray, "coordinate input frequency"]:
        """Compute the residual b - D v (c, k, f), rounded once; NaN where v is not finite.

        Parameters
        ----------
        omega : (f,) array
            rad/s.
        loads : Loads
            Of k inputs; if k = 1, also single ones.
        high, low : (c, k, f) arrays
            v in double-double; without `low`, in doubles.
        slices : {COARSE, FINE}
        """
        count = len(high)
        if self.split:
            high = np.concatenate([np.real(high), np.imag(high)])
            low = None if low is None else np.concatenate([np.real(low), np.imag(low)])
        finite = np.isfinite(high).all(0)
        if not finite.all():
            high = np.where(finite, high, 0.0)
            low = None if low is None else np.where(finite, low, 0.0)
        result = self._multiply(omega, loads, high, low, slices, 1 if loads.single else WIDTH)
        result[:, ~finite] = np.nan
        return result[:count] + 1j * result[count:] if self.split else result

    def _multiply(
        self,
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        high: Inexact[np.ndarray, "coordinate input frequency"],
        low: Inexact[np.ndarray, "coordinate input frequency"] | None,
        slices: int,
        width: int,
    ) -> Float[np.ndarray, "row input frequency"]:
        """Compute the residual (r, k, f) with common scales of `width` frequencies."""
        count = len(omega)
        omegas, values = _grouped(omega[None, None], width), _grouped(high, width)
        fastest, largest = _scale(omegas), _scale(values)
        omegas, values = omegas / fastest[..., None], values * (1 / largest)[..., None]
        values_low = None if low is None else _grouped(low, width) / largest[..., None]
        rows, size = len(self.own[0][2].high), sum(len(columns) for _, columns, _ in self.own)
        shape = (*values.shape[:2], size + len(loads.terms), width)
        y, y_low = np.empty(shape), np.zeros(shape)
        groups = len(values) if loads.single else 1
        matrix, matrix_low = np.empty((2, groups, shape[1], rows, shape[2]))
        scale = np.empty(shape[:3])
        start = 0
        for power, columns, part in self.own:
            here = slice(start, start := start + len(columns))
            matrix[..., here], matrix_low[..., here] = -part.high, -part.low
            scale[..., here] = largest[..., columns] * fastest**power
            few = values if len(columns) == values.shape[2] else values[:, :, columns]
            y[:, :, here] = few
            if values_low is not None:
                y_low[:, :, here] = values_low[:, :, columns]
            if power:
                factor, factor_low = _power(omegas, power)
                y[:, :, here], error = two_product(few, factor)
                y_low[:, :, here] *= factor
                y_low[:, :, here] += error
                if power == 2:
                    y_low[:, :, here] += few * factor_low
        for here, (power, value) in enumerate(loads.terms, start):
            each = (-1, 1, rows) if loads.single else (1, -1, rows)
            matrix[..., here] = value.high.T.reshape(each)
            matrix_low[..., here] = value.low.T.reshape(each)
            scale[..., here] = fastest[..., 0] ** power
            y[:, :, here, None], y_low[:, :, here, None] = _power(omegas, power)
        # without low parts of v those of y are 0 in the first columns
        used = slice(len(self.own[0][1]) if low is None else 0, None)
        product, terms = _multiply_in_slices(
            matrix * scale[..., None, :], matrix_low * scale[..., None, :], y, y_low, used, slices
        )
        result = _ungrouped(product, count)
        if width > 1:
            small = np.any((terms < SMALL) & (terms > 0), axis=2)
            if small.any():
                i, f = _ungrouped(small[:, :, None], count)[0].nonzero()
                result[:, i, f] = self._multiply(
                    omega[f],
                    loads.some(i),
                    high[:, None, i, f],
                    None if low is None else low[:, None, i, f],
                    slices,
                    1,
                )[:, 0]
        return result


def _grouped(
    values: Float[np.ndarray, "row input frequency"], width: int
) -> Float[np.ndarray, "group input row width"]:
    """Arrange (n, k, f) as (f / width, k, n, width), the last group filled up with its last."""
    groups = -(-values.shape[-1] // width)
    result = np.empty((groups, *values.shape[1::-1], width))
    whole = values.shape[-1] // width
    result[:whole] = (
        values[..., : whole * width].reshape(*values.shape[:2], whole, width).transpose(2, 1, 0, 3)
    )
    if whole < groups:
        rest = values[..., whole * width :].swapaxes(0, 1)
        result[whole, ..., : rest.shape[-1]] = rest
        result[whole, ..., rest.shape[-1] :] = rest[..., -1:]
    return result


def _ungrouped(
    values: Float[np.ndarray, "group input row width"] | Bool[np.ndarray, "group input row width"],
    count: int,
) -> Float[np.ndarray, "row input count"] | Bool[np.ndarray, "row input count"]:
    """Arrange (g, k, n, width) as (n, k, count)."""
    return values.transpose(2, 1, 0, 3).reshape(*values.shape[2:0:-1], -1)[..., :count]


def _multiply_in_slices(
    left: Float[np.ndarray, "*#batch row inner"],
    left_low: Float[np.ndarray, "*#batch row inner"],
    right: Float[np.ndarray, "*#batch inner width"],
    right_low: Float[np.ndarray, "*#batch inner width"],
    used: slice,
    slices: int,
) -> tuple[Float[np.ndarray, "*batch row width"], Float[np.ndarray, "*batch row width"]]:
    """Multiply matrices (..., r, n) by columns (..., n, w) of at most 1, both in double-double.

    Parameters
    ----------
    used : slice
        Where the low parts of the columns are not 0.

    Returns
    -------
    product : (..., r, w) array
        In doubles.
    terms : (..., r, w) array
        Sum of the absolute terms of each element, relative to the scale of the error.
    """
    bits = (53 - math.ceil(math.log2(slices * right.shape[-2]))) // 2
    row_scale = _scale(left)[..., None]
    left, left_low = left / row_scale, left_low / row_scale
    terms = np.abs(left) @ np.abs(right)
    last = left[..., used] @ right_low[..., used, :] + left_low @ right
    lefts, rights = [], []
    for n in range(1, slices):
        lefts.append(_first_bits(left, bits * n))
        left = left - lefts[-1]
        rights.append((_first_bits(right, bits * n), right))
        right = right - rights[-1][0]
    lefts.append(left)
    rights.append((right, right))
    product = 0.0
    for n in range(slices - 1):  # these sums cancel, so the largest come first
        for m in range(n + 1):
            product += lefts[m] @ rights[n - m][0]
    for n in range(slices):
        last += lefts[n] @ rights[slices - 1 - n][1]
    product += last
    product *= row_scale
    return product, terms


def _scale(values: Float[np.ndarray, "*batch last"]) -> Float[np.ndarray, "*shape"]:
    """Powers of 2 above the absolute values of the last axis; 1 if all are 0."""
    return np.ldexp(1.0, np.frexp(np.abs(values).max(-1))[1])


def _first_bits(values: Float[np.ndarray, "*batch"], bits: int) -> Float[np.ndarray, "*batch"]:
    """Round values of at most 1 to so many bits behind the point."""
    unit = 1.5 * 2.0 ** (52 - bits)  # its last digit is that of the result
    result = values + unit
    result -= unit
    return result


def _power(omega: Float[np.ndarray, "*shape"], power: int) -> tuple[Any, Any]:
    """Raise omega to a power of 0, 1 or 2 in double-double."""
    return two_product(omega, omega) if power == 2 else (omega if power else 1.0, 0.0)


def equations(
    high: tuple[
        Inexact[np.ndarray, "coordinate 6+coordinate"],
        Inexact[np.ndarray, "coordinate 6+coordinate"],
        Inexact[np.ndarray, "coordinate 6+coordinate"],
    ],
    low: tuple[
        Inexact[np.ndarray, "coordinate 6+coordinate"],
        Inexact[np.ndarray, "coordinate 6+coordinate"],
        Inexact[np.ndarray, "coordinate 6+coordinate"],
    ],
) -> Equations:
    """Build equations of motion from K, M and C (c, 6 + c) and their low parts."""
    split = any(np.iscomplexobj(part) for part in (*high, *low)) or bool(high[2].any())
    support, own = [], []
    for power, number, factor in ((0, 0, 1.0), (2, 1, -1.0), (1, 2, 1j if split else 0.0)):
        rows = DoubleDouble(
            *(_real_rows(factor * part[number], split=split) for part in (high, low))
        )
        used = (rows.high != 0) | (rows.low != 0)
        if power == 0 or used[:, :6].any():
            support.append((power, rows[:, :6]))
        columns = np.flatnonzero(used[:, 6:].any(0))
        if power == 0 or len(columns):
            own.append((power, columns, rows[:, 6 + columns]))
    return Equations(tuple(support), tuple(own), split)


def _real_rows(
    matrix: Inexact[np.ndarray, "coordinate 6+coordinate"], *, split: bool
) -> Float[np.ndarray, "row column"]:
    """Write a complex matrix (c, 6 + c) on (s, v), with s real, as real rows."""
    if not split:
        return np.real(matrix)
    real, imag = np.real(matrix), np.imag(matrix)
    return np.block([[real, -imag[:, 6:]], [imag, real[:, 6:]]])
