"""Findings of a fit of transfer functions: determined numbers, single changes, next measurements.

All follow from the information matrix J^T J of the weighted residuals at the end of the fit, with
the nuisance parameters eliminated (Schur's complement).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from suspension_cli.analyses.fit import search
from suspension_cli.analyses.fit.resonances import stack_parts
from suspension_cli.analyses.fit.response_fit import Candidate, SingleChange, Solution, refine
from suspension_cli.analyses.fit.response_problem import ResponseProblem
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.measured import Free, Measured
from suspension_cli.errors import InputError
from suspension_cli.linear import signals
from suspension_cli.linear.signals import Signal
from suspension_cli.studies import parameters
from suspension_cli.studies.natural_steps import natural_step
from suspension_cli.studies.response_matrix import Plant

if TYPE_CHECKING:
    from suspension_cli.analyses.fit.array_types import (
        NumberMatrix,
        Numbers,
        UnknownMatrix,
        Unknowns,
    )

WEAK = 10.0
"""Factor on the standard deviations of priors (a tenth of a number without) to weaken them."""
KNOWN = 0.3
"""Standard deviation over that of the prior below which a number is determined by the data."""
UNKNOWN = 0.8
"""The same ratio above which the data do not determine a number."""
TOGETHER = 0.2
"""Standard deviation of a combination over the smallest of its members' below which only the
combination is determined."""
COMBINED = 8
"""Numbers that are searched for combinations of three."""
REFITTED = 5
"""Most single changes that are fitted."""
WORTH = 0.02
"""Fraction of the fit's decrease of chi^2 that a single change must reach to be fitted."""
GAIN = 0.05
"""Relative calibration error of a candidate measurement."""
RELATIVE = 0.02
"""Relative noise of a candidate measurement where the measured functions have none."""
PER_BAND = 24
"""Frequencies of a candidate measurement."""
BANDS = tuple(0.1 * 10 ** (n / 3) for n in range(7))
"""Edges of the bands of candidate measurements, Hz."""
ZERO = 1e-8
"""Size of a response over others of its drive and sensor below which it is a rounding error."""
LEAST = 8
"""Number of the least known numbers for which measurements are sought."""
IMPROVES = 0.7
"""Factor on a standard deviation below which a measurement is an improvement."""
LISTED = 6
"""Most candidates that are reported."""


def information(problem: ResponseProblem, z: Unknowns) -> UnknownMatrix:
    """Compute the information of data and priors on the unknowns over their `scale`."""
    slope = problem.jacobian(z) * problem.scale
    return slope.T @ slope


def covariance(problem: ResponseProblem, z: Unknowns) -> UnknownMatrix:
    """Compute the covariance of the unknowns; infinite if not determined, NaN at a bound."""
    whole = information(problem, z)
    root = np.sqrt(np.where(np.diag(whole) > 0, np.diag(whole), 1.0))
    values, vectors = np.linalg.eigh(whole / np.outer(root, root))
    good = values > 1e-13 * values[-1]
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    lost = (np.abs(vectors[:, ~good]) > 1e-4).any(1) | (np.diag(whole) == 0)
    inverse[lost, :] = inverse[:, lost] = 0.0
    inverse[lost, lost] = np.inf
    result = inverse * np.outer(problem.scale / root, problem.scale / root)
    at_bound = (z <= problem.low) | (z >= problem.high)
    result[at_bound] = result[:, at_bound] = np.nan
    return result


def data_information(problem: ResponseProblem, z: Unknowns) -> NumberMatrix:
    """Compute the information of the data alone on the numbers over their `scale`."""
    p = problem.numbers
    whole = information(problem, z)
    sigma = problem.prior[1][:p]
    priors = np.where(np.isfinite(sigma), (problem.scale[:p] / sigma) ** 2, 0.0)
    own = whole[:p, :p] - np.diag(priors)
    return own - whole[:p, p:] @ np.linalg.solve(whole[p:, p:], whole[p:, :p])


@dataclass(frozen=True)
class NumberName:
    """Printed name and unit of a number, and the factor from SI to that unit."""

    name: str
    unit: str
    factor: float

    def text(self, value: float) -> str:
        """Write a change of the number with its unit."""
        return f"{value * self.factor:.2g} {self.unit}"


def change_unit(name: str, value: float) -> tuple[str, float]:
    """Choose the printed unit of a change of a number, and the factor to it from SI.

    >>> change_unit("stage.test.wires.d", 0.001), change_unit("stage.test.body.mass", 40.0)
    (('mm', 1000.0), ('%', 2.5))
    """
    step, unit = natural_step(name, value)
    return (unit, 1 / abs(step)) if step else ("SI", 1.0)


def short(name: str) -> str:
    """Shorten a path: ``stage.upper.wires.d`` to ``upper.d``.

    >>> short("stage.upper.wires.d"), short("stage.test.body.inertia.2")
    ('upper.d', 'test.inertia.2')
    """
    keys = name.split(".")
    if keys[0] == "stage":
        keys = [keys[1], *(key for key in keys[2:] if key not in ("wires", "body"))]
    return ".".join(keys)


def describe(problem: ResponseProblem, z: Unknowns, names: Sequence[str]) -> tuple[str, ...]:
    """Say which numbers the data determine, one statement per line."""
    p = problem.numbers
    if not p:
        return ()
    weak = WEAK * problem.scale[:p]
    known = data_information(problem, z) / np.outer(problem.scale[:p], problem.scale[:p])
    spread = np.linalg.inv((known + np.diag(1 / weak**2)) * np.outer(weak, weak)) * np.outer(
        weak, weak
    )
    sigma, scale = np.sqrt(np.diag(spread)), problem.scale[:p]
    numbers = [
        NumberName(short(name), *change_unit(name, float(z[n]))) for n, name in enumerate(names)
    ]
    together, taken = combinations(spread, scale, z[:p], numbers)
    good = [n for n in range(p) if sigma[n] <= KNOWN * scale[n] and n not in taken]
    poor = [n for n in range(p) if KNOWN * scale[n] < sigma[n] < UNKNOWN * scale[n]]
    rest = [n for n in range(p) if sigma[n] >= UNKNOWN * scale[n] and n not in taken]
    lines = []
    if good:
        lines.append(
            "determined: "
            + ", ".join(f"{numbers[n].name} (to {numbers[n].text(sigma[n])})" for n in good)
        )
    lines += together
    poor = [n for n in poor if n not in taken]
    if poor:
        lines.append(
            "hardly determined: "
            + ", ".join(f"{numbers[n].name} (to {numbers[n].text(sigma[n])})" for n in poor)
        )
    if rest:
        lines.append(
            "not determined by these data, so their values are from priors or the design: "
            + ", ".join(numbers[n].name for n in rest)
        )
    return tuple(lines)


def combinations(
    spread: NumberMatrix,
    scale: Numbers,
    value: Numbers,
    numbers: list[NumberName],
) -> tuple[list[str], set[int]]:
    """Find combinations of two or three numbers of which only the combination is determined."""
    sigma = np.sqrt(np.diag(spread))
    bad = [n for n in range(len(scale)) if sigma[n] > KNOWN * scale[n]]
    lines: list[str] = []
    taken: set[int] = set()
    for size in (2, 3):
        left = [n for n in bad if n not in taken]
        if size == 3:
            left = sorted(left, key=lambda n: -sigma[n] / scale[n])[:COMBINED]
        found = []
        for group in itertools.combinations(left, size):
            lengths = all(numbers[n].unit == "mm" for n in group)
            if not lengths and any(value[n] <= 0 for n in group):
                continue
            unit = np.ones(size) if lengths else value[list(group)]
            own = spread[np.ix_(group, group)] / np.outer(unit, unit)
            single = np.sqrt(np.diag(own)).min()
            choices = (1, -1) if lengths else (1, -1, 2, -2, 0.5, -0.5, 4, -4)
            for tail in itertools.product(choices, repeat=size - 1):
                weight = np.array([1.0, *tail])
                error = float(np.sqrt(max(weight @ own @ weight, 0.0)))
                error /= float(np.abs(weight).max())
                if error < TOGETHER * single:
                    found.append((error / single, group, weight, error, lengths))
        for _, group, weight, error, lengths in sorted(found, key=lambda item: item[0]):
            if taken & set(group):
                continue
            taken |= set(group)
            lines.append(_sentence([numbers[n] for n in group], weight, error, lengths=lengths))
    return lines, taken


def _sentence(group: list[NumberName], weight: Numbers, error: float, *, lengths: bool) -> str:
    names = [one.name for one in group]
    if lengths:
        words = f"{error * np.abs(weight).max() * 1e3:.2g} mm"
        if (weight == 1).all():
            return f"only the sum of {_listed(names)} is known (to {words})"
        if len(group) == 2:
            return f"only the difference of {_listed(names)} is known (to {words})"
        signs = "".join(
            f" {'+' if w > 0 else '-'} {name}" for w, name in zip(weight, names, strict=True)
        )
        return f"only {signs.removeprefix(' + ')} is known (to {words})"
    parts = [
        name if abs(w) == 1 else f"{name}^{abs(w):g}" for w, name in zip(weight, names, strict=True)
    ]
    above = [part for part, w in zip(parts, weight, strict=True) if w > 0]
    below = [part for part, w in zip(parts, weight, strict=True) if w < 0]
    words = f"{100 * error * np.abs(weight).max():.2g} %"
    product = " x ".join(above) + "".join(f" / {part}" for part in below)
    kind = "ratio" if below and len(group) == 2 else "product"
    return f"only the {kind} {product} is known (to {words})"


def _listed(names: list[str]) -> str:
    return ", ".join(names[:-1]) + " and " + names[-1]


def single_changes(
    found: Solution, text: str, measured: Measured, file: str, start: Unknowns
) -> tuple[float, tuple[SingleChange, ...]]:
    """Fit the measurements with one number of the design at a time.

    Numbers are ranked by the chi^2 that a change of one alone leaves, to first order around the end
    of the fit; the best are fitted.

    Returns
    -------
    float
        chi^2 of the design as given, with only the nuisance parameters fitted.
    tuple of SingleChange
        Best first.
    """
    problem, p = found.problem, found.problem.numbers
    free = problem.base.experiment[0].free
    values = {item.name: item.value for item in parameters.every(text, problem.level)}
    changes = dict(zip(free, found.z[:p] - start[:p], strict=True))
    names = [*free, *(name for name in values if name not in free)]
    plant = problem.predict(found.z).plant
    movable = [
        name
        for name, change in zip(names, plant.changes(names), strict=True)
        if name in free or (change is not None and change.matters)
    ]
    wide = _restricted(problem, text, measured, file, movable, changes)
    z = np.concatenate([wide.base.start, found.z[p:]])
    slope = wide.jacobian(z)
    slope = slope[: len(slope) - np.isfinite(wide.prior[1]).sum()]
    k = len(movable)
    rest = slope[:, k:]
    known = rest.T @ rest + np.diag(1 / wide.prior[1][k:] ** 2)
    cross = slope[:, :k].T @ rest
    own = slope[:, :k].T @ slope[:, :k] - cross @ np.linalg.solve(known, cross.T)
    moved = np.array([changes.get(name, 0.0) for name in movable])
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num((own @ moved) ** 2 / np.diag(own))
    before = _refit(problem, text, measured, file, [], found)
    result = []
    whole = float(moved @ own @ moved)
    for n in np.argsort(-gain, kind="stable")[:REFITTED]:
        if gain[n] <= max(WORTH * whole, 4.0):
            break
        end = _refit(problem, text, measured, file, [movable[int(n)]], found)
        if end is not None:
            given = float(end.problem.base.start[0])
            change = float(end.z[0]) - given
            result.append(SingleChange(movable[int(n)], given, change, end.chi_squared))
    result.sort(key=lambda item: item.chi_squared)
    if before is None:
        return float("nan"), tuple(result)
    least = before.chi_squared - WORTH * max(before.chi_squared - found.chi_squared, 0.0)
    return before.chi_squared, tuple(item for item in result if item.chi_squared < least)


def _restricted(
    problem: ResponseProblem,
    text: str,
    measured: Measured,
    file: str,
    names: Sequence[str],
    changes: dict[str, float] | None = None,
) -> ResponseProblem:
    """Set up the problem of the same measurements with other free numbers, without priors."""
    values = {item.name: item.value for item in parameters.every(text, problem.level)}
    given = {item.name: item for item in measured.parameter}
    free = []
    for name in names:
        begin = given[name].start if name in given else None
        begin = (
            values.get(name, given[name].prior if name in given else None)
            if begin is None
            else begin
        )
        assert begin is not None
        free.append(Free(name=name, start=begin + (changes or {}).get(name, 0.0)))
    other = msgspec.structs.replace(measured, parameter=free)
    base = search.build_problem([text], other, [file], problem.level)
    return problem.changed(base=base)


def _refit(
    problem: ResponseProblem,
    text: str,
    measured: Measured,
    file: str,
    names: Sequence[str],
    found: Solution,
) -> Solution | None:
    """Fit some numbers alone; None if no design is found."""
    try:
        made = _restricted(problem, text, measured, file, names)
        return refine(
            made, np.concatenate([made.base.start, found.z[problem.numbers :]]), quick=True
        )
    except (InputError, np.linalg.LinAlgError):
        return None


def least_known(problem: ResponseProblem, spread: UnknownMatrix) -> list[int]:
    """List the numbers with the largest standard deviations over their `scale`, worst first."""
    p = problem.numbers
    ratio = np.sqrt(np.diag(spread)[:p]) / problem.scale[:p]
    ratio = np.where(np.isnan(ratio), -1.0, ratio)
    return [int(n) for n in np.argsort(-ratio, kind="stable")[:LEAST] if ratio[n] > 0]


def next_measurements(
    found: Solution, numbers: Sequence[int]
) -> tuple[int | None, tuple[Candidate, ...]]:
    """Find the drives, sensors and bands that would determine a number best.

    The number is the first of `numbers` that a measurement improves by `IMPROVES`, else the one
    that it improves most. Candidates have the median relative noise of the measured functions, and
    a calibration error of `GAIN`.
    """
    problem, z, p = found.problem, found.z, found.problem.numbers
    now = problem.predict(z)
    inputs, outputs = _every_signal(now.plant)
    edges = np.log(BANDS)
    grid = np.exp(
        np.concatenate(
            [np.linspace(a, b, PER_BAND, endpoint=False) for a, b in itertools.pairwise(edges)]
        )
    )
    damping, stiffening = np.zeros((2, len(now.order)))
    added, changed = problem.added(z)
    damping[now.order[problem.damped]], stiffening[now.order[problem.stiff]] = added, changed
    response = now.plant.respond(grid, inputs, outputs, damping, stiffening)
    columns = [
        response.derivative(change)
        for change in now.plant.changes(problem.base.experiment[0].free)
        if change is not None
    ]
    columns += [
        size * response.damping_derivative(int(mode))
        for mode, size in zip(now.order[problem.damped], added, strict=True)
    ]
    first = p + len(problem.nuisances)
    places = [*range(p), *range(first, first + len(problem.damped))]
    value, slope = response.value, np.stack(columns, -1) * problem.scale[places]
    noise = [
        np.asarray(item.uncertainty) / np.maximum(np.abs(item.value), 1e-300)
        for item in problem.channels.function
    ]
    relative = float(np.clip(np.median(np.concatenate(noise)), 1e-4, 1.0)) if noise else RELATIVE
    whole = information(problem, z)
    weak = 1e-12 * np.diag(whole).max()
    spread = np.linalg.inv(whole + np.diag(np.where(np.diag(whole) > 0, weak, 1.0)))
    here = [places.index(n) for n in numbers]
    own = np.diag(spread)[list(numbers)]
    if not len(here):
        return None, ()
    result: list[tuple[np.ndarray, str, str, int]] = []
    size = np.abs(value)
    for band in range(len(BANDS) - 1):
        span = slice(band * PER_BAND, (band + 1) * PER_BAND)
        typical = np.median(size[span], axis=0)
        sigma = relative * np.maximum(size[span], 0.3 * typical)
        live = typical > ZERO * np.sqrt(np.outer(typical.max(1), typical.max(0)))
        for o, i in zip(*np.nonzero(live), strict=True):
            weight = 1 / sigma[:, o, i]
            rows = stack_parts(slope[span, o, i] * weight[:, None])
            gain = stack_parts((value[span, o, i] * weight)[:, None])[:, 0] * GAIN
            rows = rows - np.outer(gain, gain @ rows) * _shrink(float(gain @ gain))
            # Woodbury's identity for the one variance of interest
            part = spread[np.ix_(places, places)]
            carried = rows @ part
            middle = np.eye(len(rows)) + carried @ rows.T
            seen = carried[:, here]
            gained = (seen * np.linalg.solve(middle, seen)).sum(0)
            result.append((own - gained, inputs[i].text, outputs[o].text, band))
    ratio = np.sqrt(np.min([item[0] / own for item in result], axis=0).clip(0.0))
    good = np.flatnonzero(ratio < IMPROVES)
    chosen = int(good[0]) if len(good) else int(ratio.argmin())
    return numbers[chosen], _best(result, chosen, float(problem.scale[numbers[chosen]]))


def _every_signal(plant: Plant) -> tuple[list[Signal], list[Signal]]:
    """All drives of support and stages, and all motions of stages."""
    known, body = signals.bodies_with_signals(plant.system), plant.system.body
    drives = [f"{SUPPORT}.{dof}" for dof in DOFS]
    drives += [f"{name}.{force}" for name in body for force in signals.FORCES]
    motions = [f"{name}.{dof}" for name in body for dof in DOFS]
    return (
        [signals.parse_input(text, known) for text in drives],
        [signals.parse_output(text, known) for text in motions],
    )


def _best(
    result: list[tuple[np.ndarray, str, str, int]], chosen: int, scale: float
) -> tuple[Candidate, ...]:
    """Best candidates for one number, each drive and sensor once."""
    best: list[Candidate] = []
    pairs = set[tuple[str, str]]()
    for variance, drive, sensor, band in sorted(result, key=lambda item: float(item[0][chosen])):
        if (drive, sensor) not in pairs and len(best) < LISTED:
            pairs.add((drive, sensor))
            sigma = scale * float(np.sqrt(max(variance[chosen], 0.0)))
            best.append(Candidate(drive, sensor, (BANDS[band], BANDS[band + 1]), sigma))
    return tuple(best)


def _shrink(norm: float) -> float:
    """Compute c with (1 - c g g^T)^2 = (1 + g g^T)^-1, which whitens rows of unknown gain."""
    return (1 - 1 / np.sqrt(1 + norm)) / norm if norm else 0.0
