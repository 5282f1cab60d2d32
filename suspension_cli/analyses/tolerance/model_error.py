"""Change of the results of random builds from one model to another, computed for a few builds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Frequencies, Systems
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.relative_change import largest_relative_change, relative_change
from suspension_cli.studies.sample_points import RANDOM

if TYPE_CHECKING:
    from jaxtyping import Float

SEARCHED = 1000
"""First builds from which the extreme ones are taken."""
EXTREME = 15
"""Number of builds with the largest deviations, at which models are compared."""
NO_BUILD = "no extreme build has an equilibrium"
ONE_MODEL_ONLY = "some builds have an equilibrium in only one of the models"


def build_change(job: RandomBuilds) -> Callable[[Model, Model], tuple[float, str]]:
    """Return the change of the results of random builds, for `model_choice.for_builds`.

    Frequencies, couplings and statics of the nominal and of extreme builds are compared; couplings
    and responses relative to the largest of them, statics to the largest displacement or rotation.
    The effect of wire mass on frequencies is estimated for the nominal build. The change is
    infinite if a build has an equilibrium in only one model.
    """
    systems = Systems(job.design)
    deviations = _extremes(replace(job, method=RANDOM, with_indices=False))

    @cache
    def solved(model: Model) -> tuple[Modes, ColumnValues]:
        one = replace(job, level=model.name)
        return one.nominal, one.compute_with(deviations)

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        (modes, old), (others, new) = solved(simple), solved(refined)
        if (np.isfinite(old["ratio"]) != np.isfinite(new["ratio"])).any():
            return float("inf"), ONE_MODEL_ONLY
        if not np.isfinite(old["ratio"]).any():
            return float("nan"), NO_BUILD
        parts = [
            ("the cross-coupling", "ratio", slice(None)),
            ("static displacements", "static", np.s_[..., :3]),
            ("static rotations", "static", np.s_[..., 3:]),
            *((one.text, "response", np.s_[:, n]) for n, one in enumerate(job.ratios)),
        ]
        changes = [
            (relative_change(old[name][part], new[name][part]), what) for what, name, part in parts
        ]
        if refined.has_wire_mass:
            changes.append(Frequencies().change(systems(simple), systems(refined)))
        else:
            model = systems(simple)
            count = 6 * len(model.body)
            mass = model.mass[6 : 6 + count, 6 : 6 + count]
            there = pair_by_overlap(body_overlap(modes.shape, others.shape, mass))
            before, after = old["frequency"], new["frequency"][:, there]
            changes += [
                (largest_relative_change(before[:, n], after[:, n]), label)
                for n, label in enumerate(modes.label)
            ]
        return max(changes, key=lambda one: one[0])

    return change


def _extremes(job: RandomBuilds) -> Float[np.ndarray, "build factor"]:
    """Deviations of the nominal build, 0, and of the most extreme ones."""
    every = job.deviations(0, min(SEARCHED, job.count))
    scale = every.std(0)
    size = ((every / np.where(scale > 0, scale, 1.0)) ** 2).sum(1)
    most = np.argsort(-size, kind="stable")[:EXTREME]
    return np.concatenate([np.zeros_like(every[:1]), every[most]])
