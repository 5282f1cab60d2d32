"""Resonances of measured transfer functions.

Around a peak a function is

    H (w0^2 - w^2 + i w b) = N(w),   N = n0 + n1 s + n2 s^2,   s = (w^2 - wp^2) / wp^2,

with the peak's frequency wp and other resonances in n1 and n2. It is linear in w0^2, b and N;
weights are divided by the modulus of the last denominator (Sanathanan and Koerner, IEEE Trans.
Autom. Control 8, 56 (1963)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.measurements.transfer_function import MeasuredResponse

PROMINENCE = 0.6
"""Least height of a peak in ln |H| above the saddles beside it."""
NOISE = 5.0
"""The same in standard deviations of ln |H|."""
WINDOW = 0.06
"""Relative half width of the band around a peak that its fit uses; less beside another peak."""
POINTS = 7
"""Fewest frequencies of a fit."""
EXACT = 1e-9
"""Least uncertainty over the largest value that a fit uses."""
ASSUMED = 1e-3
"""Relative uncertainty of values whose uncertainty is not known."""


@dataclass(frozen=True)
class Peak:
    """One resonance of one measured function: residue / (w0^2 - w^2 + i w b) beside it.

    Its frequency with standard deviation `sigma`, both Hz; `damping` is 1/Q.
    """

    frequency: float
    sigma: float
    damping: float
    residue: complex


def find_peaks(item: MeasuredResponse) -> list[Peak]:
    """Find the resonances of a measured function.

    A peak to which no resonance can be fitted has an unknown (NaN) width.
    """
    from scipy import signal

    known = ~np.isinf(item.uncertainty)
    frequency = item.frequency[known]
    value = item.value[known]
    sigma = item.uncertainty[known]
    sigma = np.where(sigma > 0, sigma, ASSUMED * np.abs(value))
    size = np.maximum(np.abs(value), sigma)
    if not (size > 0).all():
        return []
    places, about = signal.find_peaks(np.log(size), prominence=PROMINENCE)
    noise = sigma[places] / size[places]
    noise = noise * np.hypot(1.0, np.minimum(np.exp(about["prominences"]), 0.3 / noise))
    tops = frequency[places[about["prominences"] > NOISE * noise]]
    found = []
    for n, at in enumerate(tops.tolist()):
        apart = np.abs(np.log(np.delete(tops, n) / at)).min(initial=2 * WINDOW)
        with np.errstate(divide="ignore"):
            distance = np.abs(np.log(frequency / at))
        near = distance <= max(apart / 2, np.sort(distance)[min(POINTS, len(distance)) - 1])
        peak = _fit_peak(frequency[near], value[near], sigma[near], at)
        found.append(peak or Peak(at, np.nan, np.nan, np.nan))
    return found


def _fit_peak(
    frequency: np.ndarray, value: np.ndarray, sigma: np.ndarray, at: float
) -> Peak | None:
    """Fit one resonance to values around a peak; None if there is none."""
    w = frequency / at  # in units of the frequency of the peak
    scale = np.abs(value).max()
    if len(w) < POINTS or scale == 0:
        return None
    h = value / scale
    sigma = np.maximum(sigma / scale, EXACT)
    w2 = w**2
    s = w2 - 1
    numerator = np.stack([np.ones_like(s), s, s**2], 1).astype(complex)
    columns = np.hstack([h[:, None], (1j * w * h)[:, None], -numerator, -1j * numerator])
    denominator = np.ones(len(w))
    solution = np.zeros(8)
    covariance = np.zeros((8, 8))
    misfit = 1.0
    for _ in range(6):
        weight = (1 / (sigma * denominator))[:, None]
        left, right = (
            np.concatenate([np.real(part), np.imag(part)])
            for part in (columns * weight, w2 * h * weight[:, 0])
        )
        solution = np.linalg.lstsq(left, right, rcond=1e-14)[0]
        covariance = np.linalg.pinv(left.T @ left, rcond=1e-14)
        misfit = max(1.0, float(np.sum((left @ solution - right) ** 2)) / max(len(left) - 8, 1))
        denominator = np.maximum(np.abs(solution[0] - w2 + 1j * w * solution[1]), 1e-9)
    squared = float(solution[0])
    width = float(solution[1])
    if not (w2[0] < squared < w2[-1]) or width > 0.5:
        return None
    found = np.sqrt(squared)
    error = np.sqrt(covariance[0, 0] * misfit) / (2 * found)
    if not error < 0.02:
        return None
    residue = complex(solution[2], solution[5]) * scale * (2 * np.pi * at) ** 2
    damping = max(width / found, float(np.sqrt(covariance[1, 1])) * 0.1, 1e-7)
    return Peak(float(at * found), float(at * error), damping, residue)
