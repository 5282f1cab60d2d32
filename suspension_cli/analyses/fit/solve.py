"""Least-squares fit of parameters of designs to measured modes and transfer functions.

The fit minimises chi^2, the sum of squares of `problem.residual`: of measured modes, transfer
functions and priors.

1. Exchanged, scaled and inverted channels are found (`wrong_channels`).
2. The parameters are fitted to the resonances (`resonances`), then all unknowns to the complex
   values and to modes.
3. While that is a misfit, the search starts again: with every exchange and sign that reduces chi^2
   at the fitted parameters, and from the single change of the design that explains most.

Modes alone need one search. Uncertainties are those of the linear problem at the end: the
covariance is (J^T J)^-1.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from suspension_cli.analyses import readings
from suspension_cli.analyses.analysis import Progress
from suspension_cli.analyses.fit import findings, resonances, wrong_channels
from suspension_cli.analyses.fit.problem import CONVERGED, Problem, build, default_parameters
from suspension_cli.analyses.fit.result import (
    SAME,
    Exchange,
    Fit,
    ResponseFit,
    SingleChange,
    is_unlikely,
)
from suspension_cli.analyses.fit.wrong_channels import Correction
from suspension_cli.conventions import GROUND
from suspension_cli.design import reader
from suspension_cli.design.measured import Measured
from suspension_cli.errors import Fault, InputError
from suspension_cli.linear import signals
from suspension_cli.measurements.resonances import Peak, find_peaks
from suspension_cli.measurements.transfer_function import Channels, MeasuredResponse
from suspension_cli.models import registry
from suspension_cli.studies import parameters

if TYPE_CHECKING:
    from suspension_cli.scene.arrays import Array

BEYOND = 1.5
"""Factor by which the band of modes with added damping exceeds the measured one."""
BETTER = 0.5
"""Fraction of chi^2 below which a change of channels is made after a fit."""
ROUNDS = 3
"""Most corrections, and most restarts from single changes, after a fit."""
ROUGH, STEPS = 1e-5, 40
"""Relative change of chi^2 at which a search for transfer functions ends, and its most steps. In a
misfit of narrow resonances chi^2 creeps along a curved valley; only the best search goes on to its
end."""
MAX_DRAWS = 100
"""Attempts at drawing random parameters that give a valid design."""
MAX_REFITS = 3
"""Most exchanges of labels that are fitted again."""
WORTH_REPORTING = 0.1
"""Fraction of chi^2 below which an exchange of labels is reported."""
REFITTED = 5
"""Most single changes that are fitted."""
WORTH = 0.02
"""Fraction of the fit's decrease of chi^2 that a single change must reach to be reported."""


@dataclass(frozen=True)
class Solution:
    """End of a search: the problem with corrected channels, and its unknowns z."""

    problem: Problem
    peaks: list[list[Peak]]
    z: Array
    chi_squared: float = np.inf
    corrections: tuple[Correction, ...] = ()

    @property
    def misfit(self) -> bool:
        """Whether so large a chi^2 is unlikely."""
        freedom = len(self.problem.residual(self.z)) - len(self.z)
        return is_unlikely(self.chi_squared, freedom)

    def descend(self, z: Array, tolerance: float = CONVERGED, **how: Any) -> Solution:
        """Fit all values from z on."""
        z, chi_squared = self.problem.minimise(z, tolerance=tolerance, **how)
        return replace(self, z=z, chi_squared=chi_squared)

    def refine(self, *, quick: bool = False) -> Solution:
        """Fit to the resonances, then all values; in a misfit also all values from here on.

        Transfer functions only until chi^2 changes little (`ROUGH`, `STEPS`). A `quick` fit takes
        fewer steps and is not repeated.
        """
        if not self.peaks:
            return self.descend(self.z)
        how: dict[str, Any] = {"steps": STEPS, "tolerance": ROUGH}
        if quick:
            how = {"steps": 12, "tolerance": 1e-4}
        found = self.descend(resonances.search(self.problem, self.z, self.peaks), **how)
        if found.misfit and not quick:
            found = _best([found, self.descend(self.z, **how)])
        return found

    def carry(self, problem: Problem, values: dict[str, float] | None = None) -> Solution:
        """Turn to another problem: unknowns keep their values but for those given.

        Unknowns that are new begin at their start.
        """
        known = dict(zip(self.problem.unknowns.name, self.z, strict=True)) | (values or {})
        names, start, *_ = problem.unknowns
        z = [known.get(name, first) for name, first in zip(names, start, strict=True)]
        return replace(self, problem=problem, z=np.array(z))

    def corrected(self, corrections: Sequence[Correction], made: Channels) -> Solution:
        """Change the channels."""
        found = self.carry(replace(self.problem, channels=made))
        return replace(found, corrections=tuple(corrections))


def _best(ends: Sequence[Solution]) -> Solution:
    return min(ends, key=lambda end: end.chi_squared)


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
    _check_uncertainties(functions)
    if functions and not measured.parameter:
        free = default_parameters(texts[0], level)
        measured = msgspec.structs.replace(measured, parameter=free)
    problem = build(texts, measured, files or [""] * len(texts), level)
    if functions:
        plant = problem.experiment[0].nominal
        made = Channels.of(measured, functions)
        # motions of the ground beside the support are not fitted
        known = [name for name in signals.bodies_with_signals(plant.system) if name != GROUND]
        problem = replace(
            problem, channels=made, signals=readings.parse(made, measured, tuple(known))
        )
        every, hz = np.concatenate([f.frequency for f in functions]), plant.modes.frequency
        inside = (hz > every.min() / BEYOND) & (hz < every.max() * BEYOND)
        seen = (problem.residues(plant) != 0).any(0)
        problem = replace(problem, damped=np.flatnonzero(inside & seen))
    peaks = [[peak for peak in find_peaks(item) if peak.sigma >= 0] for item in functions]
    ends, started = list[Solution](), time.monotonic()
    for x in _starts(problem, starts, seed):
        z = np.concatenate([x, problem.unknowns.start[problem.count :]])
        ends.append(_search(Solution(problem, peaks, z)))
        if tell is not None:
            tell(len(ends), starts, len(ends) / (time.monotonic() - started))
    found, changes = _best(ends), None
    if functions and (explain or found.misfit):
        found, changes = _restart(found)
    if functions:
        found = found.descend(found.z)
    slope = found.problem.jacobian(found.z)
    others = np.sort([end.chi_squared for end in ends])[1:]
    result = _collect(found, slope, measured, np.append(found.chi_squared, others))
    if functions:
        return replace(result, responses=_responses(found, slope, changes if explain else None))
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


def _starts(problem: Problem, count: int, seed: int) -> Iterator[Array]:
    """Yield starting values of the parameters: the given ones, then random ones.

    Parameters with a prior are drawn from it, others evenly between their bounds (in the logarithm
    if these are positive). Parameters without either keep their starting value.
    """
    yield problem.base
    random = np.random.default_rng(seed)
    low, high, prior, sigma = (part[: problem.count] for part in problem.unknowns[2:6])
    known, bounded = np.isfinite(sigma), np.isfinite(low) & np.isfinite(high)
    for _ in range(count - 1):
        for _ in range(MAX_DRAWS):
            fraction, normal = random.random(len(low)), random.standard_normal(len(low))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                even, geometric = low + fraction * (high - low), low * (high / low) ** fraction
                drawn = prior + np.where(known, sigma, 0.0) * normal
            kinds = [known, bounded & (low > 0), bounded]
            x = np.clip(np.select(kinds, [drawn, geometric, even], problem.base), low, high)
            try:
                problem.predict_modes(x)
                problem.experiment[0].plant(x[problem.shared[:, 0]])
            except InputError:  # an invalid design
                continue
            yield x
            break


def _search(begin: Solution) -> Solution:
    """Fit all measurements, and correct wrong channels."""
    guessed, made = wrong_channels.guess(begin.problem, begin.z)
    found = begin.corrected(guessed, made).refine()
    if found.misfit and guessed:
        found = _best([found, begin.refine()])
    for _ in range(ROUNDS):
        best = next(iter(wrong_channels.alternatives(found.problem, found.z)), None)
        if not found.misfit or best is None or best.chi_squared > BETTER * found.chi_squared:
            break
        kept = [one for one in found.corrections if not one.is_undone_by(best)]
        kept += [best] if len(kept) == len(found.corrections) else []
        again = found.corrected(kept, best.apply(found.problem.channels)).refine()
        if again.chi_squared > BETTER * found.chi_squared:
            break
        found = again
    return found


def _restart(found: Solution) -> tuple[Solution, tuple[float, tuple[SingleChange, ...]]]:
    """Start again from the best single change while it fits better than all parameters do."""
    before, changes = _single_changes(found)
    problem = found.problem
    given = dict(zip(problem.experiment[0].free, problem.base, strict=True))
    for _ in range(ROUNDS):
        best = next(iter(changes), None)
        if not found.misfit or best is None or best.name not in given:
            break
        if best.chi_squared >= found.chi_squared:
            break
        again = found.carry(problem, given | {best.name: best.start + best.change}).refine()
        if again.chi_squared > (1 - SAME) * found.chi_squared:
            break
        found = again
        before, changes = _single_changes(found)
    return found, (before, changes)


def _single_changes(found: Solution) -> tuple[float, tuple[SingleChange, ...]]:
    """Fit the measurements with one parameter of the design at a time.

    Parameters are ranked by the chi^2 that a change of one alone leaves, to first order around the
    end of the fit; the best are fitted.

    Returns
    -------
    float
        chi^2 of the design as given, with only the other unknowns fitted.
    tuple of SingleChange
        Best first.
    """
    problem, p = found.problem, found.problem.count
    one = problem.experiment[0]
    given = {item.name: item.value for item in parameters.every(one.text, one.level)}
    given |= dict(zip(one.free, problem.base, strict=True))
    fitted = given | dict(zip(one.free, found.z[:p], strict=True))
    derivatives = zip(given, one.plant(found.z[:p]).changes(list(given)), strict=True)
    matter = {
        name: change
        for name, change in derivatives
        if change is not None and (change.matters or name in one.free)
    }
    wide = problem.restricted([*matter], fitted)
    wide.experiment[0].latest[:] = [(wide.base, [*matter.values()])]
    slope = findings.data_rows(wide, wide.jacobian(found.carry(wide).z))
    own, moved = slope.T @ slope, wide.base - np.array([given[name] for name in matter])
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num((own @ moved) ** 2 / np.diag(own))

    def fit(*some: str) -> Solution:
        return found.carry(problem.restricted([*some], given), given).refine(quick=True)

    before, result = fit().chi_squared, []
    for name, worth in sorted(zip(matter, gain, strict=True), key=lambda item: -item[1])[:REFITTED]:
        if worth > max(WORTH * float(moved @ own @ moved), 4.0):
            try:
                end = fit(name)
            except (InputError, np.linalg.LinAlgError):
                continue
            change = float(end.z[0]) - given[name]
            result.append(SingleChange(name, given[name], change, end.chi_squared))
    least = before - WORTH * max(before - found.chi_squared, 0.0)
    good = [item for item in result if item.chi_squared < least]
    return before, tuple(sorted(good, key=lambda item: item.chi_squared))


def _find_exchange(found: Solution) -> Exchange | None:
    """Find two labels of one experiment whose exchange removes a misfit; None if none does.

    Pairs are ranked by chi^2 at the start and at the end of the fit; the best few are fitted again,
    until one explains the measurements.
    """
    problem, ranked = found.problem, []
    for e, item in enumerate(problem.experiment):
        labelled = [n for n, mode in enumerate(item.mode) if mode.label is not None]
        for i, j in itertools.combinations(labelled, 2):
            modes = list(item.mode)
            names = str(modes[i].label), str(modes[j].label)
            for n, label in ((i, names[1]), (j, names[0])):
                modes[n] = msgspec.structs.replace(modes[n], label=label)
            experiments = [*problem.experiment]
            experiments[e] = replace(item, mode=modes)
            other = replace(problem, experiment=experiments)
            ranked.append((min(map(other.chi_squared, (problem.base, found.z))), e, names, other))
    best = None
    for _, e, names, other in sorted(ranked, key=lambda item: item[0])[:MAX_REFITS]:
        if best is not None and not replace(found, chi_squared=best.chi_squared).misfit:
            break
        chi_squared = other.minimise(other.base)[1]
        if chi_squared < (best.chi_squared if best else WORTH_REPORTING * found.chi_squared):
            best = Exchange(e, names, chi_squared)
    return best


def _collect(found: Solution, slope: Array, measured: Measured, ends: Array) -> Fit:
    """Collect the result of a fit. Parameters at a bound have NaN in the covariance."""
    problem, p, every = found.problem, found.problem.count, found.problem.experiment
    value = found.z[:p]
    own = [value[here] for here in problem.shared.T]
    spread = findings.covariance(problem, found.z, slope)
    labels = [
        [item.labels[mode] for mode in item.assign_modes(x)] if item.mode else []
        for item, x in zip(every, own, strict=True)
    ]
    before, after = (
        np.where(hz > 0, hz, np.nan)
        for hz in (problem.predict_modes(x)[0] for x in (problem.base, value))
    )
    freedom = len(slope) - int((~np.isnan(np.diag(spread))).sum())
    unlikely = is_unlikely(found.chi_squared, freedom)
    scale = float(np.sqrt(found.chi_squared / freedom)) if unlikely else 1.0
    relative = np.where(value != 0, np.abs(value), 1.0)
    data = findings.data_rows(problem, slope) * relative
    _, singular, direction = np.linalg.svd(data, full_matrices=False)
    if direction.size:
        largest = direction[np.arange(len(direction)), np.abs(direction).argmax(1)]
        direction = direction * np.where(largest < 0, -1.0, 1.0)[:, None]
    result = Fit(
        experiment=tuple(
            name or reader.parse(item.text).design.name
            for name, item in zip(measured.names, every, strict=True)
        ),
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
        before=before,
        after=after,
        chi_squared=found.chi_squared,
        freedom=freedom,
        singular=singular,
        direction=direction,
        design=tuple(
            reader.write_toml(item.document(x)) for item, x in zip(every, own, strict=True)
        ),
        design_before=(),
        ends=ends,
    )
    return replace(result, determined=findings.describe(problem, slope, result))


def _responses(
    found: Solution, slope: Array, changes: tuple[float, tuple[SingleChange, ...]] | None
) -> ResponseFit:
    """Collect what a fit says of the measured transfer functions."""
    problem, one = found.problem, found.problem.experiment[0]
    functions, nuisances, own = problem.channels.function, problem.channels.nuisances, problem.parts
    sigma, z0 = np.sqrt(np.diag(findings.covariance(problem, found.z, slope))), problem.unknowns[1]
    matched = resonances.assign(problem, found.z, found.peaks)
    before, after = (one.frequencies(z[: problem.count]) for z in (z0, found.z))
    corrections = []
    for wrong in found.corrections:
        without = replace(problem, channels=wrong.apply(problem.channels, undo=True))
        corrections.append(replace(wrong, chi_squared=without.chi_squared(found.z)))
    extra: dict[str, Any] = {}
    if changes is not None:
        extra = {"chi_squared_before": changes[0], "changes": changes[1]}
        least, extra["candidates"] = findings.next_measurements(problem, found.z, slope)
        extra["least"] = "" if least is None else one.free[least]
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
        mode=tuple(one.labels[peak.mode] for peak in matched),
        resonance=np.array([
            (peak.frequency, peak.sigma, before[peak.mode], after[peak.mode], 1 / peak.damping,
             peak.functions)
            for peak in matched
        ]).reshape(-1, 6),
        corrections=tuple(corrections),
        **extra,
    )  # fmt: skip
