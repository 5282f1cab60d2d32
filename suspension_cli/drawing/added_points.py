"""Points added to curves that are drawn, so that narrow peaks and zeros reach their tips."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Float, Inexact

    Solve = Callable[[Array], Inexact[np.ndarray, "frequency output input"]]
    """From frequencies in Hz to values there."""

STEP = 0.5
"""Largest change of log H, complex, between neighbours."""
NARROWEST = 1e-12
"""Relative distance of neighbours at which refinement ends, as at a pole or zero without loss."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Where an interval is divided, on a logarithmic scale."""
SHORTEST = 8
"""Number of points below which a grid is that of a question, not of a curve."""
MOST = 18
"""Largest number of passes."""
UNSEEN = 2
"""First passes, in which intervals beside local maxima are always divided."""
SMOOTH = 3
"""Passes after which a curve that still changes much in most intervals is one of rounding errors,
and is not refined any more."""


def add_points(
    solve: Solve,
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    modes: Array,
    *,
    few: bool = True,
    sums: bool = False,
) -> tuple[Float[np.ndarray, " finer"], Inexact[np.ndarray, "finer output input"]]:
    """Add frequencies until a response changes little between neighbours.

    Parameters
    ----------
    solve
        Values (f, o, i) at frequencies (f,) in Hz.
    frequency : (f,) array
        Hz, ascending, above 0.
    value : (f, o, i) complex array
    modes : (m,) array
        Frequencies of modes, Hz, where resonances may be.
    few
        Whether to refine; otherwise only the modes and points beside them are added.
    sums
        Whether the last axis lists amplitudes of parts; then their root sum of squares is refined.

    Returns
    -------
    frequency, value : (g,), (g, o, i) arrays
        With those given.

    >>> pole = lambda f: (1 / (1 - f**2 + 1e-5j * f))[:, None, None]
    >>> grid = np.array([0.5, 0.9, 1.2, 2.0])
    >>> _, found = add_points(pole, grid, pole(grid), np.array([1.0]))
    >>> round(float(abs(found).max()))
    100000
    """
    inside = modes[(modes > frequency[0]) & (modes < frequency[-1])]
    beside = inside[:, None] * (1 + np.array([-3e-3, -3e-4, -1e-5, 0.0, 1e-5, 3e-4, 3e-3]))
    frequency, value = _insert(solve, frequency, value, beside.ravel())
    erratic = np.zeros(value[0].shape[:-1] if sums else value[0].size, dtype=bool)
    for number in range(MOST if few else 0):
        flat = np.sqrt((value**2).sum(-1)) if sums else value.reshape(len(value), -1)
        with np.errstate(all="ignore"):  # real part: of log |H|, imaginary part: of the angle
            change = np.log(flat[1:].astype(complex) / flat[:-1])
        large = np.isfinite(change) & (np.abs(change) > STEP)
        if number >= SMOOTH:
            erratic |= large.mean(0) > 0.5
        gap = np.log(frequency[1:] / frequency[:-1])
        wanted = np.logical_or.reduce(large & ~erratic, axis=1)
        if number < UNSEEN:  # a peak midway between two points changes neither
            size = np.abs(flat)
            top = ((size[1:-1] >= size[:-2]) & (size[1:-1] >= size[2:])).any(1)
            wanted[:-1] |= top
            wanted[1:] |= top
        wide = np.flatnonzero(wanted & (gap > NARROWEST))
        if not len(wide):
            break
        between = frequency[wide, None] * np.exp(gap[wide, None] * QUARTERS)
        frequency, value = _insert(solve, frequency, value, between.ravel())
    return frequency, value


def add_from_model(
    build: Callable[[], tuple[Solve, Array]],
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    *,
    few: bool = True,
    sums: bool = False,
) -> tuple[Float[np.ndarray, " finer"], Inexact[np.ndarray, "finer output input"]]:
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


def _insert(
    solve: Solve,
    frequency: Float[np.ndarray, " frequency"],
    value: Inexact[np.ndarray, "frequency output input"],
    more: Float[np.ndarray, " more"],
) -> tuple[Float[np.ndarray, " finer"], Inexact[np.ndarray, "finer output input"]]:
    """Insert the values at more frequencies inside a grid, except where they are not finite."""
    more = np.setdiff1d(more[(more > frequency[0]) & (more < frequency[-1])], frequency)
    if not len(more):
        return frequency, value
    try:
        found = solve(more)
    except InputError:  # one of them is a pole without loss to the last bit
        more = more * (1 + 3e-13)
        try:
            found = solve(more)
        except InputError:
            return frequency, value
    place = np.searchsorted(frequency, more)
    return np.insert(frequency, place, more), np.insert(value, place, found, axis=0)
