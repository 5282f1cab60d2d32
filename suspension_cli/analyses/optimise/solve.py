"""Optimisation of the numbers of a design to meet goals.

Searches (`search`) start from the design itself and from the best designs of a Sobol sequence
between the bounds, on the string model. The best result is the start of a search on the models that
it needs, until it needs no more complete ones. Quantities of the result are those of its TOML, read
back.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses import model_choice
from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.optimise.evaluate import Evaluator, Results
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import solve_modes
from suspension_cli.analyses.optimise.optimum import (
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.quantities import Requirements
from suspension_cli.analyses.optimise.search import EQUAL, FEASIBLE, Point, Search
from suspension_cli.design.goals import Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.models import choice, registry
from suspension_cli.models.choice import TOLERANCE, Frequencies, Systems
from suspension_cli.models.registry import Choice

if TYPE_CHECKING:
    from jaxtyping import Float

STARTS, SEED = 6, 1
"""Number of starts, and seed of all but the first."""
SAMPLES = 64
"""Designs between the bounds from which starts are chosen."""
SAME = 1e-2
"""Largest distance of equal designs, in fractions of the ranges between the bounds."""
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
    models = registry.SCENE_MODELS
    model_choice.demand_one_of(level, models, "cannot compute derivatives")
    freed = FreeDesign.of(text, goals)
    evaluator = Evaluator.of(freed)
    _check_start(evaluator)
    search, began, ends = Search(evaluator), time.monotonic(), list[tuple[float, Point | None]]()
    begins = [freed.begin, *_choose_starts(evaluator, starts - 1, seed)]
    for n, fraction in enumerate(begins, 1):
        ends.append(search.run(fraction))
        if report is not None:
            report(n, len(begins), n / (time.monotonic() - began))
    best = min((point for _, point in ends if point is not None), key=lambda point: point.rank)
    _check_bounds(freed, best)
    while True:  # models become more complete
        systems = Systems(freed.design(best.fraction))
        compare = systems.compare(lambda _: Frequencies())
        chosen = choice.choose(systems.design, level, models, compare, tolerance)
        if chosen.model.cost < registry.by_name(evaluator.modes).cost:
            chosen = choice.choose(systems.design, evaluator.modes, (), compare)
            reason = chosen.reason.replace("as requested", "other designs of the search need it", 1)
            chosen = replace(chosen, reason=reason)
        most = registry.most_complete(systems.design).name if level == registry.AUTO else level
        needed = replace(evaluator, modes=chosen.level, responses=most)
        if needed == evaluator:
            break
        evaluator, search = needed, Search(needed)
        best = search.run(best.fraction)[1] or best
    best = search.compromise(best)
    return _summarise(search, chosen, best, _starts(ends))


def _check_start(evaluator: Evaluator) -> None:
    """Raise `InputError` with the quantities that are not finite in the starting design."""
    log, items = evaluator.at(evaluator.freed.begin), evaluator.requirements.quantities
    problem, remedy = "has no finite value in the starting design", "divide by another response"
    names = [format_value(items[n].text) for n in np.flatnonzero(~np.isfinite(log[: len(items)]))]
    if names:
        raise InputError([Fault("goal", problem, remedy, name) for name in names])


def _check_bounds(freed: FreeDesign, best: Point) -> None:
    """Raise `InputError` with the bounds that dependent numbers cannot keep to."""
    remedy, count = "widen its bounds, or those of the numbers that it depends on", len(freed.start)
    faults = []
    for side, n in np.argwhere(freed.margins(best.fraction) < -FEASIBLE).tolist():
        name, at = list(freed.values(best.fraction).items())[n]
        key, bound = f"equal.{n - count + 1}.{('lower', 'upper')[side]}", freed.bounds[side, n]
        problem = f"{name} comes no closer to this bound than {at:g}"
        faults.append(Fault(key, problem, remedy, format_value(float(bound))))
    if faults:
        raise InputError(faults)


def _choose_starts(
    evaluator: Evaluator, count: int, seed: int
) -> list[Float[np.ndarray, " number"]]:
    """Choose the designs of a Sobol sequence that violate limits least."""
    from scipy.stats import qmc

    if count < 1:
        return []
    freed, search = evaluator.freed, Search(evaluator)
    how: dict[str, Any] = {"seed": seed}
    samples = qmc.Sobol(len(freed.begin), **how).random(SAMPLES)
    logs = evaluator.logs(samples, evaluator.follow(freed.begin, steps=1))
    found = map(search.know, samples, logs)
    good = [point for point in found if point is not None]
    return [point.fraction for point in sorted(good, key=lambda point: point.worst)[:count]]


def _starts(ends: list[tuple[float, Point | None]]) -> Starts:
    """Number the designs reached, the best first, equal ones alike."""
    place, seen = np.zeros(len(ends), dtype=np.int16), list[Point]()
    arrived = [(point.rank, n, point) for n, (_, point) in enumerate(ends) if point is not None]
    for _, n, point in sorted(arrived, key=lambda item: item[:2]):
        near = [np.abs(one.fraction - point.fraction).max() < SAME for one in seen]
        place[n] = [*near, True].index(True) + 1
        seen += [] if any(near) else [point]
    after, objective = (
        np.array([np.nan if point is None else getattr(point, name) for _, point in ends])
        for name in ("worst", "objective")
    )
    return Starts(np.array([before for before, _ in ends]), after, objective, place)


def _summarise(search: Search, chosen: Choice, best: Point, starts: Starts) -> Optimum:
    """Assemble the result of a search from its best point."""
    evaluator, freed = search.evaluator, search.freed
    limit, bound, stationarity = search.multipliers(best)
    wanted, items = evaluator.requirements, evaluator.requirements.quantities
    ends = (freed.begin, best.fraction)
    designs = [freed.design(one) for one in ends]
    old, new = (
        Results(evaluator, [design], evaluator.follow(one))
        for design, one in zip(designs, ends, strict=True)
    )
    before, after = old.values[0], new.values[0]
    before, after = (np.where(value < 0, np.nan, value) for value in (before, after))
    levels = {"response": evaluator.responses, "of_mode": evaluator.modes}
    mode = [
        int(new.numbers[item.key[1]][0, item.key[2]]) if item.method == "of_mode" else -1
        for item in items
    ]
    terms = "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
    lower, upper = freed.bounds
    at_lower, at_upper = freed.margins(best.fraction) <= EQUAL
    return Optimum(
        numbers=Numbers(
            name=tuple(freed.values(best.fraction)),
            tied=np.arange(len(lower)) >= len(freed.goals.free),
            before=np.array(list(freed.values(freed.begin).values())),
            after=np.array(list(freed.values(best.fraction).values())),
            lower=lower,
            upper=upper,
            bound=at_upper * 1 - at_lower,
            multiplier=np.where(np.isnan(upper - lower), np.nan, bound.sum(0)),
        ),
        quantities=Quantities(
            name=tuple(item.text for item in items),
            unit=tuple(item.unit for item in items),
            before=before,
            after=after,
            mode=np.array(mode),
            weight=wanted.weight,
            model=tuple(levels.get(item.method, "") for item in items),
        ),
        limits=_limits(wanted, after, limit),
        modes=_mode_table(evaluator, old, new, designs[1]),
        starts=starts,
        unknown=wanted.unknown,
        objective=terms if wanted.weight.any() else OBJECTIVE[freed.goals.prefer],
        stationarity=stationarity,
        fidelity=chosen.level,
        reason=chosen.reason,
        error=chosen.error,
        design=freed.toml(best.fraction),
    )


def _limits(
    wanted: Requirements,
    quantity: Float[np.ndarray, " quantity"],
    multiplier: Float[np.ndarray, " limit"],
) -> Limits:
    """Compare the limits with the optimised design."""
    limits, sense = wanted.limits, np.array([limit.sense for limit in wanted.limits], dtype=str)
    place = np.array([limit.quantity for limit in limits], dtype=int)
    asked = np.array([limit.value for limit in limits], dtype=float)
    with np.errstate(divide="ignore"):
        log = np.log(quantity[place]) - np.log(asked)
    equal = sense == "equals"
    margin = np.where(equal, -np.abs(log), np.where(sense == "at_most", -log, log))
    return Limits(
        name=tuple(limit.name(wanted.quantities[limit.quantity]) for limit in limits),
        goal=np.array([limit.goal + 1 for limit in limits], dtype=int),
        quantity=place,
        sense=tuple(sense.tolist()),
        asked=asked,
        unit=tuple(wanted.quantities[n].unit for n in place),
        value=quantity[place],
        margin=margin,
        met=margin >= np.where(equal, -EQUAL, 0.0),  # NaN is not met
        active=np.isfinite(multiplier),
        multiplier=np.nan_to_num(multiplier),
    )


def _mode_table(evaluator: Evaluator, before: Results, after: Results, design: Design) -> ModeTable:
    """List the modes of both designs by family and rank; `design` is the optimised one."""
    families = evaluator.families
    names = [
        f"{families.name(k)} {n + 1}" for k, size in enumerate(families.size) for n in range(size)
    ]
    old, new = (
        np.concatenate([own[0] for own in one.numbers[: len(families.size)]])
        for one in (before, after)
    )
    label = solve_modes(registry.by_name(evaluator.modes).system(design)).label
    frequency = [
        np.where(one.frequency[0] < 0, np.nan, one.frequency[0]) for one in (before, after)
    ]
    return ModeTable(
        name=tuple(names),
        label=tuple(label[n] for n in new),
        before=frequency[0][old],
        after=frequency[1][new],
        fraction_before=before.top_fraction[0, old],
        fraction_after=after.top_fraction[0, new],
        number=new,
    )
