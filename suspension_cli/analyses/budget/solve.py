"""Motion of a suspension by cause: spectra, cumulative RMS, comparison with a requirement.

The mean square of a motion x of power spectral density S(f) is the integral of S, that of its
velocity the integral of (2 pi f)^2 S; cumulative from the highest frequency f_max down,

    RMS(f)^2 = integral of S from f to f_max.

Between the points of the grid spectra are power laws. Points are added around each resonance, and
where the estimated error of an interval exceeds `ACCURACY` of the integral above its lower end.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.budget import table
from suspension_cli.analyses.budget.noise import Noises
from suspension_cli.analyses.budget.table import Table
from suspension_cli.errors import Fault, InputError
from suspension_cli.files.declared import along, derived, in_unit
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Complex, Float

ACCURACY = 3e-5
"""Largest estimated error of an interval over the integral from its lower end up."""
NARROWEST = 1e-13
"""Relative width at which intervals are not halved any more: enough for a Q of about 1e11."""
FRACTIONS = (0.5, 0.45, 0.56, 0.41)
"""Points that divide an interval, tried in turn where the motion is infinite."""
EQUAL = 1e-6
"""Logarithm of a ratio below which two values are equal."""
DISTINCT = 1e-12
"""Relative distance below which two frequencies are one."""
ROUNDS = 60
"""Most halvings of an interval."""
STEEP = 1e6
"""Rise of a power spectral density, within a millionth of a frequency, at a pole without loss."""
RANGE = 0.05
"""Relative distance from a resonance up to which points are placed around it."""
STEP = 1.0
"""Step in u of the points f + w sinh(u) around a resonance of half width w."""


@dataclass(frozen=True)
class Requirement:
    """A required amplitude spectral density (unit/sqrt(Hz)), and the margin to it.

    `margin` is the smallest ratio of requirement to motion, `at` its frequency, and `exceeded` are
    intervals in which the motion is above the requirement, Hz. `unit` is that of the motion.
    """

    name: str
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    density: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}/Hz^0.5"))
    margin: float
    at: float
    exceeded: tuple[tuple[float, float], ...] = field(metadata=in_unit("Hz", "interval end"))
    unit: str

    @property
    @derived()
    def end(self) -> tuple[str, ...]:
        """Ends of the intervals."""
        return "from", "to"

    @property
    def met(self) -> bool:
        """Whether the motion nowhere exceeds it."""
        return self.margin >= 1

    @property
    def excess(self) -> float:
        """Largest ratio of the motion to the requirement."""
        return 1 / self.margin if self.margin else np.inf


@dataclass(frozen=True)
class Budget:
    """One motion by cause.

    Attributes
    ----------
    frequency : (f,) array
        Hz, ascending.
    output, unit : str
        Observed motion, and m or rad.
    cause : tuple of str
        ``ground.x``, ``sensor.LOOP``, ``actuator.LOOP``, ``thermal``.
    source : tuple of str
        Name of the model or file of each cause; "" for those in the design.
    density : (c, f) array
        One-sided power spectral density by cause, unit^2/Hz.
    square, square_velocity : (c, f) arrays
        Mean squares from each frequency up by cause, unit^2 and (unit/s)^2; infinite where a
        resonance without loss is driven.
    """

    frequency: Float[np.ndarray, " frequency"]
    output: str
    unit: str
    cause: tuple[str, ...]
    source: tuple[str, ...]
    density: Float[np.ndarray, "cause frequency"]
    square: Float[np.ndarray, "cause frequency"]
    square_velocity: Float[np.ndarray, "cause frequency"]
    requirement: Requirement | None = None

    @property
    def amplitude(self) -> Float[np.ndarray, " frequency"]:
        """Amplitude spectral density (f,) of the sum, unit/sqrt(Hz)."""
        return np.sqrt(self.density.sum(0))

    @property
    def parts(self) -> dict[str, Float[np.ndarray, " frequency"]]:
        """Amplitude spectral density (f,) by cause, unit/sqrt(Hz)."""
        return {name: np.sqrt(row) for name, row in zip(self.cause, self.density, strict=True)}

    @property
    def rms(self) -> Float[np.ndarray, " frequency"]:
        """RMS (f,) of the motion from each frequency up."""
        return np.sqrt(self.square.sum(0))

    @property
    def rms_velocity(self) -> Float[np.ndarray, " frequency"]:
        """RMS (f,) of the velocity from each frequency up, unit/s."""
        return np.sqrt(self.square_velocity.sum(0))


@dataclass(frozen=True)
class Budgets:
    """Several motions by cause, as they are stored.

    Attributes
    ----------
    source, requirement
        As in `Budget`.
    contribution
        Amplitude spectral density by cause.
    mean_square, mean_square_velocity
        Mean squares of motion and velocity from each frequency up.
    """

    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    output: tuple[str, ...]
    unit: tuple[str, ...] = field(metadata=along("output"))
    cause: tuple[str, ...]
    source: tuple[str, ...] = field(metadata=along("cause"))
    contribution: Float[np.ndarray, "frequency output cause"] = field(
        metadata=in_unit("{unit}/Hz^0.5")
    )
    mean_square: Float[np.ndarray, "frequency output cause"] = field(metadata=in_unit("{unit}^2"))
    mean_square_velocity: Float[np.ndarray, "frequency output cause"] = field(
        metadata=in_unit("{unit}^2/s^2")
    )
    requirement: tuple[Requirement | None, ...]

    @property
    @derived("{unit}/Hz^0.5")
    def amplitude(self) -> Float[np.ndarray, "frequency output"]:
        """Amplitude spectral density of the sum."""
        return np.sqrt((self.contribution**2).sum(-1))

    @property
    @derived("{unit}")
    def rms(self) -> Float[np.ndarray, "frequency output"]:
        """RMS of the motion from each frequency up."""
        return np.sqrt(self.mean_square.sum(-1))

    @property
    @derived("{unit}/s")
    def rms_velocity(self) -> Float[np.ndarray, "frequency output"]:
        """RMS of the velocity from each frequency up."""
        return np.sqrt(self.mean_square_velocity.sum(-1))

    @staticmethod
    def of(budgets: list[Budget]) -> Budgets:
        """Combine the budgets of several motions at the same frequencies."""
        first = budgets[0]

        def stacked(name: str) -> Float[np.ndarray, "frequency output cause"]:
            return np.stack([getattr(one, name).T for one in budgets], axis=1)

        return Budgets(
            first.frequency,
            tuple(one.output for one in budgets),
            tuple(one.unit for one in budgets),
            first.cause,
            first.source,
            np.sqrt(stacked("density")),
            stacked("square"),
            stacked("square_velocity"),
            tuple(one.requirement for one in budgets),
        )

    def each(self) -> list[Budget]:
        """List the budget of each motion."""
        names = itertools.zip_longest(self.output, self.unit, self.requirement)
        return [
            Budget(
                self.frequency,
                output,
                unit,
                self.cause,
                self.source,
                self.contribution[:, n].T ** 2,
                self.mean_square[:, n].T,
                self.mean_square_velocity[:, n].T,
                requirement,
            )
            for n, (output, unit, requirement) in enumerate(names)
        ]


def solve(
    noises: Noises,
    grid: Float[np.ndarray, " frequency"],
    resonance: Complex[np.ndarray, " pole"],
    requirements: dict[int, Table],
    *,
    added: bool,
) -> list[Budget]:
    """Compute the budget of every output.

    Parameters
    ----------
    grid : (f,) array
        Hz, ascending.
    resonance : (p,) complex array
        Poles, rad/s; points are added around them.
    requirements : dict
        Required amplitude spectral densities by number of the output.
    added : bool
        Whether the spectra include the added points.
    """
    decades = 10.0 ** np.arange(np.ceil(np.log10(grid[0])), np.log10(grid[-1]))
    corners = [motion.corner for motion in noises.motion.values()]
    corners += [required.frequency for required in requirements.values()]
    seeds = [points_around(resonance), decades, *corners]
    frequency, density, unresolved = refine(noises.density, _join(grid, np.concatenate(seeds)))
    square = integrate_down(frequency, density)
    velocity = integrate_down(frequency, density * (2 * np.pi * frequency) ** 2)
    for at in unresolved:
        driven = _is_singular(frequency, density, at)
        for whole in (square, velocity):
            whole[driven[..., None] & (frequency <= at)] = np.inf
    if len(grid) == 1:
        square, velocity = np.full_like(square, np.nan), np.full_like(velocity, np.nan)
    shown = slice(None) if added else np.isin(frequency, grid)
    met = {
        n: compare(frequency, np.sqrt(density[n].sum(0)), required, noises.output[n].unit)
        for n, required in requirements.items()
    }
    return [
        Budget(
            frequency[shown],
            signal.text,
            signal.unit,
            noises.cause,
            noises.source,
            density[n][:, shown],
            square[n][:, shown],
            velocity[n][:, shown],
            met.get(n),
        )
        for n, signal in enumerate(noises.output)
    ]


def _join(
    grid: Float[np.ndarray, " frequency"], more: Float[np.ndarray, " point"]
) -> Float[np.ndarray, " joined"]:
    """Join a grid and further points within it that are `DISTINCT` from others."""
    points = np.unique(more[(more > grid[0]) & (more < grid[-1])])
    points = points[np.diff(points, prepend=-np.inf) > DISTINCT * points]
    after = np.searchsorted(grid, points)
    nearest = np.minimum(points - grid[after - 1], grid[after] - points)
    return np.union1d(grid, points[nearest > DISTINCT * points])


def _is_singular(
    frequency: Float[np.ndarray, " frequency"],
    density: Float[np.ndarray, "output cause frequency"],
    at: float,
) -> Bool[np.ndarray, "output cause"]:
    """Whether densities (o, c, f) rise towards a frequency as at a pole without loss: (o, c)."""
    beside = np.searchsorted(frequency, at * (1 - 1e-6))
    near = density[..., np.searchsorted(frequency, at)]
    return near > STEEP * density[..., max(beside - 1, 0)]


def points_around(resonance: Complex[np.ndarray, " pole"]) -> Float[np.ndarray, " point"]:
    """Place frequencies (n,) in Hz around poles (p,) in rad/s, denser towards them."""
    found: list[Array] = [np.zeros(0)]
    for pole in resonance:
        centre = abs(pole.imag) / (2 * np.pi)
        width = max(abs(pole.real) / (2 * np.pi), NARROWEST * centre)
        if not 0 < width < RANGE * centre:
            continue
        steps = int(np.arcsinh(RANGE * centre / width) / STEP) + 1
        # half a step aside, as the motion may be infinite at the resonance
        found.append(centre + width * np.sinh(STEP * (np.arange(-steps, steps) + 0.5)))
    return np.concatenate(found)


def refine(
    density: Callable[[Array], Array], grid: Float[np.ndarray, " given"]
) -> tuple[
    Float[np.ndarray, " frequency"],
    Float[np.ndarray, "output cause frequency"],
    Float[np.ndarray, " unresolved"],
]:
    """Add points to a grid until the integrals over spectra are accurate.

    Parameters
    ----------
    density : callable
        Power spectral densities (o, c, f) at frequencies (f,), Hz.
    grid : (f,) array
        Ascending, Hz.

    Returns
    -------
    frequency, density : arrays
        On the refined grid.
    unresolved : (n,) array
        Frequencies at which the integral does not converge.
    """
    value, narrow = density(grid), np.zeros(0, dtype=bool)
    for _ in range(ROUNDS):
        low, high = grid[:-1], grid[1:]
        total = value.sum(1)
        weighted = np.stack([total, total * (2 * np.pi * grid) ** 2])
        area = _areas(low, high, weighted[..., :-1], weighted[..., 1:])
        above = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
        # two intervals taken as one have four times the error
        pair = _areas(grid[:-2], grid[2:], weighted[..., :-2], weighted[..., 2:])
        error = np.abs(pair - area[..., :-1] - area[..., 1:]) / 3
        around = np.zeros_like(area)
        if error.size:
            around[..., :-1] = error
            around[..., 1:] = np.maximum(around[..., 1:], error)
        rough = (around > ACCURACY * above).any((0, 1))
        narrow = rough & (high - low <= NARROWEST * high)
        at = np.flatnonzero(rough & ~narrow)
        if not len(at):
            break
        middle, new = _bisect(density, low[at], high[at])
        value = np.insert(value, at + 1, new, axis=-1)
        grid = np.insert(grid, at + 1, middle)
    # beside a pole without loss even the narrowest intervals matter
    return grid, value, grid[: len(narrow)][narrow]


def _bisect(
    density: Callable[[Array], Array],
    low: Float[np.ndarray, " interval"],
    high: Float[np.ndarray, " interval"],
) -> tuple[Float[np.ndarray, " interval"], Float[np.ndarray, "output cause interval"]]:
    """Divide intervals; return the points and densities, beside poles without loss."""
    for fraction in FRACTIONS:
        middle = low + (high - low) * fraction
        try:
            return middle, density(middle)
        except InputError:
            continue
    problem = "contains a resonance without loss, where the motion is infinite"
    remedy = "give the design a loss_angle or damping"
    raise InputError([Fault("--frequency", problem, remedy, f"{float(low[0])!r}")])


def integrate_down(
    frequency: Float[np.ndarray, " frequency"], value: Float[np.ndarray, "*batch frequency"]
) -> Float[np.ndarray, "*batch frequency"]:
    """Integrate (..., f) from the highest frequency down to each one; power laws are exact."""
    area = _areas(frequency[:-1], frequency[1:], value[..., :-1], value[..., 1:])
    result = np.zeros_like(value)
    result[..., :-1] = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
    return result


def _areas(
    low: Float[np.ndarray, " interval"],
    high: Float[np.ndarray, " interval"],
    first: Float[np.ndarray, "*batch interval"],
    last: Float[np.ndarray, "*batch interval"],
) -> Float[np.ndarray, "*batch interval"]:
    """Integrate over intervals, given the values at their ends.

    S is a power law, so the integral of f S over ln f is the width in ln f times the logarithmic
    mean of f S, (b - a) / ln(b / a). Next to a 0, S is linear.
    """
    a, b, width = low * first, high * last, np.log(high / low)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(b / a)
        power = width * np.where(np.abs(ratio) > EQUAL, (b - a) / ratio, (a + b) / 2)
    return np.where((first > 0) & (last > 0), power, (first + last) / 2 * (high - low))


def compare(
    frequency: Float[np.ndarray, " frequency"],
    total: Float[np.ndarray, " frequency"],
    required: Table,
    unit: str,
) -> Requirement | None:
    """Compare an amplitude spectral density (f,) with a table; None if they do not overlap."""
    [limit] = required.column.values()
    both = (frequency >= required.frequency[0]) & (frequency <= required.frequency[-1])
    if not both.any():
        return None
    where = frequency[both]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = table.interpolate(where, required.frequency, limit) / total[both]
    ratio = np.where(np.isnan(ratio), np.inf, ratio)
    least = int(ratio.argmin())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ratio < 1, [False]]).astype(int)))
    exceeded = tuple(
        (float(where[start]), float(where[end - 1]))
        for start, end in zip(edges[::2], edges[1::2], strict=True)
    )
    return Requirement(
        required.file,
        required.frequency,
        limit,
        float(ratio[least]),
        float(where[least]),
        exceeded,
        unit,
    )


def overlaps(grid: Float[np.ndarray, " frequency"], required: Table) -> bool:
    """Whether a table overlaps the range of a grid."""
    return bool(required.frequency[0] <= grid[-1] and required.frequency[-1] >= grid[0])
