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

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.files.declared import NOT_STORED, in_unit
from suspension_cli.files.documents import Layout
from suspension_cli.scene.arrays import Array, Index

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float, Inexact, Int

Gain = Callable[[Array], np.ndarray]
"""Loop gains (f, l) at frequencies (f,) in Hz."""
GainOfDesigns = Callable[[Index, Array], np.ndarray]
"""Loop gains (f, l) of designs of numbers (f,), ascending, at frequencies (f,) in Hz."""

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
BETWEEN = 2 * STEP
"""Most that log L or log(1 + L) differs between an interval where it crosses or turns, and its
ends."""
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
    distance_frequency
        Frequency of the smallest |1 + L|, Hz.
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
    distance_frequency: float = field(default=np.nan, metadata=NOT_STORED)

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
    return compute_margins_of_designs(lambda _, at: gain(at), [frequency], faint=faint)[0]


def compute_margins_of_designs(
    gain: GainOfDesigns, frequencies: Sequence[Float[np.ndarray, " given"]], *, faint: float = 1e-6
) -> list[list[Margins]]:
    """Compute the margins of each loop of several stable closed-loop systems at once.

    As `compute_margins`, with the poles, zeros and widths of each design.
    """
    grid = refine_grids(gain, frequencies, faint=faint)
    lowest = grid.frequency[np.searchsorted(grid.design, np.arange(len(frequencies)))]
    static = gain(np.arange(len(frequencies)), lowest * STILL)
    unity = _find_unity_crossings(gain, grid)
    real = _find_real_crossings(gain, grid)
    nearest, nearest_place = search_smallest(
        lambda design, where, loop: np.abs(1 + _evaluate_each(gain, design, where, loop)),
        grid,
        np.abs(1 + grid.value),
    )
    return [
        [
            _find_margins(
                unity.of(design, loop),
                real.of(design, loop),
                complex(static[design, loop]),
                (float(nearest[design, loop]), float(nearest_place[design, loop])),
                faint,
            )
            for loop in range(static.shape[1])
        ]
        for design in range(len(static))
    ]


@dataclass(frozen=True)
class _Crossings:
    """Frequencies (Hz) where gains cross a line, with the gains, of loops of designs."""

    design: Int[np.ndarray, " crossing"]
    loop: Int[np.ndarray, " crossing"]
    frequency: Float[np.ndarray, " crossing"]
    value: Complex[np.ndarray, " crossing"]

    def of(
        self, design: int, loop: int
    ) -> tuple[Float[np.ndarray, " own"], Complex[np.ndarray, " own"]]:
        """Frequencies and gains of one loop of one design."""
        first, last = np.searchsorted(self.design, [design, design + 1])
        own = first + np.flatnonzero(self.loop[first:last] == loop)
        return self.frequency[own], self.value[own]


def _find_margins(
    unity: tuple[Float[np.ndarray, " crossing"], Complex[np.ndarray, " crossing"]],
    real: tuple[Float[np.ndarray, " crossing"], Complex[np.ndarray, " crossing"]],
    static: complex,
    nearest: tuple[float, float],
    faint: float,
) -> Margins:
    """Find the margins of one loop from its crossings, its static gain and its distance from -1."""
    at_rest = abs(np.angle(-static)) < REAL and faint < abs(static) < 1 / faint
    factors = 1 / np.abs(np.append(real[1], static if at_rest else []))
    places = np.append(real[0], 0.0 if at_rest else [])
    angle = np.angle(-unity[1])
    up = factors > 1
    delays = np.mod(angle, 2 * np.pi) / (2 * np.pi * unity[0])
    gain_up, gain_up_frequency = _find_least(factors[up], places[up])
    fall, gain_down_frequency = _find_least(1 / factors[~up], places[~up])
    phase = _find_least(np.abs(np.degrees(angle)), unity[0])
    gains = gain_up, 1 / fall, nearest[0], gain_up_frequency, gain_down_frequency
    return Margins(*phase, *gains, *_find_least(delays, unity[0]), nearest[1])


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
    grid = refine_grids(lambda _, at: gain(at), [frequency], faint=faint)
    return grid.frequency, grid.value


@dataclass(frozen=True)
class Grid:
    """Gains of designs at frequencies (Hz), which ascend for each design, as their numbers do."""

    design: Int[np.ndarray, " point"]
    frequency: Float[np.ndarray, " point"]
    value: Complex[np.ndarray, "point loop"]

    @property
    def pairs(self) -> Int[np.ndarray, " pair"]:
        """Points with a neighbour above them."""
        return np.flatnonzero(self.design[1:] == self.design[:-1])


def refine_grids(
    gain: GainOfDesigns, frequencies: Sequence[Float[np.ndarray, " given"]], *, faint: float = 0.0
) -> Grid:
    """Refine the frequencies (Hz) of each design until gains change little between neighbours.

    Those below `faint` need not.
    """
    starts = [np.unique(one[one > 0]) for one in frequencies]
    starts = [np.concatenate([[one[0] / BEYOND], one, [one[-1] * BEYOND]]) for one in starts]
    design = np.repeat(np.arange(len(starts)), [len(one) for one in starts])
    frequency = np.concatenate(starts)
    first = Grid(design, frequency, gain(design, frequency))
    parts = [first]
    low = first.pairs
    ends = frequency[low], frequency[low + 1]
    values = first.value[low], first.value[low + 1]
    design = design[low]
    while True:
        change = np.maximum(_change(*values), _change(1 + values[0], 1 + values[1]))
        silent = np.maximum(np.abs(values[0]), np.abs(values[1])) < faint
        change = np.where(silent, 0.0, change).max(1, initial=0.0)
        wide = np.flatnonzero((change > STEP) & (ends[1] - ends[0] > CLOSEST * ends[1]))
        if not len(wide):
            break
        lower, upper = (end[wide] for end in ends)
        between = lower[:, None] * (upper / lower)[:, None] ** QUARTERS
        whole = np.column_stack([lower, between, upper])
        own = np.repeat(design[wide, None], len(QUARTERS), axis=1)
        found = gain(own.ravel(), between.ravel())
        shape = (*between.shape, found.shape[1])
        sides = (value[wide, None] for value in values)
        every = np.concatenate([next(sides), found.reshape(shape), next(sides)], axis=1)
        # rounding may leave nothing between the ends of a narrow interval
        apart = np.diff(whole) > 0
        new = apart[:, :-1] & (between < upper[:, None])
        parts.append(Grid(own[new], between[new], every[:, 1:-1][new]))
        ends = whole[:, :-1][apart], whole[:, 1:][apart]
        values = every[:, :-1][apart], every[:, 1:][apart]
        design = np.repeat(design[wide, None], apart.shape[1], axis=1)[apart]
    design, frequency, value = (
        np.concatenate([getattr(one, name) for one in parts])
        for name in ("design", "frequency", "value")
    )
    order = np.lexsort([frequency, design])
    return Grid(design[order], frequency[order], value[order])


def _size(value: Complex[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Modulus, not 0, for its logarithm."""
    return np.maximum(np.abs(value), np.finfo(float).tiny)


def _change(
    low: Complex[np.ndarray, "*shape"], high: Complex[np.ndarray, "*shape"]
) -> Float[np.ndarray, "*shape"]:
    """Modulus of the logarithm of the ratio of neighbours."""
    return np.hypot(np.log(_size(high) / _size(low)), np.angle(high * low.conj()))


def _find_unity_crossings(gain: GainOfDesigns, grid: Grid) -> _Crossings:
    """Find where |L| is 1."""
    level = np.log(_size(grid.value))
    at, loop = _crossed(grid, level, np.ones(level.shape, dtype=bool))
    return _search_crossings(gain, grid, lambda z: np.log(_size(z)), at, loop)


def _find_real_crossings(gain: GainOfDesigns, grid: Grid) -> _Crossings:
    """Find where L is real and negative: of each loop those that may be nearest to -1."""
    at, loop = _crossed(grid, np.angle(-grid.value), np.real(grid.value) < 0)
    size = np.log(_size(grid.value[at, loop]))
    count = grid.value.shape[1]
    owner = grid.design[at] * count + loop
    needed = np.zeros(len(at), dtype=bool)
    for distance in (size, -size):  # of factors below and above 1
        sure = np.where(distance > BETWEEN, distance + BETWEEN, np.inf)
        least = np.full(int(owner.max(initial=0)) + 1, np.inf)
        np.minimum.at(least, owner, sure)
        needed |= (distance > -BETWEEN) & (distance - BETWEEN <= least[owner])
    return _search_crossings(gain, grid, lambda z: np.angle(-z), at[needed], loop[needed])


def _crossed(
    grid: Grid, level: Float[np.ndarray, "point loop"], counts: Bool[np.ndarray, "point loop"]
) -> tuple[Int[np.ndarray, " crossing"], Int[np.ndarray, " crossing"]]:
    """Find points above which a measure of a loop's gain changes its sign, and the loops.

    Gains for which `counts` is false are left out, and so are jumps (poles or zeros without loss).
    """
    low = grid.pairs
    crossed = ((level[low] > 0) != (level[low + 1] > 0)) & counts[low] & counts[low + 1]
    at, loop = np.nonzero(crossed)
    at = low[at]
    near = _change(grid.value[at, loop], grid.value[at + 1, loop]) < 2 * STEP
    return at[near], loop[near]


def _search_crossings(
    gain: GainOfDesigns,
    grid: Grid,
    measure: Callable[[np.ndarray], np.ndarray],
    at: Int[np.ndarray, " crossing"],
    loop: Int[np.ndarray, " crossing"],
) -> _Crossings:
    """Find the zeros of a measure of gains of loops, each above a point of the grid."""
    from scipy.optimize import elementwise

    design = grid.design[at]
    if not len(at):
        return _Crossings(design, loop, np.zeros(0), np.zeros(0, dtype=complex))
    root = elementwise.find_root(
        lambda f, design, loop: measure(_evaluate_each(gain, design, f, loop)),
        (grid.frequency[at], grid.frequency[at + 1]),
        args=(design, loop),
        tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": FOUND, "frtol": 0.0},
    )
    # interpolate, as between these frequencies the circle of a Q of 1e9 turns by 1e-7
    (low, high) = root.bracket
    (at_low, at_high) = root.f_bracket
    low_value, high_value = (_evaluate_each(gain, design, end, loop) for end in (low, high))
    weight = at_low / np.where(at_low == at_high, np.inf, at_low - at_high)
    found = low_value * (high_value / low_value) ** weight
    return _Crossings(design, loop, low + weight * (high - low), found)


def _evaluate_each(
    gain: GainOfDesigns,
    design: Int[np.ndarray, " point"],
    frequency: Float[np.ndarray, " point"],
    loop: Int[np.ndarray, " point"],
) -> Complex[np.ndarray, " point"]:
    return gain(design, frequency)[np.arange(len(frequency)), loop]


def search_smallest(
    evaluate: Callable[[Index, Array, Index], Array],
    grid: Grid,
    distance: Float[np.ndarray, "point function"],
) -> tuple[Float[np.ndarray, "design function"], Float[np.ndarray, "design function"]]:
    """Find the minimum of each positive function of each design, from those among known values.

    `distance` are values at the points of the grid, between which their logarithms differ little;
    `evaluate` computes those of designs of numbers (c,) at frequencies (c,) in Hz of functions of
    numbers (c,). Returns the minima and their frequencies.
    """
    first = np.flatnonzero(np.diff(grid.design, prepend=-1))
    smallest = np.minimum.reduceat(distance, first)
    place = np.empty_like(smallest)
    for n, part in enumerate(np.split(np.arange(len(distance)), first[1:])):
        place[n] = grid.frequency[part[distance[part].argmin(0)]]
    low = np.flatnonzero(grid.design[2:] == grid.design[:-2])
    middle = distance[low + 1]
    lowest = (middle <= distance[low]) & (middle <= distance[low + 2])
    known = smallest[grid.design[low]]
    at, function = np.nonzero(lowest & (middle <= known * np.exp(BETWEEN)))
    at = low[at]
    design = grid.design[at]
    if len(at):
        from scipy.optimize import elementwise

        found = elementwise.find_minimum(
            lambda f, design, function: evaluate(design, f, function),
            (grid.frequency[at], grid.frequency[at + 1], grid.frequency[at + 2]),
            args=(design, function),
            tolerances={"xatol": 0.0, "xrtol": ROUNDING, "fatol": 0.0, "frtol": FLAT},
            maxiter=ITERATIONS,
        )
        every = zip(design, function, found.x, found.f_x, strict=True)
        for owner, n, where, value in every:
            if value < smallest[owner, n]:
                smallest[owner, n] = value
                place[owner, n] = where
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

    grid = refine_grids(lambda _, at: gain(at), [frequency], faint=FAINT)
    smallest, where = search_smallest(
        lambda _, at, __: 1 / largest(sensitivity(at)),
        grid,
        1 / np.maximum(1 + np.real(grid.value[:, -1:]), np.finfo(float).tiny),
    )
    return SensitivityPeak(float(1 / smallest[0, 0]), float(where[0, 0]))
