"""Mode frequencies, cross-coupling and static pose of random builds.

Each nominal mode is paired with the mode of the build whose shape overlaps it most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.sweep.solve import evaluate_ratio
from suspension_cli.analyses.tolerance.quantities import (
    RATIO,
    Quantity,
    Requirement,
    each,
    find,
    of_modes,
    of_stages,
)
from suspension_cli.analyses.xcouple.solve import (
    OUTCOME,
    CouplingRequest,
    couplings,
    quotient_unit,
)
from suspension_cli.files.declared import common_unit
from suspension_cli.linear import batch_modes, eigenmodes, signals
from suspension_cli.linear.mode_pairing import pair_bodies, pair_by_overlap
from suspension_cli.linear.named_results import Ratio
from suspension_cli.models import registry, string
from suspension_cli.models.base import Model
from suspension_cli.models.choice import Frequencies, Systems, compare_builds
from suspension_cli.models.surroundings import surrounded
from suspension_cli.scene.arrays import Array, Index
from suspension_cli.studies import builds, sampling
from suspension_cli.studies.builds import Column, ColumnValues
from suspension_cli.studies.job import Job, expand, parse
from suspension_cli.studies.sample_points import RANDOM, SamplePoints

if TYPE_CHECKING:
    from jaxtyping import Float, Int

    from suspension_cli.models.choice import Comparison

SEARCHED = 1000
"""First builds from which the extreme ones are taken."""
EXTREME = 15
"""Number of builds with the largest deviations, at which models are compared."""


@lru_cache(maxsize=8)
def _solve_nominal(text: str, level: str) -> tuple[eigenmodes.Modes, Array, Index]:
    """Nominal modes, their mass-normalised shapes (m, c), and the coordinates (c,) of these."""
    # symmetry blocks keep the labels of degenerate modes
    model, design = registry.by_name(level), parse(text)
    found = eigenmodes.solve(model.system(design))
    plain = surrounded(
        string.linear_model(expand(text), split=False, wire_inertia=not model.has_wire_mass),
        design,
    )
    keep = np.flatnonzero(~plain.massless[6:]) + 6  # coordinates with inertia
    root = np.linalg.cholesky(plain.mass[np.ix_(keep, keep)])
    return found, found.shape[:, keep - 6] @ root, keep


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
        bodies, named = len(self.scene.bodies.name), len(self.ratios)
        unit = common_unit((one.unit for one in self.ratios), "response_unit")
        response = Column("response", "c16", (named,), unit, ("response_name",))
        return (
            Column("build", "u4", (), "1"),
            Column("frequency", "f8", (len(self.nominal.omega_squared),), "Hz", ("mode",)),
            Column("ratio", "c16", (len(self.question.frequency),), ratio, ("coupling_frequency",)),
            Column("static", "f8", (bodies, 6), "{static_unit}", ("stage", "static_dof")),
            *((response,) if named else ()),
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
        found = [one.ratio for one in each(self.find, named)]
        return tuple(dict.fromkeys(ratio for ratio in found if ratio is not None))

    @cached_property
    def required(self) -> tuple[Quantity, ...]:
        """Quantity of each requirement; raises `InputError` if the model has none of that name."""
        return tuple(
            replace(one, place=(self.ratios.index(one.ratio),)) if one.ratio else one
            for one in each(self.find, self.requirements)
        )

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantities whose statistics are computed, each once."""
        stages = of_stages(self.scene.bodies.name)
        return tuple(dict.fromkeys((*of_modes(self.nominal), RATIO, *stages, *self.required)))

    def find(self, requirement: Requirement) -> Quantity:
        """Find the quantity of a requirement; that of a response has no place yet."""
        name, key = requirement.quantity, requirement.key
        return find(name, key, self.nominal, self.scene.bodies.name, self.signalling)

    @cached_property
    def signalling(self) -> tuple[str, ...]:
        """Bodies with signals."""
        return signals.bodies_with_signals(registry.STRING.system(self.design))

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

    @property
    def nominal(self) -> eigenmodes.Modes:
        """Modes without random deviations, but with the design's own perturbations."""
        return _solve_nominal(self.text, self.level)[0]

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
            omega_squared = follow_modes(found, *_solve_nominal(self.text, self.level)[1:])
            coupled = couplings(found, self.question)
            response = [evaluate_ratio(found, one) for one in self.ratios]
            squared = omega_squared if self.allow_unstable else np.maximum(omega_squared, 0.0)
            frequency = np.sqrt(squared) / (2 * np.pi)
        failed = found.status != builds.GOOD
        frequency[failed] = np.nan
        static = np.where(failed[:, None, None], np.nan, found.static)
        return {
            "frequency": frequency,
            "ratio": coupled["ratio"],
            "static": static,
            **({"response": np.stack(response, axis=-1)} if response else {}),
            **{column.name: coupled[column.name] for column in OUTCOME},
        }


def follow_modes(
    found: builds.Builds,
    shapes: Float[np.ndarray, "mode coordinate"],
    keep: Int[np.ndarray, " coordinate"],
) -> Float[np.ndarray, "build mode"]:
    """Solve for omega^2, (rad/s)^2, of every build in the order of the nominal modes.

    Parameters
    ----------
    shapes
        Mass-normalised nominal modes, orthonormal.
    keep
        Their coordinates, which have inertia.
    """
    solved = batch_modes.solve(found.model)
    values, vectors = solved.omega_squared, np.swapaxes(solved.shape[..., keep - 6], -1, -2)
    overlap = (shapes @ vectors) ** 2  # (p, m, m): nominal, build
    choice = overlap.argmax(-1)
    clash = (np.sort(choice, axis=-1) != np.arange(choice.shape[-1])).any(-1)
    for n in np.flatnonzero(clash).tolist():
        choice[n] = pair_by_overlap(overlap[n])
    return np.take_along_axis(values, choice, axis=-1)


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
