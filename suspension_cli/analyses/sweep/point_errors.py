"""Errors of models at some points of a sweep, by which its model is chosen; and which points."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.followed_modes import Follower, complete
from suspension_cli.analyses.sweep.parameter_sweep import ParameterSweep
from suspension_cli.errors import InputError
from suspension_cli.quantities.differences import compare_batches
from suspension_cli.quantities.solved import Solved, of_designs
from suspension_cli.studies import variants
from suspension_cli.studies.extremes import MOST, find_extremes
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Int

    from suspension_cli.design.schema import Design
    from suspension_cli.models.choice import Comparison

POINTS = 9
"""Largest number of points at which models are compared before the sweep."""
FEW = 3
"""The same, if a quantity is computed design by design."""
FEW_EXTREMES = 6
"""Largest number of points at which models are compared after such a sweep."""


def first_points(job: ParameterSweep) -> Int[np.ndarray, " point"]:
    """Points at which models are compared before the sweep, at corners and middles of the grid."""
    corners = job.corners
    most = FEW if job.is_slow else POINTS
    return corners[np.unique(np.linspace(0, len(corners) - 1, most).astype(int))]


def extreme_points(
    follow: Follower, job: ParameterSweep, columns: Columns
) -> Int[np.ndarray, " point"]:
    """Points at which the results of a finished sweep are extreme, or change fastest."""
    known = job.on_grid(columns)
    rank = None
    if job.followed:
        rank, _ = follow(job, columns)
    most = FEW_EXTREMES if job.is_slow else MOST
    return find_extremes(complete(job, known, rank), most)


class PointErrors:
    """The change of a sweep's quantities from one model to another, at any of its points.

    Each point is solved once in each model, also if more points are compared later.
    """

    def __init__(self, job: ParameterSweep) -> None:
        self.job = job
        self._designs: dict[int, Design | None] = {}
        self._solved: dict[tuple[int, str], Solved | None] = {}

    def __call__(self, points: Int[np.ndarray, " point"]) -> Comparison:
        """Return the comparison at some points, as `model_choice.for_builds` takes it.

        Points whose design is not possible are left out.
        """
        new = np.array([n for n in points.tolist() if n not in self._designs], dtype=int)
        designs = variants.designs_at(self.job.text, self.job.values_at(new))
        self._designs.update(zip(new.tolist(), designs, strict=True))
        possible = [n for n in points.tolist() if self._designs[n] is not None]

        def solve(level: str) -> list[Solved | None]:
            return [self._at(point, level) for point in possible]

        return compare_batches(self.job.quantities, solve)

    def _at(self, point: int, level: str) -> Solved | None:
        """Solve a point in a model; None if the model cannot describe it."""
        key = point, level
        if key not in self._solved:
            self._solved[key] = None
            unstable = self.job.allow_unstable
            with contextlib.suppress(InputError):
                for _, batch in of_designs(
                    [self._designs[point]], level, self.job.needs, allow_unstable=unstable
                ):
                    self._solved[key] = batch
        return self._solved[key]
