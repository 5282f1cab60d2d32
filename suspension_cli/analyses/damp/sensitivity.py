"""Margin of all loops at once: the largest singular value of their sensitivity.

With all loops broken at their actuators, S = (1 + H G)^-1 takes disturbances at the actuators to
total forces. With M, the maximum over frequency of the largest singular value of S, all loops stay
stable while each gain is multiplied by a factor of its own between 1 / (1 + 1/M) and 1 / (1 - 1/M),
or each phase shifted by less than 2 arcsin(1 / (2 M)) (Lehtomaki, Sandell and Athans, IEEE Trans.
Autom. Control 26, 75 (1981)).

As forces and torques have no common unit, the singular values of S depend on the units. Those of
D S D^-1 with a positive diagonal D do not, and the bounds stay valid. At each frequency D is chosen
for the smallest sum of squares, with rows and columns of equal norm (Osborne, J. ACM 7, 338
(1960)); for two coupled loops that gives the smallest possible singular value, the structured
singular value of Doyle (IEE Proc. D 129, 242 (1982)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import control, margins
from suspension_cli.analyses.damp.control import Plant

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact

SWEEPS = 200
"""Most sweeps of balancing (usually 5)."""
FAINT = 1e-3
"""Distance of S from 1 below which the grid is not refined, as the peak is elsewhere."""
NOTHING = 1e-9
"""Excess of M over 1 that may be the error of the search."""
BALANCED = 1e-14
"""Relative difference of the norms of rows and columns at which balancing ends."""


@dataclass(frozen=True)
class SensitivityPeak:
    """Largest singular value of the scaled sensitivity over all frequencies.

    Attributes
    ----------
    size
        M, at least 1 in all but degenerate cases; 1 is best.
    frequency
        Hz.
    """

    size: float
    frequency: float

    @property
    def gain_up(self) -> float:
        """Factor by which gains may rise, each or all; inf without limit."""
        return 1 / (1 - 1 / self.size) if self.size > 1 + NOTHING else np.inf

    @property
    def gain_down(self) -> float:
        """Factor by which gains may fall, each or all."""
        return 1 / (1 + 1 / self.size)

    @property
    def phase(self) -> float:
        """Shift of phase that loops tolerate, each or all, degrees."""
        return float(np.degrees(2 * np.arcsin(min(1 / (2 * self.size), 1.0))))


def balance(
    matrix: Inexact[np.ndarray, "frequency loop loop"],
) -> Complex[np.ndarray, "frequency loop loop"]:
    """Scale matrices to D A D^-1 whose off-diagonal rows and columns have equal norms.

    Elements that no other balances become 0, as D can make them arbitrarily small.
    """
    matrix = np.array(matrix, dtype=complex)
    count = matrix.shape[-1]
    for _ in range(SWEEPS):
        worst = 0.0
        for k in range(count):
            others = np.arange(count) != k
            row = np.sqrt((np.abs(matrix[:, k, others]) ** 2).sum(-1))
            column = np.sqrt((np.abs(matrix[:, others, k]) ** 2).sum(-1))
            both = (row > 0) & (column > 0)
            factor = np.where(both, np.sqrt(column / np.where(both, row, 1.0)), 0.0)
            worst = max(worst, float(np.abs(np.log(factor[both])).max(initial=0.0)))
            inverse = np.where(both, 1 / np.where(both, factor, 1.0), 0.0)
            diagonal = matrix[:, k, k].copy()
            matrix[:, k, :] *= factor[:, None]
            matrix[:, :, k] *= inverse[:, None]
            matrix[:, k, k] = diagonal
        if worst < BALANCED:
            break
    return matrix


def find_peak(plant: Plant, frequency: Float[np.ndarray, " given"]) -> SensitivityPeak:
    """Find the largest singular value of the scaled sensitivity of stable closed loops.

    `frequency` (Hz) is that of `margins.compute_margins`.
    """

    def largest(sensitivity: np.ndarray) -> np.ndarray:
        return np.linalg.norm(balance(sensitivity), ord=2, axis=(1, 2))

    def gain(at: np.ndarray) -> np.ndarray:
        # S - 1 turns and changes where S does
        found = control.compute_sensitivity(plant, at)
        return np.column_stack([np.diagonal(found, axis1=1, axis2=2) - 1, largest(found) - 1])

    grid, value = margins.refine_grid(gain, frequency, faint=FAINT)
    size = np.maximum(1 + np.real(value[:, -1:]), np.finfo(float).tiny)
    smallest, where = margins.search_smallest(
        lambda at, _: 1 / largest(control.compute_sensitivity(plant, at)),
        grid,
        1 / size,
        np.abs(np.diff(np.log(size), axis=0)) + margins.STEP,
    )
    return SensitivityPeak(float(1 / smallest[0]), float(where[0]))
