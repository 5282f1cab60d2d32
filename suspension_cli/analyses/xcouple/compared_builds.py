"""Imperfect builds at which models are compared, and the change of their couplings."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.xcouple.imperfect_builds import ImperfectBuilds
from suspension_cli.models.base import Model
from suspension_cli.models.choice import compare_builds
from suspension_cli.studies.extremes import find_extremes
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Int

    from suspension_cli.models.choice import Comparison

FREQUENCIES = 12
"""Number of frequencies at which models are compared."""


def first_points(job: ImperfectBuilds) -> Int[np.ndarray, "point 2"]:
    """Points at which models are compared before the sweep: numbers of build and frequency.

    Builds are those at the corners and middles of the swept space.
    """
    last = len(job.question.frequency) - 1
    frequencies = np.unique(np.linspace(0, last, min(FREQUENCIES, last + 1)).astype(int))
    return np.stack(np.meshgrid(job.corners, frequencies), axis=-1).reshape(-1, 2)


def extreme_points(job: ImperfectBuilds, columns: Columns) -> Int[np.ndarray, "point 2"]:
    """Points at which the couplings of a finished sweep are largest, or change fastest."""
    ratio = job.on_grid(columns)["ratio"]
    found = find_extremes(ratio[..., None])
    return np.stack(np.divmod(found, ratio.shape[-1]), axis=-1)


def coupling_change(job: ImperfectBuilds, points: Int[np.ndarray, "point 2"]) -> Comparison:
    """The change of a sweep's couplings at some points, as `model_choice.for_builds` takes it."""
    build, row = np.unique(points[:, 0], return_inverse=True)
    number, column = np.unique(points[:, 1], return_inverse=True)
    frequency = tuple(job.question.frequency[n] for n in number)
    sample = replace(job, question=replace(job.question, frequency=frequency))

    def solve(model: Model) -> list[tuple[str, np.ndarray]]:
        found = replace(sample, level=model.name).compute_at(job.values_at(build))
        return [("couplings", found["ratio"][row, column])]

    return compare_builds(solve)
