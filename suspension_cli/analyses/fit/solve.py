"""Least-squares fit of parameters of designs to measured modes and transfer functions.

The fit minimises chi^2, the sum of squares of `problem.residual`: of measured modes, transfer
functions and priors. Modes alone need one search. With transfer functions

1. exchanged, scaled and inverted channels are found (`wrong_channels`);
2. the parameters are fitted to the resonances (`resonances`), then all unknowns to the complex
   values; in a misfit again by way of the logarithms of the magnitudes;
3. while that is a misfit: every exchange and sign is tried at the fitted parameters; the
   frequencies of modes far more lossy than others are freed, as something may rub; the search
   starts again from the single change of the design that explains most.

Uncertainties are those of the linear problem at the end: the covariance is (J^T J)^-1.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.fit import (
    channels,
    default_parameters,
    findings,
    resonances,
    wrong_channels,
)
from suspension_cli.analyses.fit.problem import BEYOND, Problem, build
from suspension_cli.analyses.fit.result import (
    SAME,
    Exchange,
    Fit,
    ResponseFit,
    SingleChange,
    StiffenedMode,
)
from suspension_cli.analyses.fit.search import Solution, refine, with_channels
from suspension_cli.analyses.fit.wrong_channels import Correction
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError
from suspension_cli.measurements.transfer_function import MeasuredResponse
from suspension_cli.models import registry

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

BETTER = 0.5
"""Fraction of chi^2 below which a change of channels is made after a fit."""
LOSSY = 3.0
"""Damping of a mode over the lower quartile of all from which something may rub."""
SURE = 5.0
"""Least change of omega^2 that is reported, standard deviations."""
ROUNDS = 3
"""Most corrections, and most restarts from single changes, after a fit."""
MAX_DRAWS = 100
"""Attempts at drawing random parameters that give a valid design."""
MAX_REFITS = 3
"""Most exchanges of labels that are fitted again."""
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
) -> Fit:
    """Fit parameters of designs to measured modes, and of one design to transfer functions.

    Parameters
    ----------
    texts
        The design of each experiment as TOML.
    measured
        Free parameters (`default_parameters` if there are none), modes, sensors and actuators.
    files
        Files of the designs, for errors.
    level
        Name of a model that supports derivatives, ``string`` or ``beam``.
    starts, seed
        Number of searches, of which the best is returned, and the seed of the random parameters
        where all but the first start.
    explain
        Whether to rank single changes and further measurements, for transfer functions.
    tell
        Called with (done, all, rate per second) after each search.

    Raises
    ------
    InputError
        If a design has no such parameter, mode or signal, or a function no uncertainty. It names no
        file if the measurements are at fault.
    """
    files = files or [""] * len(texts)
    _check_uncertainties(functions)
    if functions and not measured.parameter:
        free = default_parameters.choose(texts[0], level)
        measured = msgspec.structs.replace(measured, parameter=free)
    problem, peaks = build(texts, measured, files, level), []
    if functions:
        one = problem.experiment[0]
        made = channels.build(measured, functions, one.nominal.system)
        frequency = one.nominal.modes.frequency
        every = np.concatenate([item.frequency for item in functions])
        inside = (frequency > every.min() / BEYOND) & (frequency < every.max() * BEYOND)
        seen = (resonances.residues(one.nominal, made) != 0).any(0)
        problem = problem.changed(channels=made, damped=np.flatnonzero(inside & seen))
        peaks = [resonances.find_peaks(item) for item in functions]
    search = _fit_functions if functions else _fit_modes
    ends = []
    for x in _reporting(_starts(problem, starts, seed), starts, tell):
        z = np.concatenate([x, problem.start[problem.count :]])
        ends.append(search(Solution(problem, peaks, z, np.inf)))
    found = min(ends, key=lambda end: end.chi_squared)
    changes = None
    if functions and (explain or found.misfit):
        found, changes = _restart(found)
    result = _collect(found, measured, np.sort([end.chi_squared for end in ends]))
    if functions:
        return replace(
            result, responses=_responses(found, problem, result, changes, explain=explain)
        )
    return replace(result, exchange=_find_exchange(found)) if result.misfit else result


def _check_uncertainties(functions: Sequence[MeasuredResponse]) -> None:
    bad = []
    for n, item in enumerate(functions, 1):
        sigma = np.asarray(item.uncertainty, dtype=float)
        if not (np.isfinite(sigma) & (sigma > 0)).all():
            problem = (
                f"{item.name} gives no uncertainty at some frequencies, without which values have"
                " no weight"
            )
            remedy = (
                "give uncertainty (a column, or 0.05 for 5 %), or coherence and averages; or fit"
                " with --relative-uncertainty 0.05"
            )
            bad.append(Fault(f"transfer_function.{n}", problem, remedy))
    if bad:
        raise InputError(bad)


def _reporting(starts: Iterator[Array], count: int, tell: Progress | None) -> Iterator[Array]:
    """Yield starting values; report the progress after each search."""
    started = time.monotonic()
    for n, start in enumerate(starts, 1):
        yield start
        if tell is not None:
            tell(n, count, n / (time.monotonic() - started))


def _starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """Yield starting values of the parameters: the given ones, then random ones.

    Parameters with a prior are drawn from it, others evenly between their bounds (in the logarithm
    if these are positive). Parameters without either keep their starting value.
    """
    yield problem.base
    random, own = np.random.default_rng(seed), problem.parts[0]
    low, high, prior, sigma = (part[own] for part in (*problem.bounds, *problem.prior))
    known, bounded = np.isfinite(sigma), np.isfinite(low) & np.isfinite(high)
    logarithmic = bounded & (low > 0)
    for _ in range(count - 1):
        for _ in range(MAX_DRAWS):
            fraction, normal = random.random(len(low)), random.standard_normal(len(low))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                even, geometric = low + fraction * (high - low), low * (high / low) ** fraction
                drawn = prior + np.where(known, sigma, 0.0) * normal
            x = np.select([known, logarithmic, bounded], [drawn, geometric, even], problem.base)
            x = np.clip(x, low, high)
            try:
                problem.predict_modes(x)
                problem.experiment[0].plant(x[problem.shared[:, 0]])
            except InputError:  # an invalid design
                continue
            yield x
            break


def _fit_modes(begin: Solution) -> Solution:
    """Fit measured modes alone."""
    problem = begin.problem
    z, chi_squared = problem.minimise(begin.z, problem.residual, problem.jacobian)
    return replace(begin, z=z, chi_squared=chi_squared)


def _fit_functions(begin: Solution) -> Solution:
    """Fit transfer functions, and correct wrong channels."""
    corrections, guessed = wrong_channels.guess(begin.problem, begin.z)
    found = refine(with_channels(begin, guessed) if corrections else begin)
    if found.misfit and corrections:
        plain = refine(begin)
        if plain.chi_squared < found.chi_squared:
            found, corrections = plain, []
    for _ in range(ROUNDS):
        best = next(iter(wrong_channels.alternatives(found.problem, found.z)), None)
        if not found.misfit or best is None or best.chi_squared > BETTER * found.chi_squared:
            break
        again = refine(with_channels(found, best.apply(found.problem.channels)))
        if again.chi_squared > BETTER * found.chi_squared:
            break
        found, corrections = again, _merge(corrections, best)
    if found.misfit:
        found = _free_rubbing(found)
    rated = []
    for one in corrections:
        without = found.problem.changed(channels=one.apply(found.problem.channels, undo=True))
        rated.append(replace(one, chi_squared=float(np.sum(without.residual(found.z) ** 2))))
    return replace(found, corrections=tuple(rated))


def _merge(corrections: list[Correction], new: Correction) -> list[Correction]:
    """Add a correction; one that undoes an earlier one removes it."""
    same = [
        one
        for one in corrections
        if (one.kind, one.side, set(one.channel)) == (new.kind, new.side, set(new.channel))
    ]
    return [one for one in corrections if one is not same[0]] if same else [*corrections, new]


def _free_rubbing(found: Solution) -> Solution:
    """Free the frequencies of modes far more lossy than others, if that removes a misfit."""
    matched = resonances.assign(found.problem, found.z, found.peaks)
    if len(matched.mode) < 3:
        return found
    modes = matched.mode[matched.damping > LOSSY * np.quantile(matched.damping, 0.25)]
    if not len(modes) or len(modes) > len(matched.mode) / 2:
        return found
    problem = found.problem.changed(stiff=modes)
    z = np.concatenate([problem.base, found.z[problem.count :], np.zeros(len(modes))])
    again = refine(replace(found, problem=problem, z=z))
    return again if again.chi_squared < BETTER * found.chi_squared else found


def _restart(found: Solution) -> tuple[Solution, tuple[float, tuple[SingleChange, ...]]]:
    """Start again from the best single change while it fits better than all parameters do."""
    changes = findings.single_changes(found)
    for _ in range(ROUNDS):
        free = found.problem.experiment[0].free
        best = next(iter(changes[1]), None)
        if not found.misfit or best is None or best.name not in free:
            break
        if best.chi_squared >= found.chi_squared:
            break
        z = np.concatenate([found.problem.base, found.z[found.problem.count :]])
        z[free.index(best.name)] = best.start + best.change
        again = refine(replace(found, z=z))
        if again.chi_squared > (1 - SAME) * found.chi_squared:
            break
        found = again
        changes = findings.single_changes(found)
    return found, changes


def _collect(found: Solution, measured: Measured, ends: Array) -> Fit:
    """Collect the result of a fit. Parameters at a bound have NaN in the covariance."""
    problem, p, every = found.problem, found.problem.count, found.problem.experiment
    value = found.z[:p]
    own = [value[here] for here in problem.shared.T]
    for item, x in zip(every, own, strict=True):
        item.linearise(x)
    slope = problem.jacobian(found.z)
    spread = findings.covariance(problem, found.z, slope)
    labels = [
        [item.labels[mode] for mode in item.assign_modes(x)] if item.mode else []
        for item, x in zip(every, own, strict=True)
    ]
    before, after = (
        np.where(hz > 0, hz, np.nan)
        for hz in (problem.predict_modes(x)[0] for x in (problem.base, value))
    )
    relative = np.where(value != 0, np.abs(value), 1.0)
    data = findings.data_rows(problem, slope) * relative
    _, singular, direction = np.linalg.svd(data, full_matrices=False)
    if direction.size:
        largest = direction[np.arange(len(direction)), np.abs(direction).argmax(1)]
        direction = direction * np.where(largest < 0, -1.0, 1.0)[:, None]
    return Fit(
        experiment=tuple(
            name or reader.parse(item.text).design.name
            for name, item in zip(measured.names, every, strict=True)
        ),
        name=tuple(item.name for item in problem.free),
        shared=problem.shared,
        start=problem.base,
        value=value,
        sigma=np.sqrt(np.diag(spread)[:p]),
        prior=problem.prior[0][:p],
        prior_sigma=problem.prior[1][:p],
        covariance=spread[:p, :p],
        at_bound=np.isnan(np.diag(spread)[:p]),
        of=np.repeat(np.arange(len(every)), [len(names) for names in labels]),
        label=tuple(name for names in labels for name in names),
        measured=problem.measured_modes[0],
        uncertainty=problem.measured_modes[1],
        before=before,
        after=after,
        chi_squared=found.chi_squared,
        freedom=len(slope) - int((~np.isnan(np.diag(spread))).sum()),
        singular=singular,
        direction=direction,
        design=tuple(
            reader.write_toml(item.document(x)) for item, x in zip(every, own, strict=True)
        ),
        design_before=(),
        ends=ends,
    )


def _responses(
    found: Solution,
    begin: Problem,
    result: Fit,
    changes: tuple[float, tuple[SingleChange, ...]] | None,
    *,
    explain: bool,
) -> ResponseFit:
    """Collect what a fit says of the measured transfer functions."""
    problem, one = found.problem, found.problem.experiment[0]
    functions, own = problem.channels.function, problem.parts[1]
    slope = problem.jacobian(found.z)
    spread = findings.covariance(problem, found.z, slope)
    start = with_channels(Solution(begin, [], begin.start, np.inf), problem.channels)
    z0 = np.concatenate([start.z, np.zeros(len(problem.stiff))])
    matched = resonances.assign(problem, found.z, found.peaks)
    before_hz, after_hz = (one.frequencies(z[: problem.count])[matched.mode] for z in (z0, found.z))
    columns = (matched.frequency, matched.sigma, before_hz, after_hz)
    stiffened = []
    q = dict(zip(problem.damped.tolist(), np.exp(-found.z[problem.parts[2]]), strict=True))
    for n, mode in enumerate(problem.stiff.tolist(), problem.parts[3].start):
        if found.z[n] > SURE * np.sqrt(spread[n, n]):
            excess = float(np.sqrt(1 + found.z[n]) - 1)
            stiffened.append(StiffenedMode(one.labels[mode], excess, float(q[mode])))
    extra: dict[str, Any] = {}
    if explain and changes is not None:
        extra = {"chi_squared_before": changes[0], "changes": changes[1]}
        least, extra["candidates"] = findings.next_measurements(found.problem, found.z, slope)
        extra["least"] = "" if least is None else one.free[least]
    return ResponseFit(
        function=tuple(item.name for item in functions),
        input=tuple(item.input for item in functions),
        output=tuple(item.output for item in functions),
        of=np.repeat(np.arange(len(functions)), [len(item.frequency) for item in functions]),
        frequency=np.concatenate([item.frequency for item in functions]),
        uncertainty=np.concatenate([item.uncertainty for item in functions]),
        measured=np.concatenate([item.value for item in functions]),
        before=np.concatenate(problem.readings(z0)),
        after=np.concatenate(problem.readings(found.z)),
        nuisance=tuple(item.name for item in problem.nuisances),
        nuisance_value=found.z[own],
        nuisance_sigma=np.sqrt(np.diag(spread)[own]),
        nuisance_prior=np.array([item.sigma for item in problem.nuisances]),
        mode=tuple(one.labels[n] for n in matched.mode),
        resonance=np.column_stack([*columns, 1 / matched.damping, matched.functions]).reshape(
            -1, 6
        ),
        corrections=found.corrections,
        stiffened=tuple(stiffened),
        sentences=findings.describe(problem, found.z, slope),
        **extra,
    )


def _find_exchange(found: Solution) -> Exchange | None:
    """Find two labels of one experiment whose exchange removes a misfit; None if none does.

    Pairs are ranked by chi^2 at the start and at the end of the fit; the best few are fitted again.
    """
    problem, ranked = found.problem, []
    for e, (item, own) in enumerate(zip(problem.experiment, problem.shared.T, strict=True)):
        computed = [
            item.frequencies(x[own])[item.assign_modes(x[own])] for x in (problem.base, found.z)
        ]
        for i, j in itertools.combinations(item.labelled, 2):
            pair, swapped = [i, j], [j, i]
            changes = [
                (((f[pair] - item.frequency[swapped]) / item.uncertainty[swapped]) ** 2).sum()
                - (((f[pair] - item.frequency[pair]) / item.uncertainty[pair]) ** 2).sum()
                for f in computed
            ]
            ranked.append((float(min(changes)), e, i, j))
    best = None
    for _, e, i, j in sorted(ranked)[:MAX_REFITS]:
        experiments = list(problem.experiment)
        modes = list(experiments[e].mode)
        names = str(modes[i].label), str(modes[j].label)
        for here, label in ((i, names[1]), (j, names[0])):
            modes[here] = msgspec.structs.replace(modes[here], label=label)
        experiments[e] = replace(experiments[e], mode=modes)
        again = problem.changed(experiment=experiments)
        end = _fit_modes(Solution(again, [], again.start, np.inf))
        if end.chi_squared < (best.chi_squared if best else WORTH_REPORTING * found.chi_squared):
            best = Exchange(e, names, end.chi_squared)
    return best
