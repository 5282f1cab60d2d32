"""Residuals of the equations of motion of a block in double-double arithmetic.

The rounding errors of a solution v of D v = b follow from its residual b - D v, a small difference
of large terms that needs more digits than the solution has (Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed., chapter 12). Each double is cut into two halves of 26 bits,
a = a1 + a2, so that

    a b = a1 b1 + (a1 b2 + a2 b1 + a2 b2),

where each product on the right is exact. The first, the largest by 2^26, is summed in
double-double; the others likewise (`fine`) or, three times as fast, in doubles, with an error of
2^-80 of the terms.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.linear.double_double import DoubleDouble, cut, summed, two_product, two_sum
from suspension_cli.scene.arrays import Array


@dataclass(frozen=True)
class Elements:
    """Elements of each row of a matrix in double-double; arrays (w, r) or (w, r, 1, f).

    Attributes
    ----------
    column : (w, r) int array
        Columns of the w elements of each of r rows.
    high, low : arrays
        Doubles, and their low parts.
    upper, lower : arrays
        Halves of `high`.
    """

    column: Any
    high: Any
    upper: Any
    lower: Any
    low: Any

    @staticmethod
    def of(column: Any, high: Any, low: Any) -> Elements:
        """Cut the doubles of elements into halves."""
        upper = cut(high)
        return Elements(column, high, upper, high - upper, low)


@dataclass(frozen=True)
class Loads:
    """Right-hand sides b of k inputs, as polynomials in omega.

    Attributes
    ----------
    terms : tuple of (int, DoubleDouble)
        Power of omega and its coefficients (r, k).
    """

    terms: tuple[tuple[int, DoubleDouble], ...]

    def some(self, which: Any) -> Loads:
        """Select inputs."""
        return Loads(tuple((power, value[:, which]) for power, value in self.terms))


@dataclass(frozen=True)
class Equations:
    """Equations of motion D v = b of a block, D = K + i omega C - omega^2 M, as r real rows.

    Complex equations become rows of real and of imaginary parts.

    Attributes
    ----------
    high, low : tuples of (r, 6 + r) arrays
        Coefficients of 1, omega and omega^2 towards the support and the coordinates, and their low
        parts.
    constant : (r, r) bool array
        Whether each element of D is independent of frequency.
    split : bool
        Whether v is complex.
    fixed : Elements
        Elements of D that do not depend on frequency.
    column : (w, r) int array
        Columns of the others.
    coefficients : tuple of (int, (w, r, 1, 1) array, (w, r, 1, 1) array)
        Power of omega in these, and its coefficients in double-double.
    upper, remainder : (r, r) arrays
        Upper halves of the elements that do not depend on frequency, and the rest of these.
    """

    high: tuple[Any, Any, Any]
    low: tuple[Any, Any, Any]
    constant: Any
    split: bool
    fixed: Elements
    column: Any
    coefficients: tuple[tuple[int, Any, Any], ...]
    upper: Any
    remainder: Any

    def loads(self, moves: Any, forces: Any) -> Loads:
        """Compute right-hand sides b = f - E s for support motions (6, k) and forces (c, k)."""
        forces = np.concatenate([forces.real, forces.imag]) if self.split else forces.real
        terms = []
        for power, (high, low) in enumerate(zip(self.high, self.low, strict=True)):
            value = -(DoubleDouble(high[:, :6], low[:, :6]) @ DoubleDouble.of(moves))
            if power == 0:
                value = DoubleDouble.of(forces) + value
            if value.high.any() or value.low.any():
                terms.append((power, value))
        return Loads(tuple(terms))

    def at(self, omega: Array) -> Elements:
        """Evaluate the frequency-dependent elements of D at frequencies (f,), rad/s."""
        (_, high, low), *others = self.coefficients
        for power, factor, factor_low in others:
            omegas, omegas_low = _power(omega, power)
            product, error = two_product(factor, omegas)
            error += factor * omegas_low + factor_low * omegas
            high, rounding = two_sum(high, product)
            low = low + (rounding + error)
        return Elements.of(self.column, high, low)

    def residual(
        self,
        omega: Array,
        varying: Elements,
        loads: Loads,
        high: Any,
        low: Any = None,
        *,
        fine: bool,
    ) -> Any:
        """Compute the residual b - D v (c, k, f), rounded once.

        Parameters
        ----------
        omega : (f,) array
            rad/s.
        varying : Elements
            From `at`, for these frequencies.
        loads : Loads
            Of k inputs; or, if k = 1, of f inputs, one per frequency.
        high, low : (c, k, f) arrays
            v in double-double; without `low`, in doubles.
        fine : bool
            Whether to sum all products in double-double.
        """
        count = len(high)
        if self.split:
            high = np.concatenate([high.real, high.imag])
            low = None if low is None else np.concatenate([low.real, low.imag])
        upper = cut(high)
        lower = high - upper
        halves = ("upper", upper), ("lower", lower)
        products = [(n, part) for n, _ in halves for _, part in halves] if fine else [halves[0]]
        parts = (self.fixed, varying)
        width = sum(len(each.column) for each in parts)
        places = len(products) * width
        terms = np.empty((places + len(loads.terms), *high.shape))
        start = 0
        for name, half in products:
            for each in parts:
                term = terms[start : (start := start + len(each.column))]
                np.take(half, each.column, axis=0, out=term, mode="clip")
                term *= getattr(each, name)
        low_sum = np.zeros_like(high)
        for place, (power, value) in enumerate(loads.terms, places):
            _add_load(terms[place], low_sum, value, _power(omega, power))
        if fine:
            remainder = np.zeros_like(high) if low is None else low
            low_sum += _multiply(self.fixed_high, remainder) + _multiply(self.fixed_low, high)
            corrections = (varying.high, remainder), (varying.low, high)
        else:
            remainder = lower if low is None else lower + low
            low_sum += _multiply(self.upper, remainder)
            low_sum += _multiply(self.remainder, high)
            corrections = (varying.upper, remainder), (varying.lower + varying.low, high)
        for factor, part in corrections:
            for n, column in enumerate(varying.column):
                low_sum += factor[n] * part[column]
        total = summed(terms)
        result = -(total.high + (total.low + low_sum))
        return result[:count] + 1j * result[count:] if self.split else result

    @property
    def fixed_high(self) -> Any:
        """Elements of D that do not depend on frequency, in doubles (r, r)."""
        return np.where(self.constant, self.high[0][:, 6:], 0.0)

    @property
    def fixed_low(self) -> Any:
        """Low parts of these (r, r)."""
        return np.where(self.constant, self.low[0][:, 6:], 0.0)


def _power(omega: Array, power: int) -> tuple[Any, Any]:
    """Raise omega to a power of 0, 1 or 2 in double-double."""
    return two_product(omega, omega) if power == 2 else (omega if power else np.ones(()), 0.0)


def _add_load(term: Any, small: Any, value: DoubleDouble, omegas: tuple[Any, Any]) -> None:
    """Set a term (r, k, f) to -value omegas, and add its low part to `small`."""
    high, low = value.high, value.low
    if term.shape[1] == 1 and high.shape[1] == term.shape[2]:
        high, low = high[:, None], low[:, None]
    else:
        high, low = high[..., None], low[..., None]
    power, power_low = omegas
    if power.ndim == 0:
        term[:] = -high
        small -= low
        return
    product, error = two_product(high, power)
    term[:] = -product
    small -= error + (high * power_low + low * power)


def _multiply(matrix: Any, columns: Any) -> Any:
    """Multiply (r, n) by (n, k, f): (r, k, f)."""
    return (matrix @ columns.reshape(len(columns), -1)).reshape(-1, *columns.shape[1:])


def equations(high: tuple[Any, Any, Any], low: tuple[Any, Any, Any]) -> Equations:
    """Build equations of motion from K, M and C (c, 6 + c) and their low parts."""
    split = any(np.iscomplexobj(part) for part in (*high, *low)) or bool(high[2].any())
    factors = 1.0, -1.0, (1j if split else 0.0)
    (rows, rows_low), (mass, mass_low), (damping, damping_low) = (
        tuple(_real_rows(factor * part, split=split) for part in fixed_elements)
        for factor, *fixed_elements in zip(factors, high, low, strict=True)
    )
    polynomial, polynomial_low = (rows, damping, mass), (rows_low, damping_low, mass_low)
    nonzero = [part[:, 6:] != 0 for part in (*polynomial, *polynomial_low)]
    constant = ~(nonzero[1] | nonzero[2] | nonzero[4] | nonzero[5])
    used = nonzero[0] | nonzero[3]
    column = _used_columns(used & constant)
    fixed, fixed_low = (np.where(constant, part[:, 6:], 0.0) for part in (rows, rows_low))
    upper = cut(fixed)
    varying = _used_columns(~constant)
    coefficients = [
        (
            power,
            *(
                _select(part[power][:, 6:], varying, ~constant)
                for part in (polynomial, polynomial_low)
            ),
        )
        for power in range(3)
        if power == 0 or nonzero[power].any() or nonzero[3 + power].any()
    ]
    fixed_elements = [_select(part, column, used & constant) for part in (fixed, fixed_low)]
    return Equations(
        polynomial,
        polynomial_low,
        constant,
        split,
        Elements.of(column, fixed_elements[0], fixed_elements[1]),
        varying,
        tuple(coefficients),  # pyright: ignore[reportArgumentType]
        upper,
        (fixed - upper) + fixed_low,
    )


def _select(matrix: Any, column: Any, used: Any) -> Any:
    """Select elements (w, r, 1, 1) of each row in columns (w, r), 0 where not used."""
    part = np.take_along_axis(np.where(used, matrix, 0.0), column.T, 1)
    return np.ascontiguousarray(part.T)[..., None, None]


def _used_columns(used: Any) -> Any:
    """List columns (w, r) of the used elements of each row, padded with other columns."""
    width = int(used.sum(1).max(initial=0))
    return np.ascontiguousarray(np.argsort(~used, axis=1, kind="stable")[:, :width].T)


def _real_rows(matrix: Any, *, split: bool) -> Any:
    """Write a complex matrix (c, 6 + c) on (s, v), with s real, as real rows."""
    if not split:
        return np.real(matrix)
    real, imag = np.real(matrix), np.imag(matrix)
    return np.block([[real, -imag[:, 6:]], [imag, real[:, 6:]]])
