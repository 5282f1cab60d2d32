"""Crossings and avoided crossings of modes along the parameter of a sweep."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from suspension_cli.analyses.sweep.solve import SweepResult
from suspension_cli.files.hdf5 import Stored

NEAR, NEAR_MIXED = 0.05, 0.5
"""Largest relative distance in frequency of two modes that meet, unmixed or mixed."""
CLOSER = 1.3
"""Factor by which they must be farther apart at both ends of the grid."""
MIXED = 0.05
"""Fraction of the other mode's motion from which a crossing is avoided."""


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
    """

    at: float
    frequency: float
    modes: tuple[str, str]
    mixing: tuple[float, float]

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
    labels, rank = list(swept.mode or ()), group["rank"][:]
    shown = [n for n, name in enumerate(swept.result) if name in labels]
    found = []
    for pair in combinations(shown, 2):
        low, high = np.sort(swept.value[:, pair], axis=1).T
        with np.errstate(invalid="ignore", divide="ignore"):
            gap = high / low - 1
        known = np.flatnonzero(np.isfinite(gap))
        if not len(known):
            continue
        n, ends = int(np.nanargmin(gap)), known[[0, -1]]
        if not 0 < n < len(gap) - 1 or gap[n] > NEAR_MIXED:
            continue
        if gap[ends].min() < max(CLOSER * gap[n], 0.2 * NEAR):
            continue
        names = swept.result[pair[0]], swept.result[pair[1]]
        far, numbers = int(ends[np.argmax(gap[ends])]), [labels.index(name) for name in names]
        if rank[[n, far]][:, numbers].min() < 0:
            continue
        here, pure = (
            np.asarray(group["shape"][place], dtype=float)[rank[place, numbers]]
            for place in (n, far)
        )
        part = (here @ pure.T) ** 2
        part = part / np.maximum(part.sum(1, keepdims=True), 1e-300)
        mixing = float(part[0, 1]), float(part[1, 0])
        one = Crossing(swept.axes[0].values[n], float((low[n] + high[n]) / 2), names, mixing)
        if one.is_avoided or gap[n] <= NEAR:
            found.append(one)
    return sorted(found, key=lambda one: -max(one.mixing))
