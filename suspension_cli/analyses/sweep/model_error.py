"""Change of a sweep's results from one model to another, computed at some points of its grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.solve import ParameterSweep, has_modes
from suspension_cli.errors import InputError
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.linear.named_results import Mode
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Several, Systems
from suspension_cli.studies import builds
from suspension_cli.studies.axes import ends_and_middle
from suspension_cli.studies.relative_change import largest_relative_change
from suspension_cli.studies.variants import overridden

if TYPE_CHECKING:
    from jaxtyping import Float, Int

POINTS = 5
"""Largest number of points at which the effect of wire mass on modes is estimated."""
ONE_MODEL_ONLY = "some points have an equilibrium in only one of the models"


@dataclass(frozen=True)
class _Points:
    """Results in one model: status, modes (in coordinates of bodies), magnitudes."""

    status: Int[np.ndarray, " point"]
    omega_squared: Float[np.ndarray, "point mode"]
    shape: Float[np.ndarray, "point mode coordinate"]
    nominal: Float[np.ndarray, "mode coordinate"]
    response: Float[np.ndarray, "point response"]


def result_change(job: ParameterSweep) -> Callable[[Model, Model], tuple[float, str]]:
    """The change of a sweep's results, as `model_choice.for_builds` takes it.

    Results are compared at the corners and middles of the grid, with modes paired by their shapes;
    the change of mode frequencies by wire mass is estimated. The change is infinite where a point
    has an equilibrium in only one of the models. The `job` is in the simplest model.
    """
    sample = replace(job, axes=ends_and_middle(job.axes))
    modes = tuple(item for item in job.results if isinstance(item, Mode))
    count = 6 * len(job.nominal.body)

    @cache
    def points(model: Model) -> _Points:
        results = job.ratios if model.has_wire_mass else job.results
        one = replace(sample, level=model.name, results=results)
        found = one.compute(0, one.count)
        none = np.zeros((sample.count, 0, 1))
        return _Points(
            found["status"],
            found.get("omega_squared", none[..., 0]),
            found.get("shape", none)[..., :count].astype(float),
            one.nominal_shape[:, :count] if "shape" in found else none[0],
            np.abs(found.get("response", none[..., 0])),
        )

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        changes: list[tuple[float, str]] = []
        if job.ratios or not refined.has_wire_mass:
            old, new = points(simple), points(refined)
            valid = (lambda s: s == builds.GOOD) if job.ratios else has_modes
            if (valid(old.status) != valid(new.status)).any():
                return float("inf"), ONE_MODEL_ONLY
            for n, item in enumerate(job.ratios):
                most = largest_relative_change(old.response[:, n], new.response[:, n])
                missed = " is zero without it" if np.isinf(most) else ""
                changes.append((most, f"{item.text}{missed}"))
            if modes and not refined.has_wire_mass:
                changes += _shifts(job.nominal_shape[:, :count], modes, old, new)
        if modes and refined.has_wire_mass:
            changes += _mass_effects(sample, modes, simple, refined)
        return max(changes, key=lambda one: one[0], default=(0.0, "the results"))

    return change


def _shifts(
    nominal: Float[np.ndarray, "mode coordinate"],
    modes: tuple[Mode, ...],
    old: _Points,
    new: _Points,
) -> list[tuple[float, str]]:
    """Find the largest changes of frequencies at each point; infinite where a sign changes.

    A mode of one model is paired with the mode of the other whose shape overlaps it most, at this
    point or in the nominal design. The smaller change of the two counts, as shapes mix where
    frequencies meet. `nominal` are the nominal shapes of the simplest model, in which modes are
    numbered.
    """
    changes = []
    start_old, start_new = _pair(nominal, old.nominal), _pair(nominal, new.nominal)
    for n in np.flatnonzero(has_modes(old.status)):
        here, there = _pair(old.nominal, old.shape[n]), _pair(old.shape[n], new.shape[n])
        along = _pair(new.nominal, new.shape[n])
        for mode in modes:
            number = here[start_old[mode.number]]
            partners = there[number], along[start_new[mode.number]]
            squared = float(old.omega_squared[n, number])
            change = float(_frequency_change(squared, new.omega_squared[n, list(partners)]).min())
            text = f"it decides whether {mode.text} is stable" if np.isinf(change) else mode.text
            changes.append((change, text))
    return changes


def _pair(
    rows: Float[np.ndarray, "row coordinate"], columns: Float[np.ndarray, "column coordinate"]
) -> Int[np.ndarray, " row"]:
    """Pair modes by their shapes."""
    return pair_by_overlap((rows @ columns.T) ** 2)


def _frequency_change(old: float, new: Float[np.ndarray, " mode"]) -> Float[np.ndarray, " mode"]:
    """Compute relative changes of frequency from omega^2; infinite where one mode is unstable."""
    change = np.abs(np.sqrt(np.abs(old) / np.where(new > 0, new, 1.0)) - 1)
    return np.where(np.sign(old) != np.sign(new), np.inf, np.where(new > 0, change, 0.0))


def _mass_effects(
    sample: ParameterSweep, modes: tuple[Mode, ...], simple: Model, refined: Model
) -> list[tuple[float, str]]:
    """Compute the changes of mode frequencies by wire mass, at some points."""
    base, changes = sample.nominal, []
    for n in np.unique(np.linspace(0, sample.count - 1, min(POINTS, sample.count)).astype(int)):
        here = {name: float(value[0]) for name, value in sample.values(n, n + 1).items()}
        try:
            compare = Systems(overridden(sample.text, here)).compare(
                lambda system: _renumbered(modes, base, system)
            )
            changes.append(compare(simple, refined))
        except InputError:  # no equilibrium there
            continue
    return changes


def _renumbered(modes: tuple[Mode, ...], base: Modes, system: LinearSystem) -> Several:
    """Find the modes of one design that are given by their numbers in another."""
    found = eigenmodes.solve(system.constant)
    count = 6 * len(system.body)
    mass = system.mass[6 : 6 + count, 6 : 6 + count]
    number = pair_by_overlap(body_overlap(base.shape, found.shape, mass))
    return Several(tuple(Mode(one.text, int(number[one.number])) for one in modes), found)
