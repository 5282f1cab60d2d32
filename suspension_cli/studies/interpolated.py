"""Maps of many points from few: jobs over grids whose results are analytic in their numbers.

A job that is `Analytic` tells which analytic functions its results follow from. These are computed
at some hundred Chebyshev points (`chebyshev`) and evaluated at all points of the grid. Points at
the ends of the axes, random ones, and those where the largest errors are expected are then computed
in full: the largest difference is the stated error. Where it is above `ACCEPTED` the grid is
computed point by point, as it is where a point has no result, or where the functions need too many
points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from suspension_cli.linear.system import LinearSystem
from suspension_cli.studies.chebyshev import Box, Surface, interpolate
from suspension_cli.studies.chunks import Columns
from suspension_cli.studies.job import Axis

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Inexact, Int

MOST_AXES = 3
"""Most numbers of a map that is interpolated."""
SHARE = 4
"""Least number of points of a grid for each that is computed."""
CHECKED = 12
"""Number of random points that are computed in full, beside corners and the worst ones."""
WORST = 6
"""Number of points for each axis at which the largest errors are expected."""
ROUNDING = 1e-11
"""Differences below this are rounding errors, of which larger ones may be elsewhere."""
ACCEPTED = 1e-6
"""Largest difference from full solutions, relative to the result, of an interpolated map."""
NEGLIGIBLE = 1e-4
"""Results below this fraction of the largest one are compared with that fraction."""
FEWEST = 512
"""Fewest points of a map that are evaluated at once."""
MOST_POINTS = 1 << 15
"""Most points that are evaluated at once."""
MOST_VALUES = 1 << 22
"""Most values of functions that are evaluated at once, beyond `FEWEST` points."""
EVEN = 1e-9
"""Relative difference of steps, or of ratios, of values that are evenly spaced."""


class Analytic(Protocol):
    """A job over a grid whose results follow from analytic functions of its numbers."""

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Numbers and their values."""
        ...

    @property
    def count(self) -> int:
        """Number of points."""
        ...

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        ...

    @property
    def compared(self) -> Mapping[str, Any]:
        """Columns that are compared with full solutions.

        And the sizes below which their differences are relative to these.
        """
        ...

    @property
    def least(self) -> Float[np.ndarray, " function"]:
        """Sizes of the analytic functions below which they are rounding errors."""
        ...

    def compute(self, start: int, stop: int) -> Columns:
        """Compute the results of points start to stop - 1."""
        ...

    def sample(
        self, values: dict[str, Float[np.ndarray, " point"]]
    ) -> Inexact[np.ndarray, "point function"]:
        """Compute the analytic functions; NaN where a design has no result."""
        ...

    def columns_of(self, functions: Inexact[np.ndarray, "point function"]) -> Columns:
        """Results that follow from values of the functions."""
        ...


@dataclass(frozen=True)
class InterpolatedMap:
    """A job whose points are evaluated from those of a few.

    Attributes
    ----------
    error
        Largest difference from full solutions, at least `ROUNDING`; see `ACCEPTED`.
    checked
        Number of points that were computed in full for it.
    """

    job: Analytic
    surface: Surface
    error: float
    checked: int

    @property
    def count(self) -> int:
        """Number of points."""
        return self.job.count

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        return f"{self.job.identity} interpolated at {self.surface.points}"

    @property
    def chunk(self) -> int:
        """Number of points that are best evaluated at once."""
        functions = self.surface.coefficient.shape[-1]
        return max(FEWEST, min(MOST_POINTS, MOST_VALUES // functions))

    @property
    def line(self) -> str:
        """What was computed, for the text and the file."""
        size = f"{self.error:.0e}" if self.error > ROUNDING else f"below {ROUNDING:.0e}"
        return (
            f"computed at {self.surface.points:,} points, interpolated at {self.count:,}; largest"
            f" difference at {self.checked} points {size}"
        )

    def compute(self, start: int, stop: int) -> Columns:
        """Evaluate the results of points start to stop - 1."""
        return _evaluate(self.job, self.surface, start, stop)


def _evaluate(job: Analytic, surface: Surface, start: int, stop: int) -> Columns:
    """Evaluate the results of points start to stop - 1, by whole rows of the first axis."""
    first, *others = [np.array(axis.values) for axis in job.axes]
    row = int(np.prod([len(values) for values in others], dtype=int))
    low = start // row
    high = -(-stop // row)
    grid = surface.on_grid([first[low:high], *others])
    flat = grid.reshape(-1, grid.shape[-1])
    return job.columns_of(flat[start - low * row : stop - low * row])


def interpolated(job: Analytic, seed: int = 0) -> InterpolatedMap | None:
    """Interpolate a job; None if its grid is small, or is not known to `ACCEPTED` in that way."""
    lengths = [len(axis.values) for axis in job.axes]
    if len(lengths) > MOST_AXES or min(lengths) < 2:
        return None
    box = _box(job.axes)
    if box is None:
        return None
    names = [axis.name for axis in job.axes]

    def sample(points: np.ndarray) -> np.ndarray:
        return job.sample(dict(zip(names, points.T, strict=True)))

    surface = interpolate(sample, box, job.count // SHARE, job.least)
    if surface is None:
        return None
    some = np.concatenate([_corners(job.axes), _random_points(job.count, seed)])
    points = sorted({*some.tolist(), *_worst_points(job, surface)})
    error = max(_largest_difference(job, surface, points), ROUNDING)
    return InterpolatedMap(job, surface, error, len(points)) if error <= ACCEPTED else None


def _box(axes: Sequence[Axis]) -> Box | None:
    """Ranges of the axes, those with a constant ratio in their logarithm; None of empty ones."""
    low = tuple(float(min(axis.values)) for axis in axes)
    high = tuple(float(max(axis.values)) for axis in axes)
    if any(one >= other for one, other in zip(low, high, strict=True)):
        return None
    return Box(low, high, tuple(_is_logarithmic(np.array(axis.values)) for axis in axes))


def _is_logarithmic(values: Float[np.ndarray, " value"]) -> bool:
    """Whether values have a constant ratio rather than a constant step."""
    if len(values) < 3 or values.min() <= 0:
        return False
    steps = np.diff(values)
    ratios = np.diff(np.log(values))
    return _is_even(ratios) and not _is_even(steps)


def _is_even(steps: Float[np.ndarray, " step"]) -> bool:
    """Whether steps are equal but for rounding."""
    return bool(np.ptp(steps) < EVEN * np.abs(steps).max())


def _largest_difference(job: Analytic, surface: Surface, points: list[int]) -> float:
    """Largest difference of interpolated from computed results at some points."""
    exact = _joined([job.compute(point, point + 1) for point in points])
    mine = _joined([_evaluate(job, surface, point, point + 1) for point in points])
    return largest_difference(job, exact, mine)


def _joined(parts: list[Columns]) -> Columns:
    return {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}


def largest_difference(job: Analytic, exact: Columns, mine: Columns) -> float:
    """Largest of the `differences`."""
    return float(differences(job, exact, mine).max(initial=0.0))


def differences(job: Analytic, exact: Columns, mine: Columns) -> Float[np.ndarray, " point"]:
    """Largest difference of the compared columns at each point, relative to those in `exact`.

    See `NEGLIGIBLE`; infinite where only one has a result.
    """
    found = []
    for name, least in job.compared.items():
        right = exact[name]
        own = mine[name]
        size = np.abs(right)
        scale = np.maximum(np.maximum(size, NEGLIGIBLE * np.fmax.reduce(size, axis=0)), least)
        same = (own == right) | (np.isnan(own) & np.isnan(right))
        with np.errstate(all="ignore"):
            change = np.where(same, 0.0, np.abs(own - right) / scale)
        found.append(np.nan_to_num(change, nan=np.inf).reshape(len(change), -1).max(1))
    return np.max(found, axis=0)


def _worst_points(job: Analytic, surface: Surface) -> list[int]:
    """Points at which results are expected to be least accurate, some for each axis.

    There the expected error of the series along that axis changes results most: between its nodes,
    and near poles and zeros of results. Of more points than `MOST_VALUES` allow, some are examined.
    """
    most = max(MOST_VALUES // surface.coefficient.shape[-1], FEWEST)
    length = min(MOST_POINTS, -(-min(job.count, most) // WORST))
    count = min(-(-job.count // length), max(most // length, 1))
    starts = np.linspace(0, job.count - length, count).astype(int).tolist()
    worst: list[int] = []
    for axis in range(len(job.axes)):
        changed = surface.with_expected_error(axis)
        found = []
        for start in starts:
            mine = _evaluate(job, surface, start, start + length)
            other = _evaluate(job, changed, start, start + length)
            change = differences(job, mine, other)
            place = int(change.argmax())
            found.append((float(change[place]), start + place))
        worst += [point for _, point in sorted(found)[-WORST:]]
    return worst


def _corners(axes: Sequence[Axis]) -> Int[np.ndarray, " point"]:
    """Numbers of the points at the ends of all axes."""
    shape = tuple(len(axis.values) for axis in axes)
    ends = np.ix_(*([0, length - 1] for length in shape))
    return np.ravel_multi_index(ends, shape).ravel()


def _random_points(count: int, seed: int) -> Int[np.ndarray, " point"]:
    return np.random.default_rng(seed).integers(count, size=CHECKED)


@np.errstate(all="ignore")  # of builds that failed
def determinants(model: LinearSystem, omega: float) -> Complex[np.ndarray, " build"]:
    """Determinant of the dynamic stiffness Z of builds over that of K + omega^2 M.

    Without losses it is the product of (omega_k^2 - omega^2) / (omega_k^2 + omega^2) over all
    modes: 0 at resonances, and never large. `omega` is in rad/s.
    """
    (count,) = model.batch
    own = (count, model.size, model.size)
    stiffness = np.broadcast_to(model.at(np.full(count, omega)).complete, own)
    mass = np.broadcast_to(model.mass, own)
    dynamic = stiffness - omega**2 * mass + 1j * omega * np.broadcast_to(model.damping, own)
    static = np.real(stiffness) + omega**2 * mass
    moving = np.s_[:, 6:, 6:]
    turn, size = np.linalg.slogdet(dynamic[moving])
    _, scale = np.linalg.slogdet(static[moving])
    return turn * np.exp(size - scale)
