"""Analytic functions of up to three numbers, from their values at few points.

>>> import numpy as np
>>> box = Box((0.0, 1.0), (2.0, 3.0), (False, False))
>>> found = interpolate(lambda p: np.exp(p[:, :1] * p[:, 1:]), box, most=400)
>>> grid = found.on_grid([np.array([0.3]), np.array([1.5, 2.0])])
>>> bool(np.allclose(grid[0, :, 0], np.exp([0.45, 0.6]), rtol=1e-9))
True

Equilibria, matrices, and responses times the determinant of the dynamic stiffness are analytic in
the numbers of a design, so their Chebyshev coefficients fall geometrically: few points determine a
map to many digits (Trefethen, Approximation Theory and Approximation Practice (2013), chapters 3
and 8). The points are those of Chebyshev of the second kind, cos(pi j / n), which are among those
of 2 n: an axis is refined without losing what is known. The axis whose last coefficients are
largest is refined first, until those of all axes are below `SMALL` of the largest value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    Sample = Callable[[Float[np.ndarray, "point axis"]], Inexact[np.ndarray, "point function"]]
    """Values of functions at points of the box; NaN where one has none."""

SMALL = 1e-9
"""Last coefficients over the largest value of a function, below which it is known."""
FIRST = 4
"""Intervals between the points of each axis at first."""
LAST = 2
"""Number of last coefficients that must be small: functions that are even or odd have others."""


@dataclass(frozen=True)
class Box:
    """The least and largest values of each number, and whether its logarithm is interpolated."""

    low: tuple[float, ...]
    high: tuple[float, ...]
    logarithmic: tuple[bool, ...]

    def place(self, axis: int, value: Float[np.ndarray, " point"]) -> Float[np.ndarray, " point"]:
        """Places from -1 to 1 of values of a number."""
        low = self.low[axis]
        high = self.high[axis]
        if self.logarithmic[axis]:
            low, high, value = np.log(low), np.log(high), np.log(value)
        return (2 * value - low - high) / (high - low)

    def value(self, axis: int, place: Float[np.ndarray, " point"]) -> Float[np.ndarray, " point"]:
        """Values of a number at places from -1 to 1; exactly the ends at -1 and 1."""
        low = self.low[axis]
        high = self.high[axis]
        if self.logarithmic[axis]:
            inner = low * (high / low) ** ((1 + place) / 2)
        else:
            inner = low + (high - low) * (1 + place) / 2
        return np.where(place == -1, low, np.where(place == 1, high, inner))


@dataclass(frozen=True)
class Surface:
    """Chebyshev series of some functions over a box.

    Attributes
    ----------
    coefficient
        One axis per number, then the functions.
    points
        Number of points at which the functions were computed.
    """

    box: Box
    coefficient: Inexact[np.ndarray, "*axes function"]
    points: int

    def on_grid(
        self, values: Sequence[Float[np.ndarray, " value"]]
    ) -> Inexact[np.ndarray, "*axes function"]:
        """Evaluate the functions on the grid of these values of the numbers."""
        used = np.asarray(self.coefficient.any(tuple(range(len(values)))))
        found = self.coefficient[..., used]
        for axis, own in enumerate(values):
            found = np.moveaxis(
                np.tensordot(self._polynomials(axis, own), found, (1, axis)), 0, axis
            )
        result = np.zeros((*found.shape[:-1], len(used)), found.dtype)
        result[..., used] = found
        return result

    def at(self, points: Float[np.ndarray, "point axis"]) -> Inexact[np.ndarray, "point function"]:
        """Evaluate the functions at single points."""
        result = np.tensordot(self._polynomials(0, points[:, 0]), self.coefficient, (1, 0))
        for axis in range(1, points.shape[1]):
            here = self._polynomials(axis, points[:, axis])
            result = np.einsum("pk,pk...->p...", here, result)
        return result

    def with_expected_error(self, axis: int) -> Surface:
        """Add the error that the last coefficients of an axis let expect.

        A term a T_(n+1) that n intervals do not resolve is taken for a T_(n-1); a is estimated by
        the larger of the last two coefficients.
        """
        coefficient = np.moveaxis(self.coefficient, axis, 0)
        last = coefficient[-LAST:]
        missed = np.where(np.abs(last[0]) > np.abs(last[1]), last[0], last[1])
        wider = np.concatenate([coefficient, missed[None]])
        wider[-3] -= missed
        return replace(self, coefficient=np.moveaxis(wider, 0, axis))

    def _polynomials(
        self, axis: int, values: Float[np.ndarray, " value"]
    ) -> Float[np.ndarray, "value degree"]:
        place = self.box.place(axis, np.asarray(values, dtype=float))
        degree = self.coefficient.shape[axis] - 1
        return np.polynomial.chebyshev.chebvander(place, degree)


def interpolate(
    sample: Sample, box: Box, most: int, least: Float[np.ndarray, " function"] | float = 0.0
) -> Surface | None:
    """Interpolate functions over a box, from at most so many of their values.

    Errors of functions that are nowhere larger than `least` are relative to this size. Returns None
    if they need more values, or if one has none at a point.
    """
    axes = len(box.low)
    intervals = [FIRST] * axes
    known: dict[tuple[float, ...], np.ndarray] = {}
    while True:
        places = [nodes(count) for count in intervals]
        every = list(product(*places))
        new = [place for place in every if place not in known]
        if len(known) + len(new) > most:
            return None
        columns = np.array(new).T
        points = np.stack([box.value(n, own) for n, own in enumerate(columns)], axis=1)
        found = sample(points)
        if not np.isfinite(found).all():
            return None
        known.update(zip(new, found, strict=True))
        shape = tuple(count + 1 for count in intervals)
        values = np.array([known[place] for place in every]).reshape(*shape, -1)
        coefficient = coefficients(values)
        tails = _tails(coefficient, least)
        worst = int(np.argmax(tails))
        if tails[worst] <= SMALL:
            return Surface(box, coefficient, len(known))
        intervals[worst] *= 2


def nodes(intervals: int) -> list[float]:
    """Chebyshev points of the second kind, descending; the same numbers among those of twice as
    many intervals.

    >>> nodes(2)
    [1.0, 0.0, -1.0]
    """
    angle = np.arange(intervals + 1) / intervals
    # sin of an angle that is 0 in the middle: exactly symmetric
    return np.sin(np.pi * (0.5 - angle)).tolist()


def coefficients(
    values: Inexact[np.ndarray, "*axes function"],
) -> Inexact[np.ndarray, "*axes function"]:
    """Chebyshev coefficients of functions from their values at the nodes of each axis."""
    result = values
    for axis in range(values.ndim - 1):
        count = values.shape[axis] - 1
        angle = np.pi * np.arange(count + 1) / count
        weight = np.cos(angle[:, None] * np.arange(count + 1)[None, :]) * (2 / count)
        weight[:, [0, -1]] /= 2  # of the end points
        weight[[0, -1]] /= 2  # of the first and last coefficient
        result = np.moveaxis(np.tensordot(weight, result, (1, axis)), 0, axis)
    return result


def _tails(
    coefficient: Inexact[np.ndarray, "*axes function"],
    least: Float[np.ndarray, " function"] | float,
) -> Float[np.ndarray, " axis"]:
    """Last coefficients of each axis over the largest ones, of the function where they matter most.

    Over `least` of functions that are smaller.
    """
    size = np.abs(coefficient)
    axes = tuple(range(size.ndim - 1))
    largest = np.maximum(size.max(axes), least)
    scale = np.where(largest > 0, largest, 1.0)
    result = []
    for axis in axes:
        last = np.take(size, np.arange(-LAST, 0), axis=axis)
        result.append(float((last.max(axes) / scale).max()))
    return np.array(result)
