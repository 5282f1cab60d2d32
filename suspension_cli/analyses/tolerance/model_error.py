"""Change of the results of random builds from one model to another, computed for a few builds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from suspension_cli.analyses.tolerance.solve import RandomBuilds
from suspension_cli.linear.mode_pairing import body_overlap, pair_by_overlap
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Frequencies, Systems
from suspension_cli.scene.arrays import Array
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.relative_change import largest_relative_change, relative_change

SEARCHED = 1000
"""First builds from which the extreme ones are taken."""
EXTREME = 15
"""Number of builds with the largest deviations, at which models are compared."""
NO_BUILD = "no extreme build has an equilibrium"
ONE_MODEL_ONLY = "some builds have an equilibrium in only one of the models"


@dataclass(frozen=True)
class _Extremes(RandomBuilds):
    """The nominal build and the extreme builds of a job."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of builds."""
        return (1 + min(EXTREME, self.count),)

    def deviations(self, start: int, stop: int) -> Array:
        """Deviations (p, factors) of builds start to stop - 1; 0 for the nominal build."""
        every = super().deviations(0, min(SEARCHED, self.count))
        scale = every.std(0)
        size = (every / np.where(scale > 0, scale, 1.0) ** 2 * every).sum(1)
        most = np.argsort(-size, kind="stable")[:EXTREME]
        return np.concatenate([np.zeros_like(every[:1]), every[most]])[start:stop]


def build_change(job: RandomBuilds) -> Callable[[Model, Model], tuple[float, str]]:
    """Return the change of the results of random builds, for `model_choice.for_builds`.

    Frequencies, couplings and statics of the nominal and of extreme builds are compared; couplings
    and responses relative to the largest of them, statics to the largest displacement or rotation.
    The effect of wire mass on frequencies is estimated for the nominal build. The change is
    infinite if a build has an equilibrium in only one model.
    """

    @cache
    def solved(level: str) -> tuple[_Extremes, ColumnValues]:
        fields = (job.text, job.count, job.seed, job.question, job.allow_unstable)
        extremes = _Extremes(*fields, level, job.requirements)
        return extremes, extremes.compute(0, *extremes.shape)

    systems = Systems(job.design)

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        (old_job, old), (new_job, new) = solved(simple.name), solved(refined.name)
        if (np.isfinite(old["ratio"]) != np.isfinite(new["ratio"])).any():
            return float("inf"), ONE_MODEL_ONLY
        coupling = relative_change(old["ratio"], new["ratio"])
        if np.isnan(coupling):
            return coupling, NO_BUILD
        changes = [(coupling, "the cross-coupling")]
        changes += [
            (relative_change(old["static"][..., part], new["static"][..., part]), what)
            for part, what in (
                (slice(3), "static displacements"),
                (slice(3, 6), "static rotations"),
            )
        ]
        changes += [
            (relative_change(old["response"][:, n], new["response"][:, n]), one.text)
            for n, one in enumerate(job.ratios)
        ]
        if refined.has_wire_mass:
            changes.append(Frequencies().change(systems(simple), systems(refined)))
        else:
            model = systems(simple)
            count = 6 * len(model.body)
            mass = model.mass[6 : 6 + count, 6 : 6 + count]
            a, b = old_job.nominal, new_job.nominal
            there = pair_by_overlap(body_overlap(a.shape, b.shape, mass))
            changes += [
                (
                    largest_relative_change(old["frequency"][:, n], new["frequency"][:, there[n]]),
                    label,
                )
                for n, label in enumerate(a.label)
            ]
        return max(changes, key=lambda one: one[0])

    return change
