"""Complementary filters of two sensors, optimal in the sense of H-infinity.

Two sensors of one motion with the noises n1 and n2 (spectra) are blended as K y1 + (1 - K) y2. With
r = |n1 / n2| the filter minimises the largest value, over all frequencies, of

    |K|^2 r^2 + |1 - K|^2 / r^2,

in which each sensor may be as loud as the other one, where that is the quieter (Dehaeze, Verma and
Collette, MEDYNA (2020), arXiv:2111.14355). With stable filters of magnitude r and 1/r and white
noises w1 and w2 this is the estimation of e = w2 / r from y = r w1 - w2 / r,

    x' = A x + B w,    y = C x + D w,    e = C_e x + D_e w.

The part K_0 = -D_e D' (D D')^-1 of y makes the direct noise of the error orthogonal to D. What is
left of e has C_0 = C_e + K_0 C and D_0 = D_e + K_0 D, and with S = B (D', D_0') and the variances
R = diag(D D', D_0 D_0' - gamma^2) the H-infinity filter for a bound gamma follows from the
stabilising solution of

    A Y + Y A' + B B' - (Y (C', C_0') + S) R^-1 (Y (C', C_0') + S)' = 0

as K = K_0 - C_0 (s - A + L C)^-1 L with L = (Y C' + B D') (D D')^-1 (Hassibi, Sayed and Kailath,
Indefinite-Quadratic Estimation and Control, 1999, chapter 16). It exists if Y >= 0.

>>> flat = np.ones(3)
>>> found = solve(np.array([0.1, 1.0, 10.0]), flat, flat, order=1)
>>> round(abs(found.filter.at(1.0)), 6), round(found.bound, 2)
(0.5, 0.71)
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.foton import Filter

if TYPE_CHECKING:
    from jaxtyping import Float

ABOVE = 1.0005
"""gamma of a filter over the smallest possible one, next to which it has poles without bound."""
CLOSER = 1.00005
"""Ratio of two bounds gamma, of which one is possible and one is not, that ends their bisection."""
LEAST, LARGEST = 1e-3, 1e6
"""Smallest and largest gamma that is tried."""
RIGHT = 1e-6
"""Largest relative residual of a solution of a Riccati equation."""
RANGES = (1e3, 300.0, 100.0, 30.0, 10.0)
"""Largest ratios of noises that are tried: far beyond, zeros and poles have too few digits."""
KEPT = 1e-3
"""Largest relative excess over the bound by rounding of zeros and poles."""
FAR = 1e3
"""Frequency of a zero over that of the highest pole from which it is left out."""
CHECKED = 1000
"""Frequencies at which that is checked, from a decade below the noises to one above."""
SAME = 1e-3
"""Logarithm of the ratio of a zero and a pole of a fit below which they cancel."""


@dataclass(frozen=True)
class Blend:
    """Complementary filters K and 1 - K of two sensors.

    Attributes
    ----------
    filter, of_first
        K or 1 - K, and whether it is that of the first sensor. The other sensor gets the rest.
    bound
        Largest value of the square root of |K|^2 r^2 + |1 - K|^2 / r^2 that is possible with it.
    misfit
        Largest relative error of the fit of the ratio of the noises.
    largest
        Where the ratio of the noises, or its inverse, is larger, it counts as this.
    """

    filter: Filter
    of_first: bool
    bound: float
    misfit: float = 0.0
    largest: float = math.inf


def solve(
    frequency: Float[np.ndarray, " frequency"],
    first: Float[np.ndarray, " frequency"],
    second: Float[np.ndarray, " frequency"],
    order: int,
) -> Blend | None:
    """Find complementary filters of two sensors from their noise at frequencies in Hz.

    The ratio of the noises is fitted with `order` zeros and poles; K has up to twice as many. Of
    the `RANGES` the first one counts whose filters are right as zeros and poles, too. None if
    there is none.
    """
    ratio = first / second
    wide = np.geomspace(frequency[0] / 10, 10 * frequency[-1], CHECKED)
    for largest in RANGES:
        wanted = np.clip(ratio, 1 / largest, largest)
        fitted, misfit = fit_ratio(frequency, wanted, order)
        for found in blend(fitted):
            reached = evaluate(found, np.abs(fitted.at(wide)), wide).max()
            if reached <= found.bound * (1 + KEPT):
                return replace(found, misfit=misfit, largest=largest)
    return None


def blend(ratio: Filter) -> Iterator[Blend]:
    """Find K, and 1 - K, for a ratio of noises with zeros and poles in the left half plane."""
    problem = _Estimation.of(ratio)
    smallest = _find_smallest_bound(problem)
    if smallest is None:
        return
    bound = ABOVE * smallest
    y = problem.solve(bound)
    if y is None:
        return
    for of_first in (True, False):
        made = problem.make_filter(y, of_first=of_first)
        if all(pole.real > 0 for pole in made.poles):
            yield Blend(made, of_first, bound)


def evaluate(
    found: Blend, ratio: Float[np.ndarray, " frequency"], frequency: Float[np.ndarray, " frequency"]
) -> Float[np.ndarray, " frequency"]:
    """Evaluate the square root of |K|^2 r^2 + |1 - K|^2 / r^2 at frequencies in Hz."""
    one = found.filter.at(frequency)
    k, rest = (one, 1 - one) if found.of_first else (1 - one, one)
    return np.hypot(np.abs(k) * ratio, np.abs(rest) / ratio)


def fit_ratio(
    frequency: Float[np.ndarray, " frequency"], ratio: Float[np.ndarray, " frequency"], order: int
) -> tuple[Filter, float]:
    """Fit a magnitude with a filter of real zeros and poles; return it with the largest error.

    Least squares of the logarithm; the start has equal zeros and poles over the range.
    """
    from scipy.optimize import least_squares

    wanted = np.log(ratio)
    places = np.geomspace(frequency[0], frequency[-1], order + 2)[1:-1]
    start = np.log(np.concatenate([places, places]))
    square = frequency[:, None] ** 2

    def shape(roots: Float[np.ndarray, " root"]) -> Float[np.ndarray, " frequency"]:
        each = 0.5 * np.log(square + np.exp(2 * roots))
        return each[:, :order].sum(1) - each[:, order:].sum(1)

    def residual(roots: Float[np.ndarray, " root"]) -> Float[np.ndarray, " frequency"]:
        difference = shape(roots) - wanted
        return difference - difference.mean()

    wide = np.log(1e3)
    limits = np.log(frequency[0]) - wide, np.log(frequency[-1]) + wide
    found = least_squares(residual, start, bounds=limits).x
    gain = math.exp(float((wanted - shape(found)).mean()))
    misfit = float(np.abs(np.expm1(residual(found))).max())
    zeros = sorted(found[:order])
    poles = sorted(found[order:])
    kept = [(z, p) for z, p in zip(zeros, poles, strict=True) if abs(z - p) > SAME]
    own_zeros = tuple(complex(math.exp(z)) for z, _ in kept)
    own_poles = tuple(complex(math.exp(p)) for _, p in kept)
    return Filter(gain, own_zeros, own_poles), misfit


@dataclass(frozen=True)
class _Estimation:
    """What is estimated, in units of time of the mean pole; see the start of this module.

    `hertz` is the frequency that a pole of 1 stands for.
    """

    a: Float[np.ndarray, "state state"]
    b: Float[np.ndarray, "state 2"]
    c: Float[np.ndarray, " state"]
    d: Float[np.ndarray, " 2"]
    c_0: Float[np.ndarray, " state"]
    d_0: Float[np.ndarray, " 2"]
    k_0: float
    hertz: float

    @staticmethod
    def of(ratio: Filter) -> _Estimation:
        """Set up the estimation for a ratio of noises."""
        from scipy.linalg import block_diag

        roots = np.abs([*ratio.zeros, *ratio.poles])
        hertz = float(np.exp(np.log(roots).mean())) if len(roots) else 1.0
        zeros = np.real(ratio.zeros) / hertz
        poles = np.real(ratio.poles) / hertz
        a_1, b_1, c_1 = _cascade(zeros, poles)
        a_2, b_2, c_2 = _cascade(poles, zeros)
        states = len(poles)
        gain = ratio.gain
        a = np.asarray(block_diag(a_1, a_2)).reshape(2 * states, 2 * states)
        b = np.zeros((2 * states, 2))
        b[:states, 0] = b_1
        b[states:, 1] = b_2
        c = np.concatenate([gain * c_1, -c_2 / gain])
        c_e = np.concatenate([0 * c_1, c_2 / gain])
        d = np.array([gain, -1 / gain])
        d_e = np.array([0.0, 1 / gain])
        k_0 = float(-(d_e @ d) / (d @ d))
        return _Estimation(a, b, c, d, c_e + k_0 * c, d_e + k_0 * d, k_0, hertz)

    def solve(self, bound: float) -> Float[np.ndarray, "state state"] | None:
        """Solve for Y with a bound gamma; None if it is too small, or Y is not accurate."""
        from scipy.linalg import solve_continuous_are

        left = bound**2 - self.d_0 @ self.d_0
        if left <= 0:
            return None
        states = len(self.a)
        if not states:
            return np.zeros((0, 0))
        sensed = np.stack([self.c, self.c_0], axis=1)
        cross = self.b @ np.stack([self.d, self.d_0], axis=1)
        variance = np.diag([self.d @ self.d, -left])
        square = self.b @ self.b.T
        try:
            y = solve_continuous_are(self.a.T, sensed, square, variance, s=cross)
        except (np.linalg.LinAlgError, ValueError):
            return None
        gain = y @ sensed + cross
        terms = [self.a @ y, y @ self.a.T, square, -gain @ np.linalg.solve(variance, gain.T)]
        size = max(np.abs(term).max() for term in terms)
        if not np.abs(sum(terms)).max() <= RIGHT * size:
            return None
        if np.linalg.eigvalsh(y).min() < -RIGHT * np.abs(y).max():
            return None
        return y

    def make_filter(self, y: Float[np.ndarray, "state state"], *, of_first: bool) -> Filter:
        """Make the filter K or 1 - K from Y; its zeros are the poles of its inverse."""
        gain = (y @ self.c + self.b @ self.d) / (self.d @ self.d)
        a = self.a - np.outer(gain, self.c)
        direct = self.k_0 if of_first else self.k_0 - 1
        zeros = _as_roots(a + np.outer(gain, self.c_0) / direct, self.hertz)
        poles = _as_roots(a, self.hertz)
        highest = FAR * max(map(abs, poles), default=1.0)
        far = [zero for zero in zeros if abs(zero) > highest]
        size = abs(direct) * math.prod(map(abs, far))
        return Filter(size, tuple(zero for zero in zeros if zero not in far), poles)


def _as_roots(a: Float[np.ndarray, "state state"], hertz: float) -> tuple[complex, ...]:
    """Eigenvalues as roots in Hz, positive in the left half plane; pairs exactly conjugate."""
    roots = -np.linalg.eigvals(a) * hertz
    real = [complex(one.real) for one in roots if one.imag == 0]
    pairs = [(one, one.conjugate()) for one in roots.tolist() if one.imag > 0]
    return (*real, *(one for pair in pairs for one in pair))


def _cascade(
    zeros: Float[np.ndarray, " root"], poles: Float[np.ndarray, " root"]
) -> tuple[
    Float[np.ndarray, "state state"], Float[np.ndarray, " state"], Float[np.ndarray, " state"]
]:
    """Realise the product of (s + z) / (s + p) as sections in series, each with the gain 1.

    A section is x' = -p x + u, y = (z - p) x + u.
    """
    count = len(poles)
    a = np.diag(-poles)
    steps = zeros - poles
    for n in range(count):
        a[n, :n] = steps[:n]
    return a, np.ones(count), steps


def _find_smallest_bound(problem: _Estimation) -> float | None:
    """Find the smallest gamma by bisection."""
    low = max(math.sqrt(problem.d_0 @ problem.d_0), LEAST)
    high = max(1.0, 2 * low)
    while problem.solve(high) is None:
        low = high
        high *= 2
        if high > LARGEST:
            return None
    while high > CLOSER * low:
        middle = math.sqrt(low * high)
        if problem.solve(middle) is None:
            low = middle
        else:
            high = middle
    return high
