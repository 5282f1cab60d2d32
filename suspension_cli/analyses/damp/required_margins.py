"""Margins of loops whose filters are found to what `[[requirement]]` of the design limits.

Requirements on noise, RMS, decay and stability margins depend on loops. They are computed with the
whole budget of the design and the model that each quantity needs, whose mechanics are solved once
for all filters that are tried.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from suspension_cli.analyses import verdicts
from suspension_cli.analyses.damp.filter_keys import as_keys
from suspension_cli.files.declared import in_unit
from suspension_cli.quantities.kinds.damped_modes import Decay
from suspension_cli.quantities.kinds.loop_margins import Margin
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import evaluate
from suspension_cli.quantities.requirements import Verdict
from suspension_cli.quantities.solved import Solved, of_designs

if TYPE_CHECKING:
    from collections.abc import Sequence

    from suspension_cli.design.foton import Filter
    from suspension_cli.design.reader import Source
    from suspension_cli.design.schema import Design
    from suspension_cli.physics.log import Log
    from suspension_cli.quantities.requirements import Requirement


@dataclass(frozen=True)
class RequiredResult:
    """A requirement on what loops do, and the result with the filters that were found.

    Attributes
    ----------
    requirement
        Its quantity and limits in words.
    value, unit
        In SI; NaN if the design has none.
    margin
        Distance from the nearer limit, relative to it; negative if exceeded.
    met
        Whether the value meets it.
    model
        In which it was computed.
    """

    requirement: str
    value: float = field(metadata=in_unit("SI"))
    unit: str
    margin: float
    met: bool
    model: str

    @staticmethod
    def of(verdict: Verdict) -> RequiredResult:
        """Take what is stored of a verdict."""
        one = verdict.requirement
        return RequiredResult(
            one.description,
            verdict.value,
            one.quantity.unit,
            verdict.margin,
            verdict.met,
            verdict.model,
        )


@dataclass(frozen=True)
class LoopRequirements:
    """Requirements on loops of a design, and its mechanics in the models that they need.

    `solved` are by the name of the model.
    """

    requirements: tuple[Requirement, ...]
    level: str
    solved: dict[str, Solved]

    @staticmethod
    def of(source: Source, level: str, log: Log) -> LoopRequirements:
        """Find the requirements of a design that depend on loops, in a model by its name."""
        every = verdicts.find_requirements(source, log)
        own = tuple(one for one in every if one.quantity.of_loops)
        quantities = [one.quantity for one in own]
        needs = Needs.of(quantities)
        solved: dict[str, Solved] = {}
        for name in {one.level(level, source.design) for one in quantities}:
            [(_, batch)] = of_designs([source.design], name, needs)
            solved[name] = batch
        return LoopRequirements(own, level, solved)

    def judge(self, design: Design) -> list[Verdict]:
        """Compute the quantities with the loops of a design of the same mechanics."""
        batches = {name: one.with_loops([design]) for name, one in self.solved.items()}
        found = []
        for one in self.requirements:
            model = one.quantity.level(self.level, design)
            [[value]] = evaluate([one.quantity], batches[model])
            found.append(Verdict(one, float(value), model))
        return found

    def margins(self, design: Design, number: int, made: Filter) -> list[float]:
        """Compute the margins with a filter for one loop; without a value -infinity."""
        found = [one.margin for one in self.judge(with_loop(design, number, made))]
        return np.nan_to_num(found, nan=-math.inf, posinf=math.inf, neginf=-math.inf).tolist()

    @property
    def settling(self) -> float | None:
        """Shortest settling time (s) that is required of all modes; None if there is none."""
        limits = [
            one.limits.high
            for one in self.requirements
            if isinstance(one.quantity, Decay)
            and (one.quantity.what, one.quantity.mode) == ("settling", None)
        ]
        return min(limits, default=None)

    def sensitivity(self, number: int) -> float | None:
        """Largest magnitude of a loop's sensitivity, 1 over its required smallest |1 + L|."""
        distances = [
            one.limits.low
            for one in self.requirements
            if isinstance(one.quantity, Margin)
            and (one.quantity.loop, one.quantity.which) == (number, "distance")
        ]
        return 1 / max(distances) if distances and max(distances) > 0 else None


def with_loop(design: Design, number: int, made: Filter) -> Design:
    """Replace the filter of a loop of a design, of which no text is made."""
    assert design.control is not None
    loops = list(design.control.loop)
    bare = structs.replace(loops[number], damper=None, filter=None, gain_at=None)
    loops[number] = structs.replace(bare, gain=made.gain, **as_keys(made))
    return structs.replace(design, control=structs.replace(design.control, loop=loops))


def list_results(found: Sequence[Verdict]) -> tuple[RequiredResult, ...] | None:
    """List what is stored of verdicts; None without any."""
    return tuple(RequiredResult.of(one) for one in found) or None
