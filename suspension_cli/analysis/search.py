"""The search for the numbers with which several designs fit what was measured: what is minimised, where it begins, and least squares.

Bounded trust regions (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)), with derivatives that are exact on `string` and good to nine digits
or so on `beam`.  Numbers whose bounds are positive are looked for by decades.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import parameters
from suspension_cli.analysis.experiment import Experiment
from suspension_cli.analysis.parameters import twins
from suspension_cli.design.faults import suggestion
from suspension_cli.design.measured import Measured
from suspension_cli.design.scene import Array
from suspension_cli.errors import Fault, InputError, shown

CONVERGED = 1e-9
DRAWS = 100
"""Times that numbers are drawn until there is such a design."""


@dataclass(frozen=True)
class Problem:
    """All experiments and the numbers that they share.

    Attributes
    ----------
    experiment : list of Experiment
    shared : (p, e) bool array
    start, low, high : (p,) arrays
    prior, doubt : (p,) arrays
        Known before, and its standard deviation: infinite where nothing was.
    """

    experiment: list[Experiment]
    shared: Any
    start: Array
    low: Array
    high: Array
    prior: Array
    doubt: Array

    def measured(self, x: Array) -> tuple[Array, Array]:
        """Frequencies (k,) of the modes measured and their derivatives (k, p)."""
        rows, slopes = [], []
        for item, own in zip(self.experiment, self.shared.T, strict=True):
            frequency, slope = item.measured(x[own])
            whole = np.zeros((len(frequency), len(x)))
            whole[:, own] = slope
            rows.append(frequency)
            slopes.append(whole)
        return np.concatenate(rows), np.concatenate(slopes)

    @property
    def decades(self) -> Any:
        """Which numbers are looked for by decades, (p,)."""
        return (self.low > 0) & (self.start > 0)

    def weighted(self, x: Array) -> tuple[Array, Array]:
        """Residuals and their derivatives in units of the uncertainties: modes, then priors."""
        frequency, slope = self.measured(x)
        target, sigma = (np.concatenate([getattr(item, name) for item in self.experiment]) for name in ("frequency", "uncertainty"))
        known = np.isfinite(self.doubt)
        rows = [(frequency - target) / sigma, ((x - self.prior) / self.doubt)[known]]
        return np.concatenate(rows), np.concatenate([slope / sigma[:, None], np.diag(1 / self.doubt)[known]])


def problem(texts: Sequence[str], measured: Measured, files: Sequence[str], level: str = "string") -> Problem:
    """What `fit.solve` is asked.

    Raises
    ------
    InputError
        If a number is not the designs', or begins outside its bounds.
    """
    free = measured.parameter
    shared = np.array([measured.shares(n) for n in range(len(free))])
    start = _start(texts, measured, shared, level)
    low = np.array([-np.inf if item.lower is None else item.lower for item in free])
    high = np.array([np.inf if item.upper is None else item.upper for item in free])
    outside = np.flatnonzero(~((low <= start) & (start <= high)))
    if len(outside):
        n = int(outside[0])
        raise InputError([Fault(f"parameter.{n + 1}", f"the design's value {start[n]:g} lies outside the bounds", "give a start within them")])
    experiments = [
        Experiment(text, modes, [item.name for item, here in zip(free, own, strict=True) if here], start[own], measured.where(n), file, level)
        for n, (text, modes, own, file) in enumerate(zip(texts, measured.modes, shared.T, files, strict=True))
    ]
    _demand(experiments, shared)
    prior = np.array([0.0 if item.prior is None else item.prior for item in free])
    doubt = np.array([np.inf if item.uncertainty is None else item.uncertainty for item in free])
    return Problem(experiments, shared, start, low, high, prior, doubt)


def _start(texts: Sequence[str], measured: Measured, shared: Any, level: str) -> Array:
    """Where the search begins: as asked, else as the designs have it, else what was known before."""
    known = [{item.name: item.value for item in parameters.every(text, level)} for text in texts]
    found, bad = [], []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        mine = [(table, name) for table, name, here in zip(known, measured.names, own, strict=True) if here]
        given = {table.get(item.name, item.prior) for table, _ in mine}
        if item.start is None and None in given:
            table, name = next((table, name) for table, name in mine if item.name not in table)
            whose = f"the design of {name}" if name else "the design"
            others = any(item.name in table for table, _ in mine)
            remedy = "list in experiments those whose designs do" if others else suggestion(item.name, list(table))
            bad.append(Fault(f"parameter.{n}.name", f"is no number that {whose} gives", remedy + "; or give a start", shown(item.name)))
        elif item.start is None and len(given) > 1:
            bad.append(Fault(f"parameter.{n}.name", "has different values in the designs that share it", "give a start", shown(item.name)))
        found.append(item.start if item.start is not None else next(iter(given)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _demand(experiments: list[Experiment], shared: Any) -> None:
    """Tell faults of the numbers that the search begins with where they stand: in the measurements, not in a design or an override."""
    bad: dict[Fault, None] = {}
    for experiment, own in zip(experiments, shared.T, strict=True):
        try:
            experiment.design(experiment.start)
        except InputError as error:
            for n, name, x in zip(np.flatnonzero(own), experiment.free, experiment.start, strict=True):
                mine = [fault for fault in error.faults if fault.key in twins(name) or (fault.value or "").startswith(f'"{name}=')]
                bad |= {Fault(f"parameter.{n + 1}", f"{name}: {fault.problem}", fault.remedy, f"{x:g}"): None for fault in mine}
    if bad:
        raise InputError(list(bad))


def starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """Where the search begins: first as asked, then at random within what was known before and the bounds.

    Numbers with a prior are drawn from it, others evenly between their bounds (by decades where these are positive); the rest begin as asked.
    """
    yield problem.start
    random = np.random.default_rng(seed)
    known, between = np.isfinite(problem.doubt), np.isfinite(problem.low) & np.isfinite(problem.high)
    decades = problem.decades & between
    for _ in range(count - 1):
        for _ in range(DRAWS):
            share, normal = random.random(len(problem.start)), random.standard_normal(len(problem.start))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                evenly = problem.low + share * (problem.high - problem.low)
                by_decades = problem.low * (problem.high / problem.low) ** share
                drawn = problem.prior + np.where(known, problem.doubt, 0.0) * normal
            x = np.clip(np.where(known, drawn, np.where(decades, by_decades, np.where(between, evenly, problem.start))), problem.low, problem.high)
            try:
                problem.weighted(x)
            except InputError:  # no such design
                continue
            yield x
            break


def least_squares(problem: Problem, start: Array) -> tuple[Array, float]:
    """The numbers that fit best, from a start on, and their chi^2."""
    from scipy import optimize

    scale = np.where(start != 0, np.abs(start), np.where(np.isfinite(problem.doubt), problem.doubt, 1.0))
    positive = problem.decades

    def number(u: Array) -> Array:
        return scale * np.where(positive, np.exp(np.where(positive, u, 0.0)), u)

    count = len(problem.weighted(start)[0])

    def residual(u: Array) -> Array:
        try:
            return problem.weighted(number(u))[0]
        except InputError:  # no such design: the search takes a smaller step
            return np.full(count, np.inf)

    def jacobian(u: Array) -> Array:
        return problem.weighted(number(u))[1] * np.where(positive, number(u), scale)

    with np.errstate(divide="ignore", invalid="ignore"):
        begin, low, high = (np.where(positive, np.log(edge / scale), edge / scale) for edge in (start, problem.low, problem.high))
    how: dict[str, Any] = {"x_scale": "jac", "xtol": CONVERGED, "ftol": CONVERGED, "gtol": CONVERGED, "max_nfev": 200}
    found: Any = optimize.least_squares(residual, np.clip(begin, low, high), jac=jacobian, bounds=(low, high), **how)  # pyright: ignore[reportArgumentType]
    return number(found.x), 2 * float(found.cost)
