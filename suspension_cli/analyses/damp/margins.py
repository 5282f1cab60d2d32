"""Gain, phase and modulus margins of loops, on an adaptive frequency grid.

A loop gain L scaled by a real kappa has a closed-loop pole at i omega where 1 + kappa L(i omega) =
0, so gain margins are -1/L where L is real and negative. Phase margins are those where |L| is 1
(Astrom and Murray, Feedback Systems, 2nd ed., section 10.3). Near a resonance of quality factor Q,
L runs through a circle within 1/Q of its frequency, which a fixed grid misses. The grid is refined
from given frequencies (poles, zeros, ...) until L and 1 + L change little between neighbours. The
crossings of the real axis and of the unit circle, and the points closest to -1, are then found to
rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import elementwise

from suspension_cli.files.declared import in_unit
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

Gain = Callable[[Array], np.ndarray]
"""Loop gains (f, l) at frequencies (f,) in Hz."""

STEP = 0.5
"""Largest change of log L and log(1 + L) between neighbours."""
QUARTERS = np.array([0.25, 0.5, 0.75])
"""Points that divide an interval, on a log scale."""
CLOSEST = 1e-14
"""Relative width of the narrowest interval; a change within is a pole or zero without loss."""
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
    def gain_up_db(self) -> float:
        """Upper gain margin, dB."""
        return float(20 * np.log10(self.gain_up))

    @property
    def gain_down_db(self) -> float:
        """Lower gain margin, dB, negative."""
        return float(20 * np.log10(self.gain_down)) if self.gain_down > 0 else -np.inf


def compute_margins(
    gain: Gain,
    frequency: Float[np.ndarray, " given"],
    static: Float[np.ndarray, " loop"] | None = None,
    *,
    faint: float = 0.0,
) -> list[Margins]:
    """Compute the margins of each loop of a stable closed-loop system.

    A delay tau multiplies L by exp(-i omega tau), so at each frequency omega with |L| = 1 it makes
    L = -1 when omega tau is the angle from -1 to L (Astrom and Murray, section 10.3).

    Parameters
    ----------
    gain
        Loop gains L (f, l) at frequencies (f,) in Hz.
    frequency
        Hz, of poles and zeros of the gains, and a width to either side of each.
    static
        Real gains at 0 Hz, infinite where not real. A loop with L < 0, scaled by -1/L, has a pole
        at 0.
    faint
        Gain below which the grid is not refined, as a delay turns small gains without end.

    Examples
    --------
    >>> def loop(f):
    ...     s = 2j * np.pi * f[:, None]
    ...     return 1 / (s * (s + 1) * (s + 2))
    >>> round(compute_margins(loop, np.array([0.1, 1.0]))[0].gain_up, 6)
    6.0
    """
    frequency, value = refine_grid(gain, frequency, faint=faint)
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
        _change(1 + value),
    )
    result = []
    for n in range(value.shape[1]):
        factors, places = 1 / np.abs(size[n]), real[n]
        if static is not None and static[n] < 0:
            factors, places = np.append(factors, -1 / static[n]), np.append(places, 0.0)
        phases = np.abs(np.degrees(np.angle(-lag[n])))
        where = int(phases.argmin()) if len(phases) else 0
        delays = np.mod(np.angle(-lag[n]), 2 * np.pi) / (2 * np.pi * unity[n])
        late = int(delays.argmin()) if len(delays) else 0
        up, down = factors[factors > 1], factors[factors < 1]
        result.append(
            Margins(
                phase=float(phases[where]) if len(phases) else np.inf,
                phase_frequency=float(unity[n][where]) if len(phases) else np.nan,
                gain_up=float(up.min(initial=np.inf)),
                gain_down=float(down.max(initial=0.0)),
                distance=float(nearest[n]),
                gain_up_frequency=float(places[factors > 1][up.argmin()]) if len(up) else np.nan,
                gain_down_frequency=(
                    float(places[factors < 1][down.argmax()]) if len(down) else np.nan
                ),
                delay=float(delays[late]) if len(delays) else np.inf,
                delay_frequency=float(unity[n][late]) if len(delays) else np.nan,
            )
        )
    return result


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
        known, value = np.insert(known, place, new), np.insert(value, place, gain(new), axis=0)


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
    level, good = measure(value), counts(value)
    crossed = (
        ((level[:-1] > 0) != (level[1:] > 0)) & good[:-1] & good[1:] & (_change(value) < 2 * STEP)
    )
    at, loop = np.nonzero(crossed)
    found, where = np.zeros(0, dtype=complex), np.zeros(0)
    if len(at):
        root = elementwise.find_root(
            lambda f, loop: measure(_evaluate_each(gain, f, loop)),
            (frequency[at], frequency[at + 1]),
            args=(loop,),
            tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": FOUND, "frtol": 0.0},
        )
        # interpolate, as between these frequencies the circle of a Q of 1e9 turns by 1e-7
        (low, high), (at_low, at_high) = root.bracket, root.f_bracket
        low_value, high_value = (_evaluate_each(gain, end, loop) for end in (low, high))
        change = np.where(at_low == at_high, 1.0, at_low - at_high)
        weight = np.where(at_low == at_high, 0.0, at_low / change)
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
    change: Float[np.ndarray, "frequency-1 function"],
) -> tuple[Float[np.ndarray, " function"], Float[np.ndarray, " function"]]:
    """Find the minimum of each positive function, from the local minima among known values.

    Parameters
    ----------
    evaluate
        From frequencies (c,) in Hz and numbers of functions (c,) to values (c,).
    frequency
        Hz, ascending.
    distance
        Values there.
    change
        Upper bounds of the change of their logarithms between neighbours.

    Returns
    -------
    smallest, where : array
        Minima and their frequencies, Hz.
    """
    smallest, place = distance.min(0), frequency[distance.argmin(0)]
    # lower bound of the curve between the neighbours
    least = distance[1:-1] * np.exp(-np.maximum(change[:-1], change[1:]))
    low_point = (
        (distance[1:-1] <= distance[:-2]) & (distance[1:-1] <= distance[2:]) & (least < smallest)
    )
    at, loop = np.nonzero(low_point)
    if len(at):
        found = elementwise.find_minimum(
            evaluate,
            (frequency[at], frequency[at + 1], frequency[at + 2]),
            args=(loop,),
            tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": 0.0, "frtol": FLAT},
            maxiter=ITERATIONS,
        )
        for n in np.unique(loop):
            best = np.flatnonzero(loop == n)[found.f_x[loop == n].argmin()]
            if found.f_x[best] < smallest[n]:
                smallest[n], place[n] = found.f_x[best], found.x[best]
    return smallest, place
