"""Motion of a suspension by cause: spectra, cumulative RMS, comparison with a requirement.

The mean square of a motion x of power spectral density S(f) is the integral of S, that of its
velocity the integral of (2 pi f)^2 S; cumulative from the highest frequency f_max down,

    RMS(f)^2 = integral of S from f to f_max.

The trapezoidal rule is applied on the given grid with points added around each resonance, and
wherever halving an interval changes the integral above it by more than `ACCURACY`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from suspension_cli.analyses.budget import table
from suspension_cli.analyses.budget.noise import Noises
from suspension_cli.analyses.budget.table import Table
from suspension_cli.scene.arrays import Array

ACCURACY = 2e-6
"""Change by halving an interval, relative to the integral from its lower end up, that is left."""
NARROWEST = 1e-13
"""Relative width of an interval that is not halved any more: enough for a Q of about 1e11."""
ROUNDS = 60
"""Largest number of times that intervals are halved."""
RANGE = 0.05
"""Relative distance from a resonance up to which points are placed around it."""
STEP = 0.5
"""Of the points f + w sinh(u) around a resonance of half width w, in u."""


@dataclass(frozen=True)
class Requirement:
    """A required amplitude spectral density, and what is left to it.

    Attributes
    ----------
    name : str
        Of the file.
    frequency, density : (n,) arrays
        Hz, unit/sqrt(Hz).
    margin : float
        Smallest ratio of the requirement to the motion where both are known.
    at : float
        Its frequency, Hz.
    exceeded : list of (float, float)
        Intervals in which the motion is above, Hz.
    """

    name: str
    frequency: Array
    density: Array
    margin: float
    at: float
    exceeded: tuple[tuple[float, float], ...]

    @property
    def met(self) -> bool:
        """Whether the motion is nowhere above it."""
        return self.margin >= 1


@dataclass(frozen=True)
class Budget:
    """One motion by cause.

    Attributes
    ----------
    frequency : (f,) array
        Hz, ascending.
    output : str
        The observed motion.
    unit : str
        Of the motion: m or rad.
    cause : tuple of str
        ``ground.x``, ``sensor.LOOP``, ``actuator.LOOP``, ``thermal``.
    density : (c, f) array
        One-sided power spectral density by cause, unit^2/Hz.
    square, square_velocity : (c, f) arrays
        Mean square from each frequency up, by cause: unit^2 and (unit/s)^2; infinite where a
        resonance without loss is driven.
    requirement : Requirement or None
    """

    frequency: Array
    output: str
    unit: str
    cause: tuple[str, ...]
    density: Array
    square: Array
    square_velocity: Array
    requirement: Requirement | None = None

    @property
    def amplitude(self) -> Array:
        """Amplitude spectral density (f,) of the sum, unit/sqrt(Hz)."""
        return np.sqrt(self.density.sum(0))

    @property
    def parts(self) -> dict[str, Array]:
        """Amplitude spectral density (f,) by cause, unit/sqrt(Hz)."""
        return {name: np.sqrt(row) for name, row in zip(self.cause, self.density, strict=True)}

    @property
    def rms(self) -> Array:
        """RMS (f,) of the motion from each frequency up."""
        return np.sqrt(self.square.sum(0))

    @property
    def rms_velocity(self) -> Array:
        """RMS (f,) of the velocity from each frequency up, unit/s."""
        return np.sqrt(self.square_velocity.sum(0))


def solve(
    noises: Noises, grid: Array, resonance: Array, requirements: dict[int, Table], *, added: bool
) -> list[Budget]:
    """Compute the budget of every output.

    Parameters
    ----------
    noises : Noises
    grid : (f,) array
        Hz, ascending.
    resonance : (p,) complex array
        Poles, rad/s; points are added around them.
    requirements : dict
        Tables of required amplitude spectral densities by number of the output.
    added : bool
        Whether the spectra list the added points too.
    """
    corners = [motion.corner for motion in noises.motion.values()]
    corners += [table.frequency for table in requirements.values()]
    seeds = np.concatenate([points_around(resonance), *corners])
    seeds = seeds[(seeds > grid[0]) & (seeds < grid[-1])]
    frequency, density, unresolved = refine(noises.density, np.union1d(grid, seeds))
    square = integrate_down(frequency, density)
    velocity = integrate_down(frequency, density * (2 * np.pi * frequency) ** 2)
    if unresolved is not None:
        below = frequency <= unresolved.max()
        driven = density[..., np.isin(frequency, unresolved)].max(-1) > 0
        for whole in (square, velocity):
            whole[driven[..., None] & below] = np.inf
    if len(grid) == 1:
        square, velocity = np.full_like(square, np.nan), np.full_like(velocity, np.nan)
    shown = slice(None) if added else np.isin(frequency, grid)
    budgets = []
    for n, signal in enumerate(noises.output):
        total = np.sqrt(density[n].sum(0))
        required = requirements.get(n)
        budgets.append(
            Budget(
                frequency[shown],
                signal.text,
                signal.unit,
                noises.cause,
                density[n][:, shown],
                square[n][:, shown],
                velocity[n][:, shown],
                None if required is None else compare(frequency, total, required),
            )
        )
    return budgets


def points_around(resonance: Array) -> Array:
    """Place frequencies (n,) in Hz around poles (p,) in rad/s, denser towards them."""
    found: list[Array] = [np.zeros(0)]
    for pole in resonance:
        centre = abs(pole.imag) / (2 * np.pi)
        width = max(abs(pole.real) / (2 * np.pi), NARROWEST * centre)
        if not 0 < width < RANGE * centre:
            continue
        steps = int(np.arcsinh(RANGE * centre / width) / STEP) + 1
        # half a step aside, so that a resonance without loss is no point
        found.append(centre + width * np.sinh(STEP * (np.arange(-steps, steps) + 0.5)))
    return np.concatenate(found)


def refine(density: Callable[[Array], Array], grid: Array) -> tuple[Array, Array, Array | None]:
    """Add points to a grid until the integrals over spectra are accurate.

    Parameters
    ----------
    density : callable
        Power spectral densities (o, c, f) at frequencies (f,), Hz.
    grid : (f,) array
        Ascending, Hz.

    Returns
    -------
    frequency : (f,) array
    density : (o, c, f) array
    unresolved : (n,) array or None
        Frequencies at which the integral does not converge.
    """
    value = density(grid)
    pending = np.ones(max(len(grid) - 1, 0), dtype=bool)
    for _ in range(ROUNDS):
        low, high = grid[:-1], grid[1:]
        narrow = pending & (high - low <= NARROWEST * high)
        pending &= ~narrow
        if not pending.any():
            break
        weighted = _weighted(grid, value)
        area = (weighted[..., 1:] + weighted[..., :-1]) / 2 * (high - low)
        above = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
        at = np.flatnonzero(pending)
        middle = np.sqrt(low[at] * high[at])
        new = density(middle)
        now = _weighted(middle, new)
        halved = (weighted[..., at] + now) / 2 * (middle - low[at])
        halved += (now + weighted[..., at + 1]) / 2 * (high[at] - middle)
        change = np.abs(halved - area[..., at])
        split = (change > ACCURACY * (above[..., at] + halved - area[..., at])).any((0, 1))
        where = at[split] + 1
        grid = np.insert(grid, where, middle[split])
        value = np.insert(value, where, new[..., split], axis=-1)
        pending = np.zeros(len(grid) - 1, dtype=bool)
        children = at[split] + np.arange(len(where))
        pending[children] = pending[children + 1] = True
    else:
        narrow = pending
    # beside a pole without loss even the narrowest intervals still matter
    if len(grid) > 1 and narrow.any():
        return grid, value, np.unique(grid[:-1][narrow])
    return grid, value, None


def _weighted(frequency: Array, value: Array) -> Array:
    """Integrands of the mean squares of displacement and velocity: (2, o, f)."""
    total = value.sum(1)
    return np.stack([total, total * (2 * np.pi * frequency) ** 2])


def integrate_down(frequency: Array, value: Array) -> Array:
    """Integrate (..., f) from the highest frequency down to each one, by the trapezoidal rule."""
    area = (value[..., 1:] + value[..., :-1]) / 2 * np.diff(frequency)
    result = np.zeros_like(value)
    result[..., :-1] = np.cumsum(area[..., ::-1], axis=-1)[..., ::-1]
    return result


def compare(frequency: Array, total: Array, required: Table) -> Requirement | None:
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
    )


def overlaps(grid: Array, required: Table) -> bool:
    """Whether a table has frequencies in common with the range of a grid."""
    return bool(required.frequency[0] <= grid[-1] and required.frequency[-1] >= grid[0])
