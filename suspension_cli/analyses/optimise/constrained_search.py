"""Constrained search for free numbers: first the smallest violation of limits, then the objective.

Sequential quadratic programming (SLSQP; Kraft, DFVLR-FB 88-28 (1988)) with derivatives, in
fractions u in [0, 1] of the ranges between the bounds. Limits are logarithmic margins c(u) >= 0,
one per mode so that they are smooth. First

    minimise s    subject to    c(u) + s >= 0,  -s <= e(u) <= s,  s >= 0,

with the largest violation s and equalities e. If s > 0 remains, as limits exclude each other, then
minimise the sum of the violations s_i of all limits, none larger than s: limits that can be met
beside those that cannot are met. From there minimise the objective, subject to c + s_i >= 0 and
e = 0 (or its violation). Bounds always apply, also those of dependent numbers, b(u) >= 0. For an
invalid design (a slack wire, say) the search gets values far worse than the last ones, and shortens
its step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.optimise.free_parameters import FreeDesign
from suspension_cli.analyses.optimise.objective import Evaluation, Evaluator
from suspension_cli.analyses.optimise.quantities import Limit, Requirements
from suspension_cli.design.goals import Goals
from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

LARGEST, TOTAL, OBJECTIVE = "largest violation", "sum of violations", "objective"
"""What the successive searches minimise."""
MAX_ITERATIONS = 100
"""Most iterations of each search."""
PRECISION = 1e-10
"""Change of the minimised function at which a search ends."""
FEASIBLE = 1e-8
"""Largest violation of a point that satisfies all limits with the margin of the goals."""
EQUAL = 1e-6
"""Difference of violations that count as equal."""
ACTIVE = 1e-5
"""Margin below which a limit is active."""
PENALTY = 10.0
"""Change for the worse of all values at an invalid design."""


@dataclass(frozen=True)
class Point:
    """An evaluated design.

    Attributes
    ----------
    fraction : array
        Free numbers as fractions of the ranges between their bounds.
    log : array
        Logarithms of the quantities.
    violation : float
        Largest violation of a limit (logarithm).
    total : float
        Sum of the violations of all limits.
    objective : float
    outside : float
        Largest excess of a dependent number over a bound, relative to that.
    """

    fraction: Float[np.ndarray, " number"]
    log: Float[np.ndarray, " quantity"]
    violation: float
    total: float
    objective: float
    outside: float

    @property
    def worst(self) -> float:
        """Largest violation of a limit or a bound."""
        return max(self.violation, self.outside)

    @property
    def rank(self) -> tuple[float, float, float, float]:
        """Sort key (smallest is best): excess over bounds, violations, objective."""
        beyond = self.outside if self.outside > FEASIBLE else 0.0
        if self.violation <= FEASIBLE:
            return beyond, 0.0, 0.0, self.objective
        return (
            beyond,
            1.0 + round(self.violation / EQUAL),
            round(self.total / EQUAL),
            self.objective,
        )


@dataclass(frozen=True)
class ActiveSet:
    """Active limits and bounds at a point, with their Lagrange multipliers.

    Attributes
    ----------
    active : array
    multiplier : array
        Decrease of the objective per unit by which the margin of a limit may shrink (of the largest
        violation, where limits are violated).
    bound : array
        -1 at the lower bound, 1 at the upper one, 0 between them.
    bound_multiplier : array
        Multipliers of the bounds, per range between them.
    tied_multiplier : array
        Multipliers of the bounds of dependent numbers, see `FreeDesign.ties`.
    stationarity : float
        Norm of the gradient that the multipliers do not balance, over that of the whole gradient.
    """

    active: Bool[np.ndarray, " limit"]
    multiplier: Float[np.ndarray, " limit"]
    bound: Int[np.ndarray, " number"]
    bound_multiplier: Float[np.ndarray, " number"]
    tied_multiplier: Float[np.ndarray, " tied"]
    stationarity: float


@dataclass
class Search:
    """Constrained search for one design.

    Attributes
    ----------
    values : Evaluator
    goals : Goals
    seen : dict
        Cache of `value`.
    best : Point or None
        Best point of the current search.
    pairs : tuple of Limit
        Separations of neighbouring modes.
    least : tuple of float
        Least possible largest violation, and least sum of violations; 0 while unknown.
    """

    values: Evaluator
    goals: Goals
    seen: dict[bytes, Evaluation | None] = field(default_factory=dict)
    best: Point | None = None
    pairs: tuple[Limit, ...] = ()
    least: tuple[float, float] = (0.0, 0.0)

    @property
    def freed(self) -> FreeDesign:
        """Free numbers of the design."""
        return self.values.freed

    @property
    def requirements(self) -> Requirements:
        """Limits and objective of the design."""
        return self.values.requirements

    @property
    def begin(self) -> Float[np.ndarray, " number"]:
        """Fractions of the starting design."""
        return self.freed.fractions(self.freed.start)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of the goals, then the separations of neighbouring modes."""
        return (*self.requirements.limits, *self.pairs)

    def order(self, log: Float[np.ndarray, " quantity"]) -> tuple[Limit, ...]:
        """Separations of the modes that are neighbours at the logarithms of the quantities."""
        found = []
        for goal, places, value, hertz in self.requirements.separations:
            ranked = sorted(places, key=lambda n: log[n])
            found += [
                Limit(goal, high, "at_least", value, low, hertz) for low, high in pairwise(ranked)
            ]
        return tuple(found)

    def value(self, fraction: Float[np.ndarray, " number"]) -> Evaluation | None:
        """Evaluate logarithms and derivatives by fractions; None without a valid design."""
        key = fraction.tobytes()
        if key not in self.seen:
            number = self.freed.numbers(fraction)
            try:
                found = self.values.at(number)
            except (InputError, np.linalg.LinAlgError):
                self.seen[key] = None
            else:
                good = np.isfinite(found.log).all() and np.isfinite(found.slope).all()
                self.seen[key] = (
                    Evaluation(found.log, found.slope * self.freed.rate(number)) if good else None
                )
        return self.seen[key]

    def margins(
        self, now: Evaluation
    ) -> tuple[
        Float[np.ndarray, " inequality"],
        Float[np.ndarray, "inequality number"],
        Float[np.ndarray, " equality"],
        Float[np.ndarray, "equality number"],
    ]:
        """Compute margins less that of the goals, their slopes, equalities and their slopes."""
        size = len(self.begin)
        parts: dict[bool, list[tuple[float, Float[np.ndarray, " number"] | float]]] = {
            False: [],
            True: [],
        }
        for limit in self.limits:
            parts[limit.sense == "equals"].append(margin(limit, now.log, now.slope))
        (c, dc), (e, de) = (
            (np.array([value for value, _ in own]), np.array([by for _, by in own]))
            for own in parts.values()
        )
        return c - self.goals.margin, dc.reshape(-1, size), e, de.reshape(-1, size)

    def within(
        self, fraction: Float[np.ndarray, " number"]
    ) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, "row number"]]:
        """Compute relative distances of dependent numbers from their bounds, and slopes."""
        rows, sides = self.freed.ties()
        number = self.freed.numbers(fraction)
        return rows @ number + sides, rows * self.freed.rate(number)

    def objective(
        self, now: Evaluation, fraction: Float[np.ndarray, " number"]
    ) -> tuple[float, Float[np.ndarray, " number"]]:
        """Compute the objective to be minimised and its gradient."""
        if self.requirements.terms:
            weight = np.array([term.weight for term in self.requirements.terms])
            places = [term.quantity for term in self.requirements.terms]
            return float(weight @ now.log[places]), weight @ now.slope[places]
        away = fraction - self.begin
        return float(away @ away) / 2, away

    @property
    def maximises_margin(self) -> bool:
        """Whether the objective is the smallest margin."""
        return self.goals.prefer == "margin" and not self.requirements.terms

    def point(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point and update `best`; None without a valid design."""
        now = self.value(fraction)
        if now is None:
            return None
        c, _, e, _ = self.margins(now)
        missing = np.concatenate([-c, np.abs(e), [-np.inf]])
        worst = float(missing.max())
        goal = worst if self.maximises_margin else self.objective(now, fraction)[0]
        found = Point(
            fraction.copy(),
            now.log,
            _snap(max(worst, 0.0), self.least[0]),
            _snap(float(np.maximum(missing, 0.0).sum()), self.least[1]),
            goal,
            float(np.max(-self.within(fraction)[0], initial=0.0)),
        )
        if self.best is None or found.rank < self.best.rank:
            self.best = found
        return found

    def run(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Search from fractions; return the best point, or None for an invalid start."""
        self.best, self.least, now = None, (0.0, 0.0), self.value(fraction)
        if now is None:
            return None
        self.pairs = self.order(now.log)
        begin = self.point(fraction)
        assert begin is not None
        if begin.worst > FEASIBLE:
            self._solve(begin.fraction, LARGEST)
        assert self.best is not None
        feasible = self.best.worst <= FEASIBLE
        if not feasible:
            self.least = (self.best.violation, 0.0)
            self._solve(self.best.fraction, TOTAL)
            self.least = (self.best.violation, self.best.total)
        if feasible or not self.maximises_margin:
            self._solve(self.best.fraction, OBJECTIVE)
        return self.best

    def _solve(self, fraction: Float[np.ndarray, " number"], phase: str) -> None:
        """Minimise the `LARGEST` violation, their `TOTAL`, or the `OBJECTIVE` within the limits."""
        from scipy.optimize import minimize

        size, now = len(fraction), self.value(fraction)
        assert now is not None
        c, _, e, _ = self.margins(now)
        # violations s are more variables: a limit may be violated by its row of these matrices
        # times s
        share, most = np.ones((len(c) + len(e), 1)), np.inf
        lowest = 0.0 if phase == LARGEST else -np.inf
        begin = np.array([np.max([*-c, *np.abs(e)], initial=lowest)])
        if phase == TOTAL:
            share, most = np.eye(len(share)), self.least[0] + EQUAL / 2
            begin = np.maximum(np.append(-c, np.abs(e)), 0.0)
        elif phase == OBJECTIVE and not self.maximises_margin:
            share, begin = share[:, :0], begin[:0]
        held, fixed = (
            np.where((np.abs(v) > FEASIBLE) & (phase == OBJECTIVE), v, 0.0)
            for v in (np.minimum(c, 0.0), e)
        )
        of_c, of_e, count = share[: len(c)], share[len(c) :], len(begin)
        last: list[tuple[float, Array, Array, Array, Array, Array]] = []

        def evaluate(x: Array) -> tuple[float, Array, Array, Array, Array, Array]:
            """Return objective, gradient, c, slopes, e, slopes; worse by `PENALTY` if invalid."""
            u = np.clip(x[:size], 0.0, 1.0)
            now = self.value(u)
            if now is None:
                f, g, c, dc, e, de = last[0]
                return f + PENALTY, g, c - PENALTY, dc, e + np.copysign(PENALTY, e), de
            self.point(u)
            last[:] = [(*self.objective(now, u), *self.margins(now))]
            return last[0]

        def below(x: Array) -> Array:
            _, _, c, _, e, _ = evaluate(x)
            either = [e + of_e @ x[size:], of_e @ x[size:] - e] if phase != OBJECTIVE else []
            return np.concatenate([c - held + of_c @ x[size:], *either, self.within(x[:size])[0]])

        def below_slope(x: Array) -> Array:
            _, _, _, dc, _, de = evaluate(x)
            either = [np.hstack([de, of_e]), np.hstack([-de, of_e])] if phase != OBJECTIVE else []
            bounds = self.within(x[:size])[1]
            still = np.zeros((len(bounds), count))
            return np.vstack([np.hstack([dc, of_c]), *either, np.hstack([bounds, still])])

        rules: list[dict[str, object]] = [{"type": "ineq", "fun": below, "jac": below_slope}]
        if phase == OBJECTIVE and len(e):
            rules.append(
                {
                    "type": "eq",
                    "fun": lambda x: evaluate(x)[4] - fixed,
                    "jac": lambda x: np.hstack([evaluate(x)[5], np.zeros((len(e), count))]),
                }
            )
        begin = np.append(fraction, begin)
        if not len(below(begin)):
            rules = rules[1:]
        up = np.append(np.zeros(size), np.ones(count))
        function: Callable[[Array], float] = (
            (lambda x: x[size:].sum()) if count else lambda x: evaluate(x)[0]
        )
        slope: Callable[[Array], Array] = (lambda _: up) if count else lambda x: evaluate(x)[1]
        minimize(
            function,
            begin,
            jac=slope,
            bounds=[(0.0, 1.0)] * size + [(-50.0 if phase == OBJECTIVE else 0.0, most)] * count,
            constraints=rules,
            method="SLSQP",
            options={"maxiter": MAX_ITERATIONS, "ftol": PRECISION},
        )

    def active_set(self, point: Point) -> ActiveSet:
        """Find active limits and bounds, with multipliers by non-negative least squares.

        The multipliers meet the conditions of Karush, Kuhn and Tucker as well as possible.
        """
        from scipy.optimize import nnls

        now = self.value(point.fraction)
        assert now is not None
        c, dc, e, de = self.margins(now)
        b, db = self.within(point.fraction)
        side = np.where(
            point.fraction <= FEASIBLE, -1, np.where(point.fraction >= 1 - FEASIBLE, 1, 0)
        )
        # where s is minimised, the multipliers of the margins add up to 1
        most = self.maximises_margin or point.violation > FEASIBLE
        reach = 0.0
        if most:
            reach = float(np.min(c if self.maximises_margin else [*c, *-np.abs(e)], initial=np.inf))
        near, at = np.flatnonzero(c <= reach + ACTIVE), np.flatnonzero(side)
        tied = np.flatnonzero(b <= ACTIVE)
        forced = (
            np.flatnonzero(np.abs(e) >= -reach - ACTIVE)
            if most and not self.maximises_margin
            else np.arange(len(e))
        )
        matrix = np.concatenate(
            [
                dc[near],
                de[forced],
                -de[forced],
                -np.eye(len(side))[at] * side[at][:, None],
                db[tied],
            ]
        ).T
        right = np.zeros(len(side)) if most else self.objective(now, point.fraction)[1]
        if most:
            weights = [1.0, 0.0 if self.maximises_margin else 1.0, 0.0]
            counts = [len(near), 2 * len(forced), len(at) + len(tied)]
            matrix = np.vstack([matrix, np.repeat(weights, counts)])
            right = np.append(right, 1.0)
        weight, left = (
            nnls(matrix, right) if matrix.shape[1] else (np.zeros(0), float(np.linalg.norm(right)))
        )
        parts = np.split(weight, np.cumsum([len(near), len(forced), len(forced), len(at)]))
        multiplier, active = np.zeros(len(self.limits)), np.zeros(len(self.limits), dtype=bool)
        equal = np.array([limit.sense == "equals" for limit in self.limits], dtype=bool)
        plain, equals = np.flatnonzero(~equal), np.flatnonzero(equal)
        multiplier[plain[near]], active[plain[near]] = parts[0], True
        multiplier[equals[forced]], active[equals[forced]] = parts[1] - parts[2], True
        bounds, followers = np.zeros(len(side)), np.zeros(len(b))
        bounds[at], followers[tied] = parts[3], parts[4]
        return ActiveSet(
            active,
            multiplier,
            side,
            bounds,
            followers,
            float(left / max(np.linalg.norm(right), 1e-12)),
        )


def _snap(value: float, least: float) -> float:
    """Return the least value instead of one that differs by rounding; 0 is no least value."""
    return least if least and abs(value - least) < EQUAL else value


def margin(
    limit: Limit,
    log: Float[np.ndarray, " quantity"],
    slope: Float[np.ndarray, "quantity number"] | None = None,
) -> tuple[float, Float[np.ndarray, " number"] | float]:
    """Compute the margin of a limit (of an equality: ln of value over limit) and its slope."""
    y, dy = log[limit.quantity], 0.0 if slope is None else slope[limit.quantity]
    if limit.other >= 0:
        z, dz = log[limit.other], 0.0 if slope is None else slope[limit.other]
        if limit.hertz:
            high, low = np.exp(y), np.exp(z)
            return float((high - low) / limit.value - 1), (high * dy - low * dz) / limit.value
        return float(y - z - np.log(limit.value)), dy - dz
    away = float(y - np.log(limit.value))
    return (-away, -dy) if limit.sense == "at_most" else (away, dy)


def signed_margin(limit: Limit, log: Float[np.ndarray, " quantity"]) -> float:
    """Compute the margin of a limit; of an equality minus the absolute deviation."""
    value, _ = margin(limit, log)
    return -abs(value) if limit.sense == "equals" else value
