"""Stability of all loops at once: its margin, and the number of growing poles.

The margin follows from the largest singular value of the sensitivity.

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

The number follows from the argument principle, delays exact, as state spaces approximate a delay
and poles found from them may be incomplete. D = det(1 + H G) has the closed-loop poles as zeros and
the open-loop ones as poles, and is 1 far above all of them. From i 0+ to i infinity its phase grows
by pi/2 (P0 - Z0) + pi (P - Z), with P poles and Z zeros in the right half plane and P0 - Z0 more
poles than zeros at 0, where |D| rises with that power of 1 / omega (Nyquist's criterion; Astrom and
Murray, Feedback Systems, 2nd ed., section 10.2).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.damp import control, margins
from suspension_cli.analyses.damp.control import Plant
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear.poles import Poles

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
TURNED = 1e-6
"""Distance of D from 1 below which its phase is not followed."""
LITTLE = 1e-10
"""Decay rate added to all open-loop poles, over the smallest modulus of a pole."""
NEAR = 1e-8
"""Real part of a pole over its modulus below which its sign is uncertain; also the relative shift
below which no loop moves a pole."""


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


def check_stable(plant: Plant, closed: Poles, opened: Poles) -> None:
    """Raise `InputError` if a closed loop without known growing poles has some."""
    counted = count_growing(plant, closed, opened)
    if counted:
        problem = f"{counted} poles of the closed loop grow, but their frequencies were not found"
        remedy = "shorten the delays, or lower the gain where they turn the phase"
        raise InputError([Fault("control", problem, remedy)])


def count_growing(plant: Plant, closed: Poles, opened: Poles) -> int | None:
    """Count closed-loop poles in the right half plane, both of a pair; None if uncertain."""
    every = np.concatenate([closed.value, opened.value])
    every = every[np.abs(every) > 0]
    moved = closed.value[np.abs(closed.value) > 0]
    apart = np.abs(moved[:, None] - opened.value).min(1, initial=np.inf)
    moved = moved[apart > NEAR * np.abs(moved)]  # others are no zeros of D
    if (np.abs(np.real(moved)) <= NEAR * np.abs(moved)).any():
        return None
    # a little damping moves lossless open-loop poles off the path
    model, rate = plant.model, LITTLE * np.abs(every).min()
    plant = replace(plant, model=replace(model, damping=model.damping + 2 * rate * model.mass))
    filters = [loop.controller_and_sensor for loop in plant.loops]
    roots = np.array([pole for one in filters for pole in (*one.zeros, *one.poles)])
    corners = np.concatenate([every / (2 * np.pi), roots[np.abs(roots) > 0]])
    corners = np.unique(np.concatenate([np.abs(corners), np.abs(corners.imag)]))

    def gain(frequency: np.ndarray) -> np.ndarray:
        back = control.compute_open_loop(plant, frequency)
        return np.linalg.det(np.eye(len(plant.loops)) + back)[:, None] - 1

    frequency, value = margins.refine_grid(gain, corners[corners > 0], faint=TURNED)
    value = 1 + value[:, 0]
    turns = np.angle(value[1:] / value[:-1])
    if np.abs(turns).max() > 2 * margins.STEP:
        return None
    slope = np.log(np.abs(value[1] / value[0])) / np.log(frequency[1] / frequency[0])
    at_zero = -round(float(slope))
    unstable = sum(pole.real < 0 for one in filters for pole in one.poles)
    return round(count_found(opened) + unstable + at_zero / 2 - float(turns.sum()) / np.pi)


def count_found(found: Poles) -> int:
    """Count poles that grow, both of each pair."""
    grows = found.growth_rate > 0
    return int(np.where(np.imag(found.value) != 0, 2, 1)[grows].sum())
