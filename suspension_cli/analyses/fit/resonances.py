"""Resonances of measured transfer functions: frequency, width and residue of each peak.

Around a peak the function is

    H (w0^2 - w^2 + i w b) = N(w),   N = n0 + n1 s + n2 s^2,   s = (w^2 - wp^2) / wp^2,

with the peak's frequency wp and other resonances in n1 and n2. It is linear in w0^2, b and N;
weights are divided by the modulus of the last denominator (Sanathanan and Koerner, IEEE Trans.
Autom. Control 8, 56 (1963)).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

    from suspension_cli.analyses.fit.array_types import Frequencies

PROMINENCE = 0.6
"""Least height of a peak in ln |H| above the saddles beside it."""
NOISE = 5.0
"""The same in standard deviations of ln |H|."""
WINDOW = 0.06
"""Relative half width of the band around a peak that its fit uses."""
POINTS = 7
"""Fewest frequencies of a fit."""
PASSES = 6


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


def find_peaks(
    frequency: Frequencies,
    value: Complex[np.ndarray, " frequency"],
    uncertainty: Frequencies,
) -> list[Peak]:
    """Find the resonances of a measured function.

    Parameters
    ----------
    frequency
        Hz, ascending.
    uncertainty
        Standard deviation of the real and of the imaginary part.
    """
    size = np.maximum(np.abs(value), uncertainty)
    places, prominence = _maxima(np.log(size))
    noise = uncertainty[places] / size[places]
    noise = noise * np.hypot(1.0, np.minimum(np.exp(prominence), 0.3 / noise))
    result = []
    for place in places[prominence > NOISE * noise]:
        peak = _fit(frequency, value, uncertainty, float(frequency[place]))
        if peak is not None:
            result.append(peak)
    return result


def _maxima(
    level: Frequencies,
) -> tuple[Int[np.ndarray, " maximum"], Float[np.ndarray, " maximum"]]:
    """Find local maxima and their heights above their saddles."""
    inner = (level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:])
    places, heights = [], []
    for place in np.flatnonzero(inner) + 1:
        higher = np.flatnonzero(level > level[place])
        left, right = higher[higher < place], higher[higher > place]
        first = left[-1] if len(left) else 0
        last = right[0] if len(right) else len(level) - 1
        saddle = max(level[first : place + 1].min(), level[place : last + 1].min())
        if level[place] - saddle > PROMINENCE:
            places.append(int(place))
            heights.append(float(level[place] - saddle))
    return np.array(places, dtype=int), np.array(heights)


def _fit(
    frequency: Frequencies,
    value: Complex[np.ndarray, " frequency"],
    uncertainty: Frequencies,
    at: float,
) -> Peak | None:
    """Fit one resonance around a frequency; None if there is none."""
    distance = np.abs(np.log(frequency / at))
    near = distance < WINDOW
    if near.sum() < POINTS:
        near = distance <= np.sort(distance)[min(POINTS, len(distance)) - 1]
    w2 = (frequency[near] / at) ** 2  # in units of the frequency of the peak
    if len(w2) < POINTS:
        return None
    w, h, sigma = np.sqrt(w2), value[near], uncertainty[near]
    scale = np.abs(h).max()
    h, sigma, s = h / scale, sigma / scale, w2 - 1
    numerator = np.stack([np.ones_like(s), s, s**2], 1).astype(complex)
    columns = np.hstack([h[:, None], (1j * w * h)[:, None], -numerator, -1j * numerator])
    denominator = np.ones(len(w))
    solution, covariance, rest = np.zeros(8), np.zeros((8, 8)), np.zeros(1)
    for _ in range(PASSES):
        weight = (1 / (sigma * denominator))[:, None]
        left = stack_parts(columns * weight)
        right = stack_parts((w2 * h)[:, None] * weight)[:, 0]
        solution = np.linalg.lstsq(left, right, rcond=1e-14)[0]
        covariance = np.linalg.pinv(left.T @ left, rcond=1e-14)
        rest = left @ solution - right
        denominator = np.abs(solution[0] - w2 + 1j * w * solution[1])
        denominator = np.maximum(denominator, 1e-9)
    squared, width = float(solution[0]), float(solution[1])
    if not (w2[0] < squared < w2[-1]) or width > 0.5:
        return None
    misfit = max(1.0, float(rest @ rest) / max(len(rest) - len(solution), 1))
    found = np.sqrt(squared)
    error = np.sqrt(covariance[0, 0] * misfit) / (2 * found)
    if not error < 0.02:
        return None
    residue = complex(solution[2], solution[5]) * scale * (2 * np.pi * at) ** 2
    damping = max(width / found, float(np.sqrt(covariance[1, 1])) * 0.1, 1e-7)
    return Peak(float(at * found), float(at * error), damping, residue)


def stack_parts(rows: Inexact[np.ndarray, "row ..."]) -> Float[np.ndarray, "2*row ..."]:
    """Stack real parts over imaginary parts, to make complex equations real."""
    return np.concatenate([np.real(rows), np.imag(rows)])
