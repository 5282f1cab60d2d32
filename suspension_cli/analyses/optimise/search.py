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
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.optimise.evaluate import Evaluator
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
    log : array
        Logarithms of the quantities.
    margin : array
        Residuals of the rows (`Search.rows`), less the margin of the goals.
    outside : float
        Largest excess of a dependent number over a bound, relative to that.
    """

    fraction: Float[np.ndarray, " number"]
    log: Float[np.ndarray, " quantity"]
    margin: Float[np.ndarray, " row"]
    objective: float
    outside: float

    @property
    def worst(self) -> float:
        """Largest violation of a limit or a bound."""
        return max(float(np.max(-self.margin, initial=0.0)), self.outside)

    @property
    def rank(self) -> tuple[float, ...]:
        """Sort key (smallest is best): excess over bounds, violations, objective."""
        total = float(np.maximum(-self.margin, 0.0).sum())
        steps = (round(value / EQUAL) for value in (self.outside, self.worst, total))
        return (*steps, self.objective)


@dataclass(frozen=True)
class ActiveSet:
    """Active limits and bounds at a point, with their Lagrange multipliers.

    Attributes
    ----------
    active : array
    multiplier : array
        Decrease of the objective (of the sum of violations, if limits are violated) per unit by
        which the margin of a limit may shrink.
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
    _logs: dict[bytes, Array | None] = field(default_factory=dict)
    _sides: dict[bytes, tuple[Array, Array]] = field(default_factory=dict)

    def log(self, fraction: Float[np.ndarray, " number"]) -> Array | None:
        """Logarithms of the quantities; None without a valid design."""
        key = fraction.tobytes()
        if key not in self._logs:
            try:
                found = self.evaluator.at(fraction)
            except (InputError, np.linalg.LinAlgError):
                found = np.array([np.nan])
            self.know(fraction, found)
        return self._logs[key]

    def know(self, fraction: Float[np.ndarray, " number"], log: Array) -> None:
        """Take the logarithms of the quantities of a design, which are NaN if it is invalid."""
        self._logs[fraction.tobytes()] = log if np.isfinite(log).all() else None

    @property
    def rows(self) -> tuple[Int[np.ndarray, " row"], Float[np.ndarray, " row"]]:
        """Number of the limit of each residual, and its sign: an equality has both."""
        rows = [
            (n, sign)
            for n, limit in enumerate(self.limits)
            for sign in ((1.0, -1.0) if limit.sense == "equals" else (1.0,))
        ]
        number, sign = np.array(rows, dtype=float).reshape(-1, 2).T
        return number.astype(int), sign

    @property
    def _equal(self) -> Bool[np.ndarray, " row"]:
        number, _ = self.rows
        return np.array([self.limits[n].sense == "equals" for n in number], dtype=bool)

    @property
    def _shares_margin(self) -> Bool[np.ndarray, " row"]:
        """Rows whose smallest margin is maximised."""
        goals, terms = self.evaluator.freed.goals, self.evaluator.requirements.weight
        return ~self._equal & (goals.prefer == "margin" and not terms.any())

    def _margins(self, log: Float[np.ndarray, "*design quantity"]) -> Array:
        number, sign = self.rows
        margins = [self.limits[n].margin(log) for n in number]
        residual = sign * np.stack(margins, -1) if margins else np.zeros((*log.shape[:-1], 0))
        return residual - np.where(self._equal, 0.0, self.evaluator.freed.goals.margin)

    def point(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point; None without a valid design."""
        log, freed = self.log(fraction), self.evaluator.freed
        if log is None:
            return None
        margin, shared = self._margins(log), self._shares_margin
        weight, away = self.evaluator.requirements.weight, fraction - freed.begin
        objective = float(weight @ log if weight.any() else away @ away / 2)
        if shared.any():
            objective = float(np.max(-margin[shared]))
        bounds, _ = freed.dependent_margins(fraction)
        return Point(fraction, log, margin, objective, float(np.max(-bounds, initial=0.0)))

    def _gradients(self, point: Point) -> tuple[Array, Array]:
        """Differentiate the margins and the objective of a point."""
        key, weight = point.fraction.tobytes(), self.evaluator.requirements.weight
        if key not in self._sides:
            self._sides[key] = self.evaluator.neighbours(point.fraction)
        sides, rate = self._sides[key]
        margin, terms = self._margins(sides), sides @ weight
        by = (margin[::2] - margin[1::2]).T * rate
        if weight.any():
            return by, (terms[::2] - terms[1::2]) * rate
        return by, point.fraction - self.evaluator.freed.begin

    def begin(self, fraction: Float[np.ndarray, " number"]) -> Point | None:
        """Evaluate a point, between whose neighbouring modes separations are kept."""
        log = self.log(fraction)
        if log is None:
            return None
        self.limits = self.evaluator.requirements.all_limits(log)
        return self.point(fraction)

    def run(self, fraction: Float[np.ndarray, " number"]) -> tuple[float, Point | None]:
        """Search from fractions for a design that violates no limit, and for the best of these.

        Returns the violation there, NaN for an invalid design, and the best point.
        """
        begin = found = self.begin(fraction)
        if begin is None or found is None:
            return np.nan, None
        if found.worst > FEASIBLE:
            found = self._minimise(found, np.ones(len(found.margin), dtype=bool))
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
        number, _ = self.rows

        def violated(point: Point) -> list[int]:
            return sorted(set(number[point.margin < -FEASIBLE].tolist()))

        left = violated(point)
        for n in list(left):
            dropped = np.where(np.isin(number, left) & (number != n), np.inf, 0.0)
            tried = self._minimise(point, number == n, dropped)
            if n not in violated(tried):
                point = tried
                left.remove(n)
        allowed = np.where(np.isin(number, left), np.inf, 0.0)
        for n in left:
            point = self._minimise(point, number == n, np.where(number == n, 0.0, allowed))
            allowed = np.where(number == n, np.maximum(-point.margin, 0.0), allowed)
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

        size, freed = len(start.fraction), self.evaluator.freed
        allowed = np.broadcast_to(allowed, shared.shape)
        kept, any_shared = np.isfinite(allowed), bool(shared.any())
        slack = np.where(kept, allowed, 0.0) + np.where(self._equal, PRECISION, 0.0)
        column = np.where(shared, 1.0, 0.0)[:, None][:, : int(any_shared)]
        limit = np.where(shared, np.inf, np.maximum(allowed, -start.margin))
        visited = [start]

        def largest(point: Point) -> float:
            return float(np.max(-point.margin[shared], initial=least))

        def cost(point: Point) -> tuple[float, float]:
            beyond = max(point.outside - FEASIBLE, 0.0)
            return beyond, largest(point) if any_shared else point.objective

        def is_permitted(point: Point) -> bool:
            return bool((point.margin + limit >= -FEASIBLE).all())

        def at(x: Array) -> Point | None:
            point = self.point(np.clip(x[:size], 0.0, 1.0))
            if point is not None:
                visited.append(point)
                if any_shared and least == 0 and is_permitted(point) and cost(point) == (0.0, 0.0):
                    raise StopIteration
            return point

        def below(x: Array) -> Array:
            point = at(x)
            margin = visited[-1].margin - PENALTY if point is None else point.margin
            bounds, _ = freed.dependent_margins(np.clip(x[:size], 0.0, 1.0))
            return np.concatenate([(margin + slack + column @ x[size:])[kept], bounds])

        def below_slope(x: Array) -> Array:
            rows, _ = self._gradients(at(x) or visited[-1])
            _, bounds = freed.dependent_margins(np.clip(x[:size], 0.0, 1.0))
            still = np.zeros((len(bounds), column.shape[1]))
            return np.block([[rows[kept], column[kept]], [bounds, still]])

        def function(x: Array) -> float:
            point = at(x)
            penalty = PENALTY if point is None else 0.0
            return float(x[size]) if any_shared else (point or visited[-1]).objective + penalty

        def slope(x: Array) -> Array:
            if any_shared:
                return np.append(np.zeros(size), 1.0)
            return self._gradients(at(x) or visited[-1])[1]

        rules: Any = {"type": "ineq", "fun": below, "jac": below_slope}
        begin = np.append(start.fraction, [largest(start)] * any_shared)
        with contextlib.suppress(StopIteration):
            minimize(
                function,
                begin,
                jac=slope,
                bounds=[(0.0, 1.0)] * size + [(least, None)] * any_shared,
                constraints=rules if len(below(begin)) else (),
                method="SLSQP",
                options={"maxiter": MAX_ITERATIONS, "ftol": PRECISION},
            )
        good = [point for point in visited if is_permitted(point)]
        return min(good or [start], key=cost)

    def active_set(self, point: Point) -> ActiveSet:
        """Find active limits and bounds, with multipliers by non-negative least squares.

        The multipliers meet the conditions of Karush, Kuhn and Tucker as well as possible: of the
        sum of violations, if limits are violated, else of the objective.
        """
        from scipy.optimize import nnls

        by, gradient = self._gradients(point)
        violated, shared = point.margin < -FEASIBLE, self._shares_margin
        bounds, by_bounds = self.evaluator.freed.dependent_margins(point.fraction)
        side = (point.fraction >= 1 - FEASIBLE) * 1 - (point.fraction <= FEASIBLE) * 1
        reach = np.zeros(len(by))
        if violated.any():
            gradient, shared = -by[violated].sum(0), np.zeros_like(shared)
        elif shared.any():
            reach[shared] = point.margin[shared].min()
        active = (point.margin <= reach + ACTIVE) & ~violated
        near, at, tied = (np.flatnonzero(x) for x in (active, side, bounds <= ACTIVE))
        matrix = np.concatenate([by[near], -np.diag(side)[at], by_bounds[tied]]).T
        if shared.any():  # the multipliers of a smallest margin add up to 1
            gradient = np.append(np.zeros(len(side)), 1.0)
            matrix = np.vstack([matrix, np.append(shared[near], np.zeros(len(at) + len(tied)))])
        weight, left = (
            nnls(matrix, gradient) if matrix.size else (np.zeros(0), np.linalg.norm(gradient))
        )
        of_rows, of_bounds, of_tied = np.split(weight, [len(near), len(near) + len(at)])
        number, sign = self.rows
        own = np.arange(len(self.limits))[:, None] == number[near]
        multiplier, dependent = np.zeros(len(side)), np.zeros(len(bounds))
        multiplier[at], dependent[tied] = of_bounds, of_tied
        return ActiveSet(
            own.any(1),
            own @ (sign[near] * of_rows),
            side,
            multiplier,
            dependent,
            float(left / max(np.linalg.norm(gradient), 1e-12)),
        )
