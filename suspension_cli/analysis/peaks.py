"""The largest values of frequency responses between the points of a grid: at their poles, however narrow.

Around every mode of the bodies, and around every local maximum on the grid, the frequency is refined until the response no longer changes from one
point to the next (a finite peak) or the distance to it is a rounding error (a pole without loss, where the response is infinite).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import modes, response
from suspension_cli.analysis.response import Response
from suspension_cli.analysis.signals import Signal
from suspension_cli.design.scene import Array
from suspension_cli.errors import InputError
from suspension_cli.mechanics.model import LinearModel

POINTS = 17
"""Frequencies on each bracket in one step of the refinement; the bracket shrinks by half of that."""
WIDTH = 2e-3
"""Relative half width of the bracket around a mode."""
NARROWEST = 1e-13
"""Relative width of a bracket at which the refinement ends: that of a peak with a Q of some 1e12."""
STEEP = 2.0
"""Ratio of the largest to the smallest value on the narrowest bracket from which the peak has no end."""


@dataclass(frozen=True)
class Largest:
    """Where responses are largest, and how large.

    Attributes
    ----------
    frequency : (o, i) array
        Hz.
    size : (o, i) array
        Magnitude, SI; infinite at a pole without loss.
    """

    frequency: Array
    size: Array


def largest(model: LinearModel, answer: Response, inputs: list[Signal], outputs: list[Signal]) -> Largest:
    """The largest magnitude of every response within the band of its grid.

    Parameters
    ----------
    model : LinearModel
    answer : Response
        On the grid.
    inputs, outputs : list of Signal
        Those of the answer.
    """
    size = np.abs(answer.value)
    top = size.argmax(0)
    best, where = np.take_along_axis(size, top[None], 0)[0], answer.frequency[top]
    scale = np.where(best > 0, best, 1.0)
    low, high = _brackets(model, answer.frequency, (size / scale).max((1, 2)))
    share = np.linspace(0.0, 1.0, POINTS)
    while len(low):
        at = low[:, None] + (high - low)[:, None] * share
        value = _sizes(model, at, inputs, outputs)
        if value is None:
            break
        flat, reached = value.reshape(-1, *best.shape), value.max((0, 1))
        better = reached > best
        where = np.where(better, at.ravel()[flat.argmax(0)], where)
        best = np.maximum(best, reached)
        peak = (value / scale).max((2, 3)).argmax(1)
        rows, last = np.arange(len(low)), POINTS - 1
        done = high - low <= NARROWEST * high
        endless = done[:, None, None] & (value.max(1) > STEEP * value.min(1)) & (value.max(1) >= best)
        best = np.where(endless.any(0), np.inf, best)
        low, high = at[rows, np.maximum(peak - 1, 0)][~done], at[rows, np.minimum(peak + 1, last)][~done]
    return Largest(where, best)


def _brackets(model: LinearModel, frequency: Array, size: Array) -> tuple[Array, Array]:
    """Ends (n,) of the intervals that hold a peak: around modes, and around maxima on the grid; within its band."""
    order = np.argsort(frequency)
    grid, height = frequency[order], size[order]
    first, last = grid[0], grid[-1]
    found = modes.solve(replace(model, terms=())).frequency
    found = found[(found > first) & (found < last)]
    padded = np.concatenate([[-np.inf], height, [-np.inf]])
    tops = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:]))
    low = np.concatenate([found * (1 - WIDTH), grid[np.maximum(tops - 1, 0)]])
    high = np.concatenate([found * (1 + WIDTH), grid[np.minimum(tops + 1, len(grid) - 1)]])
    low, high = np.maximum(low, first), np.minimum(high, last)
    return low[high > low], high[high > low]


def _sizes(model: LinearModel, at: Array, inputs: list[Signal], outputs: list[Signal]) -> Any:
    """Magnitudes (n, points, o, i) at frequencies (n, points); None where they are infinite to the last bit even a little aside."""
    for aside in (1.0, 1.0 + 1e-14, 1.0 - 1e-14):
        try:
            return np.abs(response.solve(model, at.ravel() * aside, inputs, outputs).value).reshape(*at.shape, len(outputs), len(inputs))
        except InputError:
            continue
    return None
