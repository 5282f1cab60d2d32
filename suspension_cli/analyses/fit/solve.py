"""Least-squares fit of parameters of designs to measured modes, quantities, transfer functions.

    found = solve([design_text], measured.read("measured.toml"), level="beam")
    found.value, found.sigma  # of the parameters
    found.chi_squared, found.freedom

The fit minimises chi^2, the sum of squares of `problem.residual`: of measured modes, quantities,
transfer functions and priors.

1. Exchanged, scaled and inverted channels are found (`start`).
2. The parameters are fitted to the resonances, then all unknowns to the complex values, to modes
   and to quantities.
3. While that is a misfit, the search starts again elsewhere (`chi_squared_search`).

Modes and quantities alone need one search. Uncertainties are those of the linear problem at the
end: the covariance is (J^T J)^-1.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.fit import determined, missing_links, next_measurements, start
from suspension_cli.analyses.fit.changes import single_changes
from suspension_cli.analyses.fit.chi_squared_search import Search, search
from suspension_cli.analyses.fit.experiment import Build
from suspension_cli.analyses.fit.explanations import Exchange
from suspension_cli.analyses.fit.least_squares import covariance, data_rows, minimise
from suspension_cli.analyses.fit.problem import Problem
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.fit.result import Fitted, is_unlikely
from suspension_cli.analyses.fit.solution import Solution, best_of
from suspension_cli.analyses.logs import Progress
from suspension_cli.conventions import GROUND
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.design.significant_digits import round_to_digits
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import signals
from suspension_cli.measurements.resonances import find_peaks
from suspension_cli.measurements.transfer_function import Channels, MeasuredResponse
from suspension_cli.models import registry

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

BEYOND = 1.5
"""Factor by which the band of modes with added damping exceeds the measured one."""
NEARLY: dict[str, Any] = {"tolerance": 1e-7, "held": True}
"""End of the search before the last one, whose derivatives are exact."""
EXCHANGES = 3
"""Most exchanges of labels that are fitted."""
NEGLIGIBLE = 0.1
"""Standard errors by which rounding may change a combination of parameters."""
FEWEST_DIGITS = 3
MOST_DIGITS = 12
"""Significant digits of written parameters that are tried."""
WORTH_REPORTING = 0.1
"""Fraction of chi^2 below which an exchange of labels is reported."""


def solve(
    texts: Sequence[str],
    measured: Measured,
    files: Sequence[str] = (),
    functions: Sequence[MeasuredResponse] = (),
    *,
    level: str = registry.STRING.name,
    starts: int = 1,
    seed: int = 1,
    explain: bool = True,
    tell: Progress | None = None,
) -> Fitted:
    """Fit parameters of designs to measured modes and quantities, of one to transfer functions.

    `texts` are the designs (TOML) and `files` their files, for errors; `level` is a model that
    supports derivatives. Of `starts` searches, all but the first from random parameters, the best
    is returned; `tell` is called with (done, all, rate per second) after each. If `explain`, single
    changes and further measurements are ranked, for transfer functions. Raises `InputError`, which
    names no file if the measurements are at fault.
    """
    if functions and not measured.parameter:
        free = start.default_parameters(texts[0], level)
        measured = msgspec.structs.replace(measured, parameter=free)
    problem = start.build(texts, measured, files or [""] * len(texts), level)
    if functions:
        problem = with_functions(problem, measured, functions)
    ends = _first_searches(problem, starts, seed, tell)
    found = best_of(ends)
    changes = None
    if functions:
        if explain or found.misfit:
            again = Search.of(Solution(problem, problem.unknowns.start), found)
            found = again.go_on()
            changes = again.changes
        found = found.descend(found.z, **NEARLY)
        found = found.descend(found.z)
    slope = found.problem.jacobian(found.z)
    others = np.sort([end.chi_squared for end in ends])[1:]
    reached = np.append(found.chi_squared, others)
    result = _collect(found, slope, measured, reached)
    if not functions:
        return replace(result, exchange=_find_exchange(found)) if result.misfit else result
    responses = _responses(found, slope)
    result = replace(result, responses=responses)
    if result.misfit:
        responses = replace(responses, links=missing_links.find(found, result.excess))
    if explain and changes is not None:
        before, single = single_changes(changes, found)
        least, candidates = next_measurements.find(found.problem, found.z, slope)
        responses = replace(
            responses,
            chi_squared_before=before,
            changes=single,
            least=least,
            candidates=candidates,
        )
    return replace(result, responses=responses)


def _first_searches(
    problem: Problem, starts: int, seed: int, tell: Progress | None
) -> list[Solution]:
    """Search once from each start; random ones may be invalid designs."""
    ends: list[Solution] = []
    started = time.monotonic()
    for x in _starts(problem, starts, seed):
        z = np.concatenate([x, problem.unknowns.start[problem.count :]])
        try:
            ends.append(search(Solution(problem, z)))
        except InputError:
            if not ends:
                raise
            continue
        if tell is not None:
            tell(len(ends), starts, len(ends) / (time.monotonic() - started))
    return ends


def with_functions(
    problem: Problem, measured: Measured, functions: Sequence[MeasuredResponse]
) -> Problem:
    """Add measured functions to the problem of one design."""
    bad = []
    for n, item in enumerate(functions, 1):
        sigma = np.asarray(item.uncertainty, dtype=float)
        if not (np.isfinite(sigma) & (sigma > 0)).all():
            what = f"{item.name} gives no uncertainty at some frequencies, so they have no weight"
            remedy = (
                "give uncertainty (a column, or 0.05 for 5 %), or coherence and averages; or fit"
                " with --relative-uncertainty 0.05"
            )
            bad.append(Fault(f"transfer_function.{n}", what, remedy))
    if bad:
        raise InputError(bad)
    plant = problem.experiment[0].nominal
    made = Channels.of(measured, functions)
    # motions of the ground beside the support are not fitted
    known = [name for name in signals.bodies_with_signals(plant.system) if name != GROUND]
    peaks = [[peak for peak in find_peaks(item) if peak.sigma >= 0] for item in functions]
    read = readings.parse(made, measured, tuple(known))
    problem = replace(problem, channels=made, signals=read, peaks=peaks)
    every = np.concatenate([item.frequency for item in functions])
    hz = plant.modes.frequency
    inside = (hz > every.min() / BEYOND) & (hz < every.max() * BEYOND)
    return replace(problem, damped=np.flatnonzero(inside & problem.residues(plant).any(0)))


def _starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """Yield starting values of the parameters: the given ones, then random ones.

    Parameters with a prior are drawn from it, others evenly between their bounds (in the logarithm
    if these are positive). Parameters without either keep their starting value.
    """
    yield problem.base
    random = np.random.default_rng(seed)
    low, high, prior, sigma = (part[: problem.count] for part in problem.unknowns[2:6])
    known = np.isfinite(sigma)
    bounded = np.isfinite(low) & np.isfinite(high)
    for _ in range(count - 1):
        fraction = random.random(len(low))
        normal = random.standard_normal(len(low))
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            even = low + fraction * (high - low)
            geometric = low * (high / low) ** fraction
            drawn = prior + np.where(known, sigma, 0.0) * normal
        kinds = [known, bounded & (low > 0), bounded]
        yield np.clip(np.select(kinds, [drawn, geometric, even], problem.base), low, high)


def _find_exchange(found: Solution) -> Exchange | None:
    """Find two labels of one experiment whose exchange removes a misfit; None if none does.

    Pairs are ranked by chi^2 at the start of the fit; the best few are fitted.
    """
    problem = found.problem
    ranked: list[tuple[Exchange, Problem]] = []
    for e, item in enumerate(problem.experiment):
        for i, j in itertools.combinations(range(len(item.mode)), 2):
            first = item.mode[i].label
            second = item.mode[j].label
            if first is None or second is None:
                continue
            modes = list(item.mode)
            modes[i] = msgspec.structs.replace(modes[i], label=second)
            modes[j] = msgspec.structs.replace(modes[j], label=first)
            other = [*problem.experiment]
            other[e] = replace(item, mode=modes)
            tried = replace(problem, experiment=other)
            ranked.append((Exchange(e, (first, second), tried.chi_squared(tried.base)), tried))
    ranked.sort(key=lambda pair: pair[0].chi_squared)
    fitted: list[Exchange] = []
    for one, tried in ranked[:EXCHANGES]:
        _, chi_squared = minimise(tried, tried.base)
        fitted.append(replace(one, chi_squared=chi_squared))
    best = min(fitted, key=lambda one: one.chi_squared, default=None)
    worthy = best is not None and best.chi_squared < WORTH_REPORTING * found.chi_squared
    return best if worthy else None


def _collect(found: Solution, slope: Array, measured: Measured, ends: Array) -> Fitted:
    """Collect the result of a fit. Parameters at a bound have NaN in the covariance."""
    problem = found.problem
    p = problem.count
    every = problem.experiment
    value = found.z[:p]
    builds = [one.at(value[here]) for one, here in zip(every, problem.shared.T, strict=True)]
    labels = [
        [one.labels[mode] for mode in one.assign_modes(np.array(build.x))] if one.mode else []
        for one, build in zip(every, builds, strict=True)
    ]
    before, after = (problem.predict_modes(x)[0] for x in (problem.base, value))
    spread = covariance(problem, found.z, slope)
    inner = int((~np.isnan(np.diag(spread))).sum())
    freedom = len(slope) - inner
    scale = 1.0
    if freedom > 0 and is_unlikely(found.chi_squared, len(slope), inner):
        scale = float(np.sqrt(found.chi_squared / freedom))
    digits, rounded = _round_builds(found, slope / scale)
    relative = np.where(value != 0, np.abs(value), 1.0)
    rows = data_rows(problem, slope) * relative
    _, singular, direction = np.linalg.svd(rows, full_matrices=False)
    if direction.size:
        largest = direction[np.arange(len(direction)), np.abs(direction).argmax(1)]
        direction = direction * np.where(largest < 0, -1.0, 1.0)[:, None]
    names = zip(measured.names, every, strict=True)
    result = Fitted(
        experiment=tuple(name or reader.parse(one.text).design.name for name, one in names),
        name=tuple(item.name for item in problem.free),
        shared=problem.shared,
        start=problem.base,
        value=value,
        sigma=scale * np.sqrt(np.diag(spread)[:p]),
        prior=problem.unknowns.prior[:p],
        prior_sigma=problem.unknowns.sigma[:p],
        covariance=scale**2 * spread[:p, :p],
        scale=scale,
        at_bound=np.isnan(np.diag(spread)[:p]),
        of=np.repeat(np.arange(len(every)), [len(names) for names in labels]),
        label=tuple(name for names in labels for name in names),
        measured=problem.measured_modes[0],
        uncertainty=problem.measured_modes[1],
        before=np.where(before > 0, before, np.nan),
        after=np.where(after > 0, after, np.nan),
        value_of=np.repeat(np.arange(len(every)), [len(one.quantities) for one in every]),
        quantity=tuple(one.text for item in every for one in item.quantities),
        quantity_unit=tuple(one.unit for item in every for one in item.quantities),
        value_measured=problem.measured_values[0],
        value_uncertainty=problem.measured_values[1],
        value_before=problem.predict_values(problem.base),
        value_after=problem.predict_values(value),
        chi_squared=found.chi_squared,
        freedom=freedom,
        singular=singular,
        direction=direction,
        toml=tuple(reader.write_toml(build.document, build.text) for build in rounded),
        design_before=(),
        ends=ends,
        digits=digits,
    )
    return replace(result, determined=determined.describe(problem, slope, result))


def _round_builds(found: Solution, slope: Array) -> tuple[int, list[Build]]:
    """Find the fewest digits that matter to no combination of the parameters, and their builds.

    Rounding changes each combination by at most `NEGLIGIBLE` of its standard error, which the
    derivatives `slope` of the weighted data and priors give: parameters that the data determine
    only together need more digits than their own errors say. Those at a bound, or at their start,
    keep all digits, as all do (0 digits) if none suffice.
    """
    problem = found.problem
    value = found.z[: problem.count]
    _, _, low, high, *_ = problem.unknowns
    exact = (value == problem.base) | (value <= low[: len(value)]) | (value >= high[: len(value)])
    for digits in range(FEWEST_DIGITS, MOST_DIGITS + 1):
        rounded = np.array([round_to_digits(own, digits) for own in value.tolist()])
        written = np.where(exact, value, rounded)
        if np.linalg.norm(slope[:, : len(value)] @ (written - value)) <= NEGLIGIBLE:
            break
    else:
        digits, written = 0, value
    pairs = zip(problem.experiment, problem.shared.T, strict=True)
    return digits, [one.at(written[here]) for one, here in pairs]


def _responses(found: Solution, slope: Array) -> ResponseFit:
    """Collect what a fit says of the measured transfer functions."""
    problem = found.problem
    one = problem.experiment[0]
    functions = problem.channels.function
    nuisances = problem.channels.nuisances
    own = problem.parts
    sigma = np.sqrt(np.diag(covariance(problem, found.z, slope)))
    z0 = problem.unknowns.start
    before, after = (one.frequencies(z[: problem.count]) for z in (z0, found.z))
    peaks = start.assign_peaks(problem, found.z)
    rows = [
        (hz, error, before[n], after[n], 1 / width, count) for n, hz, error, width, count in peaks
    ]
    corrections = []
    for wrong in found.corrections:
        without = replace(problem, channels=wrong.apply(problem.channels, undo=True))
        corrections.append(replace(wrong, chi_squared=without.chi_squared(found.z)))
    return ResponseFit(
        function=tuple(item.name for item in functions),
        input=tuple(item.input for item in functions),
        output=tuple(item.output for item in functions),
        unit=tuple(item.unit for item in functions),
        of=np.repeat(np.arange(len(functions)), [len(item.frequency) for item in functions]),
        frequency=np.concatenate([item.frequency for item in functions]),
        uncertainty=np.concatenate([item.uncertainty for item in functions]),
        measured=np.concatenate([item.value for item in functions]),
        before=np.concatenate(problem.readings(z0)),
        after=np.concatenate(problem.readings(found.z)),
        nuisance=tuple(item.name for item in nuisances),
        nuisance_value=found.z[own[1]],
        nuisance_sigma=sigma[own[1]],
        nuisance_prior=np.array([item.sigma for item in nuisances]),
        mode=tuple(one.labels[peak.mode] for peak in peaks),
        resonance=np.array(rows).reshape(-1, 6),
        corrections=tuple(corrections),
    )
