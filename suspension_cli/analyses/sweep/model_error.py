"""Change of a sweep's results from one model to another, computed at some points of its grid."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np

from suspension_cli.analyses.sweep.solve import ParameterSweep
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode, Scalar
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Several, Systems
from suspension_cli.studies.axes import ends_and_middle
from suspension_cli.studies.variants import overridden

POINTS = 9
"""Largest number of points at which models are compared."""
ONE_MODEL_ONLY = "some points have an equilibrium in only one of the models"


def result_change(job: ParameterSweep) -> Callable[[Model, Model], tuple[float, str]]:
    """The change of a sweep's results, as `model_choice.for_builds` takes it.

    Results are compared at corners and middles of the grid, with modes paired by their shapes. The
    change is infinite where a point has an equilibrium, or for responses a stable one, in only one
    of the models. The `job` is in the simplest model.
    """
    axes = ends_and_middle(job.axes)
    grid = np.stack(np.meshgrid(*(axis.values for axis in axes), indexing="ij"), axis=-1)
    grid = grid.reshape(-1, len(axes))
    points: list[Systems] = []
    for row in grid[np.unique(np.linspace(0, len(grid) - 1, POINTS).astype(int))]:
        with contextlib.suppress(InputError):  # no design there
            values = {axis.name: float(value) for axis, value in zip(axes, row, strict=True)}
            points.append(Systems(overridden(job.text, values)))
    stable = bool(job.ratios) and not job.allow_unstable

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        changes = [(0.0, "the results")]
        for systems in points:
            known = {_has_result(systems, model, stable=stable) for model in (simple, refined)}
            if len(known) > 1:
                return float("inf"), ONE_MODEL_ONLY
            if known == {True}:
                compare = systems.compare(
                    lambda system: _renumbered(job.results, job.nominal, system)
                )
                changes.append(compare(simple, refined))
        return max(changes, key=lambda one: one[0])

    return change


def _has_result(systems: Systems, model: Model, *, stable: bool) -> bool:
    """Whether a design has an equilibrium in a model, and a stable one if that is needed."""
    try:
        system = systems(model)
    except InputError:
        return False
    return not stable or eigenmodes.solve(system.constant).stable


def _renumbered(results: tuple[Scalar, ...], base: Modes, system: LinearSystem) -> Several:
    """Results of one design whose modes are given by their numbers in another."""
    found = eigenmodes.solve(system.constant)
    count = 6 * len(system.body)
    mass = system.mass[6 : 6 + count, 6 : 6 + count]
    number = pair_by_overlap(body_overlap(base.shape, found.shape, mass))
    return Several(
        tuple(
            Mode(one.text, int(number[one.number])) if isinstance(one, Mode) else one
            for one in results
        ),
        found,
    )
