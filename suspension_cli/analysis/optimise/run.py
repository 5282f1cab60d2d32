"""Numbers of a design chosen so that it meets goals.

Starts are taken from the design itself and from a Sobol sequence between the bounds, worked out as one batch; from the best of them the search (`constrained`)
goes on.  It works on the `string` rung, whose derivatives are exact.  What it found is written as TOML, read back, and every goal worked out anew
by the ordinary analyses (`achieved`) on the rung that they take by themselves.  Where that rung differs, the difference of the logarithms is added to the
search's and it goes on from there, until the two agree: limits then hold for the better model.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from suspension_cli.analysis import modes, signals
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.optimise import achieved, families
from suspension_cli.analysis.optimise.achieved import Achieved
from suspension_cli.analysis.optimise.constrained import KEPT, Point, Search, margin
from suspension_cli.analysis.optimise.families import Families
from suspension_cli.analysis.optimise.freed import Freed
from suspension_cli.analysis.optimise.optimum import Optimum, Starts
from suspension_cli.analysis.optimise.outcome import EQUAL, told
from suspension_cli.analysis.optimise.quantities import wanted
from suspension_cli.analysis.optimise.valued import Values, with_imperfections
from suspension_cli.design import checks
from suspension_cli.design.goals import Goals
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.mechanics.blocks import mirrored
from suspension_cli.mechanics.nominal import nominal
from suspension_cli.models import fidelity

STARTS, SEED = 6, 1
"""How many starts are searched from, and the seed of those beside the design itself."""
SAMPLES = 64
"""Designs between the bounds that starts are chosen from."""
ROUNDS = 6
"""Times that the search is corrected for what a higher rung finds, at most."""
SETTLED = 1e-7
"""Change of that correction at which it has settled, of the value."""
SAME = 1e-2
"""Distance, as a share of the way between the bounds, within which starts have arrived at the same design."""


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
        Called with the starts that are done, all of them, and how many a second.

    Raises
    ------
    InputError
        If a goal or a number is not the design's, or no design was found whose numbers that follow from others lie within their bounds.
    """
    freed = Freed.of(text, goals)
    values = _values(freed, goals)
    search = Search(values, goals, np.zeros(len(values.wanted.quantities)))
    if search.value(search.begin) is None:
        _demand(values)
    points, before = _searched(search, starts, seed, report)
    best = min((point for point in points if point is not None), key=lambda point: point.rank)
    if best.outside > KEPT:
        raise InputError(_beyond(freed, freed.values(freed.numbers(best.share))))
    best, made, rounds = _checked(search, best, level)
    return told(search, best, _achieved(search, freed.start, level), made, _starts(points, before), rounds)


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


def _demand(values: Values) -> None:
    """Say why a design has no values to start from."""
    log = values.at(values.freed.start).log  # tells itself if there is no such design
    lost = [item.text for item, value in zip(values.wanted.quantities, log, strict=True) if not np.isfinite(value)]
    raise InputError([Fault("goal", "has no value in the design as it starts", "divide by what does not vanish", shown(text)) for text in lost])


def _beyond(freed: Freed, value: dict[str, float]) -> list[Fault]:
    """What to say of numbers that follow from others to where they must not."""
    remedy = "widen its bounds, or those of the numbers that it follows from"
    found = []
    for n, item in enumerate(freed.equal, 1):
        if item.lower is not None and value[item.name] < item.lower:
            found.append(Fault(f"equal.{n}.lower", f"{item.name} comes no nearer to it than {value[item.name]:g}", remedy, shown(item.lower)))
        if item.upper is not None and value[item.name] > item.upper:
            found.append(Fault(f"equal.{n}.upper", f"{item.name} comes no nearer to it than {value[item.name]:g}", remedy, shown(item.upper)))
    return found


def _searched(search: Search, starts: int, seed: int, report: Any) -> tuple[list[Point | None], list[float]]:
    """Where each start led, and the violation at it."""
    begins = [search.begin, *_chosen(search, starts - 1, seed)]
    points, before, began = [], [], time.monotonic()
    for n, share in enumerate(begins):
        now = search.value(share)
        if now is not None:
            search.pairs = search.order(now.log)
        begin = None if now is None else search.point(share)
        before.append(np.nan if begin is None else begin.worst)
        points.append(search.run(share))
        if report is not None:
            report(n + 1, len(begins), (n + 1) / (time.monotonic() - began))
    return points, before


def _chosen(search: Search, count: int, seed: int) -> list[Array]:
    """The best of a Sobol sequence between the bounds, worked out as one batch."""
    from scipy.stats import qmc

    if count < 1:
        return []
    how: Any = {"seed": seed}
    shares = qmc.Sobol(len(search.begin), **how).random(SAMPLES)
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
    """The best design, corrected until search and ordinary analyses agree; what it achieves; and the number of corrections.

    If they never do, that of all checked which breaks limits least; of several that break none the last.
    """
    rounds, checked = 0, []
    while True:
        made = _achieved(search, search.freed.numbers(best.share), level)
        checked.append((best, made, search.offset))
        with np.errstate(invalid="ignore", divide="ignore"):
            offset = np.log(made.value) - (best.log - search.offset)
        offset = np.where(np.isfinite(offset), offset, 0.0)
        if (np.abs(offset - search.offset) < SETTLED).all():
            return best, made, rounds
        if rounds == ROUNDS:
            best, made, search.offset = min(reversed(checked), key=lambda one: _broken(search, one[1]))
            search.seen.clear()
            return best, made, rounds
        rounds += 1
        search.offset = offset
        search.seen.clear()
        best = search.run(best.share) or best


def _broken(search: Search, made: Achieved) -> float:
    """By how much a design that was checked breaks the limit that it breaks most, as a logarithm; 0 if it keeps to all."""
    with np.errstate(invalid="ignore", divide="ignore"):
        log = np.log(made.value)
        limits = (*search.wanted.limits, *search.order(log))
        margins = np.array([-abs(margin(limit, log)[0]) if limit.sense == "equals" else margin(limit, log)[0] for limit in limits])
    worst = float(np.max(-np.where(np.isnan(margins), -np.inf, margins), initial=0.0))
    return worst if worst > EQUAL else 0.0


def _achieved(search: Search, number: Array, level: str) -> Achieved:
    """What a design achieves, by the ordinary analyses."""
    freed, values = search.freed, search.values

    def follow(found: Modes, mass: Array) -> Any:
        return families.became(freed.text, freed.values(freed.start), freed.values(number), values.nominal, found, mass)

    return achieved.of(freed.toml(number), values.wanted.quantities, values.families, level, follow)


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

    return Starts(np.array(before), each("worst"), each("objective"), place)
