"""Gain, phase and modulus margins of loops, and of all at once, on an adaptive frequency grid.

A loop gain L scaled by a real kappa has a closed-loop pole at i omega where 1 + kappa L(i omega) =
0, so gain margins are -1/L where L is real and negative. Phase margins are those where |L| is 1
(Astrom and Murray, Feedback Systems, 2nd ed., section 10.3). Near a resonance of quality factor Q,
L runs through a circle within 1/Q of its frequency, which a fixed grid misses. The grid is refined
from given frequencies (poles, zeros, ...) until L and 1 + L change little between neighbours. The
crossings of the real axis and of the unit circle, and the points closest to -1, are then found to
rounding.

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

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from scipy.optimize import elementwise

from suspension_cli.files.declared import in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

Gain = Callable[[Array], np.ndarray]
"""Loop gains (f, l) at frequencies (f,) in Hz."""

STEP = 0.5
"""Largest change of log L and log(1 + L) between neighbours."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Points that divide an interval, on a log scale."""
CLOSEST = 1e-14
"""Relative width of the narrowest interval; a change within is a pole or zero without loss."""
REAL = 0.1
"""Angle (rad) from the real axis up to which a static gain with losses is real."""
STILL = 1e-3
"""Frequency over the lowest of the grid at which gains are static."""
BEYOND = 1e3
"""Factor by which the grid extends beyond the given frequencies."""
FOUND = 1e-12
"""Measure at which the search for a crossing ends."""
ROUNDING = 4 * np.finfo(float).eps
"""Least relative distance of different frequencies."""
ITERATIONS = 12
"""Most steps of the search for a minimum, whose error is the square of that of its frequency."""
FLAT = 1e-10
"""Relative rise from a minimum to the ends of its interval at which the search ends."""
SWEEPS = 200
"""Most sweeps of balancing (usually 5)."""
BALANCED = 1e-14
"""Relative difference of the norms of rows and columns at which balancing ends."""
FAINT = 1e-3
"""Distance of S from 1 below which the grid is not refined, as the peak is elsewhere."""
NOTHING = 1e-9
"""Excess of M over 1 that may be the error of the search."""


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop, broken at its actuator with the others closed.

    Attributes
    ----------
    phase, phase_frequency
        Phase margin, degrees: the smallest of all unity-gain frequencies; and that frequency, Hz.
        Inf and NaN without unity gain.
    gain_up, gain_down
        Gain margins: factors by which the gain may grow or shrink before a pole reaches the
        imaginary axis; inf and 0 without limit.
    distance
        Modulus margin: smallest |1 + L|.
    gain_up_frequency, gain_down_frequency
        Frequencies of these poles, Hz; NaN without limit.
    delay, delay_frequency
        Delay margin, s: smallest delay that brings a pole to the imaginary axis; and its frequency,
        Hz. Inf and NaN without limit.
    """

    in_json: ClassVar = Layout(
        names={  # without units, as they were named first
            "phase_frequency": "phase_frequency",
            "gain_up_frequency": "gain_up_frequency",
            "gain_down_frequency": "gain_down_frequency",
            "delay": "delay",
            "delay_frequency": "delay_frequency",
        },
        also="gain_up_db gain_down_db",
    )
    phase: float = field(metadata=in_unit("degree"))
    phase_frequency: float = field(metadata=in_unit("Hz"))
    gain_up: float
    gain_down: float
    distance: float
    gain_up_frequency: float = field(default=np.nan, metadata=in_unit("Hz"))
    gain_down_frequency: float = field(default=np.nan, metadata=in_unit("Hz"))
    delay: float = field(default=np.inf, metadata=in_unit("s"))
    delay_frequency: float = field(default=np.nan, metadata=in_unit("Hz"))

    @property
    def gains(self) -> list[float]:
        """Gain margins that are limits."""
        return [gain for gain in (self.gain_up, self.gain_down) if 0 < gain < np.inf]

    @property
    def gain_frequencies(self) -> list[float]:
        """Frequencies of these, Hz."""
        places = (self.gain_up_frequency, self.gain_down_frequency)
        return [place for place in places if not np.isnan(place)]

    @property
    def gain_up_db(self) -> float:
        """Upper gain margin, dB."""
        return float(20 * np.log10(self.gain_up))

    @property
    def gain_down_db(self) -> float:
        """Lower gain margin, dB, negative."""
        return float(20 * np.log10(self.gain_down)) if self.gain_down > 0 else -np.inf


def compute_margins(
    gain: Gain, frequency: Float[np.ndarray, " given"], *, faint: float = 1e-6
) -> list[Margins]:
    """Compute the margins of each loop of a stable closed-loop system.

    A delay tau multiplies L by exp(-i omega tau), so at each frequency omega with |L| = 1 it makes
    L = -1 when omega tau is the angle from -1 to L (Astrom and Murray, section 10.3). A loop with
    L < 0 at 0 Hz, scaled by -1/L, has a pole at 0.

    `frequency` are poles and zeros of the gains, and a width to either side of each, Hz. The phase
    of gains below `faint` is not followed, as a delay turns them without end.

    Examples
    --------
    >>> def loop(f):
    ...     s = 2j * np.pi * f[:, None]
    ...     return 1 / (s * (s + 1) * (s + 2))
    >>> round(compute_margins(loop, np.array([0.1, 1.0]))[0].gain_up, 6)
    6.0
    """
    frequency, value = refine_grid(gain, frequency, faint=faint)
    static = gain(frequency[:1] * STILL)[0]
    unity, lag = _find_crossings(
        gain, frequency, value, lambda z: np.log(_size(z)), lambda z: np.ones(z.shape, dtype=bool)
    )
    real, size = _find_crossings(
        gain, frequency, value, lambda z: np.angle(-z), lambda z: np.real(z) < 0
    )
    nearest, _ = search_smallest(
        lambda where, loop: np.abs(1 + _evaluate_each(gain, where, loop)),
        frequency,
        np.abs(1 + value),
    )
    result = []
    for n in range(value.shape[1]):
        at_rest = abs(np.angle(-static[n])) < REAL and faint < abs(static[n]) < 1 / faint
        factors = 1 / np.abs(np.append(size[n], static[n] if at_rest else []))
        places = np.append(real[n], 0.0 if at_rest else [])
        angle = np.angle(-lag[n])
        up = factors > 1
        delays = np.mod(angle, 2 * np.pi) / (2 * np.pi * unity[n])
        gain_up, gain_up_frequency = _find_least(factors[up], places[up])
        fall, gain_down_frequency = _find_least(1 / factors[~up], places[~up])
        phase = _find_least(np.abs(np.degrees(angle)), unity[n])
        gains = gain_up, 1 / fall, float(nearest[n]), gain_up_frequency, gain_down_frequency
        result.append(Margins(*phase, *gains, *_find_least(delays, unity[n])))
    return result


def _find_least(
    values: Float[np.ndarray, " crossing"], places: Float[np.ndarray, " crossing"]
) -> tuple[float, float]:
    """Find the least value and its place; inf and NaN if there is none."""
    least = int(values.argmin()) if len(values) else 0
    return (float(values[least]), float(places[least])) if len(values) else (np.inf, np.nan)


def refine_grid(
    gain: Gain, frequency: Float[np.ndarray, " given"], *, faint: float = 0.0
) -> tuple[Float[np.ndarray, " frequency"], Complex[np.ndarray, "frequency loop"]]:
    """Refine frequencies (Hz) until gains not below `faint` change little between neighbours.

    Returns ascending frequencies, Hz, and gains.
    """
    known = np.unique(frequency[frequency > 0])
    known = np.concatenate([[known[0] / BEYOND], known, [known[-1] * BEYOND]])
    value = gain(known)
    while True:
        size = np.abs(value)
        change = np.maximum(_change(value), _change(1 + value))
        change = np.where(np.maximum(size[1:], size[:-1]) < faint, 0.0, change).max(1, initial=0.0)
        wide = np.flatnonzero((change > STEP) & (np.diff(known) > CLOSEST * known[1:]))
        if not len(wide):
            return known, value
        between = known[wide, None] * (known[wide + 1] / known[wide])[:, None] ** QUARTERS
        new = np.setdiff1d(between, known)
        if not len(new):
            return known, value
        place = np.searchsorted(known, new)
        known = np.insert(known, place, new)
        value = np.insert(value, place, gain(new), axis=0)


def _size(value: Complex[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Modulus, not 0, for its logarithm."""
    return np.maximum(np.abs(value), np.finfo(float).tiny)


def _change(
    value: Complex[np.ndarray, "frequency loop"],
) -> Float[np.ndarray, "frequency-1 loop"]:
    """Modulus of the logarithm of the ratio of neighbours."""
    return np.hypot(np.diff(np.log(_size(value)), axis=0), np.angle(value[1:] * value[:-1].conj()))


def _find_crossings(
    gain: Gain,
    frequency: Float[np.ndarray, " frequency"],
    value: Complex[np.ndarray, "frequency loop"],
    measure: Callable[[np.ndarray], np.ndarray],
    counts: Callable[[np.ndarray], np.ndarray],
) -> tuple[list[Float[np.ndarray, " _"]], list[Complex[np.ndarray, " _"]]]:
    """Find the zeros of a measure of each loop's gain: frequencies and gains per loop.

    Gains for which `counts` is false are left out, and so are jumps (poles or zeros without loss).
    """
    level = measure(value)
    good = counts(value)
    crossed = (
        ((level[:-1] > 0) != (level[1:] > 0)) & good[:-1] & good[1:] & (_change(value) < 2 * STEP)
    )
    at, loop = np.nonzero(crossed)
    found = np.zeros(0, dtype=complex)
    where = np.zeros(0)
    if len(at):
        root = elementwise.find_root(
            lambda f, loop: measure(_evaluate_each(gain, f, loop)),
            (frequency[at], frequency[at + 1]),
            args=(loop,),
            tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": FOUND, "frtol": 0.0},
        )
        # interpolate, as between these frequencies the circle of a Q of 1e9 turns by 1e-7
        (low, high) = root.bracket
        (at_low, at_high) = root.f_bracket
        low_value, high_value = (_evaluate_each(gain, end, loop) for end in (low, high))
        weight = at_low / np.where(at_low == at_high, np.inf, at_low - at_high)
        found = low_value * (high_value / low_value) ** weight
        where = low + weight * (high - low)
    every = range(value.shape[1])
    return [where[loop == n] for n in every], [found[loop == n] for n in every]


def _evaluate_each(
    gain: Gain, frequency: Float[np.ndarray, " point"], loop: Int[np.ndarray, " point"]
) -> Complex[np.ndarray, " point"]:
    return gain(frequency)[np.arange(len(frequency)), loop]


def search_smallest(
    evaluate: Callable[[Array, Index], Array],
    frequency: Float[np.ndarray, " frequency"],
    distance: Float[np.ndarray, "frequency function"],
) -> tuple[Float[np.ndarray, " function"], Float[np.ndarray, " function"]]:
    """Find the minimum of each positive function, from the local minima among known values.

    `distance` are values at ascending frequencies, and `evaluate` computes those at frequencies
    (c,) in Hz of functions of numbers (c,). Returns the minima and their frequencies.
    """
    smallest = distance.min(0)
    place = frequency[distance.argmin(0)]
    middle = distance[1:-1]
    at, loop = np.nonzero((middle <= distance[:-2]) & (middle <= distance[2:]))
    if len(at):
        found = elementwise.find_minimum(
            evaluate,
            (frequency[at], frequency[at + 1], frequency[at + 2]),
            args=(loop,),
            tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": 0.0, "frtol": FLAT},
            maxiter=ITERATIONS,
        )
        for n, where, value in zip(loop, found.x, found.f_x, strict=True):
            if value < smallest[n]:
                smallest[n] = value
                place[n] = where
    return smallest, place


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

    in_json: ClassVar = Layout(
        names={"size": "largest_singular_value", "frequency": "frequency_hz"},
        also="gain_up gain_down phase",
    )
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
    diagonal = np.eye(matrix.shape[-1]) * matrix
    others = matrix - diagonal
    for _ in range(SWEEPS):
        largest = 0.0
        for k in range(matrix.shape[-1]):
            row, column = (np.linalg.norm(x, axis=1) for x in (others[:, k], others[:, :, k]))
            both = (row > 0) & (column > 0)
            factor = np.sqrt(np.where(both, column, 1.0) / np.where(both, row, 1.0))
            others[:, k] *= np.where(both, factor, 0.0)[:, None]
            others[:, :, k] *= np.where(both, 1 / factor, 0.0)[:, None]
            largest = max(largest, float(np.abs(np.log(factor)).max()))
        if largest < BALANCED:
            break
    return diagonal + others


def find_peak(
    sensitivity: Callable[[Array], np.ndarray], frequency: Float[np.ndarray, " given"]
) -> SensitivityPeak:
    """Find the largest singular value of the scaled sensitivity of stable closed loops.

    `sensitivity` computes S (f, l, l) at frequencies (f,) in Hz; `frequency` as for
    `compute_margins`.
    """

    def largest(matrix: np.ndarray) -> np.ndarray:
        return np.linalg.norm(balance(matrix), ord=2, axis=(1, 2))

    def gain(at: np.ndarray) -> np.ndarray:
        # S - 1 turns and changes where S does
        found = sensitivity(at)
        return np.column_stack([np.diagonal(found, axis1=1, axis2=2) - 1, largest(found) - 1])

    grid, value = refine_grid(gain, frequency, faint=FAINT)
    smallest, where = search_smallest(
        lambda at, _: 1 / largest(sensitivity(at)),
        grid,
        1 / np.maximum(1 + np.real(value[:, -1:]), np.finfo(float).tiny),
    )
    return SensitivityPeak(float(1 / smallest[0]), float(where[0]))
