"""Constrained search: the least violation of all limits first, then the best design that keeps to them.

Sequential quadratic programming (SLSQP; Kraft, DFVLR-FB 88-28 (1988)) with exact derivatives, in shares u of the way between the bounds.  All limits are
margins c(u) >= 0 in logarithms, each mode's by itself, so that everything is smooth.  First

    minimise s    with    c(u) + s >= 0,  -s <= e(u) <= s,  s >= 0,

whose s is the largest violation (e: equalities); then, from there, the objective with c >= 0 and e = 0.  Bounds hold throughout, those of numbers that follow
from others b(u) >= 0 included.  Where there is no design (a wire shorter than
its span, one that goes slack) the search is told of a place far worse than the one before, so that it takes a smaller step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from suspension_cli.analysis.optimise.freed import Freed
from suspension_cli.analysis.optimise.quantities import Limit, Wanted
from suspension_cli.analysis.optimise.valued import Valued, Values
from suspension_cli.design.goals import Goals
from suspension_cli.design.scene import Array
from suspension_cli.errors import InputError

STEPS = 100
"""Of each of the two searches, at most."""
PRECISION = 1e-10
KEPT = 1e-8
"""Violation up to which a point of the search keeps to all limits; they are told less the margin that is kept from them."""
ACTIVE = 1e-5
"""Margin below which a limit holds the search back."""
WORSE = 10.0
"""How much worse than the last one a place without a design looks."""


@dataclass(frozen=True)
class Point:
    """A design of the search.

    Attributes
    ----------
    share : (p,) array
    log : (q,) array
        Logarithms of the quantities.
    violation, objective : float
    outside : float
        How far the numbers that follow from others lie beyond their bounds, as shares of these.
    """

    share: Array
    log: Array
    violation: float
    objective: float
    outside: float

    @property
    def worst(self) -> float:
        """The largest violation, of a limit or of bounds."""
        return max(self.violation, self.outside)

    @property
    def rank(self) -> tuple[float, float, float]:
        """What points are compared by: what lies out of bounds, then the violation, then the objective."""
        beyond = self.outside if self.outside > KEPT else 0.0
        return (beyond, self.violation, 0.0) if self.violation > KEPT else (beyond, 0.0, self.objective)


@dataclass(frozen=True)
class Held:
    """What holds a point where it is.

    Attributes
    ----------
    active : (k,) bool array
    multiplier : (k,) array
        Of the limits: what the objective would gain a unit of margin; where not all limits are kept, the largest violation takes its place.
    bound : (p,) int array
        -1 at the lower, 1 at the upper bound.
    bound_multiplier : (p,) array
        The same, a unit of the way between the bounds.
    tied_multiplier : (b,) array
        Of the bounds of numbers that follow from others, see `Freed.ties`.
    stationarity : float
        What is left of the objective's gradient, of all of it.
    """

    active: Any
    multiplier: Array
    bound: Any
    bound_multiplier: Array
    tied_multiplier: Array
    stationarity: float


@dataclass
class Search:
    """One problem; points that were seen are remembered.

    Attributes
    ----------
    values : Values
    goals : Goals
    offset : (q,) array
        Added to all logarithms: how a higher rung differs, at the last design that was checked.
    """

    values: Values
    goals: Goals
    offset: Array
    seen: dict[bytes, Valued | None] = field(default_factory=dict)
    best: Point | None = None
    pairs: tuple[Limit, ...] = ()

    @property
    def freed(self) -> Freed:
        """The design's free numbers."""
        return self.values.freed

    @property
    def wanted(self) -> Wanted:
        """What is asked of it."""
        return self.values.wanted

    @property
    def begin(self) -> Array:
        """Where the design as drawn is."""
        return self.freed.shares(self.freed.start)

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Those of goals, then those between neighbouring modes that are to lie apart."""
        return (*self.wanted.limits, *self.pairs)

    def order(self, log: Array) -> tuple[Limit, ...]:
        """Limits between modes that are to lie apart, in the order in which they lie now."""
        found = []
        for goal, places, value, hertz in self.wanted.separations:
            ranked = sorted(places, key=lambda n: log[n])
            found += [Limit(goal, high, "at_least", value, low, hertz) for low, high in pairwise(ranked)]
        return tuple(found)

    def value(self, share: Array) -> Valued | None:
        """Logarithms and their derivatives with respect to shares; None where there is no design."""
        key = share.tobytes()
        if key not in self.seen:
            number = self.freed.numbers(share)
            try:
                found = self.values.at(number)
            except (InputError, np.linalg.LinAlgError):
                self.seen[key] = None
            else:
                good = np.isfinite(found.log).all() and np.isfinite(found.slope).all()
                self.seen[key] = Valued(found.log + self.offset, found.slope * self.freed.rate(number)) if good else None
        return self.seen[key]

    def margins(self, now: Valued) -> tuple[Array, Array, Array, Array]:
        """Margins c (k,) less what is kept, their slopes, equalities e and theirs."""
        c, dc, e, de = [], [], [], []
        for limit in self.limits:
            value, slope = margin(limit, now.log, now.slope)
            if limit.sense == "equals":
                e.append(value)
                de.append(slope)
            else:
                c.append(value - self.goals.margin)
                dc.append(slope)
        size = len(self.begin)
        return np.array(c), np.array(dc).reshape(-1, size), np.array(e), np.array(de).reshape(-1, size)

    def within(self, share: Array) -> tuple[Array, Array]:
        """How far the numbers that follow from others lie within their bounds b (b,), as shares of these, and the slopes."""
        rows, sides = self.freed.ties()
        number = self.freed.numbers(share)
        return rows @ number + sides, rows * self.freed.rate(number)

    def objective(self, now: Valued, share: Array) -> tuple[float, Array]:
        """What is to be made small, and its gradient."""
        if self.wanted.wishes:
            weight = np.array([wish.weight for wish in self.wanted.wishes])
            places = [wish.quantity for wish in self.wanted.wishes]
            return float(weight @ now.log[places]), weight @ now.slope[places]
        away = share - self.begin
        return float(away @ away) / 2, away

    @property
    def roomy(self) -> bool:
        """Whether the largest margins are looked for."""
        return self.goals.prefer == "margin" and not self.wanted.wishes

    def point(self, share: Array) -> Point | None:
        """A point, which becomes the best if it is."""
        now = self.value(share)
        if now is None:
            return None
        c, _, e, _ = self.margins(now)
        worst = float(np.max(np.concatenate([-c, np.abs(e), [-np.inf]])))
        goal = worst if self.roomy else self.objective(now, share)[0]
        found = Point(share.copy(), now.log, max(worst, 0.0), goal, float(np.max(-self.within(share)[0], initial=0.0)))
        if self.best is None or found.rank < self.best.rank:
            self.best = found
        return found

    def run(self, share: Array) -> Point | None:
        """Search from a starting point; the best point seen on the way, None if there is no design there."""
        self.best, now = None, self.value(share)
        if now is None:
            return None
        self.pairs = self.order(now.log)
        begin = self.point(share)
        assert begin is not None
        if begin.worst > KEPT:
            self._solve(begin.share, begin.violation, phase=1)
        if self.best is not None and self.best.worst <= KEPT:
            self._solve(self.best.share, self.best.objective, phase=2)
        return self.best

    def _solve(self, share: Array, worst: float, *, phase: int) -> None:
        """Phase 1: the least violation; phase 2: the objective, within the limits."""
        from scipy.optimize import minimize

        extra = phase == 1 or self.roomy  # one more variable: the violation s, which all limits may have
        last: list[Any] = []

        def told(x: Array) -> tuple[Any, ...]:
            """Objective, gradient, c, its slopes, e, its slopes; of a place that is worse than the last where there is no design."""
            u = np.clip(x[: len(share)], 0.0, 1.0)
            now = self.value(u)
            if now is None:
                f, g, c, dc, e, de = last[0]
                return f + WORSE, g, c - WORSE, dc, e + np.copysign(WORSE, e), de
            self.point(u)
            last[:] = [(*self.objective(now, u), *self.margins(now))]
            return last[0]

        def widened(slopes: Array, sign: float) -> Array:
            return np.hstack([slopes, np.full((len(slopes), 1), sign)]) if extra else slopes

        def s(x: Array) -> float:
            return x[-1] if extra else 0.0

        def below(x: Array) -> Array:
            _, _, c, _, e, _ = told(x)
            return np.concatenate([c + s(x), *([e + s(x), s(x) - e] if phase == 1 else []), self.within(x[: len(share)])[0]])

        def below_slope(x: Array) -> Array:
            _, _, _, dc, _, de = told(x)
            bounds = widened(self.within(x[: len(share)])[1], 0.0)
            return np.vstack([widened(dc, 1.0), *([widened(de, 1.0), widened(-de, 1.0)] if phase == 1 else []), bounds])

        rules: list[Any] = [{"type": "ineq", "fun": below, "jac": below_slope}]
        if phase == 2 and any(limit.sense == "equals" for limit in self.limits):
            rules.append({"type": "eq", "fun": lambda x: told(x)[4], "jac": lambda x: widened(told(x)[5], 0.0)})
        if not len(below(np.append(share, worst) if extra else share)):
            rules = rules[1:]
        bounds = [(0.0, 1.0)] * len(share) + ([(0.0 if phase == 1 else -50.0, None)] if extra else [])
        up = np.append(np.zeros(len(share)), 1.0)
        function: Callable[[Array], float] = (lambda x: x[-1]) if extra else lambda x: told(x)[0]
        slope: Callable[[Array], Array] = (lambda x: up) if extra else lambda x: told(x)[1]
        begin = np.append(share, worst) if extra else share
        minimize(function, begin, jac=slope, bounds=bounds, constraints=rules, method="SLSQP", options={"maxiter": STEPS, "ftol": PRECISION})

    def held(self, point: Point) -> Held:
        """What is active at a point: multipliers of least squares, none of which pushes the wrong way (Karush, Kuhn and Tucker)."""
        from scipy.optimize import nnls

        now = self.value(point.share)
        assert now is not None
        c, dc, e, de = self.margins(now)
        b, db = self.within(point.share)
        edge = np.where(point.share <= KEPT, -1, np.where(point.share >= 1 - KEPT, 1, 0))
        most = self.roomy or point.violation > KEPT  # then the smallest margin is what counts, and margins share out a weight of 1
        reach = float(np.min(np.concatenate([c, [] if self.roomy else -np.abs(e)]), initial=np.inf)) if most else 0.0
        near, at, tied = np.flatnonzero(c <= reach + ACTIVE), np.flatnonzero(edge), np.flatnonzero(b <= ACTIVE)
        forced = np.flatnonzero(np.abs(e) >= -reach - ACTIVE) if most and not self.roomy else np.arange(len(e))
        matrix = np.concatenate([dc[near], de[forced], -de[forced], -np.eye(len(edge))[at] * edge[at][:, None], db[tied]]).T
        right = np.zeros(len(edge)) if most else self.objective(now, point.share)[1]
        if most:
            equal = 0.0 if self.roomy else 1.0
            matrix = np.vstack([matrix, [1.0] * len(near) + [equal] * (2 * len(forced)) + [0.0] * (len(at) + len(tied))])
            right = np.append(right, 1.0)
        weight, left = nnls(matrix, right) if matrix.shape[1] else (np.zeros(0), float(np.linalg.norm(right)))
        parts = np.split(weight, np.cumsum([len(near), len(forced), len(forced), len(at)]))
        multiplier, active = np.zeros(len(self.limits)), np.zeros(len(self.limits), dtype=bool)
        plain, equals = (np.array([n for n, limit in enumerate(self.limits) if (limit.sense == "equals") == same], dtype=int) for same in (False, True))
        multiplier[plain[near]], active[plain[near]] = parts[0], True
        multiplier[equals[forced]], active[equals[forced]] = parts[1] - parts[2], True
        bounds, followers = np.zeros(len(edge)), np.zeros(len(b))
        bounds[at], followers[tied] = parts[3], parts[4]
        return Held(active, multiplier, edge, bounds, followers, float(left / max(np.linalg.norm(right), 1e-12)))


def margin(limit: Limit, log: Array, slope: Array | None = None) -> tuple[float, Any]:
    """Margin of a limit for logarithms (q,) of the quantities, and its slope; of an equality, the logarithm of value over limit."""
    y, dy = log[limit.quantity], 0.0 if slope is None else slope[limit.quantity]
    if limit.other >= 0:
        z, dz = log[limit.other], 0.0 if slope is None else slope[limit.other]
        if limit.hertz:
            high, low = np.exp(y), np.exp(z)
            return float((high - low) / limit.value - 1), (high * dy - low * dz) / limit.value
        return float(y - z - np.log(limit.value)), dy - dz
    away = float(y - np.log(limit.value))
    return (-away, -dy) if limit.sense == "at_most" else (away, dy)
