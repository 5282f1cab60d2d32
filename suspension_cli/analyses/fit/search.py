"""Nonlinear least squares for numbers that several measured designs share.

Bounded trust regions (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)); numbers with
positive lower bounds on a logarithmic scale.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.experiment import Experiment
from suspension_cli.design import paths
from suspension_cli.design.faults import suggest
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array
from suspension_cli.studies import parameters

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.analyses.fit.array_types import ModeValues, Numbers

CONVERGED = 1e-9
"""Relative change of chi^2, numbers and gradient at which a search ends."""
MAX_DRAWS = 100
"""Attempts at drawing random numbers that give a valid design."""


@dataclass(frozen=True)
class Problem:
    """Experiments and their common free numbers.

    Attributes
    ----------
    shared
        Whether a number belongs to an experiment.
    start, low, high
        Starting values and bounds, SI.
    prior, prior_sigma
        Prior value and its standard deviation, infinite where there is none.
    """

    experiment: list[Experiment]
    shared: Bool[np.ndarray, "number experiment"]
    start: Numbers
    low: Numbers
    high: Numbers
    prior: Numbers
    prior_sigma: Numbers

    def predict(self, x: Numbers) -> tuple[ModeValues, Float[np.ndarray, "mode number"]]:
        """Compute the frequencies of all measured modes, Hz, and their derivatives."""
        rows, slopes = [], []
        for item, own in zip(self.experiment, self.shared.T, strict=True):
            frequency, slope = item.predict(x[own])
            whole = np.zeros((len(frequency), len(x)))
            whole[:, own] = slope
            rows.append(frequency)
            slopes.append(whole)
        return np.concatenate(rows), np.concatenate(slopes)

    @property
    def logarithmic(self) -> Bool[np.ndarray, " number"]:
        """Whether each number is searched on a logarithmic scale."""
        return (self.low > 0) & (self.start > 0)

    def weighted(
        self, x: Numbers
    ) -> tuple[Float[np.ndarray, " row"], Float[np.ndarray, "row number"]]:
        """Compute weighted residuals, of modes then priors, and their derivatives."""
        frequency, slope = self.predict(x)
        target, sigma = (
            np.concatenate([getattr(item, name) for item in self.experiment])
            for name in ("frequency", "uncertainty")
        )
        known = np.isfinite(self.prior_sigma)
        rows = [(frequency - target) / sigma, ((x - self.prior) / self.prior_sigma)[known]]
        return np.concatenate(rows), np.concatenate(
            [slope / sigma[:, None], np.diag(1 / self.prior_sigma)[known]]
        )


def build_problem(
    texts: Sequence[str],
    measured: Measured,
    files: Sequence[str],
    level: str = registry.STRING.name,
) -> Problem:
    """Set up the least-squares problem of one or several measured designs.

    Raises
    ------
    InputError
        If a design does not give a number, or a starting value lies outside its bounds.
    """
    free = measured.parameter
    rows = [measured.shares(n) for n in range(len(free))]
    shared = np.array(rows, dtype=bool).reshape(len(free), len(texts))
    start = _start(texts, measured, shared, level)
    low = np.array([-np.inf if item.lower is None else item.lower for item in free])
    high = np.array([np.inf if item.upper is None else item.upper for item in free])
    outside = np.flatnonzero(~((low <= start) & (start <= high)))
    if len(outside):
        n = int(outside[0])
        problem = (
            f"the design's value {start[n]:g} lies outside the bounds {low[n]:g} to {high[n]:g}"
        )
        remedy = "give a start between them, or widen them"
        raise InputError([Fault(f"parameter.{n + 1}", problem, remedy)])
    experiments = [
        Experiment(
            text,
            modes,
            [item.name for item, here in zip(free, own, strict=True) if here],
            start[own],
            measured.where(n),
            file,
            level,
        )
        for n, (text, modes, own, file) in enumerate(
            zip(texts, measured.modes, shared.T, files, strict=True)
        )
    ]
    _check_starts(experiments, shared)
    prior = np.array([0.0 if item.prior is None else item.prior for item in free])
    prior_sigma = np.array(
        [np.inf if item.uncertainty is None else item.uncertainty for item in free]
    )
    return Problem(experiments, shared, start, low, high, prior, prior_sigma)


def _start(
    texts: Sequence[str],
    measured: Measured,
    shared: Bool[np.ndarray, "number experiment"],
    level: str,
) -> Numbers:
    """Choose starting values: requested ones, else those of the designs, else the priors."""
    known = [{item.name: item.value for item in parameters.every(text, level)} for text in texts]
    found, bad = [], []
    for n, (item, own) in enumerate(zip(measured.parameter, shared, strict=True), 1):
        mine = [
            (table, name)
            for table, name, here in zip(known, measured.names, own, strict=True)
            if here
        ]
        given = {table.get(item.name, item.prior) for table, _ in mine}
        found.append(next(iter(given)) if item.start is None else item.start)
        problem, remedy = "", "give a start"
        if item.start is None and None in given:
            table, name = next((table, name) for table, name in mine if item.name not in table)
            problem = f"the design{f' of {name}' if name else ''} gives no such number"
            if any(item.name in other for other, _ in mine):
                remedy = "give a start, or list only experiments whose designs give it"
            else:
                member = item.name.rpartition(".")[2].isdigit()  # of a list that is missing
                remedy = f"{'' if member else 'give a start; '}{suggest(item.name, list(table))}"
        elif item.start is None and len(given) > 1:
            problem = "has different values in the designs that share it"
        if problem:
            bad.append(Fault(f"parameter.{n}.name", problem, remedy, format_value(item.name)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _check_starts(
    experiments: list[Experiment], shared: Bool[np.ndarray, "number experiment"]
) -> None:
    """Attribute errors in starting values to the file of measurements that gives them."""
    bad: dict[Fault, None] = {}
    for experiment, own in zip(experiments, shared.T, strict=True):
        try:
            experiment.design(experiment.start)
        except InputError as error:
            numbers = zip(np.flatnonzero(own), experiment.free, experiment.start, strict=True)
            for (n, name, x), fault in itertools.product(numbers, error.faults):
                if fault.key in paths.twins(name) or (fault.value or "").startswith(f'"{name}='):
                    problem = f"{name}: {fault.problem}"
                    bad[Fault(f"parameter.{n + 1}", problem, fault.remedy, f"{x:g}")] = None
    if bad:
        raise InputError(list(bad))


def starts(
    problem: Problem, count: int, seed: int, begin: Numbers | None = None
) -> Iterator[Numbers]:
    """Yield starting values: `begin` or else the given ones, then random ones.

    Numbers with a prior are drawn from it, others evenly between their bounds (in the logarithm if
    these are positive). Numbers without either keep their starting value.
    """
    yield problem.start if begin is None else begin
    random = np.random.default_rng(seed)
    known = np.isfinite(problem.prior_sigma)
    bounded = np.isfinite(problem.low) & np.isfinite(problem.high)
    logarithmic = problem.logarithmic & bounded
    for _ in range(count - 1):
        for _ in range(MAX_DRAWS):
            fraction = random.random(len(problem.start))
            normal = random.standard_normal(len(problem.start))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                even = problem.low + fraction * (problem.high - problem.low)
                geometric = problem.low * (problem.high / problem.low) ** fraction
                drawn = problem.prior + np.where(known, problem.prior_sigma, 0.0) * normal
            x = np.select([known, logarithmic, bounded], [drawn, geometric, even], problem.start)
            x = np.clip(x, problem.low, problem.high)
            try:
                problem.weighted(x)
            except InputError:  # an invalid design
                continue
            yield x
            break


def least_squares(problem: Problem, start: Numbers) -> tuple[Numbers, float]:
    """Minimise chi^2 from starting values; return the numbers and their chi^2."""
    from scipy import optimize

    sigma = problem.prior_sigma
    scale = np.where(start != 0, np.abs(start), np.where(np.isfinite(sigma), sigma, 1.0))
    positive = problem.logarithmic

    def number(u: Array) -> Array:
        return scale * np.where(positive, np.exp(np.where(positive, u, 0.0)), u)

    count = len(problem.weighted(start)[0])

    def residual(u: Array) -> Array:
        try:
            return problem.weighted(number(u))[0]
        except InputError:  # after an invalid design the step is shortened
            return np.full(count, np.inf)

    def jacobian(u: Array) -> Array:
        return problem.weighted(number(u))[1] * np.where(positive, number(u), scale)

    with np.errstate(divide="ignore", invalid="ignore"):
        begin, low, high = (
            np.where(positive, np.log(edge / scale), edge / scale)
            for edge in (start, problem.low, problem.high)
        )
    found = optimize.least_squares(
        residual,
        np.clip(begin, low, high),
        jac=jacobian,  # pyright: ignore[reportArgumentType]
        bounds=(low, high),
        x_scale="jac",
        xtol=CONVERGED,
        ftol=CONVERGED,
        gtol=CONVERGED,
        max_nfev=200,
    )
    return number(found.x), 2 * float(found.cost)
