"""Modes followed over a grid of designs by their shapes, through crossings, instead of by their rank.

From the design as drawn to the grid point nearest to it, and from there to the neighbours of what has been reached, each mode becomes the one that
overlaps it most (`spectrum.matched`).  Points that have no modes are gone round; beyond a gap the nearest point reached is taken instead.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from suspension_cli.analysis.spectrum import matched


def follow(shapes: Any, good: Any, start: tuple[int, ...], nominal: Any) -> tuple[Any, Any]:
    """Which mode of every grid point each mode of the design as drawn has become.

    Parameters
    ----------
    shapes : (axis 1, axis 2, ..., m, c) array
        As `spectrum.Spectrum` has them; an HDF5 dataset does too.
    good : (axis 1, axis 2, ...) bool array
        Points that have modes.
    start : tuple of int
        The point that is nearest to the design as drawn.
    nominal : (m, c) array
        Its shapes.

    Returns
    -------
    rank : (axis 1, axis 2, ..., m) int16 array
        Place of each mode among the point's modes; -1 where there are none.
    overlap : (axis 1, axis 2, ..., m) array
        With the same mode of the point that it was followed from, 0 to 1; NaN where there are none.
    """
    rank = np.full((*good.shape, len(nominal)), -1, dtype=np.int16)
    overlap = np.full((*good.shape, len(nominal)), np.nan)
    left = good.copy()
    reached: list[tuple[int, ...]] = []
    while left.any():
        point, before = _nearest(left, start, reached)
        known = nominal if before is None else np.asarray(shapes[before])[rank[before]]
        rank[point], overlap[point] = matched(known, shapes[point])
        left[point] = False
        reached += _spread(shapes, left, point, rank, overlap)
    return rank, overlap


def _nearest(left: Any, start: tuple[int, ...], reached: list[tuple[int, ...]]) -> tuple[tuple[int, ...], tuple[int, ...] | None]:
    """The next point to go to from what has been reached: the start, or across a gap; and the point to come from."""
    points = np.argwhere(left)
    if not reached:
        return tuple(points[np.abs(points - np.array(start)).sum(1).argmin()].tolist()), None
    known = np.array(reached)
    point = points[np.abs(points - np.array(start)).sum(1).argmin()]
    return tuple(point.tolist()), tuple(known[np.abs(known - point).sum(1).argmin()].tolist())


def _spread(shapes: Any, left: Any, point: tuple[int, ...], rank: Any, overlap: Any) -> list[tuple[int, ...]]:
    """Go from a point to neighbour after neighbour as far as there are any, nearest first; all points reached."""
    reached, queue = [point], deque([point])
    while queue:
        here = queue.popleft()
        mine = np.asarray(shapes[here])[rank[here]]
        for axis in range(left.ndim):
            for step in (-1, 1):
                there = (*here[:axis], here[axis] + step, *here[axis + 1 :])
                if not 0 <= there[axis] < left.shape[axis] or not left[there]:
                    continue
                rank[there], overlap[there] = matched(mine, shapes[there])
                left[there] = False
                reached.append(there)
                queue.append(there)
    return reached
