"""Riccati equations of regulators and observers, with and without a bound (see `optimal_loops`)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.physics.modal_plants import ScaledPlant

if TYPE_CHECKING:
    from jaxtyping import Float


CLOSER = 1.1
"""Ratio of two bounds gamma, of which one is possible and one is not, that ends their bisection."""
RIGHT = 1e-8
"""Largest relative residual of a solution of a Riccati equation."""
LARGEST = 1e4
"""Largest gamma that is tried, over a lower limit of it."""


@dataclass(frozen=True)
class RiccatiSolutions:
    """Solutions X and Y of both Riccati equations for a bound gamma."""

    x: Float[np.ndarray, "state state"]
    y: Float[np.ndarray, "state state"]
    bound: float


def bound_all(
    plant: ScaledPlant,
    x: Float[np.ndarray, "state state"],
    y: Float[np.ndarray, "state state"],
    weights: tuple[float, float],
    bounds: Sequence[float],
) -> Iterator[RiccatiSolutions | None]:
    """Solve for each gamma, over the smallest possible one, from X and Y without a bound."""
    if list(bounds) == [math.inf]:
        yield RiccatiSolutions(x, y, math.inf)
        return
    smallest = find_smallest_bound(plant, x, y, weights)
    for ratio in bounds:
        yield None if smallest is None else _solve_bounded(plant, weights, ratio * smallest)


def find_smallest_bound(
    plant: ScaledPlant,
    x: Float[np.ndarray, "state state"],
    y: Float[np.ndarray, "state state"],
    weights: tuple[float, float],
) -> float | None:
    """Find the smallest gamma by bisection; None if its equations have no accurate solution.

    X and Y grow as gamma falls, and the spectral radius of X Y has to be below gamma^2: with those
    without a bound that gives a gamma that is too small.
    """
    low = math.sqrt(np.abs(np.linalg.eigvals(x @ y)).max())
    high = 2 * low
    largest = LARGEST * low
    while _solve_bounded(plant, weights, high) is None:
        low = high
        high *= 2
        if high > largest:
            return None
    while high > CLOSER * low:
        middle = math.sqrt(low * high)
        if _solve_bounded(plant, weights, middle) is None:
            low = middle
        else:
            high = middle
    return high


def _solve_bounded(
    plant: ScaledPlant, weights: tuple[float, float], bound: float
) -> RiccatiSolutions | None:
    """Solve both equations for a gamma; None if it is too small."""
    x = solve_riccati(plant.a, plant.b, weights[0], bound)
    if x is None:
        return None
    y = solve_riccati(plant.a.T, plant.c, weights[1], bound)
    if y is None or np.abs(np.linalg.eigvals(x @ y)).max() >= bound**2:
        return None
    return RiccatiSolutions(x, y, bound)


def solve_riccati(
    a: Float[np.ndarray, "state state"],
    b: Float[np.ndarray, " state"],
    weight: float,
    bound: float = math.inf,
) -> Float[np.ndarray, "state state"] | None:
    """Solve A' X + X A - X (B B' / weight - 1 / bound^2) X + 1 = 0 for a stabilising X > 0.

    Of a Kalman filter, with the transposed matrices. None if there is none, or it is not accurate.
    """
    from scipy.linalg import solve_continuous_are

    one = np.eye(len(a))
    drive = b[:, None]
    cost = np.array([[weight]])
    if bound < math.inf:
        drive = np.hstack([drive, one])
        cost = np.diag([weight, *np.full(len(a), -(bound**2))])
    try:
        found = solve_continuous_are(a, drive, one, cost)
    except (np.linalg.LinAlgError, ValueError):
        return None
    by_force = (found @ b)[:, None] * (found @ b) / weight
    quadratic = by_force - found @ found / bound**2
    residual = a.T @ found + found @ a - quadratic + one
    if not np.abs(residual).max() <= RIGHT * np.abs(by_force).max():
        return None
    if not (np.linalg.eigvalsh(found) > 0).all():
        return None
    return found
