"""Mode frequencies, cross-coupling and static pose of random builds.

Each nominal mode is paired with the mode of the build whose shape overlaps it most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.tolerance.quantities import (
    RATIO,
    Quantity,
    Requirement,
    find,
    of_modes,
    of_stages,
)
from suspension_cli.analyses.xcouple.solve import CouplingRequest, couplings
from suspension_cli.errors import gather
from suspension_cli.linear import batch_modes, eigenmodes, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_pairing import pair_bodies, pair_by_overlap
from suspension_cli.linear.named_results import Ratio, quotient_unit
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Frequencies, Systems, compare_builds
from suspension_cli.studies import builds, sampling
from suspension_cli.studies.builds import OUTCOME, Builds, Column, ColumnValues
from suspension_cli.studies.job import Job, nominal_system
from suspension_cli.studies.sample_points import RANDOM, SamplePoints

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.models.choice import Comparison

SEARCHED = 1000
"""First builds from which the extreme ones are taken."""
EXTREME = 15
"""Number of builds with the largest deviations, at which models are compared."""


@dataclass(frozen=True)
class RandomBuilds(Job):
    """Random builds of one design with a `[tolerance]` table.

    Attributes
    ----------
    count
        Number of builds.
    question
        The cross-coupling; its wire and body are ignored.
    allow_unstable
        Whether builds with an unstable equilibrium are valid.
    level
        Name of a model that supports imperfect builds.
    requirements
        The responses that they name are also computed.
    method
        Sampling, see `studies.sample_points`.
    with_indices
        Whether builds are drawn for Sobol indices.
    """

    count: int
    seed: int
    question: CouplingRequest
    allow_unstable: bool = False
    level: str = registry.STRING.name
    requirements: tuple[Requirement, ...] = ()
    method: str = RANDOM
    with_indices: bool = False

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of builds."""
        return (self.count,)

    @property
    def scales(self) -> tuple[str, ...]:
        """Name of the dataset of build numbers."""
        return ("build",)

    @property
    def columns(self) -> tuple[Column, ...]:
        """Datasets of the file."""
        ratio = quotient_unit(self.question.over, self.question.under)
        bodies = len(self.scene.bodies.name)
        return (
            Column("build", "u4", (), "1"),
            Column("frequency", "f8", (len(self.nominal.omega_squared),), "Hz", ("mode",)),
            Column("ratio", "c16", (len(self.question.frequency),), ratio, ("coupling_frequency",)),
            Column("static", "f8", (bodies, 6), "{static_unit}", ("stage", "static_dof")),
            *builds.response_columns(self.ratios),
            *OUTCOME,
        )

    @cached_property
    def factors(self) -> tuple[sampling.ScatteredNumber, ...]:
        """Numbers of the design that vary between builds."""
        return sampling.factors(self.design, self.scene)

    @cached_property
    def ratios(self) -> tuple[Ratio, ...]:
        """Named responses and couplings that requirements limit."""
        named = [one for one in self.requirements if "/" in one.quantity]
        found = [one.ratio for one in gather(self.find, named)]
        return tuple(dict.fromkeys(ratio for ratio in found if ratio is not None))

    @cached_property
    def required(self) -> tuple[Quantity, ...]:
        """Quantity of each requirement; raises `InputError` if the model has none of that name."""
        return tuple(
            replace(one, place=(self.ratios.index(one.ratio),)) if one.ratio else one
            for one in gather(self.find, self.requirements)
        )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities whose statistics are computed, each once."""
        stages = of_stages(self.scene.bodies.name)
        return tuple(dict.fromkeys((*of_modes(self.nominal), RATIO, *stages, *self.required)))

    def find(self, requirement: Requirement) -> Quantity:
        """Find the quantity of a requirement; that of a response has no place yet."""
        known = signals.bodies_with_signals(nominal_system(self.text, registry.STRING.name))
        stages = self.scene.bodies.name
        return find(requirement.quantity, requirement.key, self.nominal, stages, known)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of the tolerances, each of one number or several."""
        return tuple(dict.fromkeys(factor.group for factor in self.factors))

    @cached_property
    def points(self) -> SamplePoints:
        """Points of the unit cube from which deviations follow."""
        groups = [self.groups.index(factor.group) for factor in self.factors]
        return SamplePoints(
            self.method, self.seed, self.count, tuple(groups) if self.with_indices else ()
        )

    @cached_property
    def nominal(self) -> Modes:
        """Modes without random deviations, but with the design's own perturbations."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    def check(self) -> None:
        """Raise `InputError` if there is no table of tolerances, or a signal is invalid."""
        self.compute(0, 1)

    def deviations(self, start: int, stop: int) -> Float[np.ndarray, "stop-start factor"]:
        """Draw the random deviations of builds start to stop - 1."""
        return sampling.deviations(self.factors, self.points.of(start, stop, len(self.factors)))

    def compute(self, start: int, stop: int) -> ColumnValues:
        """Compute the `columns` of builds start to stop - 1."""
        found = self.compute_with(self.deviations(start, stop))
        return {"build": np.arange(start, stop, dtype=np.uint32), **found}

    def compute_with(self, deviations: Float[np.ndarray, "build factor"]) -> ColumnValues:
        """Compute the `columns` but for `build` of builds with these deviations."""
        scene = sampling.imperfect(self.scene, self.factors, deviations)
        found = builds.balance(
            scene, self.design, level=self.level, allow_unstable=self.allow_unstable
        )
        with np.errstate(all="ignore"):
            nominal = eigenmodes.spectrum(nominal_system(self.text, self.level))
            squared = follow_modes(found, nominal.shape)
            squared = squared if self.allow_unstable else np.maximum(squared, 0.0)
            result = couplings(found, self.question) | {
                "frequency": np.sqrt(squared) / (2 * np.pi),
                "static": found.static,
                "response": builds.responses(found, self.ratios),
            }
        for name in ("frequency", "static"):
            result[name][found.status != builds.GOOD] = np.nan
        return result


def follow_modes(
    found: Builds, shapes: Float[np.ndarray, "mode coordinate"]
) -> Float[np.ndarray, "build mode"]:
    """Solve for omega^2, (rad/s)^2, of every build in the order of the nominal modes.

    `shapes` are those of the nominal modes, as in `batch_modes.Spectrum`.
    """
    solved = batch_modes.solve(found.model)
    overlap = (shapes @ np.swapaxes(solved.shape, -1, -2)) ** 2  # (p, m, m): nominal, build
    choice = overlap.argmax(-1)
    clash = (np.sort(choice, axis=-1) != np.arange(choice.shape[-1])).any(-1)
    for n in np.flatnonzero(clash).tolist():
        choice[n] = pair_by_overlap(overlap[n])
    return np.take_along_axis(solved.omega_squared, choice, axis=-1)


def build_change(job: RandomBuilds) -> Comparison:
    """The change of the results of random builds, as `model_choice.for_builds` takes it.

    Frequencies, couplings and statics of the nominal and of extreme builds are compared. The effect
    of wire mass on frequencies is estimated for the nominal build.
    """
    systems = Systems(job.design)
    deviations = _extremes(replace(job, method=RANDOM, with_indices=False))
    named = job.nominal

    def solve(model: Model) -> list[tuple[str, np.ndarray]]:
        one = replace(job, level=model.name)
        found = one.compute_with(deviations)
        values = [
            ("the cross-coupling", found["ratio"]),
            ("static displacements", found["static"][..., :3]),
            ("static rotations", found["static"][..., 3:]),
            *((ratio.text, found["response"][:, n]) for n, ratio in enumerate(job.ratios)),
        ]
        if not model.has_wire_mass:
            places = pair_bodies(named, one.nominal, systems(model))
            values += zip(named.label, found["frequency"].T[places], strict=True)
        return values

    compared = compare_builds(solve)

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        found = compared(simple, refined)
        if refined.has_wire_mass and math.isfinite(found[0]):
            found = max(found, Frequencies().change(systems(simple), systems(refined)))
        return found

    return change


def _extremes(job: RandomBuilds) -> Float[np.ndarray, "build factor"]:
    """Deviations of the nominal build, 0, and of the most extreme ones."""
    every = job.deviations(0, min(SEARCHED, job.count))
    scale = every.std(0)
    size = ((every / np.where(scale > 0, scale, 1.0)) ** 2).sum(1)
    most = np.argsort(-size, kind="stable")[:EXTREME]
    return np.concatenate([np.zeros_like(every[:1]), every[most]])
