"""Least-squares fit of numbers of designs to measured mode frequencies and transfer functions.

The fit minimises

    chi^2 = sum of ((f - measured) / uncertainty)^2 over the modes of all experiments
          + sum of ((p - prior) / uncertainty)^2 over the numbers with priors

within bounds (`search`); modes without a label are assigned again at every step. The covariance is
(J^T J)^-1 at the minimum, with the derivatives J of the weighted residuals. The singular values of
the modes' rows of J, for relative changes of the numbers, show which combinations are determined.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.fit import (
    channels,
    default_numbers,
    findings,
    response_fit,
    response_problem,
    search,
    swapped_labels,
)
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.fit.search import Problem
from suspension_cli.analyses.fit.swapped_labels import Exchange
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import named_results
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models import registry

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.analyses.fit.array_types import (
        ModeIndex,
        ModeValues,
        NumberMatrix,
        Numbers,
    )

SIGNIFICANCE = 1e-3
"""Probability of a chi^2 this large by chance below which a fit is a misfit."""
UNDETERMINED = 1e-10
"""Singular value relative to the largest, below which the data do not determine a combination."""


@dataclass(frozen=True)
class Fit:
    """Numbers of designs fitted to measured modes.

    Attributes
    ----------
    experiment
        Names of the experiments; that of the design if there is one.
    name, shared
        Dotted paths of the fitted numbers, and the experiments to which each belongs.
    start, value, sigma
        Values before and after the fit, and standard deviations (infinite where not determined,
        NaN at a bound), SI. `sigma` and `covariance` follow from the given uncertainties; in a
        misfit, multiply them by `scale` and by its square.
    of, label
        Experiment of each measured mode, from 0, and its label.
    measured, uncertainty, before, after
        Frequencies, Hz; NaN for an unstable mode.
    chi_squared, freedom
        Sum over modes and priors; and their number less that of numbers not at a bound.
    singular, direction
        Singular values of the derivatives of the weighted mode frequencies by relative changes of
        the numbers; 1/singular is the relative uncertainty of the combination `direction`.
    design, design_before
        Designs after and before the fit as TOML.
    ends
        chi^2 at the end of each search, ascending; the first is that of this fit.
    exchange
        In a misfit, two labels that fit better exchanged.
    measurements
        Text of the file of measurements.
    title
        Title of the design, or of the measurements of several designs.
    responses
        Fit of transfer functions; None if only modes were measured.
    """

    experiment: tuple[str, ...]
    name: tuple[str, ...]
    shared: Bool[np.ndarray, "number experiment"]
    start: Numbers
    value: Numbers
    sigma: Numbers
    covariance: NumberMatrix
    at_bound: Bool[np.ndarray, " number"]
    of: ModeIndex
    label: tuple[str, ...]
    measured: ModeValues
    uncertainty: ModeValues
    before: ModeValues
    after: ModeValues
    chi_squared: float
    freedom: int
    singular: Float[np.ndarray, " combination"]
    direction: Float[np.ndarray, "combination number"]
    design: tuple[str, ...]
    ends: Float[np.ndarray, " start"]
    exchange: Exchange | None = None
    design_before: tuple[str, ...] = ()
    measurements: str = ""
    title: str = ""
    responses: ResponseFit | None = None

    @property
    def misfit(self) -> bool:
        """Whether a chi^2 this large has a probability below `SIGNIFICANCE`."""
        from scipy.special import chdtrc

        return self.freedom > 0 and float(chdtrc(self.freedom, self.chi_squared)) < SIGNIFICANCE

    @property
    def scale(self) -> float:
        """Factor on `sigma` (Birge, Phys. Rev. 40, 207 (1932)).

        The root of chi^2 per degree of freedom in a misfit, else 1.
        """
        return float(np.sqrt(self.chi_squared / self.freedom)) if self.misfit else 1.0

    @property
    def residual(self) -> ModeValues:
        """Residuals after the fit over the uncertainties."""
        return (self.after - self.measured) / self.uncertainty

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the numbers, followed by their experiments unless these are all."""
        whose = [", ".join(np.array(self.experiment)[row]) for row in self.shared]
        return tuple(
            name if row.all() else f"{name} ({who})"
            for name, row, who in zip(self.name, self.shared, whose, strict=True)
        )

    @property
    def modes(self) -> tuple[str, ...]:
        """Labels of the measured modes, preceded by the experiment if there are several."""
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
    begin: Numbers | None = None,
    tell: Progress | None = None,
) -> Fit:
    """Fit numbers of designs to measured modes.

    Parameters
    ----------
    texts
        The design of each experiment as TOML.
    files
        Files of the designs, for errors.
    level
        Name of a model that supports derivatives, ``string`` or ``beam``.
    starts, seed
        Number of searches, of which the best is returned, and the seed of the random numbers where
        all but the first start.
    begin
        Where the first search begins. Labels still refer to the modes at the starting values, which
        are the default.
    tell
        Called with (done, all, rate per second) after each search.

    Raises
    ------
    InputError
        If a design has no such number or mode. It names no file if the measurements are at fault.
    """
    files = files or [""] * len(texts)
    problem = search.build_problem(texts, measured, files, level)
    ends = [
        search.least_squares(problem, start)
        for start in _reporting(search.starts(problem, starts, seed, begin), starts, tell)
    ]
    value, _ = min(ends, key=lambda end: end[1])
    residual, slope = problem.weighted(value)
    scale = np.where(value != 0, np.abs(value), 1.0)
    edges = np.array([problem.low, problem.high])
    with np.errstate(invalid="ignore"):
        at_bound = (np.abs(value - edges) <= 1e-8 * scale).any(0)
    inner = ~at_bound
    covariance = np.full((len(value), len(value)), np.nan)
    covariance[np.ix_(inner, inner)] = _inverse(slope[:, inner] * scale[inner]) * np.outer(
        scale[inner], scale[inner]
    )
    modes = sum(map(len, measured.modes))
    _, singular, direction = np.linalg.svd(slope[:modes] * scale, full_matrices=False)
    found = _collect(
        problem,
        measured,
        value,
        covariance,
        chi_squared=float(residual @ residual),
        freedom=len(residual) - int(inner.sum()),
        singular=singular,
        direction=direction,
        ends=np.sort([end for _, end in ends]),
    )
    if not found.misfit:
        return found
    exchange = swapped_labels.find_exchange(
        problem, measured, texts, files, level, value, found.chi_squared
    )
    return replace(found, exchange=exchange)


def _reporting(starts: Iterator[Numbers], count: int, tell: Progress | None) -> Iterator[Numbers]:
    """Yield starting values; report the progress after each search."""
    started = time.monotonic()
    for n, start in enumerate(starts, 1):
        yield start
        if tell is not None:
            tell(n, count, n / (time.monotonic() - started))


def solve_responses(
    text: str,
    measured: Measured,
    functions: Sequence[MeasuredResponse],
    file: str = "",
    *,
    level: str = registry.STRING.name,
    starts: int = 1,
    seed: int = 1,
    begin: Numbers | None = None,
    explain: bool = True,
    tell: Progress | None = None,
) -> Fit:
    """Fit numbers of one design to measured transfer functions, and to any measured modes.

    Parameters
    ----------
    text
        The design as TOML.
    measured
        Free numbers (`default_numbers` if there are none), sensors and actuators, modes.
    file
        File of the design, for errors.
    level
        Name of a model that supports derivatives.
    starts, seed, begin, tell
        See `solve`.
    explain
        Whether to rank single changes and further measurements.

    Raises
    ------
    InputError
        If a function has no uncertainty, or names no signal of the design.
    """
    _check_uncertainties(functions)
    if not measured.parameter:
        measured = msgspec.structs.replace(measured, parameter=default_numbers.choose(text, level))
    system = registry.by_name(level).system(reader.parse(text))
    problem = response_problem.build(
        text, measured, channels.build(measured, functions, system), file, level
    )
    p, free = problem.numbers, problem.base.experiment[0].free
    ends = [
        response_fit.solve(problem, np.concatenate([x, problem.start[p:]]))
        for x in _reporting(search.starts(problem.base, starts, seed, begin), starts, tell)
    ]
    found = min(ends, key=lambda end: end.chi_squared)
    start = response_fit.onto(problem, found.problem, problem.start)
    spread = findings.covariance(found.problem, found.z)
    extra: dict[str, Any] = {"sentences": findings.describe(found.problem, found.z, free)}
    if explain:
        before, changes = findings.single_changes(found, text, measured, file, start)
        least = findings.least_known(found.problem, spread)
        which, candidates = findings.next_measurements(found, least)
        extra |= {"chi_squared_before": before, "changes": changes, "candidates": candidates}
        extra["least"] = "" if which is None else free[which]
    value = found.z[:p]
    relative = np.where(value != 0, np.abs(value), 1.0) / problem.scale[:p]
    known = findings.data_information(found.problem, found.z) * np.outer(relative, relative)
    squared, vectors = np.linalg.eigh(known)
    return _collect(
        problem.base,
        measured,
        value,
        spread[:p, :p],
        chi_squared=found.chi_squared,
        freedom=found.freedom + int(np.isnan(np.diag(spread)).sum()),
        singular=np.sqrt(np.clip(squared, 0.0, None))[::-1],
        direction=vectors.T[::-1],
        ends=np.sort([end.chi_squared for end in ends]),
        responses=response_fit.collect(found, start, spread, **extra),
    )


def _check_uncertainties(functions: Sequence[MeasuredResponse]) -> None:
    bad = []
    for n, item in enumerate(functions, 1):
        sigma = np.asarray(item.uncertainty, dtype=float)
        if not (np.isfinite(sigma) & (sigma > 0)).all():
            bad.append(
                Fault(
                    f"transfer_function.{n}",
                    f"{item.name} gives no uncertainty at some frequencies, without which values"
                    " have no weight",
                    "give uncertainty (a column, or 0.05 for 5 %), or coherence and averages; or"
                    " fit with --relative-uncertainty 0.05",
                )
            )
    if bad:
        raise InputError(bad)


def _collect(
    problem: Problem, measured: Measured, value: Numbers, covariance: NumberMatrix, **rest: Any
) -> Fit:
    """Collect the result of a fit; `rest` are further attributes.

    Numbers at a bound have NaN in the covariance. The largest coefficient of a combination is made
    positive.
    """
    every = problem.experiment
    own = [value[here] for here in problem.shared.T]
    labels = [
        np.array(named_results.labels(item.nominal_modes))[item.assign_modes(x)].tolist()
        if item.mode
        else []
        for item, x in zip(every, own, strict=True)
    ]
    before, after = (
        np.where(found > 0, found, np.nan)
        for found in (problem.predict(x)[0] for x in (problem.start, value))
    )
    direction = rest.pop("direction")
    if direction.size:
        largest = direction[np.arange(len(direction)), np.abs(direction).argmax(1)]
        direction = direction * np.where(largest < 0, -1.0, 1.0)[:, None]
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
        at_bound=np.isnan(np.diag(covariance)),
        of=np.repeat(np.arange(len(every)), [len(names) for names in labels]),
        label=tuple(name for names in labels for name in names),
        measured=np.concatenate([item.frequency for item in every]),
        uncertainty=np.concatenate([item.uncertainty for item in every]),
        before=before,
        after=after,
        direction=direction,
        design=tuple(
            reader.write_toml(item.document(x)) for item, x in zip(every, own, strict=True)
        ),
        **rest,
    )


def _inverse(slope: Float[np.ndarray, "row number"]) -> NumberMatrix:
    """(J^T J)^-1 of J; infinite on the diagonal for numbers that J does not determine."""
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
