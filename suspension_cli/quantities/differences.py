"""How much quantities change from one model to a more complete one, for the choice of a model.

A caller gives the designs at which models are compared: the one design of an analysis, some points
of a sweep, the extreme builds of a tolerance analysis.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.schema import Design
from suspension_cli.errors import InputError
from suspension_cli.models.base import Model
from suspension_cli.models.choice import NO_BUILD, ONE_MODEL_ONLY
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved, of_designs

if TYPE_CHECKING:
    from jaxtyping import Bool

    from suspension_cli.models.choice import Comparison


def compare_designs(
    quantities: Sequence[Quantity], designs: Sequence[Design], *, allow_unstable: bool = False
) -> Comparison:
    """Return the comparison of quantities of some designs, each relative to its own value.

    The quantity that changes most decides. The change is infinite where a design has an equilibrium
    (a stable one, if a quantity needs that) in only one of the models.
    """
    needs = Needs.of(quantities)

    def solve(level: str) -> list[Solved]:
        batches = []
        for design in designs:
            found = list(of_designs([design], level, needs, allow_unstable=allow_unstable))
            if not found:
                problem = f"has no equilibrium in the {level} model"
                raise InputError.of("", problem, "change the design")
            batches.append(found[0][1])
        return batches

    return compare_batches(quantities, solve)


def compare_batches(
    quantities: Sequence[Quantity], solve: Callable[[str], Sequence[Solved | None]]
) -> Comparison:
    """Return the comparison of quantities of batches of designs in two models.

    `solve` balances the batches in a model, in the same order in each; None stands for a batch that
    the model cannot describe. A change is relative to the largest value of its batch.
    """
    known = cache(solve)
    steady = any(quantity.steady for quantity in quantities)

    def change(simple: Model, refined: Model) -> tuple[float, str]:
        worst = -1.0
        name = "the results"
        exist = False
        for old, new in zip(known(simple.name), known(refined.name), strict=True):
            before = _exists(old, steady=steady)
            after = _exists(new, steady=steady)
            if (before != after).any():
                return math.inf, ONE_MODEL_ONLY
            if old is None or new is None:
                continue
            exist = exist or bool(after.any())
            for quantity in quantities:
                own = np.fmax.reduce(quantity.change(old, new), initial=-1.0)
                if own > worst:
                    worst = float(own)
                    name = quantity.text
        if not exist:
            return math.nan, NO_BUILD
        if math.isinf(worst):
            name = f"it decides whether {name} has a value"
        return max(worst, 0.0), name

    return change


def _exists(batch: Solved | None, *, steady: bool) -> Bool[np.ndarray, " design"]:
    """Which designs of a batch have an equilibrium, or if that is needed a steady state."""
    if batch is None:
        return np.zeros(1, dtype=bool)
    return batch.is_steady if steady else batch.hangs
