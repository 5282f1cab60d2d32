"""Ordinates, limits, peaks and phases of curves."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.drawing.scales import LOWEST_PHASE

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Int

    from suspension_cli.scene.arrays import Array

PROMINENT = 2.0
"""Factor by which a peak must exceed the valleys on both sides to be labelled."""
ENDLESS, NEAR = 3e6, 3e-4
"""Ratio of the highest point of a peak to the curve at this relative distance, from which the peak
is infinite; points nearer do not set the limits of the axis."""
SPECTRUM = 30.0, 3.0, 1e20
"""Factors of room below and above a spectral density, and largest ratio on its axis."""


def wrap(phase: Float[np.ndarray, "*shape"], low: float = LOWEST_PHASE) -> Array:
    """Shift phases by turns to between `low` and a turn above, degrees."""
    return np.round((phase - low) % 360.0 + low, 9)


def phase_line(
    x: Float[np.ndarray, " frequency"],
    value: Complex[np.ndarray, " frequency"],
    low: float = LOWEST_PHASE,
) -> tuple[Float[np.ndarray, " point"], Float[np.ndarray, " point"]]:
    """Abscissas and wrapped phase (degrees) of a response, with NaN where it jumps by a turn.

    >>> phase_line(np.arange(3.0), np.exp(1j * np.radians([100.0, 150.0, 200.0])))[1].tolist()
    [100.0, 150.0, nan, -160.0]
    """
    known = np.isfinite(value) & (value != 0)
    x, phase = np.asarray(x)[known], wrap(np.degrees(np.angle(np.asarray(value)[known])), low)
    jumps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 270.0)
    return np.insert(x, jumps, np.nan), np.insert(phase, jumps, np.nan)


def ordinates(values: Array, scale: str) -> Array:
    """Values on an axis of `panels.Scale`; NaN where a logarithm does not exist."""
    if scale == "phase":
        complexes = np.iscomplexobj(values)
        return wrap(np.degrees(np.angle(values))) if complexes else values
    if scale == "linear":
        return values.astype(float)
    size = np.abs(values) if np.iscomplexobj(values) else values.astype(float)
    size = np.where(size > 0, size, np.nan)
    return 20 * np.log10(size) if scale == "db" else size


def limit_sizes(size: Array, scale: str) -> tuple[float, float] | None:
    """Limits of an axis of magnitudes, "db" or "log", a little beyond them."""
    size = size[np.isfinite(size) & (size > 0)]
    if not len(size):
        return None
    low, high = 20 * np.log10(size.min()), 20 * np.log10(size.max())
    room = 0.04 * max(high - low, 6.0)
    low, high = float(low - room), float(high + room)
    return (low, high) if scale == "db" else (10 ** (low / 20), 10 ** (high / 20))


def limit_spectrum(total: Array) -> tuple[float, float] | None:
    """Limits of an axis of spectral densities: those of the sum, with room for its parts."""
    total = total[np.isfinite(total) & (total > 0)]
    if not len(total):
        return None
    top = SPECTRUM[1] * float(total.max())
    return max(float(total.min()) / SPECTRUM[0], top / SPECTRUM[2]), top


def find_peaks(size: Float[np.ndarray, " frequency"]) -> Int[np.ndarray, " peak"]:
    """Indices of local maxima that exceed both valleys beside them, the most prominent last."""
    from scipy import signal

    level = np.log(np.where(np.isfinite(size) & (size > 0), size, np.nan))
    level = np.nan_to_num(level, nan=np.nanmin(level, initial=0.0))
    tops, found = signal.find_peaks(level, prominence=np.log(PROMINENT))
    return tops[np.argsort(found["prominences"], kind="stable")]


def find_tops(
    frequency: Float[np.ndarray, " frequency"], size: Float[np.ndarray, " frequency"]
) -> tuple[list[tuple[int, str]], Bool[np.ndarray, " frequency"]]:
    """Find the peaks of a magnitude, and which points are not beside an infinite one.

    Each peak has its index and a remark: " ∞" if it is infinite.
    """
    tops, around = [], np.isfinite(size)
    for top in find_peaks(size).tolist():
        beyond = np.abs(frequency / frequency[top] - 1) > NEAR
        beside = np.interp(frequency[top] * (1 + NEAR), frequency, size)
        endless = bool(beyond.any() and size[top] > ENDLESS * beside)
        around &= beyond | (not endless)
        tops.append((top, " ∞" if endless else ""))
    return tops, around


def unit_of_ratio(ratio: str) -> str:
    """Unit of a ratio of two motions.

    >>> unit_of_ratio("test.pitch/test.x@0,0,0.001")
    'rad/m'
    """
    names = [end.strip().split("@")[0].rpartition(".")[2] for end in ratio.split("/")[:2]]
    return "/".join("rad" if name in ("roll", "pitch", "yaw") else "m" for name in names)
