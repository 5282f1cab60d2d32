"""Crossings and avoided crossings of modes along the parameter of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analyses.sweep.result import SweepResult
from suspension_cli.files.hdf5 import Stored

NEAR, NEAR_MIXED = 0.05, 0.5
"""Largest relative distance in frequency of two modes that meet, unmixed or mixed."""
CLOSER = 1.3
"""Factor by which they must be farther apart at both ends of the grid."""
PURE = 3.0
"""Factor by which modes that mixed are farther apart where 3 % of mixing is left."""
MIXED = 0.05
"""Fraction of the other mode's motion from which a crossing is avoided."""


@dataclass(frozen=True)
class Point:
    """Point of a grid near a crossing: the parameter (SI), and the two modes' numbers from 0."""

    at: float
    rank: tuple[int, int]


@dataclass(frozen=True)
class Crossing:
    """Two modes that come closest at a point of a grid.

    Attributes
    ----------
    at
        Value of the parameter, SI.
    frequency
        Mean of the two, Hz.
    mixing
        Fraction of each one's motion there that is the other's motion far away.
    around
        Points of the grid before, at and after it.
    """

    at: float
    frequency: float
    modes: tuple[str, str]
    mixing: tuple[float, float]
    around: tuple[Point, ...] = ()

    @property
    def is_avoided(self) -> bool:
        """Whether the motions mix."""
        return max(self.mixing) > MIXED

    def __str__(self) -> str:
        """Say which modes meet, and how the first is composed where they mix."""
        first, second = self.modes
        if not self.is_avoided:
            return f"{first} crosses {second}, unmixed"
        part = 100 * max(self.mixing)
        return f"{first} and {second} mix: {100 - part:.0f} % + {part:.0f} %"


def find_crossings(group: Stored, swept: SweepResult) -> list[Crossing]:
    """Find where modes among the results of a sweep over one parameter meet, most mixed first."""
    if "shape" not in group or len(swept.axes) != 1 or len(swept.axes[0].values) < 3:
        return []
    labels = [str(name) for name in group["mode"].asstr()[:]]
    shown = [n for n, name in enumerate(swept.result) if name in labels]
    rank, shape = group["rank"][:], group["shape"]
    found = []
    for k, a in enumerate(shown):
        for b in shown[k + 1 :]:
            numbers = labels.index(swept.result[a]), labels.index(swept.result[b])
            first, second = swept.value[:, a], swept.value[:, b]
            with np.errstate(invalid="ignore", divide="ignore"):
                gap = np.abs(first - second) / np.minimum(first, second)
            if not np.isfinite(gap).any():
                continue
            n = int(np.nanargmin(gap))
            if not 0 < n < len(gap) - 1 or gap[n] > NEAR_MIXED:
                continue
            ends = np.flatnonzero(np.isfinite(gap))[[0, -1]]
            if gap[ends].min() < max(CLOSER * gap[n], 0.2 * NEAR):
                continue
            far = int(ends[np.argmax(gap[ends])])
            if min(rank[n, list(numbers)]) < 0 or min(rank[far, list(numbers)]) < 0:
                continue
            here = np.asarray(shape[n], dtype=float)[rank[n, list(numbers)]]
            pure = np.asarray(shape[far], dtype=float)[rank[far, list(numbers)]]
            part = (here @ pure.T) ** 2
            part = part / np.maximum(part.sum(1, keepdims=True), 1e-300)
            mixing = float(part[0, 1]), float(part[1, 0])
            names = swept.result[a], swept.result[b]
            middle = float(np.mean([first[n], second[n]]))
            apart = np.isfinite(gap) & (gap > PURE * gap[n])
            before, after = np.flatnonzero(apart[:n]), np.flatnonzero(apart[n:])
            near = (
                before[-1] if len(before) else ends[0],
                n,
                n + after[0] if len(after) else ends[1],
            )
            around = tuple(
                Point(swept.axes[0].values[i], (int(rank[i, numbers[0]]), int(rank[i, numbers[1]])))
                for i in near
            )
            one = Crossing(swept.axes[0].values[n], middle, names, mixing, around)
            if one.is_avoided or gap[n] <= NEAR:
                found.append(one)
    return sorted(found, key=lambda one: -max(one.mixing))
