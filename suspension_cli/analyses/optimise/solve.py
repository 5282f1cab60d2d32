"""Constrained search for the free numbers of a design that meets goals.

Every limit is a smooth residual c(u) >= 0, the logarithm of value over limit or of limit over
value, of the free numbers as fractions u of their ranges; an equality is two of opposite signs. A
search (`scipy.optimize.minimize`, SLSQP; Kraft, DFVLR-FB 88-28 (1988)) is one of

    minimise s      subject to  c + a + s >= 0  for some limits,  c + a >= 0  for others
    minimise f(u)   subject to  c + a >= 0,

where a allows violations that are already known to be unavoidable. Bounds always apply, also those
of dependent numbers. If limits exclude each other, those that come first in the file of goals are
met (`Search.compromise`; Charnes & Cooper, Management Models of Linear Programming (1961), on goals
with priorities).

Searches start from the design itself and from the best designs of a Sobol sequence between the
bounds, on the string model. The best result is the start of a search on the models that it needs,
until it needs no more complete ones. Quantities of the result are those of its TOML, read back.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.optimise.evaluate import Evaluator, Results, solve_modes
from suspension_cli.analyses.optimise.optimum import (
    EQUAL,
    Limits,
    ModeTable,
    Numbers,
    Optimum,
    Quantities,
    Starts,
)
from suspension_cli.analyses.optimise.requirements import FreeDesign
from suspension_cli.design.goals import Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.models import choice, registry
from suspension_cli.models.choice import TOLERANCE, Frequencies, Systems
from suspension_cli.models.registry import Choice
from suspension_cli.physics import model_choice
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

SAMPLES = 64
"""Designs between the bounds from which starts are chosen."""
MAX_ITERATIONS = 100
"""Most iterations of each search."""
PRECISION = 1e-10
"""Change of the minimised function at which a search ends, and allowed deviation of equalities."""
FEASIBLE = 1e-8
"""Largest violation of a point that satisfies all limits with the margin of the goals."""
ACTIVE = 1e-5
"""Margin below which a limit is active."""
SAME = 1e-2
"""Largest distance of equal designs, in fractions of the ranges between the bounds."""
PENALTY = 10.0
"""Change for the worse of all values at an invalid design."""
TERMS = "weighted sum of the logarithms of the quantities to minimise, less those to maximise"
NEAREST = "half the squared distance from the starting design, in fractions of the ranges"
OBJECTIVE = {"near": f"{NEAREST} between the bounds", "margin": "minus the smallest margin"}
"""What is minimised, and without quantities to minimise or maximise."""


@dataclass(frozen=True)
class Point:
    """A valid design: its fractions u, residuals c of all rows, and objective f.

    `outside` is the largest excess of a dependent number over a bound.
    """

    fraction: Float[np.ndarray, " number"]
    margin: Float[np.ndarray, " row"]
    objective: float
    outside: float

    @property
    def worst(self) -> float:
        """Largest violation of a limit or a bound."""
        return float(np.max(-self.margin, initial=0.0))

    @property
    def rank(self) -> tuple[float, ...]:
        """Sort key (smallest is best): excess over bounds, violations, objective."""
        total = float(np.maximum(-self.margin, 0.0).sum())
        return *(round(x / EQUAL) for x in (self.outside, self.worst, total)), self.objective


class Search:
    """Constrained search for one design.

    Its rows are the limits, with both signs of equalities, then bounds of dependent numbers: a
    residual is one of the values of `Evaluator.logs`, with a sign, less an offset. `limit` is the
    number of the limit of each row, from 0; -1 for a bound.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        self.evaluator, self.freed, goals = evaluator, evaluator.freed, evaluator.freed.goals
        self._points: dict[bytes, Point | None] = {}
        self._slopes: dict[bytes, Array] = {}
        wanted, bounds = evaluator.requirements, int(self.freed.bounded.sum())
        signs = {"at_least": (1,), "at_most": (-1,), "equals": (1, -1)}
        limits = wanted.limits
        columns = zip(limits.quantity, limits.sense, limits.asked, strict=True)
        count = len(wanted.quantities)
        rows = [
            (n, place + count * (sign < 0), sign, sign * np.log(asked), sense == "equals")
            for n, (place, sense, asked) in enumerate(columns)
            for sign in signs[sense]
        ]
        rows += [(-1, 2 * count + n, 1, 0, False) for n in range(bounds)]
        limit, place, self._sign, offset, equal = np.array(rows, float).reshape(-1, 5).T
        self.limit, self._place, self._equal = limit.astype(int), place.astype(int), equal > 0
        inexact = ~self._equal & (limit >= 0)
        self._offset = offset + inexact * goals.margin
        maximised, minimised = np.minimum(wanted.weight, 0.0), np.maximum(wanted.weight, 0.0)
        self._weight = np.concatenate([maximised, minimised, np.zeros(bounds)])
        self._shares_margin = inexact & (goals.prefer == "margin") & (not self._weight.any())

    def point(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point; None without a valid design."""
        key = fraction.tobytes()
        if key not in self._points:
            self._points[key] = None
            with contextlib.suppress(np.linalg.LinAlgError):
                self._points[key] = self.judge(fraction, self.evaluator.at(fraction))
        return self._points[key]

    def judge(self, fraction: Float[np.ndarray, " number"], values: Array) -> Point | None:
        """Residuals and objective of a design with these values; None if it is invalid."""
        if not np.isfinite(values).all():
            return None
        margin = self._sign * values[self._place] - self._offset
        away = fraction - self.freed.begin
        objective = float(self._weight @ values if self._weight.any() else away @ away / 2)
        if self._shares_margin.any():
            objective = float(np.max(-margin[self._shares_margin]))
        outside = float(np.max(-margin[self.limit < 0], initial=0.0))
        return Point(fraction, margin, objective, outside)

    def _gradients(self, point: Point) -> tuple[Array, Array]:
        """Differentiate the residuals and the objective of a point."""
        key = point.fraction.tobytes()
        if key not in self._slopes:
            self._slopes[key] = self.evaluator.slopes(point.fraction)
        slope, away = self._slopes[key], point.fraction - self.freed.begin
        gradient = self._weight @ slope if self._weight.any() else away
        return self._sign[:, None] * slope[self._place], gradient

    def run(self, point: Point) -> Point:
        """Search from a point for one that violates no limit, and for the best of these."""
        if point.worst > FEASIBLE:
            point = self._minimise(point, self.limit >= 0)
        return self._improve(point) if point.worst <= FEASIBLE else point

    def _improve(self, point: Point) -> Point:
        """Minimise the objective, with no violation larger than at a point."""
        allowed = np.where(point.margin < -FEASIBLE, -point.margin, 0.0)
        shared = self._shares_margin
        if not shared.any():
            return self._minimise(point, shared, allowed)
        return point if allowed.any() else self._minimise(point, shared, least=-np.inf)

    def compromise(self, point: Point) -> Point:
        """Meet as many limits as possible, and approach the others as far as these permit.

        Both in the order of the file of goals: a limit is met if it can be beside those before it,
        and beside those that the point meets.
        """
        left = np.unique(self.limit[point.margin < -FEASIBLE]).tolist()
        for n in list(left):
            others = np.isin(self.limit, left) & (self.limit != n)
            tried = self._minimise(point, self.limit == n, np.where(others, np.inf, 0.0))
            if (tried.margin[self.limit == n] >= -FEASIBLE).all():
                point = tried
                left.remove(n)
        allowed = np.where(np.isin(self.limit, left), np.inf, 0.0)
        for n in left:
            own = self.limit == n
            allowed[own] = 0.0
            point = self._minimise(point, own, allowed)
            allowed[own] = np.maximum(-point.margin, 0.0)[own]
        return self._improve(point) if left else point

    def _minimise(
        self,
        start: Point,
        shared: Bool[np.ndarray, " row"],
        allowed: Float[np.ndarray, " row"] | float = 0.0,
        least: float = 0.0,
    ) -> Point:
        """Minimise the largest violation of `shared` rows down to `least`; of none, the objective.

        Other rows may be violated by `allowed`; infinite ones are dropped. Returns the best point
        visited that violates no row more than that, or than at the start.
        """
        from scipy.optimize import minimize

        size, any_shared = len(start.fraction), bool(shared.any())
        allowed = np.broadcast_to(allowed, shared.shape)
        kept, permitted = np.isfinite(allowed), np.maximum(allowed, -start.margin)
        slack = np.where(kept, allowed, 0.0) + np.where(self._equal, PRECISION, 0.0)
        column = shared[:, None][:, : int(any_shared)] * 1.0
        visited = [start]

        def cost(point: Point) -> tuple[float, float]:
            violation = float(np.max(-point.margin[shared], initial=least))
            excess = max(point.outside - FEASIBLE, 0.0)
            return excess, violation if any_shared else point.objective

        def is_permitted(point: Point) -> bool:
            return bool((point.margin + permitted >= -FEASIBLE)[~shared].all())

        def at(x: Array) -> Point:
            """The point; for an invalid design the last one with a penalty."""
            point, last = self.point(np.clip(x[:size], 0.0, 1.0)), visited[-1]
            if point is None:
                worse = last.margin - PENALTY, last.objective + PENALTY
                return replace(last, margin=worse[0], objective=worse[1])
            visited.append(point)
            if any_shared and least == 0 and is_permitted(point) and cost(point) == (0.0, 0.0):
                raise StopIteration
            return point

        rules: Any = {
            "type": "ineq",
            "fun": lambda x: (at(x).margin + slack + column @ x[size:])[kept],
            "jac": lambda x: np.hstack([self._gradients(at(x))[0], column])[kept],
        }
        unit = np.append(np.zeros(size), 1.0)
        with contextlib.suppress(StopIteration):
            minimize(
                lambda x: x[size] if any_shared else at(x).objective,
                np.append(start.fraction, [cost(start)[1]] * any_shared),
                jac=lambda x: unit if any_shared else self._gradients(at(x))[1],
                bounds=[(0.0, 1.0)] * size + [(least, None)] * any_shared,
                constraints=rules if kept.any() else (),
                method="SLSQP",
                options={"maxiter": MAX_ITERATIONS, "ftol": PRECISION},
            )
        return min(filter(is_permitted, visited), key=cost)

    def multipliers(
        self, point: Point
    ) -> tuple[Float[np.ndarray, " limit"], Float[np.ndarray, "side number"], float]:
        """Find active limits and bounds, with multipliers by non-negative least squares.

        The multipliers meet the conditions of Karush, Kuhn and Tucker as well as possible: of the
        sum of violations, if limits are violated, else of the objective. They are the decrease of
        that function per unit by which the margin of a limit may shrink (NaN if it is not active),
        and per shift of a bound by the distance between both. The last number is the norm of the
        gradient that they do not balance, over that of the whole one.
        """
        from scipy.optimize import nnls

        by, gradient = self._gradients(point)
        violated, shared, size = point.margin < -FEASIBLE, self._shares_margin, len(gradient)
        if violated.any():
            gradient, shared = -by[violated].sum(0), np.zeros_like(shared)
        reach = np.where(shared, np.min(point.margin, where=shared, initial=np.inf), 0.0)
        near = (point.margin <= reach + ACTIVE) & ~violated
        at = np.array([point.fraction, 1 - point.fraction]) <= FEASIBLE
        matrix = np.vstack([by[near], np.eye(size)[at[0]], -np.eye(size)[at[1]]])
        if shared.any():  # the multipliers of a smallest margin add up to 1
            gradient = np.append(np.zeros(size), 1.0)
            matrix = np.column_stack([matrix, np.append(shared[near], np.zeros(at.sum()))])
        whole = float(np.linalg.norm(gradient))
        weight, left = nnls(matrix.T, gradient) if matrix.size else (np.zeros(0), whole)
        rows = np.zeros(len(by))
        rows[near] = weight[: near.sum()] * np.where(self._equal, self._sign, 1.0)[near]
        limit = np.full(len(self.evaluator.requirements.limits.name), np.nan)
        active = near & (self.limit >= 0)
        limit[self.limit[active]] = 0.0
        np.add.at(limit, self.limit[active], rows[active])
        bound = np.zeros(self.freed.bounded.shape)
        bound[self.freed.bounded] = rows[self.limit < 0]
        bound[:, :size][at] = weight[near.sum() :]
        return limit, bound, float(left) / max(whole, 1e-12)


def solve(
    text: str,
    goals: Goals,
    *,
    level: str = registry.AUTO,
    starts: int = 1,
    seed: int = 1,
    tolerance: float = TOLERANCE,
    report: Progress | None = None,
) -> Optimum:
    """Optimise the free numbers of a design (TOML) to meet goals.

    `level` is the model of all modes and responses, or ``auto``, which may leave the relative error
    `tolerance`. Of the `starts` the first is the design itself. `report` is called with (done, all,
    rate per second) after each.

    Raises `InputError` if the design lacks a number or quantity of the goals, or if dependent
    numbers lie outside their bounds in all designs found.
    """
    model_choice.demand_one_of(level, registry.SCENE_MODELS, "cannot compute derivatives")
    freed = FreeDesign.of(text, goals)
    evaluator = Evaluator.of(freed)
    _check_start(evaluator)
    search, began, ends = Search(evaluator), time.monotonic(), list[Point | None]()
    begins = [search.point(freed.begin)]
    begins += _choose_starts(search, starts - 1, seed) if starts > 1 else []
    for n, begin in enumerate(begins, 1):
        ends.append(begin and search.run(begin))
        if report is not None:
            report(n, len(begins), n / (time.monotonic() - began))
    best = min((point for point in ends if point is not None), key=lambda point: point.rank)
    _check_bounds(freed, best)
    while True:  # models become more complete
        systems, cost = Systems(freed.design(best.fraction)), registry.by_name(evaluator.modes).cost
        compare = systems.compare(lambda _: Frequencies())
        models = registry.SCENE_MODELS
        chosen = choice.choose(systems.design, level, models, compare, tolerance)
        if chosen.model.cost < cost:  # other designs of the search need another one
            models = tuple(model for model in models if model.cost >= cost)
            chosen = choice.choose(systems.design, level, models, compare, tolerance)
        most = registry.most_complete(systems.design).name if level == registry.AUTO else level
        needed = replace(evaluator, modes=chosen.level, responses=most)
        if needed == evaluator:
            break
        evaluator, search = needed, Search(needed)
        begin = search.point(best.fraction)
        best = search.run(begin) if begin else best
    best = search.compromise(best)
    return _summarise(search, chosen, best, _starts(begins, ends))


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


def _choose_starts(search: Search, count: int, seed: int) -> list[Point | None]:
    """Choose the designs of a Sobol sequence that violate limits least, as a batch shows them.

    There modes with labels are those most like the modes of the starting design.
    """
    from scipy.stats import qmc

    how: dict[str, Any] = {"seed": seed}
    evaluator, begin = search.evaluator, search.freed.begin
    samples = qmc.Sobol(len(begin), **how).random(SAMPLES)
    found = map(search.judge, samples, evaluator.logs(samples, evaluator.follow(begin)))
    good = sorted((point for point in found if point), key=lambda point: point.worst)
    return [search.point(point.fraction) for point in good[:count]]


def _starts(begins: Sequence[Point | None], ends: Sequence[Point | None]) -> Starts:
    """Number the designs reached, the best first, equal ones alike."""
    place, seen = np.zeros(len(ends), dtype=np.int16), list[Point]()
    reached = [(point.rank, n, point) for n, point in enumerate(ends) if point is not None]
    for _, n, point in sorted(reached, key=lambda item: item[:2]):
        near = [np.abs(one.fraction - point.fraction).max() < SAME for one in seen]
        place[n] = [*near, True].index(True) + 1
        seen += [] if any(near) else [point]

    def column(points: Sequence[Point | None], name: str) -> Array:
        return np.array([np.nan if one is None else getattr(one, name) for one in points])

    before, after = column(begins, "worst"), column(ends, "worst")
    return Starts(before, after, column(ends, "objective"), place)


def _summarise(search: Search, chosen: Choice, best: Point, starts: Starts) -> Optimum:
    """Assemble the result of a search from its best point."""
    evaluator, freed = search.evaluator, search.freed
    wanted, items = evaluator.requirements, evaluator.requirements.quantities
    gain, bound_gain, stationarity = search.multipliers(best)
    both = freed.begin, best.fraction
    (start, design), (first, last) = map(freed.design, both), map(freed.values, both)
    old = Results(evaluator, [start], evaluator.follow(freed.begin))
    new = Results(evaluator, [design], evaluator.follow(best.fraction))
    lower, upper = freed.bounds
    at_lower, at_upper = freed.margins(best.fraction) <= EQUAL
    before, after = (np.where(one.values < 0, np.nan, one.values)[0] for one in (old, new))
    modes = [new.number_of(item) for item in items]
    models = {"response": evaluator.responses, "of_mode": evaluator.modes}
    return Optimum(
        numbers=Numbers(
            name=tuple(last),
            tied=np.arange(len(lower)) >= len(freed.start),
            before=np.array([*first.values()]),
            after=np.array([*last.values()]),
            lower=lower,
            upper=upper,
            bound=at_upper * 1 - at_lower,
            multiplier=np.where(np.isnan(upper - lower), np.nan, bound_gain.sum(0)),
        ),
        quantities=Quantities(
            name=tuple(item.text for item in items),
            unit=tuple(item.unit for item in items),
            before=before,
            after=after,
            mode=np.array(modes),
            weight=wanted.weight,
            model=tuple(models.get(item.method, "") for item in items),
        ),
        limits=replace(
            wanted.limits,
            value=_limited(new, wanted.limits),
            active=np.isfinite(gain),
            multiplier=np.nan_to_num(gain),
        ),
        modes=_mode_table(evaluator, old, new, design),
        starts=starts,
        unknown=wanted.unknown,
        objective=TERMS if wanted.weight.any() else OBJECTIVE[freed.goals.prefer],
        stationarity=stationarity,
        fidelity=chosen.level,
        reason=chosen.reason,
        error=chosen.error,
        design=freed.toml(best.fraction),
        remarks=tuple(new.remarks()),
    )


def _limited(found: Results, limits: Limits) -> Float[np.ndarray, " limit"]:
    """Values of the limited quantities of one design: of two modes that share a motion the worse.

    NaN for an unstable mode, or if no mode has the label.
    """
    exists = found.values[0, limits.quantity] >= 0
    low, high = (end[0, limits.quantity] for end in found.ends(smooth=False))
    with np.errstate(divide="ignore", invalid="ignore"):
        further = np.where(np.abs(low - limits.asked) > np.abs(high - limits.asked), low, high)
    value = np.select(
        [limits.sense_is("at_least"), limits.sense_is("at_most")], [low, high], further
    )
    return np.where(exists & (low >= 0), value, np.nan)


def _mode_table(evaluator: Evaluator, before: Results, after: Results, design: Design) -> ModeTable:
    """List the modes of both designs by family and rank; `design` is the optimised one."""
    families = evaluator.families
    counts = enumerate(families.size)
    names = tuple(f"{families.name(k)} {n + 1}" for k, size in counts for n in range(size))
    label = solve_modes(registry.by_name(evaluator.modes).system(design)).label
    old, new = (np.concatenate(one.numbers[:-1], axis=1)[0] for one in (before, after))
    hertz = [np.where(one.frequency < 0, np.nan, one.frequency)[0] for one in (before, after)]
    return ModeTable(
        name=names,
        label=tuple(label[n] for n in new),
        before=hertz[0][old],
        after=hertz[1][new],
        fraction_before=before.top_fraction[0, old],
        fraction_after=after.top_fraction[0, new],
        number=new,
    )
