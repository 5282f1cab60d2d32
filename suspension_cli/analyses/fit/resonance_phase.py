"""First phase of a fit: assignment of measured resonances to modes.

Where a resonance is 1 % off, the difference of two transfer functions has no useful gradient, as
peaks are narrower than that. Peaks of every measured function are therefore first assigned to modes
by frequency and residue, and the numbers of the design fitted to these frequencies alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit import levenberg_marquardt
from suspension_cli.analyses.fit.resonances import Peak
from suspension_cli.analyses.fit.response_problem import ResponseProblem, residues
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from suspension_cli.analyses.fit.array_types import ModeIndex, ModeValues, Numbers, Unknowns

FAR = 0.2
"""Largest ln of measured over computed frequency of a peak that may belong to a mode."""
FARTHEST = 0.9
"""Largest ln of their ratio if neither has a nearer partner."""
EXPECTED = 0.5
"""Size of a resonance (see `FAINT`) from which a peak is expected."""
ROUGH = 0.02
"""Relative uncertainty of a frequency that was assigned over such a distance."""
CLOSE = 1e-4
"""Relative difference of frequencies at which resonances agree."""
NEAR = 0.03
"""Typical error of a computed frequency."""
FAINT = 0.02
"""Height of a resonance of Q 100 over the rest of the function there, below which no peak is
expected."""
AGREES = 0.01
"""Relative difference of frequencies within which peaks of several functions are one resonance."""
ROUNDS = ((0.02, 1.0), (5e-3, 0.3), (1e-3, 0.1), (1e-4, 0.03), (1e-4, 0.01))
"""Per round of assignment and fit: smallest relative uncertainty of a resonance, and the error
above which it loses weight, as it may belong to another mode."""
LOOSE = 0.1
"""Standard deviation, relative to a number, in place of a missing prior."""


@dataclass(frozen=True)
class Resonances:
    """Measured resonances, one per mode at most.

    Attributes
    ----------
    mode
        Number in the design at the start.
    frequency, sigma
        Hz.
    damping
        1/Q.
    functions
        Number of measured functions with this resonance.
    """

    mode: ModeIndex
    frequency: ModeValues
    sigma: ModeValues
    damping: ModeValues
    functions: ModeIndex


def assign(problem: ResponseProblem, z: Unknowns) -> Resonances:
    """Assign peaks of all functions to modes, and average those of one mode."""
    from scipy.optimize import linear_sum_assignment

    now = problem.predict(z)
    frequency = now.plant.modes.frequency
    squared = now.plant.modes.omega_squared
    found: dict[int, list[Peak]] = {}
    distant: dict[int, list[Peak]] = {}
    for own, some in zip(residues(now.plant, problem.channels), problem.peaks, strict=True):
        if not some:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            others = own[None, :] / (squared[None, :] - squared[:, None])
            np.fill_diagonal(others, 0.0)
            rest = np.abs(np.nan_to_num(others, posinf=0.0, neginf=0.0).sum(1))
            height = 100 * np.abs(own) / np.abs(squared)
        visible = np.flatnonzero((squared > 0) & (height > FAINT * rest) & (own != 0))
        if not len(visible):
            continue
        off = np.log(np.array([peak.frequency for peak in some])[:, None] / frequency[visible])
        size = np.log(np.abs([peak.residue for peak in some])[:, None] / np.abs(own[visible]))
        size = size - np.median(size[np.abs(off) < NEAR]) if (np.abs(off) < NEAR).any() else size
        cost = (off / NEAR) ** 2 + np.minimum(size**2, 25.0)
        cost[np.abs(off) > FAR] = 1e6
        cost = np.hstack([cost, np.full((len(some), len(some)), 60.0)])  # a peak of no mode
        rows, columns = linear_sum_assignment(cost)
        near = [(r, c) for r, c in zip(rows, columns, strict=True) if cost[r, c] < 60.0]
        for row, column in near:
            found.setdefault(int(visible[column]), []).append(some[row])
        free = np.setdiff1d(np.arange(len(some)), [row for row, _ in near])
        strong = np.flatnonzero(height[visible] > EXPECTED * rest[visible])
        lost = np.setdiff1d(strong, [column for _, column in near])
        left = np.abs(off[np.ix_(free, lost)])
        for row, column in zip(*linear_sum_assignment(left), strict=True):
            if left[row, column] < FARTHEST:
                peak = some[free[row]]
                rough = replace(peak, sigma=max(peak.sigma, ROUGH * peak.frequency))
                distant.setdefault(int(visible[lost[column]]), []).append(rough)
    for mode, several in distant.items():
        if mode not in found and len(several) >= min(2, len(problem.peaks)):
            found[mode] = several
    back = {int(mode): n for n, mode in enumerate(now.order)}
    rows = []
    for mode, several in sorted(found.items()):
        center = _center(several)
        agreeing = [one for one in several if abs(one.frequency / center - 1) < AGREES]
        weight = np.array([1 / (one.sigma / one.frequency + 1e-5) ** 2 for one in agreeing])
        mean = float(weight @ [one.frequency for one in agreeing] / weight.sum())
        damping = float(np.exp(np.median(np.log([one.damping for one in agreeing]))))
        spread = np.std([one.frequency for one in agreeing]) / np.sqrt(len(agreeing))
        sigma = float(np.hypot(mean / np.sqrt(weight.sum()), spread))
        rows.append((back[mode], mean, sigma, damping, len(agreeing)))
    table = np.array(rows).reshape(-1, 5)
    return Resonances(
        table[:, 0].astype(int), table[:, 1], table[:, 2], table[:, 3], table[:, 4].astype(int)
    )


def _center(several: list[Peak]) -> float:
    """Compute the weighted median of the frequencies."""
    order = np.argsort([one.frequency for one in several])
    weight = np.array([1 / (several[n].sigma / several[n].frequency + 1e-4) for n in order])
    place = int(np.searchsorted(weight.cumsum(), weight.sum() / 2))
    return several[order[place]].frequency


def search(problem: ResponseProblem, z: Unknowns) -> tuple[Unknowns, Resonances]:
    """Fit the numbers to the resonances; dampings follow from their widths."""
    p = problem.numbers
    center, width = problem.prior[0][:p].copy(), problem.prior[1][:p].copy()
    loose = ~np.isfinite(width)
    center[loose] = z[:p][loose]
    width[loose] = np.maximum(LOOSE * np.abs(z[:p][loose]), 1e-3 * (z[:p][loose] == 0))
    matched, x = assign(problem, z), z.copy()
    for floor, usual in ROUNDS:
        if not (p and len(matched.mode)):
            break
        sharp = np.maximum(matched.sigma / matched.frequency, 0.1 * matched.damping)
        target = np.log(matched.frequency)
        off = target - np.log(problem.frequencies(x)[matched.mode])
        off = np.nan_to_num(off, nan=1.0)
        if (np.abs(off) < np.maximum(sharp, CLOSE)).all():
            break
        sigma = np.maximum(sharp, floor) * np.sqrt(1 + (off / usual) ** 2)
        sigma[np.isin(matched.mode, problem.stiff)] = 1e3  # frequencies of their own
        x[:p] = _fit(problem, x[:p], (matched.mode, target, sigma), (center, width))
        matched = assign(problem, x)
    damping = dict(zip(matched.mode.tolist(), matched.damping.tolist(), strict=True))
    frequency = problem.frequencies(x)
    for mode, measured in zip(matched.mode.tolist(), matched.frequency, strict=True):
        place = np.flatnonzero(problem.stiff == mode)
        if len(place):
            n = len(x) - len(problem.stiff) + place[0]
            x[n] = np.clip((measured / frequency[mode]) ** 2 - 1, -0.5, 0.9)
    for n, mode in enumerate(problem.damped.tolist()):
        if mode in damping:
            x[p + len(problem.nuisances) + n] = np.clip(np.log(damping[mode]), np.log(1e-8), -0.1)
    return x, matched


def _fit(
    problem: ResponseProblem,
    x: Numbers,
    measured: tuple[ModeIndex, ModeValues, ModeValues],
    prior: tuple[Numbers, Numbers],
) -> Numbers:
    """Fit numbers to `measured`: modes, ln frequencies and standard deviations of these."""
    (modes, target, sigma), (center, width), p = measured, prior, len(x)

    def residual(v: Array) -> Array:
        frequency = problem.frequencies(v)[modes]
        with np.errstate(divide="ignore", invalid="ignore"):
            rows = (np.log(frequency) - target) / sigma
        if not np.isfinite(rows).all():
            return np.full(len(rows) + p, 1e9)
        return np.concatenate([rows, (v - center) / width])

    def jacobian(v: Array) -> Array:
        frequency, slope = problem.frequencies(v), problem.frequency_slopes(v)
        rows = slope[modes] / (frequency[modes] * sigma)[:, None]
        return np.concatenate([rows, np.diag(1 / width)])

    bounds = (problem.low[:p], problem.high[:p])
    return levenberg_marquardt.minimise(residual, jacobian, x, width, bounds, steps=15)[0]
