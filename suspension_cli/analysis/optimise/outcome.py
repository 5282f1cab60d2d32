"""What a search found, told from what the ordinary analyses find of the new design."""

from __future__ import annotations

import numpy as np

from suspension_cli.analysis.optimise.achieved import Achieved
from suspension_cli.analysis.optimise.constrained import Held, Point, Search, margin
from suspension_cli.analysis.optimise.freed import Freed
from suspension_cli.analysis.optimise.optimum import Every, Limits, Numbers, Optimum, Quantities, Starts
from suspension_cli.analysis.optimise.quantities import Limit, OfMode, Quantity, Wanted
from suspension_cli.design.scene import Array

EQUAL = 1e-6
"""Relative difference up to which a value equals what it was to equal."""


def told(search: Search, best: Point, drawn: Achieved, made: Achieved, starts: Starts, rounds: int) -> Optimum:
    """Everything that there is to say, from what the design as drawn and the new one achieve."""
    freed, asked = search.freed, search.wanted
    held = search.held(best)
    number = freed.numbers(best.share)
    return Optimum(
        numbers=_numbers(freed, number, held),
        quantities=Quantities(
            name=tuple(_titled(item) for item in asked.quantities),
            unit=tuple(item.unit for item in asked.quantities),
            before=drawn.value,
            after=made.value,
            searched=np.exp(best.log - search.offset),
            mode=made.place,
            weight=np.array([sum(wish.weight for wish in asked.wishes if wish.quantity == n) for n in range(len(asked.quantities))]),
        ),
        limits=_limits(search, made, held),
        modes=_modes(search, drawn, made),
        starts=starts,
        unknown=tuple(f"{what}: {missing} is not given" for what, missing in asked.unknown),
        objective="the logarithms to be made small, less those to be made large" if asked.wishes else OBJECTIVE[search.goals.prefer],
        stationarity=held.stationarity,
        rounds=rounds,
        fidelity=made.choice.level,
        reason=made.choice.reason,
        error=made.choice.error,
        design=freed.toml(number),
    )


OBJECTIVE = {
    "near": "half the square of the distance from the design as drawn, in shares of the way between the bounds",
    "margin": "less the smallest margin",
}


def _numbers(freed: Freed, number: Array, held: Held) -> Numbers:
    before, after = freed.values(freed.start), freed.values(number)
    lower, upper = ([getattr(item, name) for item in (*freed.free, *freed.equal)] for name in ("lower", "upper"))
    count, ties = len(freed.free), len(freed.equal)

    def known(values: list[float | None]) -> Array:
        return np.array([np.nan if value is None else value for value in values])

    bound = np.concatenate([held.bound, np.zeros(ties, dtype=int)])
    for n in range(count, count + ties):
        value = list(after.values())[n]
        size = 1e-6 * max(abs(value), 1e-12)
        bound[n] = -1 if abs(value - known(lower)[n]) <= size else 1 if abs(value - known(upper)[n]) <= size else 0
    return Numbers(
        name=tuple(after),
        tied=np.arange(count + ties) >= count,
        before=np.array(list(before.values())),
        after=np.array(list(after.values())),
        lower=known(lower),
        upper=known(upper),
        bound=bound,
        multiplier=np.concatenate([held.bound_multiplier, _followers(freed, held)]),
    )


def _followers(freed: Freed, held: Held) -> Array:
    """Multipliers of the bounds of numbers that follow, for all of the way between them: NaN where there is one bound alone."""
    found, parts = np.zeros(len(freed.equal)), iter(held.tied_multiplier)
    for n, item in enumerate(freed.equal):
        way = np.nan if item.lower is None or item.upper is None else item.upper - item.lower
        for bound in (item.lower, item.upper):
            if bound is not None:
                found[n] += next(parts) * way / (abs(bound) or 1.0)
    return found


def _limits(search: Search, made: Achieved, held: Held) -> Limits:
    """All limits against what the new design achieves; neighbours of modes that are to lie apart are those that it has."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(made.value)
    before = {limit: n for n, limit in enumerate(search.limits)}
    limits = (*search.wanted.limits, *search.order(log))
    margins = np.array([-abs(margin(limit, log)[0]) if limit.sense == "equals" else margin(limit, log)[0] for limit in limits])
    room = np.array([-EQUAL if limit.sense == "equals" else 0.0 for limit in limits])
    values = [_value(limit, made.value) for limit in limits]
    places = [before.get(limit, -1) for limit in limits]
    return Limits(
        name=tuple(_named(limit, search.wanted) for limit in limits),
        goal=np.array([limit.goal + 1 for limit in limits], dtype=int),
        quantity=np.array([limit.quantity for limit in limits], dtype=int),
        other=np.array([limit.other for limit in limits], dtype=int),
        sense=tuple(limit.sense for limit in limits),
        asked=np.array([limit.value for limit in limits]),
        value=np.array(values, dtype=float),
        margin=margins,
        met=margins >= room,  # NaN is not met
        active=np.array([place >= 0 and bool(held.active[place]) for place in places], dtype=bool),
        multiplier=np.array([held.multiplier[place] if place >= 0 else 0.0 for place in places]),
    )


def _value(limit: Limit, value: Array) -> float:
    if limit.other < 0:
        return float(value[limit.quantity])
    high, low = value[limit.quantity], value[limit.other]
    return float(high - low if limit.hertz else high / low)


def _named(limit: Limit, asked: Wanted) -> str:
    item = asked.quantities[limit.quantity]
    sign = {"at_least": ">=", "at_most": "<=", "equals": "="}[limit.sense]
    unit = "" if item.unit == "1" else f" {item.unit}"
    if limit.other >= 0:
        other = _titled(asked.quantities[limit.other])
        return f"{item.text} - {other} >= {limit.value:g} Hz" if limit.hertz else f"{item.text} / {other} >= {limit.value:g}"
    return f"{_titled(item)} {sign} {limit.value:g}{unit}"


def _titled(item: Quantity) -> str:
    """A quantity by a name of its own: a mode has a frequency and a share."""
    return item.text + (" from the top mass" if isinstance(item, OfMode) and item.share else "")


def _modes(search: Search, drawn: Achieved, made: Achieved) -> Every:
    """All modes of both designs by family and rank."""
    names, old, new = [], [], []
    for family, (was, now) in enumerate(zip(drawn.ranked, made.ranked, strict=True)):
        for rank, (a, b) in enumerate(zip(was, now, strict=False)):
            names.append(f"{search.values.families.name(family)} {rank + 1}")
            old.append(int(a))
            new.append(int(b))
    labels = made.modes.label
    return Every(
        name=tuple(names),
        label=tuple(labels[n] for n in new),
        before=drawn.modes.frequency[old],
        after=made.modes.frequency[new],
        share_before=drawn.modes.top_share[old],
        share_after=made.modes.top_share[new],
        number=np.array(new),
    )
