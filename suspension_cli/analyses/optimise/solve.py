"""Numbers of a design that meet goals.

    import suspension_cli as sus
    found = sus.optimise(sus.template("triple"), "goals.toml")
    found.met, found.numbers.after, found.design

Searches (`search`) start from the design itself, from velocity damping of its modes where goals of
loops are not met (`velocity_damping`), and from the best designs of a Sobol sequence between the
bounds, on the cheapest model that is roughly right for the design itself. The best result is the
start of a search on the model that its quantities need, until they need no more complete one.
Quantities of the result are those of its TOML, read back.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.analyses.logs import Progress
from suspension_cli.analyses.optimise import velocity_damping
from suspension_cli.analyses.optimise.evaluator import Evaluator, Report
from suspension_cli.analyses.optimise.found_digits import round_numbers
from suspension_cli.analyses.optimise.free_numbers import FreeDesign
from suspension_cli.analyses.optimise.optimum import (
    EQUAL,
    Found,
    Limits,
    ModeTable,
    Numbers,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.search import FEASIBLE, Point, Search
from suspension_cli.analyses.optimise.targets import OneLimit
from suspension_cli.analyses.optimise.velocity_damping import DampedStart
from suspension_cli.design.goals import Goals
from suspension_cli.design.reader import Source
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import eigenmodes, mode_content
from suspension_cli.linear.mode_families import Families
from suspension_cli.models import choice, registry
from suspension_cli.models.choice import TOLERANCE
from suspension_cli.models.registry import Choice
from suspension_cli.physics import model_choice
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.physics.log import Log

FILE = "file"
"""Origin of the start that is the given design."""
SAMPLES = 64
"""Designs between the bounds from which starts are chosen."""
ROUGH = 0.1
"""Relative error of the model on which all starts are searched, at the starting design."""
SAME = 1e-2
"""Largest distance of equal designs, in fractions of the ranges between the bounds."""
TERMS = "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
NEAREST = "half the squared distance from the starting design, in fractions of the ranges"
OBJECTIVE = {"near": f"{NEAREST} between the bounds", "margin": "minus the smallest margin"}
"""What is minimised, and without quantities to minimise or maximise."""


def solve(
    source: Source,
    goals: Goals,
    *,
    level: str = registry.AUTO,
    starts: int = 1,
    seed: int = 1,
    tolerance: float = TOLERANCE,
    rounding: float = 0.0,
    report: Progress | None = None,
    log: Log | None = None,
) -> Found:
    """Optimise the free numbers of a design to meet goals.

    `level` is the model of all quantities that need no more complete one, or ``auto``, which may
    leave the relative error `tolerance`. Of the `starts` the first is the design itself, beside
    which there may be one by velocity damping. Numbers are written with the fewest digits so that
    no quantity changes by more than the part `rounding` of the tolerance. `report` is called with
    (done, all, rate per second) after each, and after the final search; `log` is warned of an
    assumed ground.

    Raises `InputError` if the design lacks a number or quantity of the goals, or if dependent
    numbers lie outside their bounds in all designs found.
    """
    model_choice.demand_one_of(level, registry.SCENE_MODELS, "cannot compute derivatives")
    freed = FreeDesign.of(source.text, goals)
    evaluator = Evaluator.of(freed, source, log)
    faults = _find_unknown(evaluator)
    if faults and not velocity_damping.concerns_loops(evaluator):
        raise InputError(faults)
    search = Search(replace(evaluator, level=_first_level(evaluator, level)))
    own = search.point(freed.begin)
    damped = velocity_damping.find_start(search, own)
    if faults and damped is None:
        raise InputError(faults)
    random = _choose_starts(search, starts - 1, seed)
    begins = [own, *([damped.point] if damped else []), *random]
    origins = [FILE, *([_name(damped)] if damped else []), *["random"] * len(random)]
    ends: list[Point | None] = []
    began = time.monotonic()

    def count(done: int) -> None:
        if report is not None:
            report(done, len(begins) + 1, done / (time.monotonic() - began))

    for n, begin in enumerate(begins, 1):
        ends.append(begin and search.run(begin))
        count(n)
    best = min((point for point in ends if point is not None), key=lambda point: point.rank)
    _check_bounds(freed, best)
    chosen, search, best = _continue(search, best, level, tolerance)
    best = search.compromise(best)
    count(len(begins) + 1)
    return _summarise(search, chosen, best, _starts(origins, begins, ends), rounding * tolerance)


def _first_level(evaluator: Evaluator, level: str) -> str:
    """Name of the model on which all starts are searched: that which is wanted, without wire mass.

    If it is ``auto``, the cheapest that is roughly right for the starting design.
    """
    if level != registry.AUTO:
        return registry.BEAM.name if registry.by_name(level).has_wire_mass else level
    begin = evaluator.freed.begin
    design = evaluator.freed.design(begin)
    models = [model for model in registry.SCENE_MODELS if not model.has_wire_mass]
    return choice.choose(design, level, models, evaluator.compare(begin), ROUGH).level


def _continue(
    search: Search, best: Point, level: str, tolerance: float
) -> tuple[Choice, Search, Point]:
    """Continue a search on the model that its result needs, until that needs no other one."""
    models = registry.SCENE_MODELS
    while True:
        evaluator = search.evaluator
        design = search.freed.design(best.fraction)
        compare = evaluator.compare(best.fraction)
        cost = registry.by_name(evaluator.level).cost
        chosen = choice.choose(design, level, models, compare, tolerance)
        if chosen.model.cost < cost:  # other designs of the search need this one
            models = tuple(model for model in models if model.cost >= cost)
            chosen = choice.choose(design, level, models, compare, tolerance)
        if chosen.level == evaluator.level:
            return chosen, search, best
        search = Search(replace(evaluator, level=chosen.level))
        begin = search.point(best.fraction)
        if begin is not None:
            best = search.run(begin)


def _name(damped: DampedStart) -> str:
    """Name of a start by velocity damping."""
    return f"velocity damping (Q = {damped.quality_factor:g})"


def _find_unknown(evaluator: Evaluator) -> list[Fault]:
    """Find the quantities that are not finite in the starting design."""
    targets = evaluator.targets
    values = evaluator.at(evaluator.freed.begin)
    faults = []
    for n in np.flatnonzero(~np.isfinite(values[: len(targets.target)])).tolist():
        quantity = targets.target[n].quantity
        problem = f"has no finite value in the starting design, which {quantity.missing}"
        remedy = "change the design or the start of a free number"
        if "/" in quantity.text:
            remedy = "divide by another response"
        faults.append(Fault(targets.key[n], problem, remedy, format_value(targets.target[n].text)))
    return faults


def _check_bounds(freed: FreeDesign, best: Point) -> None:
    """Raise `InputError` with the bounds that dependent numbers cannot keep to."""
    remedy = "widen its bounds, or those of the numbers that it depends on"
    count = len(freed.start)
    faults = []
    for side, n in np.argwhere(freed.margins(best.fraction) < -FEASIBLE).tolist():
        name, at = list(freed.values(best.fraction).items())[n]
        key = f"equal.{n - count + 1}.{('lower', 'upper')[side]}"
        bound = freed.bounds[side, n]
        problem = f"{name} comes no closer to this bound than {at:g}"
        faults.append(Fault(key, problem, remedy, format_value(float(bound))))
    if faults:
        raise InputError(faults)


def _choose_starts(search: Search, count: int, seed: int) -> list[Point | None]:
    """Choose the designs of a Sobol sequence that violate limits least."""
    if count == 0:
        return []
    from scipy.stats import qmc

    how: dict[str, Any] = {"seed": seed}
    samples = qmc.Sobol(len(search.freed.begin), **how).random(SAMPLES)
    found = map(search.judge, samples, search.evaluator.values(samples))
    good = sorted((point for point in found if point), key=lambda point: point.worst)
    return [search.point(point.fraction) for point in good[:count]]


def _starts(
    origins: Sequence[str], begins: Sequence[Point | None], ends: Sequence[Point | None]
) -> Starts:
    """Number the designs reached, the best first, equal ones alike."""
    place = np.zeros(len(ends), dtype=np.int16)
    seen: list[Point] = []
    reached = [(point.rank, n, point) for n, point in enumerate(ends) if point is not None]
    for _, n, point in sorted(reached, key=lambda item: item[:2]):
        near = [np.abs(one.fraction - point.fraction).max() < SAME for one in seen]
        place[n] = [*near, True].index(True) + 1
        if not any(near):
            seen.append(point)

    def column(points: Sequence[Point | None], name: str) -> Array:
        return np.array([np.nan if one is None else getattr(one, name) for one in points])

    return Starts(
        origin=tuple(origins),
        before=column(begins, "worst"),
        after=column(ends, "worst"),
        objective=column(ends, "objective"),
        place=place,
    )


def _summarise(search: Search, chosen: Choice, best: Point, starts: Starts, change: float) -> Found:
    """Assemble the result of a search from its best point, whose numbers are rounded."""
    freed = search.freed
    targets = search.evaluator.targets
    gain, bound_gain, stationarity = search.multipliers(best)
    old = search.evaluator.report(freed.design(freed.begin))

    def met(one: Report) -> Bool[np.ndarray, " limit"]:
        return _limits(search.evaluator, old, one, gain).met

    evaluator, new = round_numbers(search.evaluator, best, search.inward(best), change, met)
    freed = evaluator.freed
    design = freed.design(best.fraction)
    quantities = [target.quantity for target in targets.target]
    return Found(
        numbers=_numbers(freed, best, bound_gain.sum(0)),
        quantities=Quantities(
            name=tuple(target.text for target in targets.target),
            unit=tuple(quantity.unit for quantity in quantities),
            before=old.value,
            after=new.value,
            mode=new.mode,
            weight=targets.weight,
            model=tuple(quantity.level(evaluator.level, design) for quantity in quantities),
        ),
        limits=_limits(evaluator, old, new, gain),
        modes=_mode_table(evaluator, old, new),
        starts=starts,
        unknown=targets.unknown,
        objective=TERMS if targets.weight.any() else OBJECTIVE[freed.goals.prefer],
        stationarity=stationarity,
        fidelity=chosen.level,
        reason=chosen.reason,
        error=chosen.error,
        toml=freed.toml(best.fraction),
        digits=freed.digits,
        rounding=change,
        remarks=new.remarks,
    )


def _numbers(freed: FreeDesign, best: Point, gain: Float[np.ndarray, " number"]) -> Numbers:
    """List the free and dependent numbers; `gain` is that of a shift of their bounds."""
    before = freed.values(freed.begin)
    after = freed.values(best.fraction)
    lower, upper = freed.bounds
    at_lower, at_upper = freed.margins(best.fraction) <= EQUAL
    return Numbers(
        name=tuple(after),
        tied=np.arange(len(lower)) >= len(freed.start),
        before=np.array([*before.values()]),
        after=np.array([*after.values()]),
        lower=lower,
        upper=upper,
        bound=at_upper * 1 - at_lower,
        multiplier=np.where(np.isnan(upper - lower), np.nan, gain),
    )


def _limits(
    evaluator: Evaluator, before: Report, after: Report, gain: Float[np.ndarray, " limit"]
) -> Limits:
    """List the limits with the values that they take; `gain` is NaN for those not active."""
    targets = evaluator.targets
    place = np.array(targets.place, dtype=int)
    pairs = list(zip(targets.place, targets.limit, strict=True))
    logarithmic = evaluator.logarithmic[place]
    asked = np.array([one.asked for one in targets.limit], dtype=float)
    return Limits(
        name=tuple(one.text for one in targets.limit),
        group=tuple(one.group for one in targets.limit),
        quantity=place,
        sense=tuple(one.sense for one in targets.limit),
        unit=tuple(one.target.quantity.unit for one in targets.limit),
        asked=asked,
        logarithmic=logarithmic,
        scale=np.where(logarithmic, asked, evaluator.scale[place]),
        before=np.array([_limited(before, *pair) for pair in pairs], dtype=float),
        value=np.array([_limited(after, *pair) for pair in pairs], dtype=float),
        active=np.isfinite(gain),
        multiplier=np.nan_to_num(gain),
    )


def _limited(found: Report, place: int, limit: OneLimit) -> float:
    """Value that a limit takes: where two modes share a motion, that which violates it more.

    NaN for an unstable mode, or if no mode has the label.
    """
    low = float(found.low[place])
    high = float(found.high[place])
    if np.isnan(found.value[place]) or (limit.target.quantity.unit == "Hz" and low < 0):
        return np.nan
    if limit.of_magnitude:
        low, high = sorted((abs(low), abs(high)))
    if limit.sense == "at_least":
        return low
    if limit.sense == "at_most":
        return high
    return low if abs(low - limit.asked) > abs(high - limit.asked) else high


def _mode_table(evaluator: Evaluator, before: Report, after: Report) -> ModeTable:
    """List the modes of both designs by family and rank."""
    families = evaluator.names.families
    counts = zip(families.names, families.size, strict=True)
    names = [f"{name} {rank + 1}" for name, size in counts for rank in range(size)]
    coordinate = evaluator.names.system.coordinate[6:]
    motions = [eigenmodes.describe(one) for one in coordinate]
    first = _modes_of(before, families, motions)
    last = _modes_of(after, families, motions)
    return ModeTable(
        name=tuple(names),
        label=last.label,
        before=first.frequency,
        after=last.frequency,
        fraction_before=first.top_fraction,
        fraction_after=last.top_fraction,
        number=last.number,
    )


class _Ranked(NamedTuple):
    """Modes of one design by family and rank; NaN, -1 and "" where it has none."""

    number: Int[np.ndarray, " mode"]
    frequency: Float[np.ndarray, " mode"]
    top_fraction: Float[np.ndarray, " mode"]
    label: tuple[str, ...]


def _modes_of(found: Report, families: Families, motions: Sequence[str]) -> _Ranked:
    count = sum(families.size)
    nothing = np.full(count, np.nan)
    solved = found.nominal
    if solved is None:
        return _Ranked(np.full(count, -1), nothing, nothing, ("",) * count)
    number = np.concatenate([ranks[0] for ranks in solved.energy_of_modes.ranked(families)])
    known = number >= 0
    leading = mode_content.leading(solved.fractions[0])
    labels = mode_content.number_labels([motions[int(place)] for place in leading])
    return _Ranked(
        number,
        np.where(known, solved.frequency[0, number], np.nan),
        np.where(known, solved.top_fraction[0, number], np.nan),
        tuple(labels[n] if n >= 0 else "" for n in number),
    )
