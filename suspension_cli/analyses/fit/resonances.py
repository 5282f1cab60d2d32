"""Resonances of measured transfer functions, their modes, and a first search for these alone.

Around a peak a function is

    H (w0^2 - w^2 + i w b) = N(w),   N = n0 + n1 s + n2 s^2,   s = (w^2 - wp^2) / wp^2,

with the peak's frequency wp and other resonances in n1 and n2. It is linear in w0^2, b and N;
weights are divided by the modulus of the last denominator (Sanathanan and Koerner, IEEE Trans.
Autom. Control 8, 56 (1963)).

Where peaks of model and measurement are farther apart than their widths, the difference of two
functions has no useful gradient. Peaks are therefore assigned to modes by frequency and residue,
and the parameters fitted to these frequencies alone, as to measured modes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.channels import Channels
from suspension_cli.analyses.fit.problem import Problem, stack_parts
from suspension_cli.design.measured import Mode
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.arrays import Array

PROMINENCE = 0.6
"""Least height of a peak in ln |H| above the saddles beside it."""
NOISE = 5.0
"""The same in standard deviations of ln |H|."""
WINDOW = 0.06
"""Relative half width of the band around a peak that its fit uses."""
POINTS = 7
"""Fewest frequencies of a fit."""
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
class Peak:
    """One resonance of one measured function.

    Attributes
    ----------
    frequency, sigma
        Hz, and its standard deviation.
    damping
        1/Q.
    residue
        n0: H is residue / (w0^2 - w^2 + i w b) beside it.
    """

    frequency: float
    sigma: float
    damping: float
    residue: complex


@dataclass(frozen=True)
class Resonance(Peak):
    """A resonance of all functions, of a nominal mode; `functions` is the number of its peaks."""

    mode: int
    functions: int

    def doubt(self, least: float) -> float:
        """Relative uncertainty of the frequency, a tenth of the width or `least` at best."""
        return max(float(np.hypot(self.sigma / self.frequency, 0.1 * self.damping)), least)


def find_peaks(item: MeasuredResponse) -> list[Peak]:
    """Find the resonances of a measured function."""
    from scipy import signal

    sigma = np.asarray(item.uncertainty)
    size = np.maximum(np.abs(item.value), sigma)
    places, about = signal.find_peaks(np.log(size), prominence=PROMINENCE)
    noise = sigma[places] / size[places]
    noise = noise * np.hypot(1.0, np.minimum(np.exp(about["prominences"]), 0.3 / noise))
    clear = places[about["prominences"] > NOISE * noise]
    found = [_fit_peak(item, float(item.frequency[place])) for place in clear]
    return [peak for peak in found if peak is not None]


def _fit_peak(item: MeasuredResponse, at: float) -> Peak | None:
    """Fit one resonance around a frequency; None if there is none."""
    distance = np.abs(np.log(item.frequency / at))
    near = distance <= max(WINDOW, np.sort(distance)[min(POINTS, len(distance)) - 1])
    w2 = (np.asarray(item.frequency)[near] / at) ** 2  # in units of the frequency of the peak
    if len(w2) < POINTS:
        return None
    w, h, sigma = np.sqrt(w2), item.value[near], np.asarray(item.uncertainty)[near]
    scale = np.abs(h).max()
    h, sigma, s = h / scale, sigma / scale, w2 - 1
    numerator = np.stack([np.ones_like(s), s, s**2], 1).astype(complex)
    columns = np.hstack([h[:, None], (1j * w * h)[:, None], -numerator, -1j * numerator])
    denominator = np.ones(len(w))
    solution, covariance, misfit = np.zeros(8), np.zeros((8, 8)), 1.0
    for _ in range(6):
        weight = (1 / (sigma * denominator))[:, None]
        left, right = stack_parts(columns * weight), stack_parts((w2 * h)[:, None] * weight)[:, 0]
        solution = np.linalg.lstsq(left, right, rcond=1e-14)[0]
        covariance = np.linalg.pinv(left.T @ left, rcond=1e-14)
        misfit = max(1.0, float(np.sum((left @ solution - right) ** 2)) / max(len(left) - 8, 1))
        denominator = np.maximum(np.abs(solution[0] - w2 + 1j * w * solution[1]), 1e-9)
    squared, width = float(solution[0]), float(solution[1])
    if not (w2[0] < squared < w2[-1]) or width > 0.5:
        return None
    found = np.sqrt(squared)
    error = np.sqrt(covariance[0, 0] * misfit) / (2 * found)
    if not error < 0.02:
        return None
    residue = complex(solution[2], solution[5]) * scale * (2 * np.pi * at) ** 2
    damping = max(width / found, float(np.sqrt(covariance[1, 1])) * 0.1, 1e-7)
    return Peak(float(at * found), float(at * error), damping, residue)


def residues(plant: Plant, channels: Channels) -> Float[np.ndarray, "function mode"]:
    """Compute the residues of the measured functions: H has residue/(w_k^2 - w^2)."""
    size, shape, basis = plant.system.size, plant.modes.shape, plant.system.basis
    seen, pushed = (
        shape @ np.array([plant.row(signal)[6:] for signal in side]).reshape(-1, size - 6).T
        for side in channels.signal
    )
    for n, signal in enumerate(channels.signal[1]):
        if not signal.acts:
            pushed[:, n] = -shape @ (basis @ plant.system.stiffness @ plant.row(signal))[6:]
    seen, pushed = (
        part @ np.real(channels.weights(side, np.zeros(1))[0]).T
        for side, part in enumerate((seen, pushed))
    )
    return np.array([seen[:, one] * pushed[:, other] for one, other in channels.pairs])


def assign(problem: Problem, z: Array, peaks: list[list[Peak]]) -> list[Resonance]:
    """Assign peaks of all functions to modes, and average those of one mode."""
    one, x = problem.experiment[0], z[problem.parts[0]]
    plant = one.plant(x)
    found: dict[int, list[Peak]] = {}
    for own, some in zip(residues(plant, problem.channels), peaks, strict=True):
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
        how = {"loss": "soft_l1", "steps": 30, "tolerance": 1e-4}  # a peak may be of another mode
        z[parts[0]] = problem.of_modes(modes).minimise(z[parts[0]], **how)[0]
        matched = assign(problem, z, peaks)
    for peak in matched:
        z[parts[2]][problem.damped == peak.mode] = np.clip(np.log(peak.damping), np.log(1e-8), -0.1)
    return z
