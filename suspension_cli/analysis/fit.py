"""Numbers of designs learned from measured frequencies: least squares with exact derivatives.

Minimised is the sum of ((f - measured) / uncertainty)^2 over the modes of all experiments and ((p - prior) / uncertainty)^2 over numbers that were
known before, within bounds (trust region; Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1 (1999)).  The covariance is the inverse of J^T J at the
end, J the weighted derivatives; what the data alone can tell apart are the singular values of their part of J, for relative changes of the numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis import parameters, scalars
from suspension_cli.analysis.experiment import Experiment
from suspension_cli.design import reader
from suspension_cli.design.faults import suggestion
from suspension_cli.design.measured import Free, Measured
from suspension_cli.design.scene import Array, Index
from suspension_cli.errors import Fault, InputError, shown

ROUNDS = 8
"""Times that modes without a label are matched anew."""
CONVERGED = 1e-9
BLIND = 1e-10
"""Singular value, of the largest, below which the data say nothing of a combination."""


@dataclass(frozen=True)
class Fit:
    """What measured modes say of designs.

    Attributes
    ----------
    experiment : tuple of str
        Names; of one design beside its measurements, the design's.
    name : tuple of str
        Numbers learned, as dotted paths; numbers of different experiments may share one.
    shared : (p, e) bool array
        Which experiments a number belongs to.
    start, value, sigma : (p,) arrays
        Before, after, and standard deviation (infinite where the data say nothing, NaN at a bound); SI.
    covariance : (p, p) array
    at_bound : (p,) bool array
    of : (k,) int array
        Experiment of each measured mode, from 0.
    label : tuple of str
        Of the measured modes.
    measured, uncertainty, before, after : (k,) arrays
        Hz.
    chi_squared : float
        Of modes and priors.
    freedom : int
        Modes and priors less numbers.
    singular : (s,) array
        Of the modes' derivatives in units of their uncertainties, for relative changes of the numbers: 1/singular is the relative
        uncertainty of a combination.
    direction : (s, p) array
        The combinations, as relative changes.
    design : tuple of str
        The fitted designs as TOML.
    """

    experiment: tuple[str, ...]
    name: tuple[str, ...]
    shared: Any
    start: Array
    value: Array
    sigma: Array
    covariance: Array
    at_bound: Any
    of: Index
    label: tuple[str, ...]
    measured: Array
    uncertainty: Array
    before: Array
    after: Array
    chi_squared: float
    freedom: int
    singular: Array
    direction: Array
    design: tuple[str, ...]

    @property
    def residual(self) -> Array:
        """After the fit, in units of the uncertainty, (k,)."""
        return (self.after - self.measured) / self.uncertainty

    @property
    def parameters(self) -> tuple[str, ...]:
        """The numbers with the experiments that they belong to, where these are not all."""
        whose = [", ".join(np.array(self.experiment)[row]) for row in self.shared]
        return tuple(name if row.all() else f"{name} ({who})" for name, row, who in zip(self.name, self.shared, whose, strict=True))

    @property
    def modes(self) -> tuple[str, ...]:
        """The measured modes with their experiments, where there are several."""
        if len(self.experiment) == 1:
            return self.label
        return tuple(f"{self.experiment[n]}: {label}" for n, label in zip(self.of, self.label, strict=True))


@dataclass(frozen=True)
class _Problem:
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

    def places(self, x: Array) -> list[list[int]]:
        """Which mode each measurement is of."""
        return [item.places(x[own]) for item, own in zip(self.experiment, self.shared.T, strict=True)]

    def measured(self, x: Array, places: list[list[int]]) -> tuple[Array, Array]:
        """Frequencies (k,) of the modes measured and their derivatives (k, p)."""
        rows, slopes = [], []
        for item, own, which in zip(self.experiment, self.shared.T, places, strict=True):
            frequency, slope = item.measured(x[own], which)
            whole = np.zeros((len(which), len(x)))
            whole[:, own] = slope
            rows.append(frequency)
            slopes.append(whole)
        return np.concatenate(rows), np.concatenate(slopes)

    def weighted(self, x: Array, places: list[list[int]]) -> tuple[Array, Array]:
        """Residuals and their derivatives in units of the uncertainties: modes, then priors."""
        frequency, slope = self.measured(x, places)
        target, sigma = (np.concatenate([getattr(item, name) for item in self.experiment]) for name in ("frequency", "uncertainty"))
        known = np.isfinite(self.doubt)
        rows = [(frequency - target) / sigma, ((x - self.prior) / self.doubt)[known]]
        return np.concatenate(rows), np.concatenate([slope / sigma[:, None], np.diag(1 / self.doubt)[known]])


def solve(texts: Sequence[str], measured: Measured, files: Sequence[str] = ()) -> Fit:
    """Learn numbers of designs from measured modes.

    Parameters
    ----------
    texts : sequence of str
        The design of each experiment as TOML.
    measured : Measured
    files : sequence of str
        Of the designs, for faults.

    Raises
    ------
    InputError
        If a number or a label is not the design's; without a file where the measurements are at fault.
    """
    problem = _problem(texts, measured, files or [""] * len(texts))
    places = problem.places(problem.start)
    value = _least_squares(problem, places, problem.start)
    for _ in range(ROUNDS):
        now = problem.places(value)
        if now == places:
            break
        places, value = now, _least_squares(problem, now, value)
    return _summed_up(problem, measured, places, value)


def _problem(texts: Sequence[str], measured: Measured, files: Sequence[str]) -> _Problem:
    free = measured.parameter
    shared = np.array([measured.shares(n) for n in range(len(free))])
    start = _start(texts, free, shared)
    low = np.array([-np.inf if item.lower is None else item.lower for item in free])
    high = np.array([np.inf if item.upper is None else item.upper for item in free])
    outside = np.flatnonzero(~((low <= start) & (start <= high)))
    if len(outside):
        n = int(outside[0])
        raise InputError([Fault(f"parameter.{n + 1}", f"the design's value {start[n]:g} lies outside the bounds", "give a start within them")])
    experiments = [
        Experiment(text, modes, [item.name for item, here in zip(free, own, strict=True) if here], start[own], measured.where(n), file)
        for n, (text, modes, own, file) in enumerate(zip(texts, measured.modes, shared.T, files, strict=True))
    ]
    prior = np.array([0.0 if item.prior is None else item.prior for item in free])
    doubt = np.array([np.inf if item.uncertainty is None else item.uncertainty for item in free])
    return _Problem(experiments, shared, start, low, high, prior, doubt)


def _start(texts: Sequence[str], free: list[Free], shared: Any) -> Array:
    """Where the search begins: as asked, else as the designs have it, else what was known before."""
    known = [{item.name: item.value for item in parameters.every(text)} for text in texts]
    found, bad = [], []
    for n, (item, own) in enumerate(zip(free, shared, strict=True), 1):
        mine = [table for table, here in zip(known, own, strict=True) if here]
        given = {table.get(item.name, item.prior) for table in mine}
        if item.start is None and None in given:
            remedy = suggestion(item.name, list(mine[0])) + "; or give a start"
            bad.append(Fault(f"parameter.{n}.name", "is no number that the design gives", remedy, shown(item.name)))
        elif item.start is None and len(given) > 1:
            bad.append(Fault(f"parameter.{n}.name", "has different values in the designs that share it", "give a start", shown(item.name)))
        found.append(item.start if item.start is not None else next(iter(given)))
    if bad:
        raise InputError(bad)
    return np.array(found, dtype=float)


def _least_squares(problem: _Problem, places: list[list[int]], value: Array) -> Array:
    """The numbers that fit best."""
    from scipy.optimize import least_squares

    scale = np.where(value != 0, np.abs(value), np.where(np.isfinite(problem.doubt), problem.doubt, 1.0))
    positive = (problem.low > 0) & (value > 0)  # a stiffness, say, is looked for over decades

    def number(u: Array) -> Array:
        return scale * np.where(positive, np.exp(np.where(positive, u, 0.0)), u)

    count = len(problem.weighted(value, places)[0])

    def residual(u: Array) -> Array:
        try:
            return problem.weighted(number(u), places)[0]
        except InputError:  # no such design: the search takes a smaller step
            return np.full(count, np.inf)

    def jacobian(u: Array) -> Array:
        return problem.weighted(number(u), places)[1] * np.where(positive, number(u), scale)

    with np.errstate(divide="ignore", invalid="ignore"):
        begin, low, high = (np.where(positive, np.log(edge / scale), edge / scale) for edge in (value, problem.low, problem.high))
    how: dict[str, Any] = {"x_scale": "jac", "xtol": CONVERGED, "ftol": CONVERGED, "gtol": CONVERGED, "max_nfev": 200}
    found: Any = least_squares(residual, np.clip(begin, low, high), jac=jacobian, bounds=(low, high), **how)  # pyright: ignore[reportArgumentType]
    return number(found.x)


def _summed_up(problem: _Problem, measured: Measured, places: list[list[int]], value: Array) -> Fit:
    residual, slope = problem.weighted(value, places)
    scale = np.where(value != 0, np.abs(value), 1.0)
    at_bound = np.zeros(len(value), dtype=bool)
    for bound in (problem.low, problem.high):
        at_bound |= np.isfinite(bound) & (np.abs(value - np.where(np.isfinite(bound), bound, 0.0)) <= 1e-8 * scale)
    inner = ~at_bound
    covariance = np.full((len(value), len(value)), np.nan)
    covariance[np.ix_(inner, inner)] = _inverse(slope[:, inner] * scale[inner]) * np.outer(scale[inner], scale[inner])
    _, singular, direction = np.linalg.svd(slope[: sum(map(len, places))] * scale, full_matrices=False)
    before, after = (np.where(found > 0, found, np.nan) for found in (problem.measured(x, places)[0] for x in (problem.start, value)))
    every = problem.experiment
    labels = [scalars.labels(item.names) for item in every]
    return Fit(
        experiment=tuple(name or reader.parse(item.text).design.name for name, item in zip(measured.names, every, strict=True)),
        name=tuple(item.name for item in measured.parameter),
        shared=problem.shared,
        start=problem.start,
        value=value,
        sigma=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        at_bound=at_bound,
        of=np.repeat(np.arange(len(every)), [len(which) for which in places]),
        label=tuple(names[n] for names, which in zip(labels, places, strict=True) for n in which),
        measured=np.concatenate([item.frequency for item in every]),
        uncertainty=np.concatenate([item.uncertainty for item in every]),
        before=before,
        after=after,
        chi_squared=float(residual @ residual),
        freedom=len(residual) - int(inner.sum()),
        singular=singular,
        direction=direction * np.where(direction[np.arange(len(direction)), np.abs(direction).argmax(1)] < 0, -1.0, 1.0)[:, None],
        design=tuple(reader.dump(item.document(value[own])) for item, own in zip(every, problem.shared.T, strict=True)),
    )


def _inverse(slope: Array) -> Array:
    """(J^T J)^-1; infinite on the diagonal for numbers that J does not tell."""
    if not slope.shape[1]:
        return np.zeros((0, 0))
    _, singular, direction = np.linalg.svd(slope, full_matrices=True)
    whole = np.zeros(slope.shape[1])
    whole[: len(singular)] = singular
    told = whole > BLIND * whole.max()
    result = (direction[told].T / whole[told] ** 2) @ direction[told]
    blind = (np.abs(direction[~told]) > 1e-6).any(0)
    result[np.ix_(blind, blind)] = np.where(np.eye(int(blind.sum())) > 0, np.inf, result[np.ix_(blind, blind)])
    return result
