"""Peaks of frequency responses, however narrow, between the points of a grid.

Around every mode and every local maximum on the grid, the interval that contains the peak is
narrowed until the response is flat within it, or to rounding. A response that still varies within
that has a pole without loss there: its peak is infinite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes, response
from suspension_cli.linear.response import Peaks, Response
from suspension_cli.linear.signals import Signal
from suspension_cli.linear.system import LinearSystem
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

Solve = Callable[[Array], "Inexact[np.ndarray, 'frequency output input']"]
"""Responses (f, o, i) at frequencies (f,) in Hz."""

POINTS = 17
"""Frequencies per bracket and step; each step divides the width of the bracket by 8."""
WIDTH = 2e-3
"""Relative half width of the bracket around a mode."""
NARROWEST = 1e-13
"""Relative width of a bracket at which the refinement ends: enough for a Q of about 1e12."""
FLAT = 1e-7
"""Relative variation of all responses within a bracket at which the refinement ends."""
STEEP = 2.0
"""Ratio of the largest to the smallest value on the narrowest bracket of an infinite peak."""


def find_peaks(
    model: LinearSystem,
    answer: Response,
    inputs: list[Signal],
    outputs: list[Signal],
    solve: Solve | None = None,
    resonances: Array | None = None,
) -> Peaks:
    """Find the largest magnitude of every response within the band of its grid.

    `solve` and `resonances` (Hz) replace the responses and the modes of the model.
    """
    if solve is None:
        solve = lambda at: response.solve(model, at, inputs, outputs).value  # noqa: E731
    if resonances is None:
        resonances = eigenmodes.solve(model.constant).frequency
    size = np.abs(answer.value)
    top = size.argmax(0)
    best, where = np.take_along_axis(size, top[None], 0)[0], answer.frequency[top]
    scale = np.where(best > 0, best, 1.0)
    low, high = _brackets(resonances, answer.frequency, (size / scale).max((1, 2)))
    fraction = np.linspace(0.0, 1.0, POINTS)
    while len(low):
        at = low[:, None] + (high - low)[:, None] * fraction
        value = _magnitudes(solve, at)
        if value is None:
            break
        flat, reached = value.reshape(-1, *best.shape), value.max((0, 1))
        better = reached > best
        where = np.where(better, at.ravel()[flat.argmax(0)], where)
        best = np.maximum(best, reached)
        peak = (value / scale).max((2, 3)).argmax(1)
        done, top, least = high - low <= NARROWEST * high, value.max(1), value.min(1)
        infinite = done[:, None, None] & (top > STEEP * least) & (top >= best)
        best = np.where(infinite.any(0), np.inf, best)
        done |= (top - least <= FLAT * top).all((1, 2))
        rows = np.flatnonzero(~done)
        low = at[rows, np.maximum(peak[rows] - 1, 0)]
        high = at[rows, np.minimum(peak[rows] + 1, POINTS - 1)]
    return Peaks(where, best)


def _brackets(found: Array, frequency: Array, size: Array) -> tuple[Array, Array]:
    """Ends (n,) in Hz of intervals around modes and maxima on the grid, within its band."""
    order = np.argsort(frequency)
    grid, height = frequency[order], size[order]
    first, last = grid[0], grid[-1]
    found = found[(found > first) & (found < last)]
    padded = np.concatenate([[-np.inf], height, [-np.inf]])
    tops = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:]))
    low = np.concatenate([found * (1 - WIDTH), grid[np.maximum(tops - 1, 0)]])
    high = np.concatenate([found * (1 + WIDTH), grid[np.minimum(tops + 1, len(grid) - 1)]])
    low, high = np.maximum(low, first), np.minimum(high, last)
    return low[high > low], high[high > low]


def _magnitudes(
    solve: Solve, at: Float[np.ndarray, "bracket point"]
) -> Float[np.ndarray, "bracket point output input"] | None:
    """Magnitudes (n, points, o, i) at frequencies (n, points), Hz.

    Taken beside an infinite one; None if those are infinite too.
    """
    for factor in (1.0, 1.0 + 1e-14, 1.0 - 1e-14):
        try:
            value = np.abs(solve(at.ravel() * factor))
            return value.reshape(*at.shape, *value.shape[1:])
        except InputError:
            continue
    return None
