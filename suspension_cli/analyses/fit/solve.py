"""Least-squares fit of numbers of designs to measured mode frequencies.

The fit minimises

    chi^2 = sum of ((f - measured) / uncertainty)^2 over the modes of all experiments
          + sum of ((p - prior) / uncertainty)^2 over the numbers with priors

within bounds (`search`); modes without a label are assigned anew at every step. The covariance is
the inverse of J^T J at the minimum, where J are the derivatives of the weighted residuals. The
singular values of the modes' rows of J, for relative changes of the numbers, show which
combinations the data determine.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from suspension_cli.analyses.fit import search, swapped_labels
from suspension_cli.analyses.fit.search import Problem
from suspension_cli.analyses.fit.swapped_labels import Exchange
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.linear import named_results
from suspension_cli.models import registry
from suspension_cli.scene.arrays import Array, Index

Progress = Callable[[int, int, float], None]
SIGNIFICANCE = 1e-3
"""Probability of a chi^2 this large by chance, below which a fit is a misfit."""
UNDETERMINED = 1e-10
"""Singular value relative to the largest, below which the data do not determine a combination."""


@dataclass(frozen=True)
class Fit:
    """Numbers of designs fitted to measured modes: p numbers, e experiments, k measured modes.

    Attributes
    ----------
    experiment : tuple of str
        Names of the experiments; for a single design, the name of the design.
    name : tuple of str
        Dotted paths of the fitted numbers; several experiments may share one.
    shared : (p, e) bool array
        Whether a number belongs to an experiment.
    start, value, sigma : (p,) arrays
        Values before and after the fit, and standard deviations (infinite where the data do not
        determine a number, NaN at a bound), SI. `sigma` assumes the given uncertainties of the
        measurements; multiply it by `scale` in a misfit.
    covariance : (p, p) array
    at_bound : (p,) bool array
    of : (k,) int array
        Experiment of each measured mode, from 0.
    label : tuple of str
        Labels of the measured modes.
    measured, uncertainty, before, after : (k,) arrays
        Frequencies, Hz; NaN for an unstable mode.
    chi_squared : float
        Sum over modes and priors.
    freedom : int
        Degrees of freedom: modes and priors less numbers that are not at a bound.
    singular : (s,) array
        Singular values of the derivatives of the weighted mode frequencies, for relative changes
        of the numbers: 1/singular is the relative uncertainty of a combination.
    direction : (s, p) array
        The combinations, as relative changes.
    design : tuple of str
        The fitted designs as TOML.
    ends : (n,) array
        chi^2 at the end of the search from each start, ascending; the first is that of this fit.
    exchange : Exchange or None
        In a misfit, the two labels that fit better exchanged.
    design_before : tuple of str
        The designs before the fit as TOML.
    measurements : str
        Text of the file of measured modes.
    title : str
        Title of the design, or of the measurements where there are several designs.
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
    design_before: tuple[str, ...] = ()
    measurements: str = ""
    title: str = ""

    @property
    def misfit(self) -> bool:
        """Whether a chi^2 this large has a probability below `SIGNIFICANCE`."""
        from scipy.special import chdtrc

        return self.freedom > 0 and float(chdtrc(self.freedom, self.chi_squared)) < SIGNIFICANCE

    @property
    def scale(self) -> float:
        """Factor on `sigma`: the root of chi^2 per degree of freedom in a misfit, else 1.

        Birge, Phys. Rev. 40, 207 (1932).
        """
        return float(np.sqrt(self.chi_squared / self.freedom)) if self.misfit else 1.0

    @property
    def residual(self) -> Array:
        """Residuals after the fit over the uncertainties, (k,)."""
        return (self.after - self.measured) / self.uncertainty

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the numbers, followed by their experiments where these are not all."""
        whose = [", ".join(np.array(self.experiment)[row]) for row in self.shared]
        return tuple(
            name if row.all() else f"{name} ({who})"
            for name, row, who in zip(self.name, self.shared, whose, strict=True)
        )

    @property
    def modes(self) -> tuple[str, ...]:
        """Labels of the measured modes, preceded by the experiment where there are several."""
        if len(self.experiment) == 1:
            return self.label
        return tuple(
            f"{self.experiment[n]}: {label}" for n, label in zip(self.of, self.label, strict=True)
        )


def solve(
    texts: Sequence[str],
    measured: Measured,
    files: Sequence[str] = (),
    *,
    level: str = registry.STRING.name,
    starts: int = 1,
    seed: int = 1,
    begin: Array | None = None,
    tell: Progress | None = None,
) -> Fit:
    """Fit numbers of designs to measured modes.

    Parameters
    ----------
    texts : sequence of str
        The design of each experiment as TOML.
    measured : Measured
    files : sequence of str
        Files of the designs, for errors.
    level : str
        Name of a model that supports derivatives, ``string`` or ``beam``.
    starts, seed : int
        Number of searches, all but the first from random numbers, and the seed of these; the best
        fit is returned.
    begin : (p,) array, optional
        Where the first search begins instead of at the starting values, to whose modes labels
        refer.
    tell : callable, optional
        Called with (done, all, rate per second) after each search.

    Raises
    ------
    InputError
        If a design has no such number or mode; it names no file if the measurements are wrong.
    """
    files = files or [""] * len(texts)
    problem = search.build_problem(texts, measured, files, level)
    ends, started = [], time.monotonic()
    for start in search.starts(problem, starts, seed, begin):
        ends.append(search.least_squares(problem, start))
        if tell is not None:
            tell(len(ends), starts, len(ends) / (time.monotonic() - started))
    value, _ = min(ends, key=lambda end: end[1])
    found = _summarise(problem, measured, value, np.sort([end for _, end in ends]))
    if not found.misfit:
        return found
    return replace(
        found,
        exchange=swapped_labels.find_exchange(
            problem, measured, texts, files, level, value, found.chi_squared
        ),
    )


def _summarise(problem: Problem, measured: Measured, value: Array, ends: Array) -> Fit:
    residual, slope = problem.weighted(value)
    scale = np.where(value != 0, np.abs(value), 1.0)
    at_bound = np.zeros(len(value), dtype=bool)
    for bound in (problem.low, problem.high):
        at_bound |= np.isfinite(bound) & (
            np.abs(value - np.where(np.isfinite(bound), bound, 0.0)) <= 1e-8 * scale
        )
    inner = ~at_bound
    covariance = np.full((len(value), len(value)), np.nan)
    covariance[np.ix_(inner, inner)] = _inverse(slope[:, inner] * scale[inner]) * np.outer(
        scale[inner], scale[inner]
    )
    _, singular, direction = np.linalg.svd(
        slope[: sum(map(len, measured.modes))] * scale, full_matrices=False
    )
    before, after = (
        np.where(found > 0, found, np.nan)
        for found in (problem.predict(x)[0] for x in (problem.start, value))
    )
    every = problem.experiment
    labels = [
        np.array(named_results.labels(item.nominal_modes))[item.assign_modes(value[own])]
        for item, own in zip(every, problem.shared.T, strict=True)
    ]
    return Fit(
        experiment=tuple(
            name or reader.parse(item.text).design.name
            for name, item in zip(measured.names, every, strict=True)
        ),
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
        direction=direction
        * np.where(
            direction[np.arange(len(direction)), np.abs(direction).argmax(1)] < 0, -1.0, 1.0
        )[:, None],
        design=tuple(
            reader.write_toml(item.document(value[own]))
            for item, own in zip(every, problem.shared.T, strict=True)
        ),
        ends=ends,
    )


def _inverse(slope: Array) -> Array:
    """(J^T J)^-1 of J (r, p); infinite on the diagonal for numbers that J does not determine."""
    if not slope.shape[1]:
        return np.zeros((0, 0))
    _, singular, direction = np.linalg.svd(slope, full_matrices=True)
    whole = np.zeros(slope.shape[1])
    whole[: len(singular)] = singular
    determined = whole > UNDETERMINED * whole.max()
    result = (direction[determined].T / whole[determined] ** 2) @ direction[determined]
    undetermined = (np.abs(direction[~determined]) > 1e-6).any(0)
    result[np.ix_(undetermined, undetermined)] = np.where(
        np.eye(int(undetermined.sum())) > 0, np.inf, result[np.ix_(undetermined, undetermined)]
    )
    return result
