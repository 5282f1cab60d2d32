"""Fit of a design to measured transfer functions, alone or together with measured modes.

1. Exchanged, inverted or scaled channels are found (`wrong_channels`).
2. The numbers are fitted to the resonances (`resonance_phase`).
3. All unknowns are fitted to the complex values (`response_problem`), which gives chi^2.
4. In a misfit, every exchange and sign is tried with the fitted numbers, and the frequencies of
   modes far more lossy than others are freed, as something may rub.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.fit import (
    levenberg_marquardt,
    resonance_phase,
    wrong_channels,
)
from suspension_cli.analyses.fit.resonance_phase import Resonances
from suspension_cli.analyses.fit.response_problem import ResponseProblem
from suspension_cli.analyses.fit.wrong_channels import BETTER, Correction
from suspension_cli.linear import named_results

if TYPE_CHECKING:
    from jaxtyping import Complex, Float, Int

    from suspension_cli.analyses.fit.array_types import UnknownMatrix, Unknowns

LOSSY = 3.0
"""Damping of a mode over the lower quartile of all from which something may rub."""
SURE = 5.0
"""Least change of omega^2 that is reported, standard deviations."""
ROUNDS = 3
"""Most corrections after a fit."""
STEPS, QUICK = 40, 10
"""Most Gauss-Newton steps of a fit, and of one that only ranks a number."""


@dataclass(frozen=True)
class SingleChange:
    """Fit with one number of the design free, and the nuisance parameters.

    Attributes
    ----------
    name
        Dotted path of the number.
    start, change
        Value in the design and its change, SI.
    """

    name: str
    start: float
    change: float
    chi_squared: float


@dataclass(frozen=True)
class Candidate:
    """A measurement (input and output signals, band in Hz) that would determine a number better.

    `sigma` is the standard deviation of that number with this measurement.
    """

    input: str
    output: str
    band: tuple[float, float]
    sigma: float


@dataclass(frozen=True)
class ResponseFit:
    """Measured transfer functions and a fit to them.

    Attributes
    ----------
    function, input, output
        Names of the functions and of their channels.
    of
        Function of each point.
    frequency, uncertainty, measured, before, after
        Hz, and readings per drive as measured, and as predicted before and after the fit.
    nuisance
        Fitted properties of sensors and actuators: keys, values (relative for gains, s for
        delays), and standard deviations after the fit and of the priors.
    mode, resonance
        Modes with a measured resonance: frequency as measured, its standard deviation, before and
        after (Hz), measured Q, number of functions with it.
    corrections
        Wrong channels.
    stiffened
        Modes stiffer than the design explains: label, relative excess of frequency, Q.
    chi_squared_before
        chi^2 of the design as given, with the nuisance parameters fitted.
    changes
        Single changes that explain most, best first.
    sentences
        Determined and undetermined numbers.
    least
        A number that is known least; "" if none is free.
    candidates
        Measurements that would determine it best, best first.
    """

    function: tuple[str, ...]
    input: tuple[str, ...]
    output: tuple[str, ...]
    of: Int[np.ndarray, " point"]
    frequency: Float[np.ndarray, " point"]
    uncertainty: Float[np.ndarray, " point"]
    measured: Complex[np.ndarray, " point"]
    before: Complex[np.ndarray, " point"]
    after: Complex[np.ndarray, " point"]
    nuisance: tuple[str, ...]
    nuisance_value: Float[np.ndarray, " nuisance"]
    nuisance_sigma: Float[np.ndarray, " nuisance"]
    nuisance_prior: Float[np.ndarray, " nuisance"]
    mode: tuple[str, ...]
    resonance: Float[np.ndarray, "mode 6"]
    corrections: tuple[Correction, ...] = ()
    stiffened: tuple[tuple[str, float, float], ...] = ()
    chi_squared_before: float = float("nan")
    changes: tuple[SingleChange, ...] = ()
    sentences: tuple[str, ...] = ()
    least: str = ""
    candidates: tuple[Candidate, ...] = ()

    @property
    def chi_squared(self) -> Float[np.ndarray, " function"]:
        """chi^2 of each function after the fit."""
        off = np.abs((self.after - self.measured) / self.uncertainty) ** 2
        return np.bincount(self.of, off, len(self.function)).astype(float)

    @property
    def points(self) -> Int[np.ndarray, " function"]:
        """Number of residuals of each function: two per value."""
        return 2 * np.bincount(self.of, minlength=len(self.function))


@dataclass(frozen=True)
class Solution:
    """End of a search: the problem with corrected channels, and its unknowns z."""

    problem: ResponseProblem
    z: Unknowns
    chi_squared: float
    matched: Resonances
    corrections: tuple[Correction, ...] = field(default=())

    @property
    def freedom(self) -> int:
        """Degrees of freedom: residuals and priors less unknowns."""
        return len(self.problem.residual(self.z)) - len(self.z)

    @property
    def misfit(self) -> bool:
        """Whether a chi^2 this large has a probability below 0.1 %."""
        from scipy.special import chdtrc

        return self.freedom > 0 and float(chdtrc(self.freedom, self.chi_squared)) < 1e-3


def solve(problem: ResponseProblem, start: Unknowns | None = None) -> Solution:
    """Fit the unknowns of a problem, and correct wrong channels."""
    z = problem.start if start is None else start
    corrections, channels = wrong_channels.guess(problem, z)
    now = problem.changed(channels=channels) if corrections else problem
    found = refine(now, onto(problem, now, z))
    if found.misfit and corrections:
        plain = refine(problem, z)
        if plain.chi_squared < found.chi_squared:
            found, corrections = plain, []
    for _ in range(ROUNDS):
        if not found.misfit:
            break
        best = next(iter(wrong_channels.alternatives(found.problem, found.z)), None)
        if best is None or best.chi_squared > BETTER * found.chi_squared:
            break
        changed = found.problem.changed(channels=best.apply(found.problem.channels))
        again = refine(changed, found.z)
        if again.chi_squared > BETTER * found.chi_squared:
            break
        found, corrections = again, _merge(corrections, best)
    if found.misfit:
        found = _free_rubbing(found)
    return replace(found, corrections=_rated(found, corrections))


def _free_rubbing(found: Solution) -> Solution:
    """Free the frequencies of modes far more lossy than others, if that removes a misfit."""
    matched = found.matched
    if len(matched.mode) < 3:
        return found
    lossy = matched.damping > LOSSY * np.quantile(matched.damping, 0.25)
    modes = matched.mode[lossy]
    if not len(modes) or len(modes) > len(matched.mode) / 2:
        return found
    problem = found.problem.changed(stiff=modes)
    z = np.concatenate([problem.base.start, found.z[problem.numbers :], np.zeros(len(modes))])
    again = refine(problem, z)
    return again if again.chi_squared < BETTER * found.chi_squared else found


def stiffened(found: Solution, spread: UnknownMatrix) -> tuple[tuple[str, float, float], ...]:
    """Find modes stiffer than the design explains: label, excess of frequency, Q."""
    problem, names = found.problem, labels(found.problem)
    first = len(found.z) - len(problem.stiff)
    damping = dict(zip(problem.damped.tolist(), problem.added(found.z)[0], strict=True))
    result = []
    for n, mode in enumerate(problem.stiff.tolist(), first):
        if found.z[n] > SURE * np.sqrt(spread[n, n]):
            excess = float(np.sqrt(1 + found.z[n]) - 1)
            result.append((names[mode], excess, float(1 / damping.get(mode, np.nan))))
    return tuple(result)


def onto(old: ResponseProblem, new: ResponseProblem, z: Unknowns) -> Float[np.ndarray, " more"]:
    """Convert values of the unknowns to a problem with more unknowns, which begin at 0."""
    values = {
        (item.side, item.channel, item.kind, item.other): value
        for item, value in old.nuisance_values(z).items()
    }
    own = [
        values.get((item.side, item.channel, item.kind, item.other), 0.0) for item in new.nuisances
    ]
    p, q, r = old.numbers, len(old.nuisances), len(old.damped)
    return np.concatenate([z[:p], own, z[p + q : p + q + r], np.zeros(len(new.stiff))])


def _merge(corrections: list[Correction], new: Correction) -> list[Correction]:
    """Add a correction; one that undoes an earlier one removes it."""
    same = [
        one
        for one in corrections
        if (one.kind, one.side, set(one.channel)) == (new.kind, new.side, set(new.channel))
    ]
    if same and new.kind != wrong_channels.FACTOR:
        return [one for one in corrections if one is not same[0]]
    return [*corrections, new]


def _rated(found: Solution, corrections: list[Correction]) -> tuple[Correction, ...]:
    """Rate each correction by chi^2 of the fitted numbers without it."""
    rated = []
    for one in corrections:
        channels = one.undo(found.problem.channels)
        residual = found.problem.changed(channels=channels).residual(found.z)
        rated.append(replace(one, chi_squared=float(residual @ residual)))
    return tuple(rated)


def refine(problem: ResponseProblem, z: Unknowns, *, quick: bool = False) -> Solution:
    """Fit to the resonances, then to the complex values.

    In a misfit the search is repeated without the first. A `quick` fit takes fewer steps and is not
    repeated.
    """
    begin, matched = resonance_phase.search(problem, z)
    end, chi_squared = _descend(problem, begin, QUICK if quick else STEPS)
    found = Solution(problem, end, chi_squared, matched)
    if not quick and found.misfit and not np.array_equal(begin, z):
        other, reached = _descend(problem, z, STEPS)
        if reached < chi_squared:
            end, chi_squared = other, reached
    return Solution(problem, end, chi_squared, resonance_phase.assign(problem, end))


def _descend(problem: ResponseProblem, z: Unknowns, steps: int) -> tuple[Unknowns, float]:
    return levenberg_marquardt.minimise(
        problem.residual,
        problem.jacobian,
        z,
        problem.scale,
        (problem.low, problem.high),
        steps=steps,
        relative=1e-3 if steps == QUICK else 1e-8,
    )


def labels(problem: ResponseProblem) -> list[str]:
    """Labels of the modes of the design at the start."""
    return named_results.labels(problem.nominal.modes)


def collect(
    found: Solution,
    start: Unknowns,
    covariance: UnknownMatrix,
    **findings: Any,
) -> ResponseFit:
    """Collect the result of a fit from `start`; `findings` are further attributes."""
    problem, p = found.problem, found.problem.numbers
    functions = problem.channels.function
    q = slice(p, p + len(problem.nuisances))
    before_hz, after_hz = (problem.frequencies(z)[found.matched.mode] for z in (start, found.z))
    names = labels(problem)
    matched = found.matched
    return ResponseFit(
        function=tuple(item.name for item in functions),
        input=tuple(item.input for item in functions),
        output=tuple(item.output for item in functions),
        of=np.repeat(np.arange(len(functions)), [len(item.frequency) for item in functions]),
        frequency=np.concatenate([item.frequency for item in functions]),
        uncertainty=np.concatenate([item.uncertainty for item in functions]),
        measured=np.concatenate([item.value for item in functions]),
        before=np.concatenate(problem.predict(start).reading),
        after=np.concatenate(problem.predict(found.z).reading),
        nuisance=tuple(item.name for item in problem.nuisances),
        nuisance_value=found.z[q],
        nuisance_sigma=np.sqrt(np.diag(covariance)[q]),
        nuisance_prior=np.array([item.sigma for item in problem.nuisances]),
        mode=tuple(names[n] for n in matched.mode),
        resonance=np.column_stack(
            [
                matched.frequency,
                matched.sigma,
                before_hz,
                after_hz,
                1 / matched.damping,
                matched.functions,
            ]
        ).reshape(-1, 6),
        corrections=found.corrections,
        stiffened=stiffened(found, covariance),
        **findings,
    )
