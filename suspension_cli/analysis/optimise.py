"""Numbers of a design chosen so that it meets goals.

Starts are taken from the design itself and from a Sobol sequence between the bounds, worked out as one batch; from the best of them the search (`search`)
goes on.  It works on the `string` rung, whose derivatives are exact.  What it found is written as TOML, read back, and every goal worked out anew
by the ordinary analyses (`achieved`) on the rung that they take by themselves.  Where that rung differs, the difference of the logarithms is added to the
search's and it goes on from there, until the two agree: limits then hold for the better model.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import achieved, families, modes, signals
from suspension_cli.analysis.achieved import Achieved
from suspension_cli.analysis.families import Families
from suspension_cli.analysis.freed import Freed
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.quantities import Limit, Wanted, wanted
from suspension_cli.analysis.search import Held, Point, Search, margin
from suspension_cli.analysis.valued import Values, with_imperfections
from suspension_cli.design import checks
from suspension_cli.design.expand import nominal
from suspension_cli.design.goals import Goals
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.models import fidelity

STARTS, SEED = 6, 1
"""How many starts are searched from, and the seed of those beside the design itself."""
SAMPLES = 64
"""Designs between the bounds that starts are chosen from."""
ROUNDS = 6
"""Times that the search is corrected for what a higher rung finds, at most."""
SETTLED = 1e-7
"""Change of that correction at which it has settled, of the value."""
EQUAL = 1e-6
"""Relative difference up to which a value equals what it was to equal."""
SAME = 1e-2
"""Distance, as a share of the way between the bounds, within which starts have arrived at the same design."""


@dataclass(frozen=True)
class Numbers:
    """The numbers that changed: the free ones, then those that follow from them; (n,) arrays.

    Attributes
    ----------
    name : tuple of str
        Dotted paths.
    tied : bool array
    before, after, lower, upper : arrays
        SI; NaN where there is no bound.
    bound : int array
        -1 at the lower bound, 1 at the upper one, 0 between them.
    multiplier : array
        What the objective would gain if the bound gave way, for all of the way between the bounds.
    """

    name: tuple[str, ...]
    tied: Any
    before: Array
    after: Array
    lower: Array
    upper: Array
    bound: Any
    multiplier: Array


@dataclass(frozen=True)
class Quantities:
    """What goals are about, (q,).

    Attributes
    ----------
    name, unit : tuple of str
    before, after : arrays
        As the ordinary analyses have them; NaN for an unstable mode.
    searched : array
        As the search had them, on `string`.
    mode : int array
        Place of the mode that each is about among those of the new design, from 0; -1 for others.
    weight : array
        Of what was to be made small (above 0) or large (below 0); 0 for others.
    """

    name: tuple[str, ...]
    unit: tuple[str, ...]
    before: Array
    after: Array
    searched: Array
    mode: Any
    weight: Array


@dataclass(frozen=True)
class Limits:
    """What was asked of them, (k,).

    Attributes
    ----------
    name : tuple of str
        ``yaw 3 <= 5 Hz``.
    goal : int array
        Number of the goal in its file, from 1.
    quantity, other : int arrays
        Place of the quantity, and of the one that it is to lie apart from (-1: none).
    sense : tuple of str
    limit, value : arrays
        Of a separation, ratios or differences.
    margin : array
        Logarithm of value over limit, or of limit over value: below 0 the limit is not met; of an equality, less its absolute value.
    met, active : bool arrays
        Active limits are those that hold the search back.
    multiplier : array
        What the objective would gain a unit of margin.
    """

    name: tuple[str, ...]
    goal: Any
    quantity: Any
    other: Any
    sense: tuple[str, ...]
    limit: Array
    value: Array
    margin: Array
    met: Any
    active: Any
    multiplier: Array


@dataclass(frozen=True)
class Every:
    """All modes, by family and rank, (m,).

    Attributes
    ----------
    name : tuple of str
    label : tuple of str
        Of the new design, as `pendsus modes` has it.
    before, after : arrays
        Hz; NaN for an unstable one.
    share_before, share_after : arrays
        Share of the kinetic energy in the top mass.
    number : int array
        Place among the modes of the new design, from 0.
    """

    name: tuple[str, ...]
    label: tuple[str, ...]
    before: Array
    after: Array
    share_before: Array
    share_after: Array
    number: Any


@dataclass(frozen=True)
class Starts:
    """Where the search began, (s,); the first start is the design as drawn.

    Attributes
    ----------
    before, after : arrays
        Largest violation of a limit (logarithm); NaN where there is no design.
    objective : array
    place : int array
        Number of the design at which each arrived, from 1: the same number for the same design; 0 where there is none.
    """

    before: Array
    after: Array
    objective: Array
    place: Any


@dataclass(frozen=True)
class Optimum:
    """A design that was made to meet goals.

    Attributes
    ----------
    numbers, quantities, limits, modes, starts
    unknown : tuple of str
        What was asked for but is not known, and what the design would have to give.
    objective : str
        What was made small.
    stationarity : float
        What multipliers leave of the objective's gradient, of all of it.
    rounds : int
        Times that the search was corrected for what a higher rung finds.
    fidelity, reason : str
        The rung of the modes.
    error : float
        Its estimated relative error.
    design : str
        TOML.
    """

    numbers: Numbers
    quantities: Quantities
    limits: Limits
    modes: Every
    starts: Starts
    unknown: tuple[str, ...]
    objective: str
    stationarity: float
    rounds: int
    fidelity: str
    reason: str
    error: float
    design: str

    @property
    def met(self) -> bool:
        """Whether all limits are, and nothing that was asked for is unknown."""
        return bool(self.limits.met.all()) and not self.unknown


def solve(text: str, goals: Goals, *, level: str = "auto", starts: int = STARTS, seed: int = SEED, report: Any = None) -> Optimum:
    """Choose numbers of a design.

    Parameters
    ----------
    text : str
        The design as TOML.
    goals : Goals
    level : str
        Rung on which the result is checked, or ``auto``.
    starts, seed : int
    report : callable, optional
        Called with the share of the starts that are done.

    Raises
    ------
    InputError
        If a goal or a number is not the design's.
    """
    freed = Freed.of(text, goals)
    values = _values(freed, goals)
    search = Search(values, goals, np.zeros(len(values.wanted.quantities)))
    if search.value(search.begin) is None:
        values.at(freed.start)  # says why there is none
    points, before = _searched(search, starts, seed, report)
    best = min((point for point in points if point is not None), key=lambda point: point.rank)
    best, made, rounds = _checked(search, best, level)
    return _told(search, goals, best, made, _starts(points, before), rounds, level)


def _values(freed: Freed, goals: Goals) -> Values:
    """What is asked of the design as it starts."""
    design = freed.design(freed.start)
    for n, goal in enumerate(goals.goal, 1):
        faults = [] if goal.perturbation is None else checks.of_design(with_imperfections(design, tuple(goal.perturbation)))
        if faults:
            raise InputError([Fault(f"goal.{n}.{fault.key}", fault.problem, fault.remedy, fault.value) for fault in faults])
    model = fidelity.linear_model(design, "string")
    found = modes.solve(model)
    kin = Families.of(mirrored(nominal(design)), found.energy)
    return Values(freed, wanted(goals, design, found, kin, signals.bodies(model)), kin)


def _searched(search: Search, starts: int, seed: int, report: Any) -> tuple[list[Point | None], list[float]]:
    """Where each start led, and the violation at it."""
    begins = [search.begin, *_chosen(search, starts - 1, seed)]
    points, before = [], []
    for n, share in enumerate(begins):
        now = search.value(share)
        if now is not None:
            search.pairs = search.order(now.log)
        begin = None if now is None else search.point(share)
        before.append(np.nan if begin is None else begin.violation)
        points.append(search.run(share))
        if report is not None:
            report((n + 1) / len(begins))
    return points, before


def _chosen(search: Search, count: int, seed: int) -> list[Array]:
    """The best of a Sobol sequence between the bounds, worked out as one batch."""
    from scipy.stats import qmc

    if count < 1:
        return []
    shares = qmc.Sobol(len(search.begin), seed=seed).random(SAMPLES)
    logs = search.values.batch(np.array([search.freed.numbers(share) for share in shares]))
    rows, sides = search.freed.ties()
    worst = np.full(len(shares), np.inf)
    for n, (share, log) in enumerate(zip(shares, logs, strict=True)):
        if np.isfinite(log).all():
            found = [margin(limit, log)[0] for limit in (*search.wanted.limits, *search.order(log))]
            equal = [limit.sense == "equals" for limit in (*search.wanted.limits, *search.order(log))]
            below = [-abs(value) if same else value for value, same in zip(found, equal, strict=True)]
            worst[n] = max([*(-value for value in below), *(-(rows @ search.freed.numbers(share) + sides)), 0.0])
    order = np.argsort(worst, kind="stable")
    return [shares[n] for n in order[:count] if np.isfinite(worst[n])]


def _checked(search: Search, best: Point, level: str) -> tuple[Point, Achieved, int]:
    """The best design, corrected until search and ordinary analyses agree; what it achieves; and the number of corrections."""
    rounds = 0
    while True:
        made = _achieved(search, search.freed.numbers(best.share), level)
        with np.errstate(invalid="ignore", divide="ignore"):
            offset = np.log(made.value) - (best.log - search.offset)
        offset = np.where(np.isfinite(offset), offset, 0.0)
        if rounds == ROUNDS or (np.abs(offset - search.offset) < SETTLED).all():
            return best, made, rounds
        rounds += 1
        search.offset = offset
        search.seen.clear()
        best = search.run(best.share) or best


def _achieved(search: Search, number: Array, level: str) -> Achieved:
    """What a design achieves, by the ordinary analyses."""
    freed, values = search.freed, search.values

    def follow(found: Modes, mass: Array) -> Any:
        return families.became(freed.text, freed.values(freed.start), freed.values(number), values.nominal, found, mass)

    return achieved.of(freed.toml(number), values.wanted.quantities, level, follow)


def _starts(points: list[Point | None], before: list[float]) -> Starts:
    """Which starts arrived at the same design, numbered from the best."""
    place = np.zeros(len(points), dtype=np.int16)
    seen: list[Point] = []
    order = sorted((n for n, point in enumerate(points) if point is not None), key=lambda n: points[n].rank)  # type: ignore[union-attr]
    for n in order:
        point = points[n]
        assert point is not None
        near = [k for k, one in enumerate(seen, 1) if np.abs(one.share - point.share).max() < SAME]
        if not near:
            seen.append(point)
        place[n] = near[0] if near else len(seen)

    def each(name: str) -> Array:
        return np.array([np.nan if point is None else getattr(point, name) for point in points])

    return Starts(np.array(before), each("violation"), each("objective"), place)


def _told(search: Search, goals: Goals, best: Point, made: Achieved, starts: Starts, rounds: int, level: str) -> Optimum:
    """Everything that there is to say, from what the new design achieves."""
    freed, asked = search.freed, search.wanted
    drawn = _achieved(search, freed.start, level)
    held = search.held(best)
    number = freed.numbers(best.share)
    return Optimum(
        numbers=_numbers(freed, number, held),
        quantities=Quantities(
            name=tuple(item.text for item in asked.quantities),
            unit=tuple(item.unit for item in asked.quantities),
            before=drawn.value,
            after=made.value,
            searched=np.exp(best.log - search.offset),
            mode=made.place,
            weight=np.array([sum(wish.weight for wish in asked.wishes if wish.quantity == n) for n in range(len(asked.quantities))]),
        ),
        limits=_limits(search, made, held),
        modes=_modes(drawn, made),
        starts=starts,
        unknown=tuple(f"{what}: {missing} is not given" for what, missing in asked.unknown),
        objective="the logarithms to be made small, less those to be made large" if asked.wishes else OBJECTIVE[goals.prefer],
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
        multiplier=np.concatenate([held.bound_multiplier, np.zeros(ties)]),
    )


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
        limit=np.array([limit.value for limit in limits]),
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
        other = asked.quantities[limit.other].text
        return f"{item.text} - {other} >= {limit.value:g} Hz" if limit.hertz else f"{item.text} / {other} >= {limit.value:g}"
    word = " from the top mass" if getattr(item, "share", False) else ""
    return f"{item.text}{word} {sign} {limit.value:g}{unit}"


def _modes(drawn: Achieved, made: Achieved) -> Every:
    """All modes of both designs by family and rank."""
    names, old, new = [], [], []
    for family, (was, now) in enumerate(zip(drawn.families.ranked(drawn.modes.energy), made.families.ranked(made.modes.energy), strict=False)):
        for rank, (a, b) in enumerate(zip(was, now, strict=False)):
            names.append(f"{made.families.name(family)} {rank + 1}")
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


