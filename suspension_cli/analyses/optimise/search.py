"""Constrained search for free numbers: first what is missed, then the objective.

Every limit is a smooth residual c(u) >= 0, the logarithm of value over limit or of limit over
value, of the free numbers as fractions u of their ranges; an equality is two of opposite signs. A
search (`scipy.optimize.minimize`, SLSQP; Kraft, DFVLR-FB 88-28 (1988)) is one of

    minimise s      subject to  c + a + s >= 0  for some limits,  c + a >= 0  for others
    minimise f(u)   subject to  c + a >= 0,

where a allows violations that are already known to be unavoidable. Bounds always apply, also those
of dependent numbers. If limits exclude each other, those that come first in the file of goals are
met (`Search.compromise`; Charnes & Cooper, Management Models of Linear Programming (1961), on goals
with priorities).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.optimise.evaluate import Evaluator
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

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
PENALTY = 10.0
"""Change for the worse of all values at an invalid design."""
LARGEST_MARGIN = 50.0
"""Largest margin, where margins are maximised."""


@dataclass(frozen=True)
class Point:
    """A valid design.

    Attributes
    ----------
    fraction : array
        Free numbers as fractions of the ranges between their bounds.
    margin : array
        Residuals of the rows of the search, less the margin of the goals.
    outside : float
        Largest excess of a dependent number over a bound.
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

    Its rows are the limits, with both signs of equalities, then bounds of dependent numbers: the
    residual of each is linear in one of the values of `Evaluator.logs`.

    Attributes
    ----------
    limit : array
        Number of the limit of each row, from 0; -1 for a bound.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        self.evaluator, self.freed, goals = evaluator, evaluator.freed, evaluator.freed.goals
        self._points: dict[bytes, Point | None] = {}
        self._slopes: dict[bytes, Array] = {}
        wanted, bounds = evaluator.requirements, int(self.freed.bounded.sum())
        rows = [
            (n, limit.quantity, np.log(limit.value), sign, limit.sense == "equals")
            for n, limit in enumerate(wanted.limits)
            for sign in {"at_least": (1, 0), "at_most": (-1, 0), "equals": (1, -1)}[limit.sense]
            if sign
        ]
        rows += [(-1, len(wanted.quantities) + n, 0, 1, False) for n in range(bounds)]
        limit, place, self._target, self._sign, equal = np.array(rows, float).reshape(-1, 5).T
        self.limit, self._place, self._equal = limit.astype(int), place.astype(int), equal > 0
        self._kept = np.where(self._equal | (limit < 0), 0.0, goals.margin)
        self._weight = np.append(wanted.weight, np.zeros(bounds))
        maximise = goals.prefer == "margin" and not self._weight.any()
        self._shares_margin = maximise & ~self._equal & (limit >= 0)

    def know(self, fraction: Float[np.ndarray, " number"], values: Array) -> Point | None:
        """Make the point of a design with these values; None if one is NaN: the design is invalid.

        The point is kept.
        """
        point = None
        if np.isfinite(values).all():
            margin = self._sign * (values[self._place] - self._target) - self._kept
            away = fraction - self.freed.begin
            objective = float(self._weight @ values if self._weight.any() else away @ away / 2)
            if self._shares_margin.any():
                objective = float(np.max(-margin[self._shares_margin]))
            outside = float(np.max(-margin[self.limit < 0], initial=0.0))
            point = Point(fraction, margin, objective, outside)
        self._points[fraction.tobytes()] = point
        return point

    def point(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point; None without a valid design."""
        if fraction.tobytes() in self._points:
            return self._points[fraction.tobytes()]
        try:
            values = self.evaluator.at(fraction)
        except np.linalg.LinAlgError:
            values = np.array([np.nan])
        return self.know(fraction, values)

    def _gradients(self, point: Point) -> tuple[Array, Array]:
        """Differentiate the margins and the objective of a point."""
        key = point.fraction.tobytes()
        if key not in self._slopes:
            self._slopes[key] = self.evaluator.slopes(point.fraction)
        slope, away = self._slopes[key], point.fraction - self.freed.begin
        gradient = self._weight @ slope if self._weight.any() else away
        return self._sign[:, None] * slope[self._place], gradient

    def run(self, fraction: Float[np.ndarray, " number"]) -> tuple[float, Point | None]:
        """Search from fractions for a design that violates no limit, and for the best of these.

        Returns the violation there, NaN for an invalid design, and the best point.
        """
        begin = found = self.point(fraction)
        if begin is None or found is None:
            return np.nan, None
        if found.worst > FEASIBLE:
            found = self._minimise(found, self.limit >= 0)
        if found.worst <= FEASIBLE:
            found = self._improve(found)
        return begin.worst, found

    def _improve(self, point: Point) -> Point:
        """Minimise the objective, with no violation larger than at a point."""
        allowed = np.where(point.margin < -FEASIBLE, -point.margin, 0.0)
        shared = self._shares_margin
        if not shared.any():
            return self._minimise(point, shared, allowed)
        return point if allowed.any() else self._minimise(point, shared, least=-LARGEST_MARGIN)

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
            allowed[self.limit == n] = 0.0
            point = self._minimise(point, self.limit == n, allowed)
            allowed[self.limit == n] = np.maximum(-point.margin, 0.0)[self.limit == n]
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
        visited, unit = [start], np.append(np.zeros(size), 1.0)

        def largest(point: Point) -> float:
            return float(np.max(-point.margin[shared], initial=least))

        def cost(point: Point) -> tuple[float, float]:
            beyond = max(point.outside - FEASIBLE, 0.0)
            return beyond, largest(point) if any_shared else point.objective

        def is_permitted(point: Point) -> bool:
            return bool((point.margin + permitted >= -FEASIBLE)[~shared].all())

        def at(x: Array) -> tuple[Point, float]:
            """The point, or for an invalid design the last one with a penalty."""
            point = self.point(np.clip(x[:size], 0.0, 1.0))
            if point is None:
                return visited[-1], PENALTY
            visited.append(point)
            if any_shared and least == 0 and is_permitted(point) and cost(point) == (0.0, 0.0):
                raise StopIteration
            return point, 0.0

        def margin(x: Array) -> Array:
            point, penalty = at(x)
            return (point.margin - penalty + slack + column @ x[size:])[kept]

        def margin_slope(x: Array) -> Array:
            return np.hstack([self._gradients(at(x)[0])[0], column])[kept]

        def function(x: Array) -> float:
            point, penalty = at(x)
            return float(x[size]) if any_shared else point.objective + penalty

        def slope(x: Array) -> Array:
            return unit if any_shared else self._gradients(at(x)[0])[1]

        rules: Any = {"type": "ineq", "fun": margin, "jac": margin_slope}
        with contextlib.suppress(StopIteration):
            minimize(
                function,
                np.append(start.fraction, [largest(start)] * any_shared),
                jac=slope,
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
        sum of violations, if limits are violated, else of the objective.

        Returns
        -------
        limit : array
            Decrease of that function per unit by which the margin of a limit may shrink; NaN for a
            limit that is not active.
        bound : array
            The same of the bounds of free and dependent numbers, per distance between them.
        stationarity : float
            Norm of the gradient that the multipliers do not balance, over that of the whole one.
        """
        from scipy.optimize import nnls

        by, gradient = self._gradients(point)
        violated, shared = point.margin < -FEASIBLE, self._shares_margin
        reach = np.zeros(len(by))
        if violated.any():
            gradient, shared = -by[violated].sum(0), np.zeros_like(shared)
        elif shared.any():
            reach[shared] = point.margin[shared].min()
        near = np.flatnonzero((point.margin <= reach + ACTIVE) & ~violated)
        sides = np.vstack([np.eye(len(gradient)), -np.eye(len(gradient))])
        at = np.flatnonzero(np.append(point.fraction, 1 - point.fraction) <= FEASIBLE)
        matrix = np.vstack([by[near], sides[at]]).T
        if shared.any():  # the multipliers of a smallest margin add up to 1
            gradient = np.append(np.zeros(len(gradient)), 1.0)
            matrix = np.vstack([matrix, np.append(shared[near], np.zeros(len(at)))])
        weight, left = np.zeros(0), np.linalg.norm(gradient)
        if matrix.size:
            weight, left = nnls(matrix, gradient)
        limit, rows = np.full(len(self.evaluator.requirements.limits), np.nan), np.zeros(len(by))
        rows[near] = weight[: len(near)] * np.where(self._equal, self._sign, 1.0)[near]
        for row in near[self.limit[near] >= 0]:
            n = int(self.limit[row])
            limit[n] = np.nan_to_num(limit[n]) + rows[row]
        bound = np.zeros(self.freed.bounded.shape)
        bound[self.freed.bounded] = rows[self.limit < 0]
        bound[at // len(point.fraction), at % len(point.fraction)] = weight[len(near) :]
        size = max(float(np.linalg.norm(gradient)), 1e-12)
        return limit, bound, float(left) / size
