"""Modes of measured resonances, and a first search for these alone.

Where peaks of model and measurement are farther apart than their widths, the difference of two
functions has no useful gradient. Peaks are therefore assigned to modes by frequency and residue,
and the parameters fitted to these frequencies alone, as to measured modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.design.measured import Mode
from suspension_cli.measurements.resonances import Peak
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

NEAR = 0.03
"""Typical error of a computed frequency."""
FARTHEST = 0.9
"""Largest ln of measured over computed frequency of a peak that may belong to a mode."""
DISTANT = 0.2
"""The same, from which two functions must agree."""
FAINT = 0.02
"""Height of a resonance of Q 100 over the rest of the function there, below which no peak is
expected."""
AGREES = 0.01
"""Relative difference of frequencies within which peaks of several functions are one resonance."""
ROUNDS = (1e-2, 1e-3, 1e-4)
"""Least relative uncertainty of a resonance in each round of assignment and search."""


@dataclass(frozen=True)
class Resonance(Peak):
    """A resonance of all functions, of a nominal mode; `functions` is the number of its peaks."""

    mode: int
    functions: int

    def doubt(self, least: float) -> float:
        """Relative uncertainty of the frequency, a tenth of the width or `least` at best."""
        return max(float(np.hypot(self.sigma / self.frequency, 0.1 * self.damping)), least)


def assign(problem: Problem, z: Array, peaks: list[list[Peak]]) -> list[Resonance]:
    """Assign peaks of all functions to modes, and average those of one mode."""
    one, x = problem.experiment[0], z[problem.parts[0]]
    plant = one.plant(x)
    found: dict[int, list[Peak]] = {}
    for own, some in zip(problem.residues(plant), peaks, strict=True):
        for mode, peak in _pair(plant, own, some):
            found.setdefault(mode, []).append(peak)
    back = {int(mode): n for n, mode in enumerate(one.order(x))}
    rows = []
    for mode, several in found.items():
        hz, sigma, damping, residue = np.array([[*vars(peak).values()] for peak in several]).T
        hz, sigma, damping = hz.real, sigma.real, damping.real
        weight = 1 / (sigma / hz + 1e-4)
        order = np.argsort(hz)
        median = hz[order[np.searchsorted(weight[order].cumsum(), weight.sum() / 2)]]
        good = np.abs(hz / median - 1) < AGREES
        far = abs(np.log(median / plant.modes.frequency[mode])) > DISTANT
        if far and good.sum() < min(2, len(peaks)):
            continue
        weight = (weight * good) ** 2
        mean, count = float(weight @ hz / weight.sum()), int(good.sum())
        scatter = float(np.hypot(mean / np.sqrt(weight.sum()), np.std(hz[good]) / np.sqrt(count)))
        width = float(np.exp(np.median(np.log(damping[good]))))
        rows.append(Resonance(mean, scatter, width, complex(residue[0]), back[mode], count))
    return sorted(rows, key=lambda row: row.mode)


def _pair(plant: Plant, own: Array, peaks: list[Peak]) -> list[tuple[int, Peak]]:
    """Assign peaks of a function to modes, whose residues are given."""
    from scipy.optimize import linear_sum_assignment

    frequency, squared = plant.modes.frequency, plant.modes.omega_squared
    with np.errstate(divide="ignore", invalid="ignore"):
        others = own[None, :] / (squared[None, :] - squared[:, None])
        np.fill_diagonal(others, 0.0)
        rest = np.abs(np.nan_to_num(others, posinf=0.0, neginf=0.0).sum(1))
        height = 100 * np.abs(own) / np.abs(squared)
    visible = np.flatnonzero((squared > 0) & (height > FAINT * rest) & (own != 0))
    if not len(visible) or not peaks:
        return []
    off = np.log(np.array([peak.frequency for peak in peaks])[:, None] / frequency[visible])
    size = np.log(np.abs([peak.residue for peak in peaks])[:, None] / np.abs(own[visible]))
    near = np.abs(off) < NEAR
    size = size - (np.median(size[near]) if near.any() else 0.0)
    faint = np.log(np.minimum(height / (FAINT * rest + 1e-300), 1e4)[visible])
    # the tails of the density of computed frequencies go with the inverse square of the error
    cost = np.log1p((off / NEAR) ** 2) + 0.1 * np.minimum(size**2, 25.0) - 0.2 * faint
    alone = np.log1p((FARTHEST / NEAR) ** 2)  # a peak of no mode
    pairs = linear_sum_assignment(np.hstack([cost, np.full((len(peaks), len(peaks)), alone)]))
    return [
        (int(visible[column]), peaks[row])
        for row, column in zip(*pairs, strict=True)
        if column < len(visible) and cost[row, column] < alone
    ]


def search(problem: Problem, z: Array, peaks: list[list[Peak]]) -> Array:
    """Fit the parameters to the resonances; dampings follow from their widths."""
    one, parts, z = problem.experiment[0], problem.parts, z.copy()
    matched = assign(problem, z, peaks)
    for least in ROUNDS if problem.count else ():
        modes = [
            Mode(
                frequency=peak.frequency,
                uncertainty=peak.frequency * peak.doubt(least),
                label=one.labels[peak.mode],
            )
            for peak in matched
        ]
        how = {"loss": "soft_l1", "steps": 30, "tolerance": 1e-2}  # a peak may be of another mode
        z[parts[0]] = problem.of_modes(modes).minimise(z[parts[0]], **how)[0]
        matched = assign(problem, z, peaks)
    for peak in matched:
        z[parts[2]][problem.damped == peak.mode] = np.clip(np.log(peak.damping), np.log(1e-8), -0.1)
    return z
