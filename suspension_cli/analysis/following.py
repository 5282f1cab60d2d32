"""Modes followed over a grid of designs by their shapes, through crossings, instead of by their rank.

From the design as drawn to the grid point nearest to it, and from there to the neighbours of what has been reached, each mode becomes the one that
overlaps it most (`spectrum.matched`).  Points that have no modes are gone round; beyond a gap the nearest point reached is taken instead.

Where two modes that couple come close, their shapes pass through all mixtures: on a fine grid each would turn into the other, step by step, however weak
the coupling.  So while modes are closer than `CLOSE` they are compared with the shape they had before: tilt is tilt again beyond a near miss, and lines
jump by less than that.  Modes that keep farther apart than that turn into each other on unbroken lines.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np

from suspension_cli.analysis.spectrum import matched

CLOSE = 0.1
"""Relative difference of omega^2 (5 % in frequency) within which two modes are too close to be told apart by the shape of the moment."""


def follow(omega_squared: Any, shapes: Any, good: Any, start: tuple[int, ...], nominal: Any) -> tuple[Any, Any]:
    """Which mode of every grid point each mode of the design as drawn has become.

    Parameters
    ----------
    omega_squared : (axis 1, axis 2, ..., m) array
        In ascending order at each point.
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
        With the shape that it was followed from, 0 to 1; NaN where there are none.
    """
    rank = np.full((*good.shape, len(nominal)), -1, dtype=np.int16)
    overlap = np.full((*good.shape, len(nominal)), np.nan)
    left = good.copy()
    reached: list[tuple[int, ...]] = []
    while left.any():
        point, before = _nearest(left, start, reached)
        known = np.asarray(nominal, dtype=float) if before is None else np.asarray(shapes[before])[rank[before]]
        queue = deque([(point, known)])
        left[point] = False
        while queue:
            here, known = queue.popleft()
            mine = np.asarray(shapes[here], dtype=float)
            rank[here], overlap[here] = matched(known, mine)
            reached.append(here)
            sure = ~_close(omega_squared[here], mine)[rank[here]]
            known = np.where(sure[:, None], mine[rank[here]], known)
            for there in _neighbours(here, left):
                left[there] = False
                queue.append((there, known))
    return rank, overlap


def _close(squared: Any, shape: Any) -> Any:
    """Modes (m,) of one point that are close to another one that they can mix with."""
    near = np.abs(squared[:, None] - squared) < CLOSE * np.maximum(np.abs(squared[:, None]), np.abs(squared))
    mixing = np.abs(shape) @ np.abs(shape).T > 0
    return (near & mixing & ~np.eye(len(squared), dtype=bool)).any(1)


def _neighbours(here: tuple[int, ...], left: Any) -> list[tuple[int, ...]]:
    """Points next to one that are still to be reached."""
    steps = [(*here[:axis], here[axis] + step, *here[axis + 1 :]) for axis in range(left.ndim) for step in (-1, 1)]
    return [there for there in steps if all(0 <= k < n for k, n in zip(there, left.shape, strict=True)) and left[there]]


def _nearest(left: Any, start: tuple[int, ...], reached: list[tuple[int, ...]]) -> tuple[tuple[int, ...], tuple[int, ...] | None]:
    """The next point to go to from what has been reached: the start, or across a gap; and the point to come from."""
    points = np.argwhere(left)
    if not reached:
        return tuple(points[np.abs(points - np.array(start)).sum(1).argmin()].tolist()), None
    known = np.array(reached)
    point = points[np.abs(points - np.array(start)).sum(1).argmin()]
    return tuple(point.tolist()), tuple(known[np.abs(known - point).sum(1).argmin()].tolist())
