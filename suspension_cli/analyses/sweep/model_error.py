"""Change of a sweep's results from one model to another, computed at some points of its grid."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np

from suspension_cli.analyses.sweep.solve import ParameterSweep
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.named_results import Mode
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Several, Systems, pair_bodies
from suspension_cli.studies.job import ends_and_middle
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
                changes += _changes(job, systems, simple, refined)
        return max(changes, key=lambda one: one[0])

    return change


def _has_result(systems: Systems, model: Model, *, stable: bool) -> bool:
    """Whether a design has an equilibrium in a model, and a stable one if that is needed."""
    try:
        system = systems(model)
    except InputError:
        return False
    return not stable or eigenmodes.solve(system.constant).stable


def _changes(
    job: ParameterSweep, systems: Systems, simple: Model, refined: Model
) -> list[tuple[float, str]]:
    """Change of each result at one point.

    Where frequencies meet, shapes mix differently in both models. So a mode's partner is the one of
    most similar shape here or, if that changes it less, the one that the nominal mode becomes.
    """
    old, new = systems(simple), systems(refined)
    modes, partners = (eigenmodes.solve(system.constant) for system in (old, new))
    here, there = (
        pair_bodies(job.nominal, one, system) for one, system in ((modes, old), (partners, new))
    )
    items = tuple(
        Mode(one.text, int(here[one.number])) if isinstance(one, Mode) else one
        for one in job.results
    )
    found = Several(items, modes).changes(old, new)
    if refined.has_wire_mass:
        return found
    with np.errstate(invalid="ignore"):
        direct = np.abs(modes.frequency[here] / partners.frequency[there] - 1)
    return [
        (min(change, float(direct[one.number])) if isinstance(one, Mode) else change, text)
        for one, (change, text) in zip(job.results, found, strict=True)
    ]
