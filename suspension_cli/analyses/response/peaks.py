"""Peaks of frequency responses, however narrow, between the points of a grid.

Near a pole p, a response is H = b + r / (omega - p), with b from all other poles. Three points of H
give b, r and p, and with them the place and height of the peak; three points there, closer
together, give the next estimate. The search starts at every mode and at every local maximum on the
grid. A peak narrower than the rounding of frequencies is that of a pole without loss: infinite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.linear.response import Peaks, Response
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

Solve = Callable[[Array], "Inexact[np.ndarray, 'frequency output input']"]
"""Responses (f, o, i) at frequencies (f,) in Hz."""

WIDTH = 1e-3
"""Relative distance of the first points around a mode."""
STEPS = 16
"""Most estimates per peak; three or four are usual."""
NARROWEST = 1e-13
"""Least relative distance of the points: enough for a Q of about 1e12."""
CLOSER = 0.01
"""Distance of the next points from a pole over the distance that the estimate moved."""
FLAT = 1e-7
"""Relative change of the peak from step to step at which the search ends."""
LOW = 0.1
"""Peaks that promise less than this share of the largest are not followed."""


def find_peaks(answer: Response, solve: Solve, resonances: Array) -> Peaks:
    """Find the largest magnitude of every response within the band of its grid.

    `resonances` are the modes or poles of the model, Hz.
    """
    frequency, shape = answer.frequency, answer.value.shape[1:]
    size = np.abs(answer.value).reshape(len(frequency), -1)
    best, where = size.max(0), frequency[size.argmax(0)]
    band = frequency.min(), frequency.max()
    centre, distance = _starts(resonances, frequency, size)
    # every response near every start; later the estimates that are worth following
    row, pair = np.divmod(np.arange(len(centre) * len(best)), len(best))
    for step in range(STEPS):
        at = np.clip(centre[:, None] * (1 + distance[:, None] * np.array([-1, 0, 1])), *band)
        value = _values(solve, at) if len(row) else None
        if value is None:
            break
        top = np.abs(value).reshape(-1, len(best))
        higher = top.max(0) > best
        best, where = np.where(higher, (top.max(0), at.ravel()[top.argmax(0)]), (best, where))
        own, centre, distance = value[row, :, pair], centre[row], distance[row]
        place, height, width = _peak(at[row], own)
        place = np.clip(place, *band)
        moved, reached = np.abs(place / centre - 1), np.abs(own).max(1)
        on = moved < 3 * distance
        if step:
            on &= (height > LOW * best[pair]) & (height > (1 + FLAT) * reached)
            on &= distance > NARROWEST
        inside = (place > band[0]) & (place < band[1])
        lossless = on & inside & (width < NARROWEST * place) & (moved < FLAT)
        best[pair[lossless]], where[pair[lossless]] = np.inf, place[lossless]
        next_distance = np.maximum(width / place, CLOSER * moved)
        distance = np.clip(next_distance, NARROWEST, distance / 2)
        centre, distance, pair = place[on], distance[on], pair[on]
        row = np.arange(len(pair))
    return Peaks(where.reshape(shape), best.reshape(shape))


def _starts(
    resonances: Array, frequency: Array, size: Float[np.ndarray, "frequency pair"]
) -> tuple[Array, Array]:
    """Places (Hz) and relative distances of the first points: modes and maxima on the grid."""
    order = np.argsort(frequency)
    grid, size = frequency[order], size[order]
    found = resonances[(resonances > grid[0]) & (resonances < grid[-1])]
    inner = (size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:]) & (size[1:-1] > 0)
    tops = 1 + np.flatnonzero(inner.any(1))
    apart = np.maximum(grid[tops + 1] - grid[tops], grid[tops] - grid[tops - 1]) / grid[tops]
    return np.append(found, grid[tops]), np.append(np.full(len(found), WIDTH), apart)


def _peak(
    at: Float[np.ndarray, "estimate 3"], value: Complex[np.ndarray, "estimate 3"]
) -> tuple[Array, Array, Array]:
    """Place, height and width (Hz) of the peak of b + r / (omega - p) through three points.

    With y the distance from Re p and g = Im p, |b + r / (y - i g)|^2 is |b|^2 + (A + B y) / (y^2 +
    g^2), A = |r|^2 - 2 g Im(b* r), B = 2 Re(b* r); it is largest at B g^2 / (A + |(A, B g)|).
    """
    x = at - at[:, 1:2]
    with np.errstate(all="ignore"):
        # divided differences of H and x H
        slope = (value[:, 1] - value[:, 0]) / -x[:, 0], (value[:, 2] - value[:, 1]) / x[:, 2]
        change = value[:, 2] - value[:, 0]
        pole = change / (slope[1] - slope[0])
        upper, lower = x[:, 2] - pole, x[:, 0] - pole
        residue = change * upper * lower / (lower - upper)
        rest, g = value[:, 2] - residue / upper, pole.imag
        both = np.conj(rest) * residue
        a, b = np.abs(residue) ** 2 - 2 * g * both.imag, 2 * both.real
        y = np.where(g == 0, 0.0, b * g**2 / (a + np.hypot(a, b * g)))
        height = np.sqrt(np.abs(rest) ** 2 + (a + b * y) / (y**2 + g**2))
    return at[:, 1] + pole.real + y, height, np.abs(g)


def _values(
    solve: Solve, at: Float[np.ndarray, "row 3"]
) -> Complex[np.ndarray, "row 3 pair"] | None:
    """Responses at frequencies in Hz; beside an infinite one; None if those are infinite too."""
    for factor in (1.0, 1.0 + 1e-14, 1.0 - 1e-14):
        try:
            return solve(at.ravel() * factor).reshape(*at.shape, -1)
        except InputError:
            continue
    return None
