"""Optimisation of the numbers of a design to meet goals.

Searches (`search`) start from the design itself and from the best designs of a Sobol sequence
between the bounds. They use the cheapest of the string, beam and violin models that is accurate
enough at the start. Where the result needs a more complete model, the search continues with that,
at most twice per quantity. Quantities of the result are those of its TOML, read back.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.optimise.evaluate import Evaluator, Values
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.optimum import (
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.quantities import Limit, Quantity
from suspension_cli.analyses.optimise.search import FEASIBLE, ActiveSet, Point, Search
from suspension_cli.design.goals import Goals
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.models import registry
from suspension_cli.models.choice import TOLERANCE

if TYPE_CHECKING:
    from jaxtyping import Float

STARTS, SEED = 6, 1
"""Number of starts, and seed of all but the first."""
SAMPLES = 64
"""Designs between the bounds from which starts are chosen."""
SAME = 1e-2
"""Largest distance of equal designs, in fractions of the ranges between the bounds."""
EQUAL = 1e-6
"""Relative deviation up to which an equality is met."""
OBJECTIVE = {
    "near": (
        "half the squared distance from the starting design, in fractions of the ranges between the"
        " bounds"
    ),
    "margin": "minus the smallest margin",
}
"""What is minimised without quantities to minimise or maximise."""


def solve(
    text: str,
    goals: Goals,
    *,
    level: str = registry.AUTO,
    starts: int = STARTS,
    seed: int = SEED,
    tolerance: float = TOLERANCE,
    report: Progress | None = None,
) -> Optimum:
    """Optimise the free numbers of a design to meet goals.

    Parameters
    ----------
    text : str
        The design as TOML.
    goals : Goals
    level : str
        Model of all modes and responses, or ``auto``.
    starts, seed : int
        Number of starts, and seed of all but the first, which is the design itself.
    tolerance : float
        Relative error that ``auto`` may leave.
    report : callable, optional
        Called with (done, all, rate per second) after each start.

    Raises
    ------
    InputError
        If the design lacks a number or quantity of the goals, or if dependent numbers lie outside
        their bounds in all designs found.
    """
    freed = FreeDesign.of(text, goals)
    evaluator = Evaluator.of(freed, level, tolerance, freed.begin)
    search, began = Search(evaluator), time.monotonic()
    if search.value(freed.begin) is None:
        _check_start(evaluator)
    begins = [freed.begin, *_choose_starts(evaluator, starts - 1, seed)]
    ends: list[tuple[float, Point | None]] = []
    for n, fraction in enumerate(begins, 1):
        ends.append(search.run(fraction))
        if report is not None:
            report(n, len(begins), n / (time.monotonic() - began))
    best = min((point for _, point in ends if point is not None), key=lambda point: point.rank)
    if best.outside > FEASIBLE:
        raise InputError(_bound_faults(freed, freed.values(best.fraction)))
    while True:  # models become more complete
        needed = Evaluator.of(freed, level, tolerance, best.fraction, evaluator)
        better = Search(needed)
        if needed.levels == evaluator.levels or (found := better.run(best.fraction)[1]) is None:
            break
        evaluator, search, best = needed, better, found
    best, some = search.compromise(search.begin(best.fraction) or best)
    return _summarise(search, needed, best, search.active_set(best, some), _starts(ends))


def _check_start(evaluator: Evaluator) -> None:
    """Raise `InputError` with the quantities that are not finite in the starting design."""
    log = evaluator.values(evaluator.freed.begin).log  # raises if the design is invalid
    problem = "has no finite value in the starting design"
    remedy = "divide by a response that does not vanish"
    raise InputError(
        [
            Fault("goal", problem, remedy, format_value(item.text))
            for item, value in zip(evaluator.quantities, log, strict=True)
            if not np.isfinite(value)
        ]
    )


def _bound_faults(freed: FreeDesign, value: dict[str, float]) -> list[Fault]:
    remedy = "widen its bounds, or those of the numbers that it depends on"
    found = []
    for n, item in enumerate(freed.goals.equal, 1):
        at = value[item.name]
        for side, bound in (("lower", item.lower), ("upper", item.upper)):
            if bound is not None and (at < bound if side == "lower" else at > bound):
                problem = f"{item.name} comes no closer to this bound than {at:g}"
                found.append(Fault(f"equal.{n}.{side}", problem, remedy, format_value(bound)))
    return found


def _choose_starts(
    evaluator: Evaluator, count: int, seed: int
) -> list[Float[np.ndarray, " number"]]:
    """Choose the designs of a Sobol sequence that violate limits least, on the model of modes."""
    from scipy.stats import qmc

    if count < 1:
        return []
    search, found = Search(replace(evaluator, responses={})), []
    how: dict[str, Any] = {"seed": seed}
    for fraction in qmc.Sobol(len(evaluator.freed.begin), **how).random(SAMPLES):
        begin = search.begin(fraction, steps=1)
        if begin is not None:
            found.append((begin.worst, len(found), fraction))
    return [fraction for _, _, fraction in sorted(found)[:count]]


def _starts(ends: list[tuple[float, Point | None]]) -> Starts:
    """Number the designs reached, the best first, equal ones alike."""
    place = np.zeros(len(ends), dtype=np.int16)
    seen: list[Point] = []
    arrived = [(point.rank, n, point) for n, (_, point) in enumerate(ends) if point is not None]
    for _, n, point in sorted(arrived, key=lambda item: item[:2]):
        distances = [np.abs(one.fraction - point.fraction).max() for one in seen]
        near = [k for k, distance in enumerate(distances, 1) if distance < SAME]
        if not near:
            seen.append(point)
        place[n] = near[0] if near else len(seen)
    after, objective = (
        np.array([np.nan if point is None else getattr(point, name) for _, point in ends])
        for name in ("worst", "objective")
    )
    return Starts(np.array([before for before, _ in ends]), after, objective, place)


def _summarise(
    search: Search, needed: Evaluator, best: Point, active: ActiveSet, starts: Starts
) -> Optimum:
    """Assemble the result of a search from its best point."""
    evaluator, freed = search.evaluator, search.evaluator.freed
    wanted, items = evaluator.requirements, evaluator.quantities
    before, after = (evaluator.values(one) for one in (freed.begin, best.fraction))
    weight = np.zeros(len(items))
    for place, own in wanted.terms:
        weight[place] += own
    terms = "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
    return Optimum(
        numbers=_numbers(freed, best, active),
        quantities=Quantities(
            name=tuple(item.text for item in items),
            unit=tuple(item.unit for item in items),
            before=before.value,
            after=after.value,
            mode=after.place,
            weight=weight,
            model=tuple(evaluator.level(item) for item in items),
        ),
        limits=_limits(search, after, active),
        modes=_modes(evaluator, before, after),
        starts=starts,
        unknown=wanted.unknown,
        objective=terms if wanted.terms else OBJECTIVE[freed.goals.prefer],
        stationarity=active.stationarity,
        fidelity=needed.modes.level,
        reason=needed.modes.reason,
        error=needed.modes.error,
        design=freed.toml(best.fraction),
    )


def _numbers(freed: FreeDesign, best: Point, active: ActiveSet) -> Numbers:
    """Numbers with their bounds; those of dependent numbers have rows of their own."""
    before, after = freed.values(freed.begin), freed.values(best.fraction)
    items = [*freed.goals.free, *freed.goals.equal]
    lower, upper = (
        np.array([getattr(item, side) for item in items], dtype=float)
        for side in ("lower", "upper")
    )
    count = len(freed.goals.free)
    bound, multiplier = np.zeros(len(items), dtype=int), np.zeros(len(items))
    bound[:count], multiplier[:count] = active.bound, active.bound_multiplier
    margins, _ = freed.dependent_margins(best.fraction)
    rows = zip(margins, active.dependent_multiplier, strict=True)
    for n in range(count, len(items)):
        for edge, side in ((lower[n], -1), (upper[n], 1)):
            if np.isfinite(edge):
                margin, own = next(rows)
                bound[n] = side if abs(margin) <= EQUAL else bound[n]
                multiplier[n] += own * (upper[n] - lower[n]) / (abs(edge) or 1.0)
    return Numbers(
        name=tuple(after),
        tied=np.arange(len(items)) >= count,
        before=np.array(list(before.values())),
        after=np.array(list(after.values())),
        lower=lower,
        upper=upper,
        bound=bound,
        multiplier=np.where(np.isnan(upper - lower), np.nan, multiplier),
    )


def _limits(search: Search, after: Values, active: ActiveSet) -> Limits:
    """Compare limits, and separations of its neighbouring modes, with the optimised design."""
    wanted, places = search.evaluator.requirements, {one: n for n, one in enumerate(search.limits)}
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(after.value)
    limits = (*wanted.limits, *wanted.neighbours(log))
    equal = np.array([limit.sense == "equals" for limit in limits], dtype=bool)
    margins = np.array([limit.margin(log)[0] for limit in limits], dtype=float)
    margins = np.where(equal, -np.abs(margins), margins)
    known = [places.get(limit, -1) for limit in limits]
    return Limits(
        name=tuple(limit.name(wanted.quantities) for limit in limits),
        goal=np.array([limit.goal + 1 for limit in limits], dtype=int),
        quantity=np.array([limit.quantity for limit in limits], dtype=int),
        other=np.array([limit.other for limit in limits], dtype=int),
        sense=tuple(limit.sense for limit in limits),
        unit=tuple(_unit(limit, wanted.quantities) for limit in limits),
        asked=np.array([limit.value for limit in limits], dtype=float),
        value=np.array([limit.of(after.value) for limit in limits], dtype=float),
        margin=margins,
        met=margins >= np.where(equal, -EQUAL, 0.0),  # NaN is not met
        active=np.array([n >= 0 and bool(active.active[n]) for n in known], dtype=bool),
        multiplier=np.array([active.multiplier[n] if n >= 0 else 0.0 for n in known]),
    )


def _unit(limit: Limit, quantities: Sequence[Quantity]) -> str:
    """Unit of a limit: of its quantity, or of the separation of two modes."""
    if limit.other < 0:
        return quantities[limit.quantity].unit
    return "Hz" if limit.hertz else "1"


def _modes(evaluator: Evaluator, before: Values, after: Values) -> ModeTable:
    """List the modes of both designs by family and rank."""
    rows = [
        (f"{evaluator.families.name(family)} {rank + 1}", int(old), int(new))
        for family, both in enumerate(zip(before.ranked, after.ranked, strict=True))
        for rank, (old, new) in enumerate(zip(*both, strict=False))
    ]
    old, new = [old for _, old, _ in rows], [new for _, _, new in rows]
    return ModeTable(
        name=tuple(name for name, _, _ in rows),
        label=tuple(after.modes.label[n] for n in new),
        before=before.modes.frequency[old],
        after=after.modes.frequency[new],
        fraction_before=before.modes.top_fraction[old],
        fraction_after=after.modes.top_fraction[new],
        number=np.array(new),
    )
