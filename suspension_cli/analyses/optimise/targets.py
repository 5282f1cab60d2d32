"""Goals of a design: quantities, the limits on them, and what is minimised.

The tables `[[requirement]]` and `[[objective]]` of a file of goals, its short forms `[[goal]]`, and
the design's own `[[requirement]]` become the same: limits on one side of a quantity, and weights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from suspension_cli.analyses.optimise import short_forms
from suspension_cli.design import checks
from suspension_cli.design.goals import Goals
from suspension_cli.design.locked_stages import spell_out, undo
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import (
    InputError,
    attribute_faults_to,
    collect,
    format_value,
    join_errors,
)
from suspension_cli.quantities import requirements, vocabulary
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.requirements import Limits, Requirement

if TYPE_CHECKING:
    from jaxtyping import Float

Sense = Literal["at_least", "at_most", "equals"]
SIGNS: dict[Sense, str] = {"at_least": ">=", "at_most": "<=", "equals": "="}


@dataclass(frozen=True)
class Target:
    """A quantity of a design with some imperfections beside its own."""

    quantity: Quantity
    perturbation: tuple[Perturbation, ...] = ()

    @property
    def text(self) -> str:
        """Name, as printed."""
        return f"{self.quantity.text}, imperfect" if self.perturbation else self.quantity.text


@dataclass(frozen=True)
class OneLimit:
    """A limit on one side of a target, or its value.

    Attributes
    ----------
    asked
        SI.
    of_magnitude
        Whether the sign of the quantity does not matter.
    group
        Limits of one group are reported together.
    key
        Key that gives it, for error messages.
    """

    target: Target
    sense: Sense
    asked: float
    of_magnitude: bool
    group: str
    key: str

    @property
    def text(self) -> str:
        """The limit as printed: ``yaw 3 <= 5 Hz``."""
        unit = "" if self.target.quantity.unit == "1" else self.target.quantity.unit
        name = self.target.text
        if self.of_magnitude and self.target.quantity.signed:
            name = f"|{name}|"
        return f"{name} {SIGNS[self.sense]} {self.asked:g} {unit}".rstrip()


@dataclass(frozen=True)
class Targets:
    """All goals of a design.

    Attributes
    ----------
    target
        What limits and objectives refer to, each once.
    limit
        In the order in which they are met if not all can be.
    weight
        Of the logarithm of each target in what is minimised; negative to maximise it.
    key
        Key that names each target first, for error messages.
    unknown
        Requested stresses that are not known, and the keys that the design lacks.
    """

    target: tuple[Target, ...]
    limit: tuple[OneLimit, ...]
    weight: Float[np.ndarray, " target"]
    key: tuple[str, ...]
    unknown: tuple[str, ...]

    @property
    def place(self) -> list[int]:
        """Number of the target of each limit."""
        return [self.target.index(one.target) for one in self.limit]

    def limits_on(self, target: Target) -> list[OneLimit]:
        """List the limits on a target."""
        return [one for one in self.limit if one.target == target]


def with_imperfections(design: Design, perturbation: Sequence[Perturbation]) -> Design:
    """Add imperfections to those of a design; those of locked stages have no effect."""
    return spell_out(_imperfect(undo(design), perturbation))


def _imperfect(in_file: Design, perturbation: Sequence[Perturbation]) -> Design:
    """Add imperfections to a design as the file gives it."""
    return msgspec.structs.replace(in_file, perturbation=[*in_file.perturbation, *perturbation])


def interpret(goals: Goals, names: Names, design_file: str) -> Targets:
    """Look up the quantities of goals in a starting design.

    Raises `InputError` with all that the design lacks, or with limits that no design can meet;
    faults of its own requirements name its file.
    """
    made = _Made(names, goals)
    errors: list[InputError] = []
    every = [
        *((made.add_requirement, n) for n in range(len(goals.requirement))),
        *((made.add_goal, n) for n in range(len(goals.goal))),
        *((made.add_objective, n) for n in range(len(goals.objective))),
    ]
    collect(lambda one: one[0](one[1]), every, errors)
    if errors:
        raise join_errors(errors)
    if goals.design_requirements:
        with attribute_faults_to(design_file):
            own = requirements.find(requirements.of_design(names.design), names)
        for one in own:
            made.add_own_requirement(one)
    for together in made.required.values():
        requirements.demand_possible(together)
    if not made.weight:
        problem = "nothing is limited, minimised or maximised, here or in the design"
        remedy = "add [[requirement]] or [[objective]]"
        if made.unknown:
            problem = "no goal names a quantity that is known for this design"
            remedy = f"give {next(iter(made.unknown.values()))}"
        raise InputError.of("goal", problem, remedy)
    unknown = tuple(f"{what}: {key} is not given" for what, key in made.unknown.items())
    return Targets(
        tuple(made.weight),
        tuple(dict.fromkeys(made.limits)),
        np.array([*made.weight.values()]),
        tuple(made.key[target] for target in made.weight),
        unknown,
    )


class _Made:
    """Targets, limits and weights as they are read, one table after the other."""

    def __init__(self, names: Names, goals: Goals) -> None:
        self.names = names
        self.goals = goals
        self.weight: dict[Target, float] = {}
        self.key: dict[Target, str] = {}
        self.limits: list[OneLimit] = []
        self.required: dict[tuple[Perturbation, ...], list[Requirement]] = {}
        self.unknown: dict[str, str] = {}

    def add_goal(self, number: int) -> None:
        """Add the quantities that a short form stands for."""
        goal = self.goals.goal[number]
        key = f"goal.{number + 1}"
        perturbation = self._imperfections(goal.perturbation, key)
        meant = short_forms.expand(goal, self.names, key)
        self.unknown |= meant.unknown
        sign = int(goal.minimise) - int(goal.maximise)
        for quantity in meant.quantities:
            target = Target(quantity, perturbation)
            self._add(target, key)
            self._add_weight(target, key, sign * (goal.weight or 1.0))
            limits = Limits(quantity.text, *meant.limits, key=key, low_key=key, high_key=key)
            self._add_limits(target, limits, goal.name or goal.kind)

    def add_requirement(self, number: int) -> None:
        """Add a limit on one quantity."""
        given = self.goals.requirement[number]
        key = f"requirement.{number + 1}"
        perturbation = self._imperfections(given.perturbation, key)
        quantity = vocabulary.parse(given.quantity, self.names, f"{key}.quantity")
        target = Target(quantity, perturbation)
        self._add(target, key)
        low = _first(given.at_least, given.equals, -math.inf)
        high = _first(given.at_most, given.equals, math.inf)
        limits = Limits(
            quantity.text,
            low,
            high,
            note=given.note,
            key=key,
            low_key=f"{key}.{'at_least' if given.equals is None else 'equals'}",
            high_key=f"{key}.{'at_most' if given.equals is None else 'equals'}",
        )
        self._add_limits(target, limits, given.note or target.text)

    def add_objective(self, number: int) -> None:
        """Add a quantity to minimise or maximise."""
        given = self.goals.objective[number]
        key = f"objective.{number + 1}"
        word = "maximise" if given.minimise is None else "minimise"
        perturbation = self._imperfections(given.perturbation, key)
        quantity = vocabulary.parse(getattr(given, word), self.names, f"{key}.{word}")
        sign = 1.0 if word == "minimise" else -1.0
        target = Target(quantity, perturbation)
        self._add(target, key)
        self._add_weight(target, key, sign * given.weight)

    def add_own_requirement(self, own: Requirement) -> None:
        """Add a requirement of the design itself."""
        target = Target(own.quantity)
        limits = replace(
            own.limits,
            low_key=f"{own.limits.low_key} of the design",
            high_key=f"{own.limits.high_key} of the design",
        )
        self._add(target, limits.key)
        self._add_limits(target, limits, limits.note or target.text)

    def _add(self, target: Target, key: str) -> None:
        vocabulary.demand_derivative(target.quantity, key)
        self.weight.setdefault(target, 0.0)
        self.key.setdefault(target, key)

    def _add_weight(self, target: Target, key: str, weight: float) -> None:
        """Minimise or maximise a target; raises `InputError` if another table does the opposite."""
        if weight * self.weight[target] < 0:
            problem = "is both minimised and maximised"
            remedy = "give one objective for it, and limits for the rest"
            raise InputError.of(key, problem, remedy, format_value(target.text))
        self.weight[target] += weight

    def _add_limits(self, target: Target, limits: Limits, group: str) -> None:
        known = {(one.target, one.sense, one.asked, one.of_magnitude) for one in self.limits}
        required = Requirement(target.quantity, limits)
        self.required.setdefault(target.perturbation, []).append(required)
        of_magnitude = required.limits_magnitude
        for sense, asked in _sides(limits):
            if (target, sense, asked, of_magnitude) not in known:
                one = OneLimit(target, sense, asked, of_magnitude, group, limits.key)
                self.limits.append(one)

    def _imperfections(
        self, given: Sequence[Perturbation] | None, key: str
    ) -> tuple[Perturbation, ...]:
        """Check the imperfections of a goal; raises `InputError` if the design has no such part."""
        if not given:
            return ()
        in_file = undo(self.names.design)
        faults = checks.check_design(_imperfect(in_file, given))
        if faults:
            before = len(in_file.perturbation)
            raise InputError(
                [replace(one, key=_renumbered(one.key, key, before)) for one in faults]
            )
        return tuple(given)


def _sides(limits: Limits) -> Iterator[tuple[Sense, float]]:
    """Sides of limits: one value, or each that is finite."""
    if limits.low == limits.high:
        yield "equals", limits.low
        return
    if math.isfinite(limits.low):
        yield "at_least", limits.low
    if math.isfinite(limits.high):
        yield "at_most", limits.high


def _first(*values: float | None) -> float:
    """The first value that is given."""
    return next(value for value in values if value is not None)


def _renumbered(key: str, goal: str, before: int) -> str:
    """Key of a fault of an imperfection in the table that gives it, after `before` others."""
    head, _, rest = key.partition(".")
    number, _, last = rest.partition(".")
    if head == "perturbation" and number.isdigit() and int(number) > before:
        return f"{goal}.perturbation.{int(number) - before}.{last}"
    return f"{goal}.{key}"
