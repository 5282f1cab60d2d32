"""What a fit says: determined parameters, single changes that explain the data, next measurements.

All follow from the Jacobian J of the weighted residuals at the end of the fit.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.problem import Problem, stack_parts, typical_change
from suspension_cli.analyses.fit.result import Candidate, SingleChange
from suspension_cli.analyses.fit.search import Solution, refine
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.measured import Free
from suspension_cli.errors import InputError
from suspension_cli.linear import signals
from suspension_cli.studies import parameters
from suspension_cli.studies.parameters import natural_step

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.scene.arrays import Array

UNDETERMINED = 1e-10
"""Singular value relative to the largest, below which the data do not determine a combination."""
WEAK = 10.0
"""Factor on the typical changes of parameters, to weaken their priors."""
KNOWN = 0.3
"""Standard deviation over the typical change below which a parameter is determined by the data."""
UNKNOWN = 0.8
"""The same ratio above which the data do not determine a parameter."""
TOGETHER = 0.2
"""Standard deviation of a combination over the smallest of its members' below which only the
combination is determined."""
COMBINED = 8
"""Parameters that are searched for combinations of three."""
REFITTED = 5
"""Most single changes that are fitted."""
WORTH = 0.02
"""Fraction of the fit's decrease of chi^2 that a single change must reach to be reported."""
GAIN = 0.05
"""Relative calibration error of a candidate measurement."""
PER_BAND = 24
"""Frequencies of a candidate measurement."""
BANDS = tuple(0.1 * 10 ** (n / 3) for n in range(7))
"""Edges of the bands of candidate measurements, Hz."""
ZERO = 1e-8
"""Size of a response over others of its drive and sensor below which it is a rounding error."""
LEAST = 8
"""Number of the least known parameters for which measurements are sought."""
IMPROVES = 0.7
"""Factor on a standard deviation below which a measurement is an improvement."""
LISTED = 6
"""Most candidates that are reported."""


def covariance(problem: Problem, z: Array, slope: Array) -> Float[np.ndarray, "unknown unknown"]:
    """Compute (J^T J)^-1; infinite where not determined, NaN at a bound."""
    low, high = problem.bounds
    size = np.where(z != 0, np.abs(z), problem.scale)
    inner = (np.abs(z - low) > 1e-8 * size) & (np.abs(z - high) > 1e-8 * size)
    result = np.full((len(z), len(z)), np.nan)
    if not inner.any():
        return result
    scaled = slope[:, inner] * problem.scale[inner]
    norm = np.sqrt((scaled**2).sum(0))
    norm[norm == 0] = 1.0
    _, singular, direction = np.linalg.svd(np.linalg.qr(scaled / norm, mode="r"))
    whole = np.zeros(inner.sum())
    whole[: len(singular)] = singular
    good = whole > UNDETERMINED * whole.max()
    inverse = (direction[good].T / whole[good] ** 2) @ direction[good]
    lost = (np.abs(direction[~good]) > 1e-6).any(0)
    inverse[lost, :] = inverse[:, lost] = 0.0
    inverse[lost, lost] = np.inf
    result[np.ix_(inner, inner)] = inverse * np.outer(*2 * [problem.scale[inner] / norm])
    return result


def data_rows(problem: Problem, slope: Array) -> Float[np.ndarray, "row parameter"]:
    """Derivatives of the weighted data by the parameters, all other unknowns fitted to them.

    The columns of the other unknowns, with their priors, are projected out (Golub and Pereyra, SIAM
    J. Numer. Anal. 10, 413 (1973)).
    """
    known = np.isfinite(problem.prior[1])
    of_parameters = np.flatnonzero(known[: problem.count])
    first = len(slope) - int(known.sum())
    rows = np.delete(slope, first + np.arange(len(of_parameters)), axis=0)
    own, others = rows[:, : problem.count], rows[:, problem.count :]
    if not others.shape[1]:
        return own
    basis = np.linalg.qr(others * problem.scale[problem.count :])[0]
    return own - basis @ (basis.T @ own)


def change_unit(name: str, value: float) -> tuple[str, float]:
    """Choose the printed unit of a change of a parameter, and the factor to it from SI.

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


def describe(problem: Problem, z: Array, slope: Array) -> tuple[str, ...]:
    """Say which parameters the data determine, one statement per line."""
    p = problem.count
    if not p:
        return ()
    scale, names = problem.scale[:p], [item.name for item in problem.free]
    rows = data_rows(problem, slope) * scale
    spread = np.linalg.inv(rows.T @ rows + np.eye(p) / WEAK**2)
    sigma = np.sqrt(np.diag(spread))
    units = [change_unit(name, float(value)) for name, value in zip(names, z[:p], strict=True)]
    said, taken = combinations(names, z[:p], spread * np.outer(scale, scale), sigma > KNOWN)
    alone = [n for n in range(p) if n not in taken]

    def words(some: list[int]) -> str:
        sizes = [(short(names[n]), sigma[n] * scale[n] * units[n][1], units[n][0]) for n in some]
        return ", ".join(f"{name} (to {size:.2g} {unit})" for name, size, unit in sizes)

    good = [n for n in alone if sigma[n] <= KNOWN]
    poor = [n for n in alone if KNOWN < sigma[n] < UNKNOWN]
    rest = [short(names[n]) for n in alone if sigma[n] >= UNKNOWN]
    lines = ["determined: " + words(good)] if good else []
    lines += said + (["hardly determined: " + words(poor)] if poor else [])
    if rest:
        text = "not determined by these data, so their values are from priors or the design: "
        lines.append(text + ", ".join(rest))
    return tuple(lines)


def combinations(
    names: list[str], value: Array, spread: Array, uncertain: Bool[np.ndarray, " parameter"]
) -> tuple[list[str], set[int]]:
    """Find combinations of two or three parameters of which only the combination is determined.

    Sums of lengths, or products of powers; `spread` is the covariance of the parameters.
    """
    lengths = [change_unit(name, 1.0)[0] == "mm" for name in names]
    lines: list[str] = []
    taken: set[int] = set()
    for size in (2, 3):
        left = [n for n in np.flatnonzero(uncertain) if n not in taken]
        if size == 3:
            left = sorted(left, key=lambda n: -spread[n, n] / value[n] ** 2)[:COMBINED]
        found = []
        for group in itertools.combinations(left, size):
            some, summed = list(group), all(lengths[n] for n in group)
            if not summed and (value[some] <= 0).any():
                continue
            unit = np.ones(size) if summed else value[some]
            own = spread[np.ix_(some, some)] / np.outer(unit, unit)
            single = np.sqrt(np.diag(own)).min()
            for tail in itertools.product(
                (1, -1) if summed else (1, -1, 2, -2, 0.5, -0.5, 4, -4), repeat=size - 1
            ):
                weight = np.array([1.0, *tail])
                error = float(np.sqrt(max(weight @ own @ weight, 0.0)))
                ratio = error / float(np.abs(weight).max()) / single
                if ratio < TOGETHER:
                    found.append((ratio, some, weight, error, summed))
        for _, some, weight, error, summed in sorted(found, key=lambda item: item[0]):
            if not taken & set(some):
                taken |= set(some)
                short_names = [short(names[n]) for n in some]
                lines.append(_sentence(short_names, weight, error, summed=summed))
    return lines, taken


def _sentence(names: list[str], weight: Array, error: float, *, summed: bool) -> str:
    if summed:
        words = f"is known (to {1e3 * error:.2g} mm)"
        listed = ", ".join(names[:-1]) + " and " + names[-1]
        if (weight == 1).all():
            return f"only the sum of {listed} {words}"
        if len(names) == 2:
            return f"only the difference of {listed} {words}"
        terms = [f"{'+' if w > 0 else '-'} {n}" for w, n in zip(weight, names, strict=True)]
        return f"only {' '.join(terms).removeprefix('+ ')} {words}"
    parts = [n if abs(w) == 1 else f"{n}^{abs(w):g}" for w, n in zip(weight, names, strict=True)]
    above = " x ".join(part for part, w in zip(parts, weight, strict=True) if w > 0)
    below = "".join(f" / {part}" for part, w in zip(parts, weight, strict=True) if w < 0)
    kind = "ratio" if below and len(names) == 2 else "product"
    return f"only the {kind} {above}{below} is known (to {100 * error:.2g} %)"


def restricted(problem: Problem, names: list[str], values: dict[str, float]) -> Problem:
    """Set up the problem of the same measurements with other free parameters, without priors."""
    start = np.array([values[name] for name in names])
    one = replace(
        problem.experiment[0],
        free=names,
        start=start,
        scale=typical_change(start),
        around=None,
        _plants={},
    )
    free, shared = [Free(name=name) for name in names], np.ones((len(names), 1), dtype=bool)
    return problem.changed(experiment=[one], free=free, shared=shared, base=start, _solved={})


def single_changes(found: Solution) -> tuple[float, tuple[SingleChange, ...]]:
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
    one, rest = problem.experiment[0], found.z[p:]
    given = {item.name: item.value for item in parameters.every(one.text, one.level)}
    given |= dict(zip(one.free, problem.base, strict=True))
    changes = dict(zip(one.free, found.z[:p] - problem.base, strict=True))
    derivatives = dict(zip(given, one.plant(found.z[:p]).changes(list(given)), strict=True))
    matter = {
        name: change
        for name, change in derivatives.items()
        if change is not None and (change.matters or name in one.free)
    }
    names = list(matter)
    moved = np.array([changes.get(name, 0.0) for name in names])
    wide = restricted(problem, names, {n: given[n] + changes.get(n, 0.0) for n in names})
    wide.experiment[0].around = (wide.base, list(matter.values()))
    slope = data_rows(wide, wide.jacobian(np.concatenate([wide.base, rest])))
    own = slope.T @ slope
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = np.nan_to_num((own @ moved) ** 2 / np.diag(own))

    def fit(some: list[str]) -> Solution:
        made = restricted(problem, some, given)
        begin = np.concatenate([made.base, rest])
        return refine(replace(found, problem=made, z=begin), quick=True)

    before = fit([]).chi_squared
    result = []
    for n in np.argsort(-gain, kind="stable")[:REFITTED]:
        if gain[n] > max(WORTH * float(moved @ own @ moved), 4.0):
            try:
                end = fit([names[n]])
            except (InputError, np.linalg.LinAlgError):
                continue
            start = given[names[n]]
            result.append(SingleChange(names[n], start, float(end.z[0]) - start, end.chi_squared))
    least = before - WORTH * max(before - found.chi_squared, 0.0)
    good = [item for item in result if item.chi_squared < least]
    return before, tuple(sorted(good, key=lambda item: item.chi_squared))


def next_measurements(
    problem: Problem, z: Array, slope: Array
) -> tuple[int | None, tuple[Candidate, ...]]:
    """Find the drives, sensors and bands that would determine a little known parameter best.

    The parameter is the first of the least known ones that a measurement improves by `IMPROVES`,
    else the one that it improves most. Candidates have the median relative noise of the measured
    functions, and a calibration error of `GAIN`. The information J^T J of a candidate is added to
    that of the fit (Fisher).
    """
    p, one = problem.count, problem.experiment[0]
    scaled = slope * problem.scale
    whole = scaled.T @ scaled
    spread = np.linalg.inv(whole + 1e-12 * np.diag(whole).max() * np.eye(len(whole)))
    at_bound = np.isnan(np.diag(covariance(problem, z, slope)))
    order = np.argsort(-np.diag(spread)[:p], kind="stable")
    least = [int(n) for n in order if not at_bound[n]][:LEAST]
    if not least:
        return None, ()
    plant, modes = one.plant(z[:p]), one.order(z[:p])
    known, body = signals.bodies_with_signals(plant.system), plant.system.body
    drives = [f"{SUPPORT}.{dof}" for dof in DOFS]
    drives += [f"{name}.{force}" for name in body for force in signals.FORCES]
    inputs = [signals.parse_input(text, known) for text in drives]
    outputs = [signals.parse_output(f"{name}.{dof}", known) for name in body for dof in DOFS]
    bands = [np.geomspace(a, b, PER_BAND, endpoint=False) for a, b in itertools.pairwise(BANDS)]
    damping, stiffening = np.zeros((2, len(modes)))
    damping[modes[problem.damped]] = added = np.exp(z[problem.parts[2]])
    stiffening[modes[problem.stiff]] = z[problem.parts[3]]
    response = plant.respond(np.concatenate(bands), inputs, outputs, damping, stiffening)
    columns = [response.derivative(change) for change in one.changes(z[:p])]
    columns += [
        size * response.damping_derivative(int(mode))
        for mode, size in zip(modes[problem.damped], added, strict=True)
    ]
    places = [*range(p), *range(problem.parts[2].start, problem.parts[2].stop)]
    value, rate = response.value, np.stack(columns, -1) * problem.scale[places]
    noise = [
        item.uncertainty / np.maximum(np.abs(item.value), 1e-300)
        for item in problem.channels.function
    ]
    relative = float(np.clip(np.median(np.concatenate(noise)), 1e-4, 1.0))
    part, own = spread[np.ix_(places, places)], np.diag(spread)[least]
    found: list[tuple[Array, str, str, int]] = []
    for band in range(len(bands)):
        span = slice(band * PER_BAND, (band + 1) * PER_BAND)
        typical = np.median(np.abs(value[span]), axis=0)
        sigma = relative * np.maximum(np.abs(value[span]), 0.3 * typical)
        live = typical > ZERO * np.sqrt(np.outer(typical.max(1), typical.max(0)))
        for o, i in zip(*np.nonzero(live), strict=True):
            weight = 1 / sigma[:, o, i, None]
            rows = stack_parts(rate[span, o, i] * weight)
            gain = GAIN * stack_parts(value[span, o, i, None] * weight)
            # Woodbury's identity for the variances of interest
            middle = np.eye(len(rows)) + rows @ part @ rows.T + gain @ gain.T
            seen = rows @ part[:, least]
            gained = (seen * np.linalg.solve(middle, seen)).sum(0)
            found.append((own - gained, inputs[i].text, outputs[o].text, band))
    ratio = np.sqrt(np.min([item[0] / own for item in found], axis=0).clip(0.0))
    good = np.flatnonzero(ratio < IMPROVES)
    chosen = int(good[0]) if len(good) else int(ratio.argmin())
    best: dict[tuple[str, str], Candidate] = {}
    for variance, drive, sensor, band in sorted(found, key=lambda item: float(item[0][chosen])):
        if (drive, sensor) not in best and len(best) < LISTED:
            sigma = problem.scale[least[chosen]] * float(np.sqrt(max(variance[chosen], 0.0)))
            best[drive, sensor] = Candidate(drive, sensor, (BANDS[band], BANDS[band + 1]), sigma)
    return least[chosen], tuple(best.values())
