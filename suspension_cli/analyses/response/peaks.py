"""Peaks of frequency responses, however narrow, between the points of a grid.

Around every mode and every local maximum on the grid, parabolas through 1/|H|^2 at three points
lead to the peak (successive parabolic interpolation; Brent, Algorithms for Minimization without
Derivatives (1973), chapter 5): near a pole s = i omega_0 - gamma, 1/|H|^2 is proportional to (omega
- omega_0)^2 + gamma^2, so a few points suffice however narrow the peak. A response that still
varies within rounding of the frequency has a pole without loss there: its peak is infinite.
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
    from jaxtyping import Float, Inexact, Int

Solve = Callable[[Array], "Inexact[np.ndarray, 'frequency output input']"]
"""Responses (f, o, i) at frequencies (f,) in Hz."""

POINTS = 17
"""Frequencies in the first look at a bracket."""
WIDTH = 2e-3
"""Relative half width of the bracket around a mode."""
NEAR = 1e-5
"""Relative distance of the first points around the peak of one response among several."""
STEPS = 16
"""Most parabolas per bracket; three to six are usual."""
NARROWEST = 1e-13
"""Relative step at which the search ends: enough for a Q of about 1e12."""
FLAT = 1e-7
"""Relative change of the peak from step to step at which the search ends."""
BESIDE = 3e-13
"""Relative distance from a peak at which it must not have fallen, unless it is infinite."""
STEEP = 2.0
"""Ratio of an infinite peak to its value beside."""


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
    size, frequency = np.abs(answer.value), answer.frequency
    top = size.argmax(0)
    best, where = np.take_along_axis(size, top[None], 0)[0], frequency[top]
    scale = np.where(best > 0, best, 1.0)
    low, high = _brackets(resonances, frequency, (size / scale).max((1, 2)))

    def look(
        at: Float[np.ndarray, "bracket point"], pair: Int[np.ndarray, " bracket"] | None
    ) -> Float[np.ndarray, "bracket point"]:
        """Keep the largest values at some frequencies; 1/|H|^2, of one response per bracket."""
        nonlocal best, where
        value = _magnitudes(solve, at)
        if value is None:
            return np.full(at.shape, np.nan)
        flat = value.reshape(-1, *best.shape)
        reached, top = flat.max(0), at.ravel()[flat.argmax(0)]
        where, best = np.where(reached > best, top, where), np.maximum(best, reached)
        shape = (value / scale).reshape(*at.shape, -1)
        chosen = shape.max(2) if pair is None else shape[np.arange(len(at)), :, pair]
        with np.errstate(divide="ignore"):
            return chosen**-2.0

    def search(
        at: Float[np.ndarray, "bracket point"], pair: Int[np.ndarray, " bracket"] | None = None
    ) -> None:
        depth = look(at, pair)
        for _ in range(STEPS):
            finite = np.isfinite(depth).all(1)
            at, depth = _around_least(at[finite], depth[finite])
            pair = None if pair is None else pair[finite]
            if not len(at):
                break
            place, least = _vertex(at, depth), depth.min(1)
            # beside it, so that the next parabola is narrow, and far from it where that fails
            step = np.abs(at - place[:, None]).min(1)
            near = place[:, None] + step[:, None] * np.array([-0.7, 0.0, 0.7])
            far = at[:, 1:2] + (at[:, ::2] - at[:, 1:2]) / 5
            more = np.clip(np.append(near, far, 1), at[:, :1], at[:, -1:])
            new = look(more, pair)
            left = (step > NARROWEST * place) & (np.abs(new[:, 1] - least) > FLAT * least)
            at, depth = np.append(at, more, 1)[left], np.append(depth, new, 1)[left]
            pair = None if pair is None else pair[left]

    if len(low):
        search(low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, POINTS))
        inside = (where > frequency.min()) & (where < frequency.max()) & (best.size > 1)
        pairs = np.flatnonzero(inside)
        if len(pairs):  # those of one resonance may peak at places of their own
            search(where.ravel()[pairs, None] * (1 + NEAR * np.array([-1.0, 0.0, 1.0])), pairs)
    beside = _magnitudes(solve, where.ravel()[:, None] * (1 + BESIDE * np.array([-1.0, 1.0])))
    if beside is not None:
        pairs = np.arange(best.size)
        level = beside.reshape(best.size, 2, best.size)[pairs, :, pairs].max(1).reshape(best.shape)
        best = np.where(best > STEEP * level, np.inf, best)
    return Peaks(where, best)


def _around_least(
    at: Float[np.ndarray, "bracket point"], depth: Float[np.ndarray, "bracket point"]
) -> tuple[Float[np.ndarray, "bracket 3"], Float[np.ndarray, "bracket 3"]]:
    """Select the least of each row and its neighbours."""
    order = at.argsort(1)
    at, depth = np.take_along_axis(at, order, 1), np.take_along_axis(depth, order, 1)
    middle = depth.argmin(1)[:, None].clip(1, at.shape[1] - 2) + np.array([-1, 0, 1])
    return np.take_along_axis(at, middle, 1), np.take_along_axis(depth, middle, 1)


def _vertex(
    at: Float[np.ndarray, "bracket 3"], depth: Float[np.ndarray, "bracket 3"]
) -> Float[np.ndarray, " bracket"]:
    """Place of the least value of the parabola through three points, between the outer ones."""
    span = at.T
    left, right = span[1] - span[0], span[2] - span[1]
    with np.errstate(all="ignore"):
        first, second = (depth[:, 1] - depth[:, 0]) / left, (depth[:, 2] - depth[:, 1]) / right
        curve = (second - first) / (left + right)
        place = (span[0] + span[1]) / 2 - first / (2 * curve)
    lowest = span[depth.argmin(1), np.arange(len(at))]
    place = np.where((curve > 0) & np.isfinite(place), place, lowest)
    return np.clip(place, span[0], span[2])


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
