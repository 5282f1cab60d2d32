"""Constrained search for the free numbers of a design that meets goals.

Every limit is a smooth residual c(u) >= 0 of the free numbers as fractions u of their ranges: the
logarithm of value over limit or of limit over value, or a difference from the limit over its size;
an equality is two of opposite signs. A search (`scipy.optimize.minimize`, SLSQP; Kraft, DFVLR-FB
88-28 (1988)) is one of

    minimise s      subject to  c + a + s >= 0  for some limits,  c + a >= 0  for others
    minimise f(u)   subject to  c + a >= 0,

where a allows violations that are already known to be unavoidable. Bounds always apply, also those
of dependent numbers. If limits exclude each other, those that come first in the file of goals are
met (`Search.compromise`; Charnes & Cooper, Management Models of Linear Programming (1961), on goals
with priorities).
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.analyses.optimise.evaluator import Evaluator
from suspension_cli.analyses.optimise.optimum import EQUAL
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from collections.abc import Iterator

    from jaxtyping import Bool, Float

MAX_ITERATIONS = 100
"""Most iterations of each search."""
PRECISION = 1e-10
"""Change of the minimised function at which a search ends, and allowed deviation of equalities."""
FEASIBLE = 1e-8
"""Largest violation of a point that satisfies all limits with the margin of the goals."""
ACTIVE = 1e-5
"""Margin below which a limit is active."""
PENALTY = 10.0
"""Change for the worse of all values at an invalid design."""


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


class Row(NamedTuple):
    """A residual: `sign` times the value at `place`, less `offset`.

    `limit` is the number of its limit; -1 for a bound.
    """

    limit: int
    place: int
    sign: float
    offset: float
    equality: bool


class Search:
    """Constrained search for one design.

    Its rows are the limits, with both signs of equalities, then bounds of dependent numbers: a
    residual is one of the values of `Evaluator.values`, with a sign, less an offset. `limit` is the
    number of the limit of each row, from 0; -1 for a bound.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        self.evaluator = evaluator
        self.freed = evaluator.freed
        self._points: dict[bytes, Point | None] = {}
        self._slopes: dict[bytes, Array] = {}
        goals = evaluator.freed.goals
        bounds = int(self.freed.bounded.sum())
        rows = [*self._rows_of_limits(), *self._rows_of_bounds(bounds)]
        self.limit = np.array([row.limit for row in rows], dtype=int)
        self._place = np.array([row.place for row in rows], dtype=int)
        self._sign = np.array([row.sign for row in rows], dtype=float)
        self._equal = np.array([row.equality for row in rows], dtype=bool)
        inexact = ~self._equal & (self.limit >= 0)
        self._offset = np.array([row.offset for row in rows]) + inexact * goals.margin
        weight = evaluator.targets.weight
        maximised = np.minimum(weight, 0.0)
        minimised = np.maximum(weight, 0.0)
        self._weight = np.concatenate([maximised, minimised, np.zeros(bounds)])
        self._shares_margin = inexact & (goals.prefer == "margin") & (not self._weight.any())

    def _rows_of_limits(self) -> Iterator[Row]:
        """Rows of all limits: of lower ones the smallest values, of upper ones the largest."""
        targets = self.evaluator.targets
        count = len(targets.target)
        for n, (one, target) in enumerate(zip(targets.limit, targets.place, strict=True)):
            offset = self.evaluator.offset(one.target, one.asked)
            equality = one.sense == "equals"
            if one.sense != "at_most":
                yield Row(n, target, 1.0, offset, equality)
            if one.sense != "at_least":
                yield Row(n, target + count, -1.0, -offset, equality)
            two_sided = one.of_magnitude and one.target.quantity.signed
            if two_sided and one.sense == "at_most" and not self.evaluator.logarithmic[target]:
                yield Row(n, target, 1.0, -offset, equality)

    def _rows_of_bounds(self, bounds: int) -> Iterator[Row]:
        first = 2 * len(self.evaluator.targets.target)
        for n in range(bounds):
            yield Row(-1, first + n, 1.0, 0.0, equality=False)

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
        slope = self._slopes[key]
        away = point.fraction - self.freed.begin
        gradient = self._weight @ slope if self._weight.any() else away
        return self._sign[:, None] * slope[self._place], gradient

    def inward(self, point: Point) -> Float[np.ndarray, " number"]:
        """Direction in which active limits, together, gain room."""
        active = (np.abs(point.margin) <= ACTIVE) & ~self._equal
        return self._gradients(point)[0][active].sum(0)

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

        size = len(start.fraction)
        any_shared = bool(shared.any())
        allowed = np.broadcast_to(allowed, shared.shape)
        kept = np.isfinite(allowed)
        permitted = np.maximum(allowed, -start.margin)
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
            point = self.point(np.clip(x[:size], 0.0, 1.0))
            if point is None:
                last = visited[-1]
                worse = last.margin - PENALTY
                return replace(last, margin=worse, objective=last.objective + PENALTY)
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
        violated = point.margin < -FEASIBLE
        shared = self._shares_margin
        size = len(gradient)
        if violated.any():
            gradient = -by[violated].sum(0)
            shared = np.zeros_like(shared)
        reach = np.where(shared, np.min(point.margin, where=shared, initial=np.inf), 0.0)
        near = (point.margin <= reach + ACTIVE) & ~violated
        at = np.array([point.fraction, 1 - point.fraction]) <= FEASIBLE
        matrix = np.vstack([by[near], np.eye(size)[at[0]], -np.eye(size)[at[1]]])
        if shared.any():  # the multipliers of a smallest margin add up to 1
            gradient = np.append(np.zeros(size), 1.0)
            matrix = np.column_stack([matrix, np.append(shared[near], np.zeros(at.sum()))])
        whole = float(np.linalg.norm(gradient))
        weight = np.zeros(0)
        left = whole
        if matrix.size:
            weight, left = nnls(matrix.T, gradient)
        rows = np.zeros(len(by))
        rows[near] = weight[: near.sum()] * np.where(self._equal, self._sign, 1.0)[near]
        limit = np.full(len(self.evaluator.targets.limit), np.nan)
        active = near & (self.limit >= 0)
        limit[self.limit[active]] = 0.0
        np.add.at(limit, self.limit[active], rows[active])
        bound = np.zeros(self.freed.bounded.shape)
        bound[self.freed.bounded] = rows[self.limit < 0]
        bound[:, :size][at] = weight[near.sum() :]
        return limit, bound, float(left) / max(whole, 1e-12)
