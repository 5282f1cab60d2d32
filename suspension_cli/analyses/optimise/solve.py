"""Optimisation of the numbers of a design to meet goals.

Searches (`constrained_search`) start from the design itself and from the best designs of a Sobol
sequence between the bounds. They use the cheapest of the string, beam and violin models that is
accurate enough at the start. Where the result needs a more complete model, the search continues
with that, at most twice per quantity. The result is written as TOML, read back, and every goal is
checked (`achieved`).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.optimise import achieved
from suspension_cli.analyses.optimise.achieved import Achieved
from suspension_cli.analyses.optimise.chosen_models import Models, choose
from suspension_cli.analyses.optimise.constrained_search import (
    FEASIBLE,
    Point,
    Search,
    signed_margin,
)
from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.analyses.optimise.objective import Evaluator
from suspension_cli.analyses.optimise.optimum import Optimum, Starts
from suspension_cli.analyses.optimise.outcome import summarise
from suspension_cli.analyses.optimise.quantities import Limit, interpret, with_imperfections
from suspension_cli.design import checks
from suspension_cli.design.goals import Goals
from suspension_cli.equilibrium.nominal import expand_nominal
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import eigenmodes, signals
from suspension_cli.linear.symmetry import is_mirror_symmetric
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
        Model of search and check, or ``auto``.
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
    search = _search(freed, goals, choose(freed.design(freed.start), (), level, tolerance))
    search = _search(freed, goals, _needed(search, search.begin, level, tolerance))
    if search.value(search.begin) is None:
        _check_start(search.values)
    points, before = _search_all(search, starts, seed, report)
    best = min((point for point in points if point is not None), key=lambda point: point.rank)
    if best.outside > FEASIBLE:
        raise InputError(_bound_faults(freed, freed.values(freed.numbers(best.fraction))))
    models = _needed(search, best.fraction, level, tolerance)
    while models.levels != search.values.models.levels:  # models become more complete
        better = _search(freed, goals, models)
        found = better.run(best.fraction)
        if found is None:
            break
        search, best = better, found
        models = _needed(search, best.fraction, level, tolerance)
    drawn, made = (_achieved(search, one) for one in (search.begin, best.fraction))
    return summarise(search, best, drawn, made, models.modes, _starts(points, before))


def _needed(
    search: Search, fraction: Float[np.ndarray, " number"], level: str, tolerance: float
) -> Models:
    """Choose the models that a design needs, none simpler than those of the search."""
    freed, values = search.freed, search.values
    design = freed.design(freed.numbers(fraction))
    return choose(design, values.requirements.quantities, level, tolerance, values.models)


def _search(freed: FreeDesign, goals: Goals, models: Models) -> Search:
    return Search(_values(freed, goals, models), goals)


def _values(freed: FreeDesign, goals: Goals, models: Models) -> Evaluator:
    """Set up quantities and requirements at the starting design."""
    design = freed.design(freed.start)
    for n, goal in enumerate(goals.goal, 1):
        imperfect = with_imperfections(design, tuple(goal.perturbation or ()))
        faults = checks.check_design(imperfect) if goal.perturbation else []
        if faults:
            raise InputError([replace(one, key=f"goal.{n}.{one.key}") for one in faults])
    model = models.modes.model.system(design)
    found = eigenmodes.solve(model.constant)
    families = Families.of(is_mirror_symmetric(expand_nominal(design)), found.energy)
    known = signals.bodies_with_signals(model)
    requirements = interpret(goals, design, found, families, known, models.modes.level)
    return Evaluator(freed, requirements, families, models)


def _check_start(values: Evaluator) -> None:
    """Raise `InputError` with the quantities that are not finite in the starting design."""
    log = values.at(values.freed.start).log  # raises if the design is invalid
    problem = "has no finite value in the starting design"
    remedy = "divide by a response that does not vanish"
    raise InputError(
        [
            Fault("goal", problem, remedy, format_value(item.text))
            for item, value in zip(values.requirements.quantities, log, strict=True)
            if not np.isfinite(value)
        ]
    )


def _bound_faults(freed: FreeDesign, value: dict[str, float]) -> list[Fault]:
    remedy = "widen its bounds, or those of the numbers that it depends on"
    found = []
    for n, item in enumerate(freed.equal, 1):
        at = value[item.name]
        for side, bound in (("lower", item.lower), ("upper", item.upper)):
            if bound is not None and (at < bound if side == "lower" else at > bound):
                problem = f"{item.name} comes no closer to this bound than {at:g}"
                found.append(Fault(f"equal.{n}.{side}", problem, remedy, format_value(bound)))
    return found


def _search_all(
    search: Search, starts: int, seed: int, report: Progress | None
) -> tuple[list[Point | None], list[float]]:
    """Search from every start; return the points reached and the violations at the starts."""
    begins = [search.begin, *_choose_starts(search, starts - 1, seed)]
    points, before, began = [], [], time.monotonic()
    for n, fraction in enumerate(begins):
        now = search.value(fraction)
        if now is not None:
            search.pairs = search.order(now.log)
        begin = None if now is None else search.point(fraction)
        before.append(np.nan if begin is None else begin.worst)
        points.append(search.run(fraction))
        if report is not None:
            report(n + 1, len(begins), (n + 1) / (time.monotonic() - began))
    return points, before


def _choose_starts(search: Search, count: int, seed: int) -> list[Float[np.ndarray, " number"]]:
    """Choose the designs of a Sobol sequence that violate limits least."""
    from scipy.stats import qmc

    if count < 1:
        return []
    how: Any = {"seed": seed}
    fractions = qmc.Sobol(len(search.begin), **how).random(SAMPLES)
    logs = search.values.batch(np.array([search.freed.numbers(fraction) for fraction in fractions]))
    rows, sides = search.freed.ties()
    worst = np.full(len(fractions), np.inf)
    for n, (fraction, log) in enumerate(zip(fractions, logs, strict=True)):
        if np.isfinite(log).all():
            margins = [signed_margin(limit, log) for limit in _all_limits(search, log)]
            dependent = rows @ search.freed.numbers(fraction) + sides
            worst[n] = max(*(-value for value in margins), *(-dependent), 0.0, 0.0)
    order = np.argsort(worst, kind="stable")
    return [fractions[n] for n in order[:count] if np.isfinite(worst[n])]


def _all_limits(search: Search, log: Float[np.ndarray, " quantity"]) -> tuple[Limit, ...]:
    """Limits of the goals, then separations of the modes that are neighbours at `log`."""
    return (*search.requirements.limits, *search.order(log))


def _achieved(search: Search, fraction: Float[np.ndarray, " number"]) -> Achieved:
    values, number = search.values, search.freed.numbers(fraction)
    return achieved.evaluate(
        search.freed.toml(number),
        values.requirements.quantities,
        values.families,
        values.models,
        lambda found, model: values.follow(found, model, number),
    )


def _starts(points: list[Point | None], before: list[float]) -> Starts:
    """Number the designs reached, the best first, equal ones alike."""
    place = np.zeros(len(points), dtype=np.int16)
    seen: list[Point] = []
    arrived = [(point.rank, n, point) for n, point in enumerate(points) if point is not None]
    for _, n, point in sorted(arrived, key=lambda item: item[:2]):
        assert point is not None
        near = [
            k for k, one in enumerate(seen, 1) if np.abs(one.fraction - point.fraction).max() < SAME
        ]
        if not near:
            seen.append(point)
        place[n] = near[0] if near else len(seen)

    def each(name: str) -> np.ndarray:
        return np.array([np.nan if point is None else getattr(point, name) for point in points])

    return Starts(np.array(before), each("worst"), each("objective"), place)
