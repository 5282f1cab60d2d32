"""Numbers of designs learned from measured frequencies: least squares.

Minimised is the sum of ((f - measured) / uncertainty)^2 over the modes of all experiments and ((p - prior) / uncertainty)^2 over numbers that were
known before, within bounds (`search`); modes without a label are matched at every step.  The covariance is the inverse of J^T J at the end, J the
weighted derivatives; what the data alone can tell apart are the singular values of their part of J, for relative changes of the numbers.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analysis import exchange, scalars, search
from suspension_cli.analysis.exchange import Exchange
from suspension_cli.analysis.search import Problem
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.design.scene import Array, Index

Tell = Callable[[int, int, float], None]
UNLIKELY = 1e-3
"""Chance that chi^2 is as large as it is, below which model and measurements do not agree within the uncertainties."""
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
        Before, after, and standard deviation if the uncertainties of the measurements are right (infinite where the data say nothing, NaN at a
        bound); SI.  Of a misfit it is to be multiplied by `scale`.
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
    ends : (n,) array
        chi^2 at which the search ended from each start, ascending: the first is that of this fit.
    exchange : Exchange or None
        Of a misfit, the two labels that should be exchanged.
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
    ends: Array
    exchange: Exchange | None = None

    @property
    def misfit(self) -> bool:
        """Whether model and measurements disagree by more than the uncertainties allow."""
        from scipy.special import chdtrc

        return self.freedom > 0 and float(chdtrc(self.freedom, self.chi_squared)) < UNLIKELY

    @property
    def scale(self) -> float:
        """By what uncertainties are to be multiplied: of a misfit the root of chi^2 per degree of freedom (Birge, Phys. Rev. 40, 207 (1932)), else 1."""
        return float(np.sqrt(self.chi_squared / self.freedom)) if self.misfit else 1.0

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


def solve(
    texts: Sequence[str],
    measured: Measured,
    files: Sequence[str] = (),
    *,
    level: str = "string",
    starts: int = 1,
    seed: int = 1,
    tell: Tell | None = None,
) -> Fit:
    """Learn numbers of designs from measured modes.

    Parameters
    ----------
    texts : sequence of str
        The design of each experiment as TOML.
    measured : Measured
    files : sequence of str
        Of the designs, for faults.
    level : str
        Rung of the models, ``string`` or ``beam``.
    starts, seed : int
        Searches, all but the first from random numbers; the best counts.
    tell : callable, optional
        Called with (done, all, rate) after each.

    Raises
    ------
    InputError
        If a number or a label is not the design's; without a file where the measurements are at fault.
    """
    problem = search.problem(texts, measured, files or [""] * len(texts), level)
    ends, began = [], time.monotonic()
    for start in search.starts(problem, starts, seed):
        ends.append(search.least_squares(problem, start))
        if tell is not None:
            tell(len(ends), starts, len(ends) / (time.monotonic() - began))
    value, _ = min(ends, key=lambda end: end[1])
    found = _summed_up(problem, measured, value, np.sort([end for _, end in ends]))
    if not found.misfit:
        return found
    return replace(found, exchange=exchange.best(problem, measured, texts, files or [""] * len(texts), level, value, found.chi_squared))


def _summed_up(problem: Problem, measured: Measured, value: Array, ends: Array) -> Fit:
    residual, slope = problem.weighted(value)
    scale = np.where(value != 0, np.abs(value), 1.0)
    at_bound = np.zeros(len(value), dtype=bool)
    for bound in (problem.low, problem.high):
        at_bound |= np.isfinite(bound) & (np.abs(value - np.where(np.isfinite(bound), bound, 0.0)) <= 1e-8 * scale)
    inner = ~at_bound
    covariance = np.full((len(value), len(value)), np.nan)
    covariance[np.ix_(inner, inner)] = _inverse(slope[:, inner] * scale[inner]) * np.outer(scale[inner], scale[inner])
    _, singular, direction = np.linalg.svd(slope[: sum(map(len, measured.modes))] * scale, full_matrices=False)
    before, after = (np.where(found > 0, found, np.nan) for found in (problem.measured(x)[0] for x in (problem.start, value)))
    every = problem.experiment
    labels = [np.array(scalars.labels(item.names))[item.places(value[own])] for item, own in zip(every, problem.shared.T, strict=True)]
    return Fit(
        experiment=tuple(name or reader.parse(item.text).design.name for name, item in zip(measured.names, every, strict=True)),
        name=tuple(item.name for item in measured.parameter),
        shared=problem.shared,
        start=problem.start,
        value=value,
        sigma=np.sqrt(np.diag(covariance)),
        covariance=covariance,
        at_bound=at_bound,
        of=np.repeat(np.arange(len(every)), [len(names) for names in labels]),
        label=tuple(str(name) for names in labels for name in names),
        measured=np.concatenate([item.frequency for item in every]),
        uncertainty=np.concatenate([item.uncertainty for item in every]),
        before=before,
        after=after,
        chi_squared=float(residual @ residual),
        freedom=len(residual) - int(inner.sum()),
        singular=singular,
        direction=direction * np.where(direction[np.arange(len(direction)), np.abs(direction).argmax(1)] < 0, -1.0, 1.0)[:, None],
        design=tuple(reader.dump(item.document(value[own])) for item, own in zip(every, problem.shared.T, strict=True)),
        ends=ends,
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
