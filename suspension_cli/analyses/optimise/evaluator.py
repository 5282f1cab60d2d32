"""Goals of designs as functions of their free numbers, in batches, and their derivatives.

Every target is a smooth function of the numbers: the logarithm of the quantity, continued linearly
in its square where it is small or a mode grows, or the quantity over its limit if it has a sign.
Derivatives are central differences between neighbours in every free number, all in one batch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.optimise.free_numbers import FreeDesign
from suspension_cli.analyses.optimise.shared_modes import describe_shared, number_of_mode
from suspension_cli.analyses.optimise.targets import (
    Target,
    Targets,
    interpret,
    with_imperfections,
)
from suspension_cli.design.reader import Source
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from suspension_cli.models.base import Model
from suspension_cli.quantities.differences import compare_designs
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.solved import Solved, of_designs

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.models.choice import Comparison
    from suspension_cli.physics.log import Log

TINY = 1e-30
"""Smallest value of a quantity, in place of 0, which has no logarithm."""
STEP = 2e-5
"""Step of derivatives, in fractions of the ranges; energy fractions of close modes vary fast, and
no quantity has rounding errors above 1e-12."""
LINEAR_BELOW = 0.1
"""Frequency, over the lowest limit on it (0.01 Hz without limits), below which its logarithm
continues linearly in omega^2, to unstable modes; for quantities with a sign likewise."""
LEAST_HERTZ = 0.01


@dataclass(frozen=True)
class Evaluator:
    """Goals of a design as functions of its free numbers.

    Attributes
    ----------
    names
        What names of quantities refer to in the starting design.
    level
        Name of the model; quantities that need a more complete one are computed in that.
    """

    freed: FreeDesign
    targets: Targets
    names: Names
    level: str = registry.STRING.name

    @staticmethod
    def of(freed: FreeDesign, source: Source, log: Log | None = None) -> Evaluator:
        """Interpret the goals for the starting design; `log` is warned of an assumed ground.

        Raises `InputError` if the design lacks something that a goal refers to.
        """
        begin = replace(source, design=freed.design(freed.begin), text=freed.toml(freed.begin))
        names = names_of(begin, log=log)
        return Evaluator(freed, interpret(freed.goals, names, source.file), names)

    def at(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " value"]:
        """Evaluate one design, as `values`."""
        return self.values(fraction[None])[0]

    def values(
        self, fractions: Float[np.ndarray, "design number"], *, exact_modes: bool = True
    ) -> Float[np.ndarray, "design value"]:
        """Functions of all targets, then margins of the bounds of dependent numbers.

        Twice those of targets: as lower limits take them, then as upper ones (`Quantity.ends`).
        NaN for an invalid design. Without `exact_modes`, changes of modes by wire mass are
        neglected.
        """
        designs = [self.freed.design_if_valid(one) for one in fractions]
        low = np.full((len(designs), len(self.targets.target)), np.nan)
        high = low.copy()
        how = {"allow_unstable": True, "exact_modes": exact_modes}
        for some, places, batch in self._solved(designs, **how):
            for n in some:
                ends = self.targets.target[n].quantity.ends(batch, smooth=True)
                low[places, n], high[places, n] = ends
        margins = [self.freed.margins(one)[self.freed.bounded] for one in fractions]
        return np.hstack([self._function(np.hstack([low, high])), np.array(margins)])

    def slopes(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, "value number"]:
        """Differentiate the `values` by the fractions.

        One-sided where a neighbour has no equilibrium. Changes of modes by wire mass are neglected.
        Raises `InputError` if a number cannot change alone.
        """
        steps = STEP * np.eye(len(fraction))
        line = np.array([*(fraction + steps), *(fraction - steps), fraction])
        *sides, middle = self.values(line, exact_modes=False)
        above, below = np.array(sides).reshape(2, len(steps), -1)
        above_known = np.where(np.isnan(above), 2 * middle - below, above)
        below_known = np.where(np.isnan(below), 2 * middle - above, below)
        for item, own in zip(self.freed.goals.free, above_known, strict=True):
            if np.isnan(own).any():
                problem = "a change of this number alone unbalances the suspension"
                remedy = "let other numbers depend on it by [[equal]]"
                raise InputError.of(f"free.{item.name}", f"{problem} in its nominal pose", remedy)
        return (above_known - below_known).T / (2 * STEP)

    def offset(self, target: Target, limit: float) -> float:
        """Value of the function of a target at a limit on it."""
        n = self.targets.target.index(target)
        if self.logarithmic[n]:
            return float(np.log(limit))
        return limit / float(self.scale[n])

    @cached_property
    def logarithmic(self) -> Bool[np.ndarray, " target"]:
        """Which targets enter by their logarithms: positive ones, and magnitudes."""
        return np.array([self._is_logarithmic(target) for target in self.targets.target])

    def _is_logarithmic(self, target: Target) -> bool:
        limits = self.targets.limits_on(target)
        if target.quantity.vanishes or any(one.asked <= 0 for one in limits):
            return False
        return not target.quantity.signed or all(one.of_magnitude for one in limits)

    @cached_property
    def scale(self) -> Float[np.ndarray, " target"]:
        """Size by which targets without logarithms are divided: their largest limit."""
        sizes = [
            max((abs(one.asked) for one in self.targets.limits_on(target)), default=0.0)
            for target in self.targets.target
        ]
        return np.array([size or 1.0 for size in sizes])

    def _function(self, value: Float[np.ndarray, "design end"]) -> Float[np.ndarray, "design end"]:
        """Functions of targets, from their smallest and then their largest values."""
        signed = np.tile([target.quantity.signed for target in self.targets.target], 2)
        logarithmic = np.tile(self.logarithmic, 2)
        squared = np.where(signed, value**2, value * np.abs(value))
        floor = np.tile(self._floors, 2)
        least = np.maximum(squared, floor)
        with np.errstate(invalid="ignore"):  # infinite ratios of responses
            log = np.log(least) / 2 + (squared - least) / (2 * floor)
        return np.where(logarithmic, log, value / np.tile(self.scale, 2))

    @cached_property
    def _floors(self) -> Float[np.ndarray, " target"]:
        """Squares of targets below which their logarithms continue linearly."""
        floors = []
        for target in self.targets.target:
            limits = [one.asked for one in self.targets.limits_on(target)]
            floor = TINY
            if self._is_logarithmic(target) and (
                target.quantity.unit == "Hz" or target.quantity.signed
            ):
                default = LEAST_HERTZ if target.quantity.unit == "Hz" else TINY
                floor = LINEAR_BELOW * min(limits, default=default)
            floors.append(floor**2)
        return np.array(floors)

    @cached_property
    def groups(self) -> dict[tuple[Perturbation, ...], list[int]]:
        """Numbers of the targets of each set of imperfections."""
        found: dict[tuple[Perturbation, ...], list[int]] = {}
        for n, target in enumerate(self.targets.target):
            found.setdefault(target.perturbation, []).append(n)
        return found

    def _solved(
        self, designs: Sequence[Design | None], *, allow_unstable: bool, exact_modes: bool
    ) -> Iterator[tuple[list[int], Int[np.ndarray, " place"], Solved]]:
        """Balance designs with the imperfections of each group of targets.

        Yields the numbers of the targets, the places of designs, and these.
        """
        for perturbation, some in self.groups.items():
            imperfect = [one and with_imperfections(one, perturbation) for one in designs]
            needs = Needs.of([self.targets.target[n].quantity for n in some])
            how = {"allow_unstable": allow_unstable, "exact_modes": exact_modes}
            for places, batch in of_designs(imperfect, self.level, needs, **how):
                yield some, places, batch

    def report(self, design: Design) -> Report:
        """Compute all targets of a design as other commands do."""
        size = len(self.targets.target)
        value, low, high = np.full((3, size), np.nan)
        remarks: dict[str, None] = {}
        mode = np.full(size, -1)
        for some, _, batch in self._solved([design], allow_unstable=False, exact_modes=True):
            for n in some:
                quantity = self.targets.target[n].quantity
                value[n] = quantity.values(batch)[0]
                low[n], high[n] = (end[0] for end in quantity.ends(batch, smooth=False))
                mode[n] = number_of_mode(quantity, batch)
                remarks |= dict.fromkeys(describe_shared(quantity, batch))
        nominal = self._nominal(design)
        return Report(value, low, high, mode, tuple(remarks), nominal)

    def _nominal(self, design: Design) -> Solved | None:
        """The design itself, also if it is unstable; None if it has no equilibrium."""
        how = {"allow_unstable": True, "exact_modes": True}
        batches = [batch for _, batch in of_designs([design], self.level, Needs(), **how)]
        return batches[0] if batches else None

    def compare(self, fraction: Float[np.ndarray, " number"]) -> Comparison:
        """Return the comparison of all targets of a design in two models; the worst decides."""
        design = self.freed.design(fraction)
        comparisons = [
            compare_designs(
                [self.targets.target[n].quantity for n in some],
                [with_imperfections(design, perturbation)],
            )
            for perturbation, some in self.groups.items()
        ]

        def change(simple: Model, refined: Model) -> tuple[float, str]:
            found = [compare(simple, refined) for compare in comparisons]
            known = [one for one in found if not np.isnan(one[0])]
            return max(known, key=lambda one: one[0]) if known else found[0]

        return change


@dataclass(frozen=True)
class Report:
    """Targets of one design.

    Attributes
    ----------
    value
        SI; NaN where the design has none.
    low, high
        Smallest and largest value where two modes share a motion.
    mode
        Number of the mode, from 0; -1 of other quantities.
    remarks
        Which modes share a motion, or that there is none of it.
    nominal
        The design without the imperfections of goals; None without an equilibrium.
    """

    value: Float[np.ndarray, " target"]
    low: Float[np.ndarray, " target"]
    high: Float[np.ndarray, " target"]
    mode: Int[np.ndarray, " target"]
    remarks: tuple[str, ...]
    nominal: Solved | None
