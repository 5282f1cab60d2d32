"""Constrained search for free numbers: first the smallest violation of limits, then the objective.

Sequential quadratic programming (SLSQP; Kraft, DFVLR-FB 88-28 (1988)) with derivatives, in
fractions u in [0, 1] of the ranges between the bounds. Limits are logarithmic margins c(u) >= 0,
one per mode so that they are smooth. First

    minimise s    subject to    c(u) + s >= 0,  -s <= e(u) <= s,  s >= 0,

with the largest violation s and equalities e; from there, minimise the objective subject to c >= 0
and e = 0. Bounds always apply, also those of dependent numbers, b(u) >= 0. For an invalid design (a
slack wire, say) the search gets values far worse than the last ones, and shortens its step.
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

MAX_ITERATIONS = 100
"""Most iterations of each of the two searches."""
PRECISION = 1e-10
"""Change of the minimised function at which a search ends."""
FEASIBLE = 1e-8
"""Largest violation of a point that satisfies all limits with the margin of the goals."""
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
    objective : float
    outside : float
        Largest excess of a dependent number over a bound, relative to that.
    """

    fraction: Float[np.ndarray, " number"]
    log: Float[np.ndarray, " quantity"]
    violation: float
    objective: float
    outside: float

    @property
    def worst(self) -> float:
        """Largest violation of a limit or a bound."""
        return max(self.violation, self.outside)

    @property
    def rank(self) -> tuple[float, float, float]:
        """Sort key (smallest is best): excess over bounds, violation, objective."""
        beyond = self.outside if self.outside > FEASIBLE else 0.0
        return (
            (beyond, self.violation, 0.0)
            if self.violation > FEASIBLE
            else (beyond, 0.0, self.objective)
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
    """

    values: Evaluator
    goals: Goals
    seen: dict[bytes, Evaluation | None] = field(default_factory=dict)
    best: Point | None = None
    pairs: tuple[Limit, ...] = ()

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
        worst = float(np.max(np.concatenate([-c, np.abs(e), [-np.inf]])))
        goal = worst if self.maximises_margin else self.objective(now, fraction)[0]
        found = Point(
            fraction.copy(),
            now.log,
            max(worst, 0.0),
            goal,
            float(np.max(-self.within(fraction)[0], initial=0.0)),
        )
        if self.best is None or found.rank < self.best.rank:
            self.best = found
        return found

    def run(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Search from fractions; return the best point, or None for an invalid start."""
        self.best, now = None, self.value(fraction)
        if now is None:
            return None
        self.pairs = self.order(now.log)
        begin = self.point(fraction)
        assert begin is not None
        if begin.worst > FEASIBLE:
            self._solve(begin.fraction, begin.violation, phase=1)
        if self.best is not None and self.best.worst <= FEASIBLE:
            self._solve(self.best.fraction, self.best.objective, phase=2)
        return self.best

    def _solve(self, fraction: Float[np.ndarray, " number"], worst: float, *, phase: int) -> None:
        """Minimise the violation (phase 1), or the objective subject to the limits (phase 2)."""
        from scipy.optimize import minimize

        # the largest violation s is one more variable
        extra = phase == 1 or self.maximises_margin
        last: list[tuple[float, Array, Array, Array, Array, Array]] = []

        def evaluate(x: Array) -> tuple[float, Array, Array, Array, Array, Array]:
            """Return objective, gradient, c, slopes, e, slopes; worse by `PENALTY` if invalid."""
            u = np.clip(x[: len(fraction)], 0.0, 1.0)
            now = self.value(u)
            if now is None:
                f, g, c, dc, e, de = last[0]
                return f + PENALTY, g, c - PENALTY, dc, e + np.copysign(PENALTY, e), de
            self.point(u)
            last[:] = [(*self.objective(now, u), *self.margins(now))]
            return last[0]

        def widened(slopes: Array, sign: float) -> Array:
            return np.hstack([slopes, np.full((len(slopes), 1), sign)]) if extra else slopes

        def s(x: Array) -> float:
            return x[-1] if extra else 0.0

        def below(x: Array) -> Array:
            _, _, c, _, e, _ = evaluate(x)
            return np.concatenate(
                [
                    c + s(x),
                    *([e + s(x), s(x) - e] if phase == 1 else []),
                    self.within(x[: len(fraction)])[0],
                ]
            )

        def below_slope(x: Array) -> Array:
            _, _, _, dc, _, de = evaluate(x)
            bounds = widened(self.within(x[: len(fraction)])[1], 0.0)
            return np.vstack(
                [
                    widened(dc, 1.0),
                    *([widened(de, 1.0), widened(-de, 1.0)] if phase == 1 else []),
                    bounds,
                ]
            )

        rules: list[dict[str, object]] = [{"type": "ineq", "fun": below, "jac": below_slope}]
        if phase == 2 and any(limit.sense == "equals" for limit in self.limits):
            rules.append(
                {
                    "type": "eq",
                    "fun": lambda x: evaluate(x)[4],
                    "jac": lambda x: widened(evaluate(x)[5], 0.0),
                }
            )
        if not len(below(np.append(fraction, worst) if extra else fraction)):
            rules = rules[1:]
        bounds = [(0.0, 1.0)] * len(fraction) + (
            [(0.0 if phase == 1 else -50.0, None)] if extra else []
        )
        up = np.append(np.zeros(len(fraction)), 1.0)
        function: Callable[[Array], float] = (
            (lambda x: x[-1]) if extra else lambda x: evaluate(x)[0]
        )
        slope: Callable[[Array], Array] = (lambda _: up) if extra else lambda x: evaluate(x)[1]
        begin = np.append(fraction, worst) if extra else fraction
        minimize(
            function,
            begin,
            jac=slope,
            bounds=bounds,
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
