"""Result of an optimisation, from the search and its check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.optimise.achieved import Achieved
from suspension_cli.analyses.optimise.constrained_search import (
    ActiveSet,
    Point,
    Search,
    signed_margin,
)
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.optimum import (
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.quantities import (
    Limit,
    OfMode,
    OfResponse,
    Quantity,
    Requirements,
)
from suspension_cli.models.registry import Choice

if TYPE_CHECKING:
    from jaxtyping import Float

EQUAL = 1e-6
"""Relative deviation up to which an equality is met."""


def summarise(
    search: Search, best: Point, drawn: Achieved, made: Achieved, choice: Choice, starts: Starts
) -> Optimum:
    """Assemble the result of a search from its best point.

    Parameters
    ----------
    drawn, made : Achieved
        Quantities of the starting and of the optimised design.
    choice : Choice
        The model of the modes.
    """
    freed, requirements = search.freed, search.requirements
    active = search.active_set(best)
    number = freed.numbers(best.fraction)
    return Optimum(
        numbers=_numbers(freed, number, active),
        quantities=Quantities(
            name=tuple(_titled(item) for item in requirements.quantities),
            unit=tuple(item.unit for item in requirements.quantities),
            before=drawn.value,
            after=made.value,
            searched=np.exp(best.log),
            mode=made.place,
            weight=np.array(
                [
                    sum(term.weight for term in requirements.terms if term.quantity == n)
                    for n in range(len(requirements.quantities))
                ]
            ),
            model=tuple(
                search.values.models.of(item) if isinstance(item, OfMode | OfResponse) else ""
                for item in requirements.quantities
            ),
        ),
        limits=_limits(search, made, active),
        modes=_modes(search, drawn, made),
        starts=starts,
        unknown=tuple(f"{what}: {missing} is not given" for what, missing in requirements.unknown),
        objective=(
            "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
            if requirements.terms
            else OBJECTIVE[search.goals.prefer]
        ),
        stationarity=active.stationarity,
        fidelity=choice.level,
        reason=choice.reason,
        error=choice.error,
        design=freed.toml(number),
    )


OBJECTIVE = {
    "near": (
        "half the squared distance from the starting design, in fractions of the ranges between the"
        " bounds"
    ),
    "margin": "minus the smallest margin",
}


def _numbers(freed: FreeDesign, number: Float[np.ndarray, " number"], active: ActiveSet) -> Numbers:
    before, after = freed.values(freed.start), freed.values(number)
    lower, upper = (
        [getattr(item, name) for item in (*freed.free, *freed.equal)] for name in ("lower", "upper")
    )
    count, ties = len(freed.free), len(freed.equal)

    def known(values: list[float | None]) -> np.ndarray:
        return np.array([np.nan if value is None else value for value in values])

    bound = np.concatenate([active.bound, np.zeros(ties, dtype=int)])
    for n in range(count, count + ties):
        value = list(after.values())[n]
        size = 1e-6 * max(abs(value), 1e-12)
        bound[n] = (
            -1
            if abs(value - known(lower)[n]) <= size
            else 1
            if abs(value - known(upper)[n]) <= size
            else 0
        )
    return Numbers(
        name=tuple(after),
        tied=np.arange(count + ties) >= count,
        before=np.array(list(before.values())),
        after=np.array(list(after.values())),
        lower=known(lower),
        upper=known(upper),
        bound=bound,
        multiplier=np.concatenate([active.bound_multiplier, _dependent_multipliers(freed, active)]),
    )


def _dependent_multipliers(freed: FreeDesign, active: ActiveSet) -> Float[np.ndarray, " tied"]:
    """Multipliers of the bounds of dependent numbers per range between them; NaN with one bound."""
    found, parts = np.zeros(len(freed.equal)), iter(active.tied_multiplier)
    for n, item in enumerate(freed.equal):
        span = np.nan if item.lower is None or item.upper is None else item.upper - item.lower
        for bound in (item.lower, item.upper):
            if bound is not None:
                found[n] += next(parts) * span / (abs(bound) or 1.0)
    return found


def _limits(search: Search, made: Achieved, active: ActiveSet) -> Limits:
    """Compare limits, and separations of its neighbouring modes, with the optimised design."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(made.value)
    before = {limit: n for n, limit in enumerate(search.limits)}
    limits = (*search.requirements.limits, *search.order(log))
    margins = np.array([signed_margin(limit, log) for limit in limits])
    least = np.array([-EQUAL if limit.sense == "equals" else 0.0 for limit in limits])
    values = [_value(limit, made.value) for limit in limits]
    places = [before.get(limit, -1) for limit in limits]
    return Limits(
        name=tuple(_named(limit, search.requirements) for limit in limits),
        goal=np.array([limit.goal + 1 for limit in limits], dtype=int),
        quantity=np.array([limit.quantity for limit in limits], dtype=int),
        other=np.array([limit.other for limit in limits], dtype=int),
        sense=tuple(limit.sense for limit in limits),
        asked=np.array([limit.value for limit in limits]),
        value=np.array(values, dtype=float),
        margin=margins,
        met=margins >= least,  # NaN is not met
        active=np.array(
            [place >= 0 and bool(active.active[place]) for place in places], dtype=bool
        ),
        multiplier=np.array([active.multiplier[place] if place >= 0 else 0.0 for place in places]),
    )


def _value(limit: Limit, value: Float[np.ndarray, " quantity"]) -> float:
    if limit.other < 0:
        return float(value[limit.quantity])
    high, low = value[limit.quantity], value[limit.other]
    return float(high - low if limit.hertz else high / low)


def _named(limit: Limit, requirements: Requirements) -> str:
    item = requirements.quantities[limit.quantity]
    sign = {"at_least": ">=", "at_most": "<=", "equals": "="}[limit.sense]
    unit = "" if item.unit == "1" else f" {item.unit}"
    if limit.other >= 0:
        other = _titled(requirements.quantities[limit.other])
        return (
            f"{item.text} - {other} >= {limit.value:g} Hz"
            if limit.hertz
            else f"{item.text} / {other} >= {limit.value:g}"
        )
    return f"{_titled(item)} {sign} {limit.value:g}{unit}"


def _titled(item: Quantity) -> str:
    """Unique name of a quantity, as a mode has a frequency and an energy fraction."""
    return item.text + (" from the top mass" if isinstance(item, OfMode) and item.fraction else "")


def _modes(search: Search, drawn: Achieved, made: Achieved) -> ModeTable:
    """List the modes of both designs by family and rank."""
    names, old, new = [], [], []
    for family, (was, now) in enumerate(zip(drawn.ranked, made.ranked, strict=True)):
        for rank, (a, b) in enumerate(zip(was, now, strict=False)):
            names.append(f"{search.values.families.name(family)} {rank + 1}")
            old.append(int(a))
            new.append(int(b))
    labels = made.modes.label
    return ModeTable(
        name=tuple(names),
        label=tuple(labels[n] for n in new),
        before=drawn.modes.frequency[old],
        after=made.modes.frequency[new],
        fraction_before=drawn.modes.top_fraction[old],
        fraction_after=made.modes.top_fraction[new],
        number=np.array(new),
    )
