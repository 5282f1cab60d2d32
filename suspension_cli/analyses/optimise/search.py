"""Constrained search for free numbers: first what is missed, then the objective.

Every limit is a smooth residual c(u) >= 0, the logarithm of value over limit or of limit over
value, of the free numbers as fractions u of their ranges; an equality is two of opposite signs. A
search (`scipy.optimize.minimize`, SLSQP; Kraft, DFVLR-FB 88-28 (1988)) is one of

    minimise s         subject to  c + a + s >= 0,    s >= 0      (largest violation)
    minimise sum s_i   subject to  c + a + s_i >= 0,  s_i >= 0    (sum of violations)
    minimise f(u)      subject to  c + a >= 0                     (objective),

where a allows violations that are already known to be unavoidable. Bounds always apply, also those
of dependent numbers. If limits exclude each other, the largest violation balances them. A limit
without which the others can be met, or violated less than without any other, is set aside
(`compromise`): it is met as well as the others permit, instead of spoiling these.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.optimise.evaluate import PATH_STEPS, Evaluator, Values
from suspension_cli.analyses.optimise.quantities import Limit
from suspension_cli.errors import InputError
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

MAX_ITERATIONS = 100
"""Most iterations of each search."""
PRECISION = 1e-10
"""Change of the minimised function at which a search ends, and allowed deviation of equalities."""
FEASIBLE = 1e-8
"""Largest violation of a point that satisfies all limits with the margin of the goals."""
EQUAL = 1e-6
"""Difference of violations that count as equal."""
ACTIVE = 1e-5
"""Margin below which a limit is active."""
CLOSE = 0.1
"""Difference of expected violations, over the present one, up to which limits may be set aside."""
PENALTY = 10.0
"""Change for the worse of all values at an invalid design."""


class _NothingViolatedError(Exception):
    """Ends a search for the smallest violations at a point without any."""


@dataclass(frozen=True)
class Point:
    """A valid design.

    Attributes
    ----------
    fraction : array
        Free numbers as fractions of the ranges between their bounds.
    margin : array
        Residuals of the rows (`Search.rows`), less the margin of the goals.
    outside : float
        Largest excess of a dependent number over a bound, relative to that.
    """

    fraction: Float[np.ndarray, " number"]
    values: Values
    margin: Float[np.ndarray, " row"]
    objective: float
    outside: float

    @property
    def violation(self) -> float:
        """Largest violation of a limit."""
        return float(np.max(-self.margin, initial=0.0))

    @property
    def worst(self) -> float:
        """Largest violation of a limit or a bound."""
        return max(self.violation, self.outside)

    @property
    def rank(self) -> tuple[float, ...]:
        """Sort key (smallest is best): excess over bounds, violations, objective."""
        total = float(np.maximum(-self.margin, 0.0).sum())
        steps = (round(value / EQUAL) for value in (self.outside, self.violation, total))
        return (*steps, self.objective)


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
    bound_multiplier, dependent_multiplier : arrays
        Multipliers of the bounds, per range between them, and of those of dependent numbers
        (`FreeDesign.dependent_margins`).
    stationarity : float
        Norm of the gradient that the multipliers do not balance, over that of the whole gradient.
    """

    active: Bool[np.ndarray, " limit"]
    multiplier: Float[np.ndarray, " limit"]
    bound: Int[np.ndarray, " number"]
    bound_multiplier: Float[np.ndarray, " number"]
    dependent_multiplier: Float[np.ndarray, " bound"]
    stationarity: float


@dataclass
class Search:
    """Constrained search for one design.

    Attributes
    ----------
    limits : tuple of Limit
        Limits of the goals, then the separations of modes that are neighbours at the last start.
    """

    evaluator: Evaluator
    limits: tuple[Limit, ...] = ()
    _known: dict[bytes, Values | None] = field(default_factory=dict)
    _slopes: dict[bytes, Array] = field(default_factory=dict)

    def value(
        self, fraction: Float[np.ndarray, " number"], steps: int = PATH_STEPS
    ) -> Values | None:
        """Evaluate quantities; None without a valid design. `steps` as of `Evaluator.values`."""
        key = fraction.tobytes()
        if key not in self._known:
            try:
                found = self.evaluator.values(fraction, steps)
            except (InputError, np.linalg.LinAlgError):
                found = None
            good = found is not None and np.isfinite(found.log).all()
            self._known[key] = found if good else None
        return self._known[key]

    def _slope(self, values: Values, fraction: Float[np.ndarray, " number"]) -> Array:
        """Differentiate logarithms of quantities; where a neighbour is invalid, the last slopes."""
        key = fraction.tobytes()
        if key not in self._slopes:
            try:
                slopes = self.evaluator.slopes(values, fraction)
                found = np.nan_to_num(slopes * self.evaluator.freed.rate(fraction))
            except (InputError, np.linalg.LinAlgError):
                if not self._slopes:
                    raise
                found = next(reversed(self._slopes.values()))
            self._slopes[key] = found
        return self._slopes[key]

    @property
    def rows(self) -> list[tuple[int, float]]:
        """Number of the limit of each residual, and its sign: an equality has both."""
        return [
            (n, sign)
            for n, limit in enumerate(self.limits)
            for sign in ((1.0, -1.0) if limit.sense == "equals" else (1.0,))
        ]

    @property
    def _equal(self) -> Bool[np.ndarray, " row"]:
        return np.array([self.limits[n].sense == "equals" for n, _ in self.rows], dtype=bool)

    @property
    def _maximises_margin(self) -> bool:
        goals = self.evaluator.freed.goals
        return goals.prefer == "margin" and not self.evaluator.requirements.terms

    def point(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point; None without a valid design."""
        values = self.value(fraction)
        if values is None:
            return None
        residual = np.array([sign * self.limits[n].margin(values.log)[0] for n, sign in self.rows])
        equal = self._equal
        margin = residual - np.where(equal, 0.0, self.evaluator.freed.goals.margin)
        away = fraction - self.evaluator.freed.begin
        terms = self.evaluator.requirements.terms
        if terms:
            objective = sum(weight * float(values.log[place]) for place, weight in terms)
        elif self._maximises_margin:
            objective = float(np.max(-margin[~equal], initial=-np.inf))
        else:
            objective = float(away @ away) / 2
        bounds, _ = self.evaluator.freed.dependent_margins(fraction)
        return Point(fraction, values, margin, objective, float(np.max(-bounds, initial=0.0)))

    def _gradients(self, point: Point) -> tuple[Array, Array]:
        """Differentiate the margins and the objective of a point."""
        slope, terms = self._slope(point.values, point.fraction), self.evaluator.requirements.terms
        by = np.zeros((len(self.rows), slope.shape[1]))
        for row, (n, sign) in zip(by, self.rows, strict=True):
            for place, rate in self.limits[n].margin(point.values.log)[1].items():
                row += sign * rate * slope[place]
        if terms:
            return by, np.sum([weight * slope[place] for place, weight in terms], axis=0)
        return by, point.fraction - self.evaluator.freed.begin

    def begin(
        self, fraction: Float[np.ndarray, " number"], steps: int = PATH_STEPS
    ) -> Point | None:
        """Evaluate a point, between whose neighbouring modes separations are kept."""
        values, requirements = self.value(fraction, steps), self.evaluator.requirements
        if values is None:
            return None
        self.limits = (*requirements.limits, *requirements.neighbours(values.log))
        return self.point(fraction)

    def run(self, fraction: Float[np.ndarray, " number"]) -> tuple[float, Point | None]:
        """Search from fractions for a design that violates no limit, and for the best of these.

        Returns the violation there, NaN for an invalid design, and the best point.
        """
        begin = self.begin(fraction)
        if begin is None:
            return np.nan, None
        every, none = np.ones((len(begin.margin), 1)), np.zeros(len(begin.margin))
        found = begin if begin.worst <= FEASIBLE else self._minimise(begin, every, none)
        return begin.worst, self._optimise(found) if found.worst <= FEASIBLE else found

    def _optimise(self, point: Point) -> Point:
        """Minimise the objective, with no violation larger than at a point."""
        allowed = np.where(point.margin < -FEASIBLE, -point.margin, 0.0)
        if not self._maximises_margin:
            return self._minimise(point, np.zeros((len(allowed), 0)), allowed)
        if point.worst > FEASIBLE:
            return point
        return self._minimise(point, np.where(self._equal, 0.0, 1.0)[:, None], allowed, least=-50.0)

    def compromise(self, point: Point) -> tuple[Point, Bool[np.ndarray, " row"]]:
        """Meet all limits but those that prevent it, and these as well as the others permit.

        Of the limits that balance each other at the least largest violation, the one without which
        that is smallest is set aside, if it is unique, until the rest can be met.

        Returns
        -------
        found : Point
        some : array
            Rows of the limits whose largest violation is least.
        """
        limit = np.array([n for n, _ in self.rows], dtype=int)
        none, aside, rest = np.zeros(len(limit)), limit < 0, point
        if point.violation <= FEASIBLE:
            return point, ~aside
        while _violation(rest, ~aside) > FEASIBLE:
            multiplier = self.active_set(rest, ~aside).multiplier
            groups = [aside | (limit == n) for n in np.flatnonzero(np.abs(multiplier) > ACTIVE)]
            expected = [self._expected(rest, ~group) for group in groups]
            worst = min(expected, default=0.0) + CLOSE * _violation(rest, ~aside)
            tried = []
            for group, left in zip(groups, expected, strict=True):
                if left <= worst:
                    share, dropped = np.where(group, 0.0, 1.0), np.where(group, np.inf, 0.0)
                    one = self._minimise(rest, share[:, None], dropped)
                    tried.append((_violation(one, ~group), len(tried), group, one))
            tried.sort(key=lambda choice: choice[:2])
            if not tried or (len(tried) > 1 and tried[1][0] - tried[0][0] < EQUAL):
                aside, rest = limit >= 0, point
                break
            _, _, aside, rest = tried[0]
        found = self._minimise(rest, np.where(aside, 1.0, 0.0)[:, None], none)
        most = _violation(found, aside) + EQUAL / 2
        found = self._minimise(found, np.eye(len(aside))[:, aside], none, most)
        return self._optimise(found), aside

    def _expected(self, point: Point, some: Bool[np.ndarray, " row"]) -> float:
        """Least largest violation of some limits between the bounds, if they were linear."""
        from scipy.optimize import linprog

        by, _ = self._gradients(point)
        upper = np.column_stack([-by, -np.ones(len(by))])[some]
        right, size = (point.margin - by @ point.fraction)[some], len(point.fraction)
        bounds = [(0.0, 1.0)] * size + [(0.0, None)]
        found = linprog(np.append(np.zeros(size), 1.0), upper, right, bounds=bounds)
        return float(found.fun or 0.0)

    def _minimise(
        self,
        start: Point,
        share: Float[np.ndarray, "row violation"],
        allowed: Float[np.ndarray, " row"],
        most: float = np.inf,
        least: float = 0.0,
    ) -> Point:
        """Minimise a sum of violations from `least` to `most`; without these, the objective.

        `share` are the rows that each violation permits beside those `allowed`, of which infinite
        ones drop a row. Returns the best point visited that permits no more.
        """
        from scipy.optimize import minimize

        size, count = len(start.fraction), share.shape[1]
        kept, freed = np.isfinite(allowed), self.evaluator.freed
        slack = np.where(self._equal, PRECISION, 0.0) + allowed
        own = share.any(1) & kept
        visited = [start]
        permitted = np.maximum(np.where(own, most, 0.0) + allowed, -start.margin * (count == 0))

        def cost(point: Point) -> tuple[float, float]:
            beyond = max(point.outside - FEASIBLE, 0.0)
            if not count:
                return beyond, point.objective
            left = np.maximum(-(point.margin + np.where(kept, allowed, 0.0)), least)[own]
            return beyond, float(left.max(initial=least) if count == 1 else left.sum())

        def is_permitted(point: Point) -> bool:
            return bool((point.margin + permitted >= -FEASIBLE)[kept].all())

        def at(x: Array) -> Point | None:
            point = self.point(np.clip(x[:size], 0.0, 1.0))
            if point is not None:
                visited.append(point)
                if count and least == 0 and is_permitted(point) and cost(point) == (0.0, 0.0):
                    raise _NothingViolatedError
            return point

        def below(x: Array) -> Array:
            point = at(x)
            c = visited[-1].margin - PENALTY if point is None else point.margin
            bounds, _ = freed.dependent_margins(np.clip(x[:size], 0.0, 1.0))
            return np.concatenate([(c + slack + share @ x[size:])[kept], bounds])

        def below_slope(x: Array) -> Array:
            rows, _ = self._gradients(at(x) or visited[-1])
            _, bounds = freed.dependent_margins(np.clip(x[:size], 0.0, 1.0))
            still = np.zeros((len(bounds), count))
            return np.block([[rows[kept], share[kept]], [bounds, still]])

        def function(x: Array) -> float:
            point = at(x)
            penalty = PENALTY if point is None else 0.0
            return x[size:].sum() if count else (point or visited[-1]).objective + penalty

        def slope(x: Array) -> Array:
            if count:
                return np.append(np.zeros(size), np.ones(count))
            return self._gradients(at(x) or visited[-1])[1]

        missing = np.where(own, -start.margin - np.where(kept, allowed, 0.0), -np.inf)
        first = np.where(share > 0, missing[:, None], least).max(0, initial=least)
        begin = np.append(start.fraction, np.minimum(first, most))
        rules: Any = {"type": "ineq", "fun": below, "jac": below_slope}
        with contextlib.suppress(_NothingViolatedError):
            minimize(
                function,
                begin,
                jac=slope,
                bounds=[(0.0, 1.0)] * size + [(least, most)] * count,
                constraints=rules if len(below(begin)) else (),
                method="SLSQP",
                options={"maxiter": MAX_ITERATIONS, "ftol": PRECISION},
            )
        good = [point for point in visited if is_permitted(point)]
        return min(good or [start], key=cost)

    def active_set(self, point: Point, some: Bool[np.ndarray, " row"]) -> ActiveSet:
        """Find active limits and bounds, with multipliers by non-negative least squares.

        The multipliers meet the conditions of Karush, Kuhn and Tucker as well as possible. If the
        limits of rows `some` are violated, of their largest violation, else of the objective.
        """
        from scipy.optimize import nnls

        by, gradient = self._gradients(point)
        if violated := _violation(point, some) > FEASIBLE:
            shared = some
        else:
            shared = ~self._equal & self._maximises_margin
        reach = np.zeros(len(by))
        if shared.any():
            reach[shared] = point.margin[shared].min()
        if violated:
            reach[~shared] = np.minimum(point.margin[~shared], 0.0)
        bounds, by_bounds = self.evaluator.freed.dependent_margins(point.fraction)
        side = (point.fraction >= 1 - FEASIBLE) * 1 - (point.fraction <= FEASIBLE) * 1
        near, at, tied = (
            np.flatnonzero(x) for x in (point.margin <= reach + ACTIVE, side, bounds <= ACTIVE)
        )
        matrix = np.concatenate([by[near], -np.diag(side)[at], by_bounds[tied]]).T
        right = gradient
        if shared.any():  # the multipliers of a largest violation add up to 1
            weights = np.zeros(matrix.shape[1])
            weights[: len(near)] = shared[near]
            matrix = np.vstack([matrix, weights])
            right = np.append(np.zeros(len(side)), 1.0)
        weight, left = nnls(matrix, right) if matrix.size else (np.zeros(0), np.linalg.norm(right))
        of_rows, of_bounds, of_tied = np.split(weight, [len(near), len(near) + len(at)])
        found = ActiveSet(
            np.zeros(len(self.limits), dtype=bool),
            np.zeros(len(self.limits)),
            side,
            np.zeros(len(side)),
            np.zeros(len(bounds)),
            float(left / max(np.linalg.norm(right), 1e-12)),
        )
        for row, value in zip(near, of_rows, strict=True):
            n, sign = self.rows[row]
            found.active[n] = True
            found.multiplier[n] += sign * value
        found.bound_multiplier[at], found.dependent_multiplier[tied] = of_bounds, of_tied
        return found


def _violation(point: Point, some: Bool[np.ndarray, " row"]) -> float:
    """Largest violation of some limits."""
    return float(np.max(-point.margin[some], initial=0.0))
