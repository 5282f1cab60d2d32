"""Maps of many points from few: jobs over grids whose results are analytic in their numbers.

A job that is `Analytic` tells which analytic functions its results follow from. These are computed
at some hundred Chebyshev points (`chebyshev`) and evaluated at all points of the grid. Points at
the ends of the axes and random ones are then computed in full: the largest difference is the stated
error, and where it is above `ACCEPTED` the grid is computed point by point, as it is where a point
has no result, or where the functions need too many points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

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
"""Number of random points that are computed in full, beside the corners."""
ACCEPTED = 1e-6
"""Largest difference from full solutions, relative to the result, of an interpolated map."""
NEGLIGIBLE = 1e-4
"""Results below this fraction of the largest one are compared with that fraction."""
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
    def compared(self) -> Sequence[str]:
        """Columns that are compared with full solutions."""
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
        Largest difference from full solutions, see `ACCEPTED`.
    """

    job: Analytic
    surface: Surface
    error: float

    @property
    def count(self) -> int:
        """Number of points."""
        return self.job.count

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        return f"{self.job.identity} interpolated at {self.surface.points}"

    @property
    def line(self) -> str:
        """What was computed, for the text and the file."""
        return (
            f"computed at {self.surface.points:,} points, interpolated at {self.count:,}; largest"
            f" difference at {CHECKED + 2 ** len(self.job.axes)} points {self.error:.0e}"
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

    surface = interpolate(sample, box, job.count // SHARE)
    if surface is None:
        return None
    error = _largest_difference(job, surface, seed)
    return InterpolatedMap(job, surface, error) if error <= ACCEPTED else None


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


def _largest_difference(job: Analytic, surface: Surface, seed: int) -> float:
    """Largest difference of interpolated from computed results, at corners and random points."""
    points = np.concatenate([_corners(job.axes), _random_points(job.count, seed)])
    exact = [job.compute(point, point + 1) for point in points.tolist()]
    mine = [_evaluate(job, surface, point, point + 1) for point in points.tolist()]
    largest = 0.0
    for name in job.compared:
        right = np.concatenate([one[name] for one in exact])
        own = np.concatenate([one[name] for one in mine])
        size = np.abs(right)
        scale = np.maximum(size, NEGLIGIBLE * size.max(0))
        with np.errstate(all="ignore"):
            change = np.where(own == right, 0.0, np.abs(own - right) / scale)
        largest = max(largest, float(np.nan_to_num(change, nan=np.inf).max(initial=0.0)))
    return largest


def _corners(axes: Sequence[Axis]) -> Int[np.ndarray, " point"]:
    """Numbers of the points at the ends of all axes."""
    shape = tuple(len(axis.values) for axis in axes)
    ends = np.ix_(*([0, length - 1] for length in shape))
    return np.ravel_multi_index(ends, shape).ravel()


def _random_points(count: int, seed: int) -> Int[np.ndarray, " point"]:
    return np.random.default_rng(seed).integers(count, size=CHECKED)


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
    with np.errstate(all="ignore"):
        turn, size = np.linalg.slogdet(dynamic[moving])
        _, scale = np.linalg.slogdet(static[moving])
    return turn * np.exp(size - scale)
