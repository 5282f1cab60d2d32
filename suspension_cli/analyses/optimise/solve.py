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
from suspension_cli.analyses.optimise.evaluate import Evaluator
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import Families, solve_modes
from suspension_cli.analyses.optimise.optimum import (
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.search import EQUAL, FEASIBLE, ActiveSet, Point, Search
from suspension_cli.design.goals import Goals
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear.eigenmodes import Modes
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
    if best.outside > FEASIBLE:
        raise InputError(_bound_faults(freed, freed.values(best.fraction)))
    while True:  # models become more complete
        systems = Systems(freed.design(best.fraction))
        compare = systems.compare(lambda _: Frequencies())
        chosen = choice.choose(systems.design, level, models, compare, tolerance)
        models = models[[one.name for one in models].index(chosen.level) :]
        most = registry.most_complete(systems.design).name if level == registry.AUTO else level
        needed = replace(evaluator, modes=chosen.level, responses=most)
        if needed == evaluator:
            break
        evaluator, search = needed, Search(needed)
        best = search.run(best.fraction)[1] or best
    search.begin(best.fraction)
    best = search.compromise(search.point(best.fraction) or best)
    return _summarise(search, chosen, best, search.active_set(best), _starts(ends))


def _check_start(evaluator: Evaluator) -> None:
    """Raise `InputError` with the quantities that are not finite in the starting design."""
    log = evaluator.at(evaluator.freed.begin)
    problem = "has no finite value in the starting design"
    remedy = "divide by a response that does not vanish"
    faults = [
        Fault("goal", problem, remedy, format_value(item.text))
        for item, value in zip(evaluator.requirements.quantities, log, strict=True)
        if not np.isfinite(value)
    ]
    if faults:
        raise InputError(faults)


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
    """Choose the designs of a Sobol sequence that violate limits least."""
    from scipy.stats import qmc

    if count < 1:
        return []
    freed, search = evaluator.freed, Search(evaluator)
    how: dict[str, Any] = {"seed": seed}
    samples = qmc.Sobol(len(freed.begin), **how).random(SAMPLES)
    shapes = evaluator.follow(freed.begin, steps=1)
    designs = [freed.design_if_valid(fraction) for fraction in samples]
    for fraction, log in zip(
        samples, evaluator.logs(evaluator.values(evaluator.results(designs, shapes))), strict=True
    ):
        search.know(fraction, log)
    found = [search.begin(fraction) for fraction in samples]
    good = [point for point in found if point is not None]
    return [point.fraction for point in sorted(good, key=lambda point: point.worst)[:count]]


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
    search: Search, chosen: Choice, best: Point, active: ActiveSet, starts: Starts
) -> Optimum:
    """Assemble the result of a search from its best point."""
    evaluator, freed = search.evaluator, search.evaluator.freed
    wanted, items = evaluator.requirements, evaluator.requirements.quantities
    model = registry.by_name(evaluator.modes)
    modes = [solve_modes(model.system(freed.design(one))) for one in (freed.begin, best.fraction)]
    results = [
        evaluator.results([freed.design(one)], evaluator.follow(one))
        for one in (freed.begin, best.fraction)
    ]
    before, after = (np.where(v < 0, np.nan, v) for one in results for v in evaluator.values(one))
    levels = {"response": evaluator.responses, "stress": "", "depth": ""}
    modal = [item.method not in levels for item in items]
    terms = "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
    return Optimum(
        numbers=_numbers(freed, best, active),
        quantities=Quantities(
            name=tuple(item.text for item in items),
            unit=tuple(item.unit for item in items),
            before=before,
            after=after,
            mode=np.array(
                [
                    results[1].numbers(*item.key)[0] if own else -1
                    for item, own in zip(items, modal, strict=True)
                ]
            ),
            weight=wanted.weight,
            model=tuple(levels.get(item.method, evaluator.modes) for item in items),
        ),
        limits=_limits(search, after, active),
        modes=_mode_table(evaluator.families, *modes),
        starts=starts,
        unknown=wanted.unknown,
        objective=terms if wanted.weight.any() else OBJECTIVE[freed.goals.prefer],
        stationarity=active.stationarity,
        fidelity=chosen.level,
        reason=chosen.reason,
        error=chosen.error,
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


def _limits(search: Search, value: Float[np.ndarray, " quantity"], active: ActiveSet) -> Limits:
    """Compare limits, and separations of its neighbouring modes, with the optimised design."""
    wanted, places = search.evaluator.requirements, {one: n for n, one in enumerate(search.limits)}
    with np.errstate(divide="ignore"):
        log = np.log(value)
    limits = wanted.all_limits(log)
    equal = np.array([limit.sense == "equals" for limit in limits], dtype=bool)
    margins = np.array([limit.margin(log) for limit in limits], dtype=float)
    margins = np.where(equal, -np.abs(margins), margins)
    known = [places.get(limit, -1) for limit in limits]
    return Limits(
        name=tuple(limit.name(wanted.quantities) for limit in limits),
        goal=np.array([limit.goal + 1 for limit in limits], dtype=int),
        quantity=np.array([limit.quantity for limit in limits], dtype=int),
        other=np.array([limit.other for limit in limits], dtype=int),
        sense=tuple(limit.sense for limit in limits),
        asked=np.array([limit.value for limit in limits], dtype=float),
        value=np.array([limit.of(value) for limit in limits], dtype=float),
        margin=margins,
        met=margins >= np.where(equal, -EQUAL, 0.0),  # NaN is not met
        active=np.array([n >= 0 and bool(active.active[n]) for n in known], dtype=bool),
        multiplier=np.array([active.multiplier[n] if n >= 0 else 0.0 for n in known]),
    )


def _mode_table(families: Families, *modes: Modes) -> ModeTable:
    """List the modes of both designs by family and rank."""
    ranked = [families.ranked(one.energy) for one in modes]
    name = [
        f"{families.name(family)} {rank + 1}"
        for family, both in enumerate(zip(*ranked, strict=True))
        for rank in range(min(map(len, both)))
    ]
    old, new = (
        np.concatenate(
            [
                own[: min(map(len, both))]
                for own, both in zip(one, zip(*ranked, strict=True), strict=True)
            ]
        )
        for one in ranked
    )
    before, after = modes
    return ModeTable(
        name=tuple(name),
        label=tuple(after.label[n] for n in new),
        before=before.frequency[old],
        after=after.frequency[new],
        fraction_before=before.top_fraction[old],
        fraction_after=after.top_fraction[new],
        number=new,
    )
