"""Random builds of a design with a `[tolerance]` table, and quantities of each::

    job = RandomBuilds(source.text, 1000, 1, question)
    columns = job.compute(0, 1000)
    columns["value"]  # (build, quantity), of job.quantities

The deviations of a build (`studies.sampling`) are imposed on the scene of the design. All builds of
a chunk are then balanced together, and each quantity is read from them (`quantities.solved`).

By default the quantities are those that every design has: the frequencies of its modes, its
cross-coupling and the static poses of its bodies. Requirements and ``--result`` add others. A mode
is followed from the nominal design to each build by its shape; where a requirement names it by its
motion, it is in each build the mode that is mostly that motion.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.files.mapped_arrays import copy_column
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry
from suspension_cli.physics.couplings import CouplingRequest
from suspension_cli.quantities import solved, vocabulary
from suspension_cli.quantities.differences import compare_batches
from suspension_cli.quantities.kinds.modes import ALL, FollowedMode, Frequency, FrequencyByNumber
from suspension_cli.quantities.kinds.poses import STATIC, StaticPose
from suspension_cli.quantities.kinds.responses import COUPLING, Ratio, quotient_unit
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.nominal_results import follow_all
from suspension_cli.quantities.quantity import Quantity, evaluate
from suspension_cli.quantities.requirements import Limits, Requirement, find
from suspension_cli.quantities.solved import Solved
from suspension_cli.studies import builds, sampling
from suspension_cli.studies.extremes import find_largest
from suspension_cli.studies.job import Job, nominal_system
from suspension_cli.studies.run import Columns

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.models.choice import Comparison

    Deviations = Float[np.ndarray, "build factor"]
    """Random deviations of builds."""

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
    seed
        Of the random numbers; the same seed gives the same builds.
    question
        The cross-coupling; its imperfect wire and body are ignored.
    level
        Name of the model.
    requirements
        What builds must meet.
    results
        Further quantities whose statistics are computed.
    """

    count: int
    seed: int
    question: CouplingRequest
    allow_unstable: bool = False
    level: str = registry.STRING.name
    requirements: tuple[Requirement, ...] = ()
    results: tuple[Quantity, ...] = ()

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
            return super().identity

    @cached_property
    def factors(self) -> tuple[sampling.ScatteredNumber, ...]:
        """Numbers of the design that vary between builds."""
        return sampling.factors(self.design, self.scene)

    @cached_property
    def groups(self) -> tuple[str, ...]:
        """Names of the tolerances, each of one number or several."""
        return tuple(dict.fromkeys(factor.group for factor in self.factors))

    @cached_property
    def nominal(self) -> Modes:
        """Modes without random deviations, but with the design's own perturbations."""
        return eigenmodes.solve(nominal_system(self.text, self.level))

    @cached_property
    def followed(self) -> tuple[FollowedMode, ...]:
        """Frequencies of all modes, each followed from the nominal design by its shape."""
        return tuple(follow_all(self.text, self.level))

    @cached_property
    def modes(self) -> tuple[Quantity, ...]:
        """One frequency for each nominal mode: of its motion where that is asked for, by name."""
        by_name = {one.text: one for one in self._asked if isinstance(one, Frequency)}
        return tuple(by_name.get(one.text, one) for one in self.followed)

    @property
    def coupling(self) -> Ratio:
        """The cross-coupling at its last frequency."""
        return self.couplings[-1]

    @cached_property
    def couplings(self) -> tuple[Ratio, ...]:
        """The cross-coupling at all its frequencies."""
        asked = self.question
        unit = quotient_unit(asked.over, asked.under)
        *others, last = asked.frequency
        names = [*(f"{COUPLING} at {one:g} Hz" for one in others), COUPLING]
        pairs = zip(names, (*others, last), strict=True)
        signals = asked.over, asked.under, asked.input
        return tuple(Ratio(name, unit, *signals, frequency) for name, frequency in pairs)

    @cached_property
    def statics(self) -> tuple[StaticPose, ...]:
        """Static displacements and rotations of all bodies."""
        return tuple(
            StaticPose(f"{stage} static {dof}", unit, body, number)
            for body, stage in enumerate(self.scene.bodies.name)
            for number, (dof, unit) in enumerate(STATIC.items())
        )

    @cached_property
    def required(self) -> tuple[Quantity, ...]:
        """The quantity of each requirement."""
        return tuple(self._in_this_model(one.quantity) for one in self.requirements)

    @cached_property
    def others(self) -> tuple[Quantity, ...]:
        """Quantities that are asked for, beside those that every design has."""
        always = {*self.modes, self.coupling, *self.statics}
        asked = (*self.required, *map(self._in_this_model, self.results))
        return tuple(one for one in dict.fromkeys(asked) if one not in always)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """All quantities whose statistics are computed, each once."""
        return (*self.modes, self.coupling, *self.statics, *self.others)

    @cached_property
    def labelled(self) -> tuple[Frequency, ...]:
        """Modes that are meant by their motion, which another mode may share."""
        return tuple(one for one in self.quantities if isinstance(one, Frequency))

    @property
    def _asked(self) -> tuple[Quantity, ...]:
        return (*(one.quantity for one in self.requirements), *self.results)

    def _in_this_model(self, quantity: Quantity) -> Quantity:
        """Name a mode by number as the nominal design in this model names it."""
        if not isinstance(quantity, FollowedMode) or quantity.place >= len(self.followed):
            return quantity
        own = self.followed[quantity.place]
        if self.modes[quantity.place] is own:
            return own
        return own.with_number()

    def check(self) -> None:
        """Raise `InputError` if there is no table of tolerances, or a signal is invalid."""
        self.compute(0, 1)

    def deviations(self, start: int, stop: int) -> Float[np.ndarray, "stop-start factor"]:
        """Draw the random deviations of builds start to stop - 1."""
        uniform = sampling.uniforms(self.seed, start, stop, len(self.factors))
        return sampling.deviations(self.factors, uniform)

    def further_deviations(self, start: int, stop: int) -> Float[np.ndarray, "stop-start factor"]:
        """Draw deviations of points that are independent of all builds."""
        seed = self.seed + sampling.FURTHER
        uniform = sampling.uniforms(seed, start, stop, len(self.factors))
        return sampling.deviations(self.factors, uniform)

    def balance(self, deviations: Deviations) -> Solved:
        """Balance builds with these deviations."""
        return solved.of_builds(
            sampling.imperfect(self.scene, self.factors, deviations),
            self.design,
            self.level,
            Needs.of([*self.quantities, *self.couplings]),
            allow_unstable=self.allow_unstable,
        )

    def compute(self, start: int, stop: int) -> Columns:
        """Compute the quantities of builds start to stop - 1; NaN of those that failed."""
        found = self.balance(self.deviations(start, stop))
        failed = found.found.status != builds.GOOD
        with np.errstate(all="ignore"):  # of builds that failed
            value = evaluate(self.quantities, found)
            ratio = np.stack([one.read(found) for one in self.couplings], axis=1)
            shared = [one.is_shared(found) & ~failed for one in self.labelled]
        value[failed] = np.nan
        columns = {"ratio": ratio, "value": value, **found.found.outcome}
        if shared:
            columns["shared"] = np.stack(shared, axis=1)
        return columns


def find_quantities(texts: Iterable[str], names: Names, text: str) -> tuple[Quantity, ...]:
    """Look up the quantities of ``--result`` of a design, whose TOML is `text`.

    Raises `InputError` with all that the design lacks.
    """
    given = [one for one in texts if one.strip() != ALL]  # all modes are always computed
    return tuple(_follow(one, text) for one in vocabulary.parse_all(given, names, "--result"))


def find_requirements(limits: Iterable[Limits], names: Names, text: str) -> tuple[Requirement, ...]:
    """Look up the quantities that limits name in a design, whose TOML is `text`.

    Raises `InputError` with all that the design lacks.
    """
    found = find(list(limits), names)
    return tuple(replace(one, quantity=_follow(one.quantity, text)) for one in found)


def _follow(quantity: Quantity, text: str) -> Quantity:
    """Follow a mode that is meant by its number in the nominal design."""
    if not isinstance(quantity, FrequencyByNumber):
        return quantity
    return FollowedMode(quantity.text, quantity.unit, quantity.place, text)


def compare_models(job: RandomBuilds) -> Callable[[Deviations], Comparison]:
    """Compare the quantities of builds of given deviations, for `model_choice.for_builds`."""
    quantities = (*job.quantities, *job.couplings[:-1])

    def compare(deviations: Deviations) -> Comparison:
        return compare_batches(
            quantities, lambda level: [replace(job, level=level).balance(deviations)]
        )

    return compare


def first_points(job: RandomBuilds) -> Deviations:
    """Deviations of the nominal build, 0, and of the most extreme ones."""
    every = job.deviations(0, min(SEARCHED, job.count))
    scale = every.std(0)
    size = ((every / np.where(scale > 0, scale, 1.0)) ** 2).sum(1)
    most = np.argsort(-size, kind="stable")[:EXTREME]
    return np.concatenate([np.zeros_like(every[:1]), every[most]])


def extreme_points(job: RandomBuilds, columns: Columns) -> Deviations:
    """Deviations of the builds whose quantities turned out largest and smallest."""
    arrays = columns["ratio"], columns["value"]
    results = (copy_column(one, n) for one in arrays for n in range(one.shape[1]))
    chosen = find_largest(results).tolist()
    return np.concatenate([job.deviations(0, 0), *(job.deviations(n, n + 1) for n in chosen)])
