"""One-to-one pairing of modes by their shapes: of two models, two designs, a grid of designs.

Over a grid (`follow`) modes are followed through crossings: from the nominal design to the nearest
grid point, and on to the neighbours of points already visited, each mode becomes the one that
overlaps it most. Points without modes are bypassed, or crossed where there is no way round.

Where two modes that couple come close, their shapes mix: on a fine grid each would turn into the
other, step by step, however weak the coupling. So modes closer than `CLOSE` are compared with the
shape they had before. Pitch is then pitch again beyond a near crossing, and lines jump by less than
`CLOSE`. Modes that stay farther apart turn into each other on unbroken lines.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import h5py
    from jaxtyping import Bool, Float, Inexact, Int

    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.linear.system import LinearSystem

CLOSE = 0.1
"""Relative difference of omega^2 (5 % in frequency) within which the current shapes of two modes
do not identify them."""


def pair_by_overlap(overlap: Float[np.ndarray, "row column"]) -> Int[np.ndarray, " row"]:
    """Pair rows with columns one to one for the largest sum of overlaps.

    Returns the column of each row; -1 for rows without partner, if there are fewer columns than
    rows.

    >>> pair_by_overlap([[0.9, 0.8], [0.7, 0.1]])
    array([1, 0])
    """
    overlap = np.asarray(overlap, dtype=float)
    if not overlap.size:
        return np.full(len(overlap), -1)
    choice = overlap.argmax(1)
    if len(set(choice.tolist())) == len(choice):  # no sum exceeds that of the row maxima
        return choice
    from scipy.optimize import linear_sum_assignment

    rows, columns = linear_sum_assignment(overlap, maximize=True)
    choice = np.full(len(overlap), -1)
    choice[rows] = columns
    return choice


def pair_by_shape(
    before: Float[np.ndarray, "mode coordinate"], after: Float[np.ndarray, "mode coordinate"]
) -> tuple[Int[np.ndarray, " mode"], Float[np.ndarray, " mode"]]:
    """Pair the modes of two designs by their orthonormal shapes, as in `batch_modes.Spectrum`.

    Returns the mode of the second paired with each of the first, and the squared scalar products.
    """
    overlap = (np.asarray(before, dtype=float) @ np.asarray(after, dtype=float).T) ** 2
    choice = pair_by_overlap(overlap)
    return choice, overlap[np.arange(len(choice)), choice]


def pair_batch(
    nominal: Float[np.ndarray, "mode coordinate"],
    shapes: Float[np.ndarray, "build mode coordinate"],
) -> Int[np.ndarray, "build mode"]:
    """Find the mode of every build that each mode of a nominal design has become, by overlap.

    -1 for builds without modes, whose shapes are NaN.
    """
    overlap = (nominal @ np.swapaxes(shapes, -1, -2)) ** 2
    known = np.asarray(np.isfinite(overlap).all((-2, -1)))
    choice = np.where(known[:, None], overlap.argmax(-1), -1)
    several = known & (np.sort(choice, axis=-1) != np.arange(choice.shape[-1])).any(-1)
    for n in np.flatnonzero(several).tolist():
        choice[n] = pair_by_overlap(overlap[n])
    return choice


def pair_bodies(rows: Modes, columns: Modes, model: LinearSystem) -> Int[np.ndarray, " mode"]:
    """Pair the modes of two models of one design, of which `model` is one, by bodies' motion."""
    bodies = slice(6, 6 + 6 * len(model.body))
    return pair_by_overlap(body_overlap(rows.shape, columns.shape, model.mass[bodies, bodies]))


def body_overlap(
    rows: Inexact[np.ndarray, "row _"],
    columns: Inexact[np.ndarray, "column _"],
    mass: Float[np.ndarray, "moving moving"],
) -> Float[np.ndarray, "row column"]:
    """Overlaps |u^T M v| of shapes of unit modal mass in the motion of bodies."""
    count = len(mass)
    return np.abs(rows[:, :count] @ mass @ columns[:, :count].T)


def follow(
    omega_squared: Float[np.ndarray, "*grid mode"],
    shapes: Float[np.ndarray, "*grid mode coordinate"] | h5py.Dataset,
    good: Bool[np.ndarray, "*grid"],
    start: tuple[int, ...],
    nominal: Float[np.ndarray, "mode coordinate"],
) -> tuple[Int[np.ndarray, "*grid mode"], Float[np.ndarray, "*grid mode"]]:
    """Find which mode of every grid point each mode of the nominal design has become.

    `omega_squared` and `shapes` are as in `batch_modes.Spectrum`; points without modes are not
    `good`. The point `start` is nearest to the nominal design, whose shapes are `nominal`. Returns
    the rank (int16) of each mode among the point's modes, -1 where there are none, and its overlap
    (0 to 1; NaN) with the shape that it was followed from.
    """
    rank = np.full((*good.shape, len(nominal)), -1, dtype=np.int16)
    overlap = np.full((*good.shape, len(nominal)), np.nan)
    left = np.ones(good.shape, dtype=bool)
    left[start] = False
    queue = deque([(start, np.asarray(nominal, dtype=float))])
    beyond_gaps = deque[Any]()
    while queue or beyond_gaps:
        here, known = (queue or beyond_gaps).popleft()
        if good[here]:
            mine = np.asarray(shapes[here], dtype=float)
            rank[here], overlap[here] = pair_by_shape(known, mine)
            sure = ~_close(omega_squared[here], mine)[rank[here]]
            known = np.where(sure[:, None], mine[rank[here]], known)
        for there in _neighbours(here, left):
            left[there] = False
            (queue if good[there] else beyond_gaps).append((there, known))
    return rank, overlap


def _close(
    squared: Float[np.ndarray, " mode"], shape: Float[np.ndarray, "mode coordinate"]
) -> Bool[np.ndarray, " mode"]:
    """Whether each mode of a point is close to another with which it can mix."""
    size = np.abs(squared)
    near = np.abs(squared[:, None] - squared) < CLOSE * np.maximum(size[:, None], size)
    mixing = np.abs(shape) @ np.abs(shape).T > 0
    return np.any(near & mixing & ~np.eye(len(squared), dtype=bool), axis=1)


def _neighbours(here: tuple[int, ...], left: Bool[np.ndarray, "*grid"]) -> list[tuple[int, ...]]:
    """List the neighbours of a point that are still to be visited."""
    steps = np.concatenate([np.eye(left.ndim, dtype=int), -np.eye(left.ndim, dtype=int)])
    there = np.array(here) + steps
    inside = ((there >= 0) & (there < left.shape)).all(1)
    return [point for point in map(tuple, there[inside].tolist()) if left[point]]
