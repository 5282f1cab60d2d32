"""Bounded least squares for many residuals and few unknowns.

Damped Gauss-Newton steps (Marquardt, J. SIAM 11, 431 (1963)) from the normal equations of scaled
unknowns. An unknown at a bound stays there while its gradient points outwards.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from suspension_cli.analyses.fit.array_types import Unknowns

LARGEST_DAMPING = 1e12


def minimise(
    residual: Callable[[Array], Array],
    jacobian: Callable[[Array], Array],
    start: Unknowns,
    scale: Unknowns,
    bounds: tuple[Array, Array],
    *,
    tolerance: float = 1e-5,
    relative: float = 1e-8,
    steps: int = 60,
) -> tuple[Unknowns, float]:
    """Minimise the sum of squares of residuals; return the unknowns and the sum.

    Parameters
    ----------
    residual, jacobian
        From the unknowns (P,) to residuals (r,) and their derivatives (r, P). After an `InputError`
        of `residual` the step is shortened.
    tolerance, relative
        Decrease of the sum of squares, absolute and relative, below which the search ends.
    steps
        Most Gauss-Newton steps.
    """
    low, high = bounds
    x = np.clip(start, low, high)
    rest = residual(x)
    cost, damping = float(rest @ rest), 1e-4
    for _ in range(steps):
        slope = jacobian(x) * scale
        normal, gradient = slope.T @ slope, slope.T @ rest
        free = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
        diagonal = np.diag(normal).copy()
        diagonal[diagonal <= 0] = 1.0
        better, new, found, reached, expected = False, x, rest, cost, 0.0
        while damping < LARGEST_DAMPING:
            left = normal + np.diag(damping * diagonal + 1e-14 * diagonal.max(initial=0.0))
            step = np.zeros(len(x))
            step[free] = -np.linalg.solve(left[np.ix_(free, free)], gradient[free])
            expected = -float(2 * gradient @ step + step @ normal @ step)
            new = np.clip(x + step * scale, low, high)
            try:
                found = residual(new)
                reached = float(found @ found)
            except (InputError, np.linalg.LinAlgError):
                reached = np.inf
            if reached < cost:
                better = True
                break
            if expected < tolerance + relative * cost:
                break
            damping = max(10 * damping, 1e-6)
        if not better:
            break
        gained = cost - reached
        x, rest, cost = new, found, reached
        damping = max(damping / 5, 1e-10)
        if max(gained, expected) < tolerance + relative * cost:
            break
    return x, cost
