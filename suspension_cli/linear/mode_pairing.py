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
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.files.mapped_arrays import release

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Inexact, Int

    from suspension_cli.linear.eigenmodes import Modes
    from suspension_cli.linear.system import LinearSystem

FOLLOWED = 5_000
"""Points after which the memory of spectra and shapes is given back."""
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
    nominal: Float[np.ndarray, "*#build mode coordinate"],
    shapes: Float[np.ndarray, "build mode coordinate"],
) -> Int[np.ndarray, "build mode"]:
    """Find the mode of every build that each mode of a nominal design has become, by overlap.

    Shapes known of each build may take the place of the nominal ones. -1 for builds without modes,
    whose shapes are NaN.
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
    shapes: Float[np.ndarray, "*grid mode coordinate"],
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
    squared = omega_squared.reshape(good.size, -1)
    forms = shapes.reshape(good.size, *shapes.shape[-2:])
    known_good = good.ravel()
    rank = np.full((good.size, len(nominal)), -1, dtype=np.int16)
    overlap = np.full((good.size, len(nominal)), np.nan, dtype=np.float32)
    left = np.ones(good.size, dtype=bool)
    layer = np.array([np.ravel_multi_index(start, good.shape)])
    left[layer] = False
    known = np.asarray(nominal, dtype=float)[None]
    beyond_gaps = deque[tuple[int, np.ndarray]]()
    read = 0
    while len(layer):
        read += len(layer)
        if read > FOLLOWED:  # large arrays are mapped to files
            release(omega_squared)
            release(shapes)
            read = 0
        if known_good[layer[0]]:  # all are, except of the start and of a point beyond gaps
            rank[layer], overlap[layer], known = _pair(known, squared[layer], forms[layer])
        there, parent = _neighbours(layer, left.reshape(good.shape))
        left[there] = False
        further = known_good[there]
        gap = zip(there[~further].tolist(), parent[~further].tolist(), strict=True)
        beyond_gaps.extend((point, known[origin]) for point, origin in gap)
        layer = there[further]
        known = known[parent[further]] if len(layer) else known
        if not len(layer) and beyond_gaps:
            point, shape = beyond_gaps.popleft()
            layer = np.array([point])
            known = shape[None]
    return rank.reshape(*good.shape, -1), overlap.reshape(*good.shape, -1)


def _pair(
    known: Float[np.ndarray, "point mode coordinate"],
    squared: Float[np.ndarray, "point mode"],
    forms: Float[np.ndarray, "point mode coordinate"],
) -> tuple[
    Int[np.ndarray, "point mode"],
    Float[np.ndarray, "point mode"],
    Float[np.ndarray, "point mode coordinate"],
]:
    """Pair modes of points with the shapes known there; ranks, overlaps, shapes known beyond."""
    rank = pair_batch(known, forms)
    chosen = np.take_along_axis(forms, rank[..., None], 1)
    overlap = (known * chosen).sum(-1) ** 2
    sure = ~np.take_along_axis(_close(squared, forms), rank, 1)
    return rank, overlap, np.where(sure[..., None], chosen, known)


def _close(
    squared: Float[np.ndarray, "point mode"], forms: Float[np.ndarray, "point mode coordinate"]
) -> Bool[np.ndarray, "point mode"]:
    """Whether each mode of a point is close to another with which it can mix."""
    size = np.abs(squared)
    larger = np.maximum(size[:, :, None], size[:, None])
    near = np.abs(squared[:, :, None] - squared[:, None]) < CLOSE * larger
    mixing = np.abs(forms) @ np.abs(forms).swapaxes(1, 2) > 0
    return np.any(near & mixing & ~np.eye(squared.shape[1], dtype=bool), axis=2)


def _neighbours(
    layer: Int[np.ndarray, " point"], left: Bool[np.ndarray, "*grid"]
) -> tuple[Int[np.ndarray, " neighbour"], Int[np.ndarray, " neighbour"]]:
    """Number the neighbours of points that are still to be visited.

    With the place in `layer` of the first point that each is a neighbour of.
    """
    steps = np.concatenate([np.eye(left.ndim, dtype=int), -np.eye(left.ndim, dtype=int)])
    there = np.stack(np.unravel_index(layer, left.shape), axis=-1)[:, None] + steps
    inside = ((there >= 0) & (there < left.shape)).all(-1)
    parent = np.nonzero(inside)[0]
    point = np.asarray(np.ravel_multi_index(tuple(there[inside].T), left.shape))
    waiting = np.flatnonzero(left.ravel()[point])
    _, first = np.unique(point[waiting], return_index=True)
    first = waiting[np.sort(first)]  # in the order in which one after the other would be visited
    return point[first], parent[first]
