"""How many digits of the numbers found matter to the goals."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.optimise.evaluator import Evaluator, Report
from suspension_cli.analyses.optimise.search import Point
from suspension_cli.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from jaxtyping import Bool, Float

    from suspension_cli.scene.arrays import Array

FEWEST = 3
MOST = 12
"""Significant digits that are tried."""


def round_numbers(
    evaluator: Evaluator,
    best: Point,
    inward: Float[np.ndarray, " free"],
    change: float,
    met: Callable[[Report], Bool[np.ndarray, " limit"]],
) -> tuple[Evaluator, Report]:
    """Find the fewest digits of the free numbers that suffice, by computing the rounded designs.

    Parameters
    ----------
    inward : array
        Where active limits gain room. Each number is rounded to the nearest value, or else to the
        one on that side.
    change : float
        How much a quantity of the goals may change: relative, of those with a sign to the largest
        limit. 0 to round nothing.
    met : function
        Which limits a report meets: those that were met still are.

    Returns
    -------
    evaluator : Evaluator
        Its `freed` writes so many digits; all if none suffice.
    report : Report
        Of the rounded design.
    """
    exact = evaluator.report(evaluator.freed.design(best.fraction))
    bounds = np.minimum(evaluator.freed.margins(best.fraction), 0.0)
    sides = ((), tuple(np.sign(inward).astype(int).tolist()))
    tried = itertools.product(range(FEWEST, MOST + 1), sides) if change else ()
    for digits, side in tried:
        freed = replace(evaluator.freed, digits=digits, side=side)
        rounded = replace(evaluator, freed=freed)
        try:
            report = rounded.report(freed.design(best.fraction))
        except InputError:  # no design
            continue
        within = (freed.margins(best.fraction) >= bounds).all()
        if (
            within
            and _is_near(evaluator, exact, report, change)
            and (met(report) >= met(exact)).all()
        ):
            return rounded, report
    return evaluator, exact


def _is_near(evaluator: Evaluator, exact: Report, rounded: Report, change: float) -> bool:
    """Whether no quantity changed by more than `change`."""

    def near(before: Array, after: Array) -> bool:
        size = np.where(evaluator.logarithmic, np.abs(before), evaluator.scale)
        with np.errstate(invalid="ignore"):  # infinite ones
            close = np.abs(after - before) <= change * size
        same = (after == before) | (np.isnan(after) & np.isnan(before))
        return bool((close | same).all())

    names = ("value", "low", "high")
    return all(near(getattr(exact, name), getattr(rounded, name)) for name in names)
