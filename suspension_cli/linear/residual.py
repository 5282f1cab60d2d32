"""Residuals of the equations of motion of a block, to twice the digits of doubles.

The rounding errors of a solution v of D v = b follow from its residual b - D v, a small difference
of large terms that needs more digits than the solution has (Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed., chapter 12). With D = K + i omega C - omega^2 M and b a polynomial in
omega it is A y, one product of a constant matrix and columns

    A = (-K, b_0, -iC, b_1, M, b_2),    y = (v, 1, omega v, omega, omega^2 v, omega^2).

Both are cut into slices of few bits, for example three,

    A = A_1 + A_2 + A_3,   y = y_1 + y_2 + y_3,
    A y = A_1 y_1 + (A_1 y_2 + A_2 y_1) + (A_1 y_3 + A_2 (y_2 + y_3) + A_3 y),

so that ordinary matrix products compute all but the last bracket without rounding errors, in any
order of summation (Ozaki, Ogita, Oishi and Rump, Numer. Algorithms 59, 95 (2012)). The scale of
each column of A is the largest element of y at a few neighbouring frequencies. Where all terms of a
row are far below it, the relative error is larger.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.linear.double_double import DoubleDouble, two_product

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

FIRST, COARSE, FINE = 2, 3, 4
"""Number of slices: errors of some 2^-75, 2^-95 and 2^-115 of the largest terms."""
FEW = 12
"""Number of coordinates up to which two slices mostly suffice for the first residual."""
WIDTH = 64
"""Neighbouring frequencies with common scales."""
SMALL = 2.0**-15
"""Size of a row's terms, relative to its scale, below which its frequency gets scales of its
own."""
SMALLEST = -900
"""Power of 2 below which values count as 0."""
LIMIT = 1e-10
"""Relative correction of a first solution above which a second one matters."""
MARGIN = 58
"""Bits in all slices but the last above which errors of the last never matter."""


@dataclass(frozen=True)
class Loads:
    """Equations of motion with right-hand sides b, as products A y.

    Attributes
    ----------
    high, low
        A for each input, in double-double.
    powers
        Powers of omega in the order of y, and which of (v, 1) each multiplies.
    single
        Whether the first axis is that of frequencies, each with one input.
    """

    high: Float[np.ndarray, "input row column"]
    low: Float[np.ndarray, "input row column"]
    powers: tuple[tuple[int, Int[np.ndarray, " _"]], ...]
    single: bool = False

    def select(
        self, which: Int[np.ndarray, " some"] | Bool[np.ndarray, " frequency"] | slice
    ) -> Loads:
        """Select the inputs of single frequencies."""
        return Loads(self.high[which], self.low[which], self.powers, single=True)


@dataclass(frozen=True)
class Equations:
    """Equations of motion D v = b of a block, D = K + i omega C - omega^2 M, as r real rows.

    Complex equations become rows of real and imaginary parts.

    Attributes
    ----------
    terms
        Power of omega, the coordinates that it multiplies (all for the power 0), its coefficients
        (r, n), and those towards the support (r, 6).
    split
        Whether v is complex.
    """

    terms: tuple[tuple[int, Int[np.ndarray, " _"], DoubleDouble, DoubleDouble], ...]
    split: bool

    def loads(
        self, moves: Float[np.ndarray, "6 input"], forces: Inexact[np.ndarray, "coordinate input"]
    ) -> Loads:
        """Compute right-hand sides b = f - E s for support motions and forces."""
        forces = (
            np.concatenate([np.real(forces), np.imag(forces)]) if self.split else np.real(forces)
        )
        constant = DoubleDouble.of(moves)
        parts, powers = [], []
        for power, columns, own, support in self.terms:
            load = -(support @ constant)
            if power == 0:
                load = DoubleDouble.of(forces) + load
            parts += [-own] * bool(len(columns))
            if power == 0 or load.high.any():
                parts.append(DoubleDouble(load.high.T[..., None], load.low.T[..., None]))
                columns = np.append(columns, len(forces))
            if len(columns):
                powers.append((power, columns))
        shape = (moves.shape[1], len(forces), sum(len(columns) for _, columns in powers))
        high, low, start = np.empty(shape), np.empty(shape), 0
        for part in parts:
            own = slice(start, start := start + part.high.shape[-1])
            high[..., own], low[..., own] = part.high, part.low
        return Loads(high, low, tuple(powers))

    def first_residual(
        self,
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        values: Inexact[np.ndarray, "coordinate input frequency"],
    ) -> tuple[
        Inexact[np.ndarray, "coordinate input frequency"], Float[np.ndarray, "input frequency"]
    ]:
        """Compute the residual b - D v of a first solution v; NaN where v is not finite.

        Also returns the relative correction of v up to which errors of the residual do not matter.
        `omega` in rad/s.
        """
        slices = FIRST if len(values) <= FEW else COARSE
        result, size, bits = self._multiply(omega, loads, values, None, slices, WIDTH)
        return result, np.minimum(2.0 ** (bits * (slices - 1) - MARGIN) * size, LIMIT)

    def residual(
        self,
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        high: Inexact[np.ndarray, "coordinate input frequency"],
        low: Inexact[np.ndarray, "coordinate input frequency"],
        *,
        slices: int = COARSE,
    ) -> Inexact[np.ndarray, "coordinate input frequency"]:
        """Compute the residual b - D v of v in double-double, rounded; NaN where v is not finite.

        `omega` in rad/s; `loads` of each input, or single ones for one column of v; `slices` COARSE
        or FINE.
        """
        width = 1 if loads.single else WIDTH
        result, size, _ = self._multiply(omega, loads, high, low, slices, width)
        if width > 1:
            i, f = np.nonzero(size < SMALL)
            if len(i):
                result[:, i, f] = self._multiply(
                    omega[f], loads.select(i), high[:, None, i, f], low[:, None, i, f], slices, 1
                )[0][:, 0]
        return result

    def _multiply(
        self,
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        high: Inexact[np.ndarray, "coordinate input frequency"],
        low: Inexact[np.ndarray, "coordinate input frequency"] | None,
        slices: int,
        width: int,
    ) -> tuple[
        Inexact[np.ndarray, "coordinate input frequency"], Float[np.ndarray, "input frequency"], int
    ]:
        """Compute the residual with common scales of `width` frequencies.

        Also returns the smallest sum of absolute terms of any row, relative to the scale of its
        error, and the number of bits per slice.
        """
        total, groups, inner = len(omega), -(-len(omega) // width), loads.high.shape[-1]
        bits = (53 - math.ceil(math.log2((slices - 1) * inner))) // 2
        finite = np.isfinite(high).all(0)
        if not finite.all():
            high = np.where(finite, high, 0.0)
            low = None if low is None else np.where(finite, low, 0.0)
        omega = np.concatenate([omega, np.full(groups * width - total, omega[-1])])
        # from above: the remainders y_S, ..., y - y_1, y, then y_(S-1), ..., y_1
        rows = np.empty(((2 * slices - 1) * inner, high.shape[1], groups * width))
        y = rows[(slices - 1) * inner : slices * inner]
        errors = self._write_columns(y, omega, loads, high, low)
        sizes = np.abs(y)
        scale = _power_of_two(sizes.reshape(*y.shape[:-1], groups, width).max(-1))
        parts, unit = rows.reshape(2 * slices - 1, *y.shape), np.repeat(scale, width, axis=-1)
        for n in range(1, slices):
            _cut_to_grid(parts[slices - n], unit, bits * n, parts[-n])
            np.subtract(parts[slices - n], parts[-n], out=parts[slices - 1 - n])
        for where, error in errors:
            parts[: slices - 1, where] += error

        weights, relative = _cut_matrix(loads, scale.transpose(2, 1, 0)[:, :, None], slices, bits)
        product = np.zeros((groups, high.shape[1], weights.shape[-2], width))
        for n in range(1, slices):  # free of rounding errors; they cancel, so the largest first
            product += weights[..., : n * inner] @ _stacked(rows[-n * inner :], width)
        product += weights @ _stacked(rows[: slices * inner], width)
        terms = relative @ _stacked(sizes, width)
        idle = ~np.any(terms, axis=-1)
        if idle.any():  # rows without terms have no error
            terms[idle] = 1.0
        size = terms.min(-2).swapaxes(0, 1).reshape(high.shape[1], -1)[:, :total]
        result = product.transpose(2, 1, 0, 3).reshape(-1, high.shape[1], len(omega))[..., :total]
        result[:, ~finite] = np.nan
        if self.split:
            result = result[: len(high)] + 1j * result[len(high) :]
        return result, size, bits

    def _write_columns(
        self,
        y: Float[np.ndarray, "row input frequency"],
        omega: Float[np.ndarray, " frequency"],
        loads: Loads,
        high: Inexact[np.ndarray, "coordinate input _"],
        low: Inexact[np.ndarray, "coordinate input _"] | None,
    ) -> list[tuple[slice, Float[np.ndarray, "_ input frequency"]]]:
        """Write y: v and the constant 1, then these times powers of omega; return low parts."""
        here, y_low = self._fill(y, high, 1.0), np.zeros(0)
        errors = []
        if low is not None:
            y_low = np.empty((here, *y.shape[1:]))
            self._fill(y_low, low, 0.0)
            errors.append((slice(here), y_low))
        for power, columns in loads.powers[1:]:
            where = slice(here, here := here + len(columns))
            which = slice(len(columns)) if columns[-1] == len(columns) - 1 else columns
            factor, factor_low = _power(omega, power)
            y[where], error = two_product(y[which], factor)
            if power == 2:
                error += y[which] * factor_low
            if low is not None:
                error += y_low[which] * factor
            errors.append((where, error))
        return errors

    def _fill(
        self,
        rows: Float[np.ndarray, "row input _"],
        values: Inexact[np.ndarray, "coordinate input frequency"],
        constant: float,
    ) -> int:
        """Write v and a constant, repeating the last frequency; return the number of rows."""
        parts = [np.real(values), np.imag(values)] if self.split else [values]
        total = values.shape[-1]
        for n, part in enumerate(parts):
            rows[n * len(part) : (n + 1) * len(part), :, :total] = part
        count = len(parts) * len(values)
        rows[:count, :, total:] = rows[:count, :, total - 1 : total]
        rows[count] = constant
        return count + 1


def _cut_matrix(
    loads: Loads,
    scale: Float[np.ndarray, "group input 1 column"],
    slices: int,
    bits: int,
) -> tuple[Float[np.ndarray, "group input row _"], Float[np.ndarray, "group input row column"]]:
    """Cut A, whose columns multiply numbers of at most `scale`, into slices side by side.

    Also returns its absolute elements relative to the scale of the error of each row.
    """
    high, low = loads.high, loads.low
    if loads.single:
        high, low = high[:, None], low[:, None]
    magnitude, inner = np.abs(high), high.shape[-1]
    row_scale = _power_of_two((magnitude * scale).max(-1))[..., None]
    result = np.empty((*row_scale.shape[:-1], slices * inner))
    unit, remainder = row_scale / scale, high
    for n in range(slices - 1):
        begun = result[..., n * inner : (n + 1) * inner]
        _cut_to_grid(remainder, unit, bits * (n + 1), begun)
        remainder = remainder - begun
    np.add(remainder, low, out=result[..., -inner:])
    return result, magnitude / row_scale


def _stacked(
    rows: Float[np.ndarray, "row input _"], width: int
) -> Float[np.ndarray, "group input row _"]:
    """View rows as matrices (g, k, n, width) of neighbouring frequencies."""
    return rows.reshape(*rows.shape[:-1], -1, width).transpose(2, 1, 0, 3)


def _power_of_two(values: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Powers of 2 above values, at least 2^`SMALLEST`; 1 for 0."""
    return np.ldexp(1.0, np.maximum(np.frexp(values)[1], SMALLEST))


def _cut_to_grid(
    values: Float[np.ndarray, "*#shape"],
    unit: Float[np.ndarray, "*shape"],
    bits: int,
    out: Float[np.ndarray, "*shape"],
) -> None:
    """Round values of at most `unit`, a power of 2, to multiples of 2^-bits of it."""
    shift = (1.5 * 2.0 ** (52 - bits)) * unit  # its last digit is that of the result
    np.add(values, shift, out=out)
    out -= shift


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
    """Build equations of motion from K, M and C and their low parts."""
    split = any(np.iscomplexobj(part) for part in (*high, *low)) or bool(high[2].any())
    terms = []
    for power, number, factor in ((0, 0, 1.0), (1, 2, 1j if split else 0.0), (2, 1, -1.0)):
        rows = DoubleDouble(
            *(_real_rows(factor * part[number], split=split) for part in (high, low))
        )
        used = ((rows.high != 0) | (rows.low != 0)).any(0)
        if power == 0 or used.any():
            columns = np.flatnonzero(used[6:] | (power == 0))
            terms.append((power, columns, rows[:, 6 + columns], rows[:, :6]))
    return Equations(tuple(terms), split)


def _real_rows(
    matrix: Inexact[np.ndarray, "coordinate 6+coordinate"], *, split: bool
) -> Float[np.ndarray, "row column"]:
    """Write a complex matrix (c, 6 + c) on (s, v), with s real, as real rows."""
    if not split:
        return np.real(matrix)
    real, imag = np.real(matrix), np.imag(matrix)
    return np.block([[real, -imag[:, 6:]], [imag, real[:, 6:]]])
