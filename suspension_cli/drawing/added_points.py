"""Frequencies added to those of a curve, so that narrow peaks and zeros reach their tips."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact, Int

    Solve = Callable[[Array], Inexact[np.ndarray, "frequency output input"]]
    """From frequencies in Hz to values there."""
    Curve = tuple[Float[np.ndarray, " finer"], Inexact[np.ndarray, "finer output input"]]

STEP = 0.5
"""Largest change of log H, complex, between neighbours."""
NARROWEST = 1e-12
"""Relative distance of neighbours at which refinement ends, as at a pole or zero without loss."""
PIECES = 8
"""Most parts into which a pass divides an interval, equal on a logarithmic scale."""
SHORTEST = 8
"""Number of points below which a grid is that of a question, not of a curve."""
LONGEST = 50_000
"""Number of points at which refinement ends: the curve is one of rounding errors."""
PASSES = 18
"""Most passes."""
UNSEEN = 2
"""First passes, in which intervals beside local maxima are always divided."""


def add_points(
    solve: Solve,
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    modes: Array,
    *,
    few: bool = True,
    sums: bool = False,
    least: float = 0.0,
) -> Curve:
    """Add frequencies (Hz, ascending, above 0) until a response changes little between neighbours.

    `modes` are frequencies (Hz) where resonances may be. If not `few`, only they and points beside
    them are added. With `sums` the last axis lists amplitudes of parts, whose root sum of squares
    is refined. No points are added below the fraction `least` of the largest value.

    >>> pole = lambda f: (1 / (1 - f**2 + 1e-5j * f))[:, None, None]
    >>> grid = np.array([0.5, 0.9, 1.2, 2.0])
    >>> _, found = add_points(pole, grid, pole(grid), np.array([1.0]))
    >>> round(float(abs(found).max()))
    100000
    """
    beside = modes[:, None] * (1 + np.array([-3e-3, -3e-4, -1e-5, 0.0, 1e-5, 3e-4, 3e-3]))
    frequency, value = _insert(solve, frequency, value, beside.ravel())
    for number in range(PASSES if few else 0):
        flat = np.sqrt((value**2).sum(-1)) if sums else value.reshape(len(value), -1)
        size = np.abs(flat)
        with np.errstate(all="ignore"):  # real part: of log |H|, imaginary part: of the angle
            change = np.log(flat[1:].astype(complex) / flat[:-1])
        pieces = np.where(np.isfinite(change), np.ceil(np.abs(change) / STEP), 1)
        if number < UNSEEN:  # a peak midway between two points changes neither
            top = (size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:]) & (size[1:-1] > 0)
            pieces[:-1][top] = PIECES
            pieces[1:][top] = PIECES
        pieces[np.maximum(size[1:], size[:-1]) < least * size.max(0)] = 1
        most = pieces.max(1).clip(max=PIECES).astype(int)
        most[np.diff(np.log(frequency)) < NARROWEST] = 1
        if (most == 1).all() or len(frequency) > LONGEST:
            break
        frequency, value = _insert(solve, frequency, value, _divide(frequency, most))
    return frequency, value


def add_from_model(
    build: Callable[[], tuple[Solve, Array]],
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    *,
    few: bool = True,
    sums: bool = False,
) -> Curve:
    """Add points to the values of a result, solved for by its model.

    `build` makes the function that solves for them, and lists modes, from the result's design: a
    results file is enough. If that fails, or the grid is short, the values stay as they are.
    """
    if len(frequency) < SHORTEST or frequency[0] <= 0 or (np.diff(frequency) <= 0).any():
        return frequency, value
    try:
        solve, modes = build()
        return add_points(solve, frequency, value, modes, few=few, sums=sums)
    except InputError:
        return frequency, value


def _divide(
    frequency: Float[np.ndarray, " frequency"], pieces: Int[np.ndarray, " interval"]
) -> Float[np.ndarray, " more"]:
    """Points that divide each interval into a number of pieces, equal on a logarithmic scale.

    >>> _divide(np.array([1.0, 4.0, 5.0, 40.0]), np.array([2, 1, 3])).round(3).tolist()
    [2.0, 10.0, 20.0]
    """
    number = np.repeat(np.arange(len(pieces)), pieces - 1)
    first = np.cumsum(pieces - 1) - (pieces - 1)
    within = np.arange(len(number)) - first[number] + 1
    ratio = frequency[number + 1] / frequency[number]
    return frequency[number] * ratio ** (within / pieces[number])


def _insert(
    solve: Solve,
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    more: Float[np.ndarray, " more"],
) -> Curve:
    """Insert the values at more frequencies inside a grid, beside poles without loss."""
    more = np.setdiff1d(more[(more > frequency[0]) & (more < frequency[-1])], frequency)
    for factor in (1.0, 1 + 3e-13) if len(more) else ():
        try:
            found = solve(more * factor)
        except InputError:
            continue
        place = np.searchsorted(frequency, more)
        return np.insert(frequency, place, more * factor), np.insert(value, place, found, axis=0)
    return frequency, value
