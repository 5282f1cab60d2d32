"""What a fit says: determined parameters and next measurements.

Both follow from the Jacobian J of the weighted residuals at the end of the fit.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.fit.problem import TYPICAL, Problem, stack_parts
from suspension_cli.analyses.fit.result import Candidate, Fit
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.linear import signals
from suspension_cli.studies.parameters import natural_step

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

    from suspension_cli.scene.arrays import Array

WEAK = 10.0
"""Factor on the typical changes of parameters, to weaken their priors."""
KNOWN, UNKNOWN = 0.3, 0.8
"""Standard deviation over that of the prior, or over the value if there is none, below which a
parameter is determined by the data, and above which it is not."""
TOGETHER = 0.2
"""Standard deviation of a combination over the smallest of its members' below which only the
combination is determined."""
POWERS = np.array([1.0, -1.0, 2.0, -2.0, 0.5, -0.5, 4.0, -4.0])
"""Exponents in a product of which only the product is determined."""
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


def describe(problem: Problem, slope: Array, fitted: Fit) -> tuple[str, ...]:
    """Say which parameters the data determine without priors, one statement per line."""
    p, free = problem.count, np.isinf(fitted.prior_sigma)
    # of parameters without prior: the value itself
    scale = problem.unknowns.scale[:p] * np.where(free, 1 / TYPICAL, 1.0)
    rows = problem.data_rows(slope) * scale
    spread = np.linalg.inv(rows.T @ rows + np.eye(p) / WEAK**2)
    sigma = np.sqrt(np.diag(spread))
    names = [short(name) for name in fitted.parameters]
    units = [change_unit(*item) for item in zip(fitted.name, fitted.value.tolist(), strict=True)]
    lengths = [unit == "mm" for unit, _ in units]
    covariance = spread * np.outer(scale, scale)
    lines, taken = combinations(names, lengths, fitted.value, covariance, sigma > KNOWN)
    said: dict[str, list[str]] = {
        "determined: ": [],
        "hardly determined: ": [],
        "not determined by these data, so their values are from priors or the design: ": [],
    }
    good, poor, no = said.values()
    for n in (n for n in range(p) if n not in taken):
        unit, factor = units[n]
        known = f"{names[n]} (to {sigma[n] * scale[n] * factor:.2g} {unit})"
        some = good if sigma[n] <= KNOWN else poor
        (some if sigma[n] < UNKNOWN else no).append(known if sigma[n] < UNKNOWN else names[n])
    first, *others = (head + ", ".join(some) if some else "" for head, some in said.items())
    return tuple(line for line in (first, *lines, *others) if line)


def combinations(
    names: list[str],
    lengths: list[bool],
    value: Array,
    spread: Array,
    uncertain: Bool[np.ndarray, " parameter"],
) -> tuple[list[str], set[int]]:
    """Find combinations of two or three parameters of which only the combination is determined.

    Sums of lengths, or products of powers; `spread` is the covariance of the parameters. The
    coefficients are those of the smallest principal axis of the members' covariance, rounded.
    Returns a sentence about each combination, and all members.
    """
    found = []
    left = np.flatnonzero(uncertain).tolist()
    for some in itertools.chain(*(itertools.combinations(left, size) for size in (2, 3))):
        group, summed = [*some], all(lengths[n] for n in some)
        if not summed and (value[group] <= 0).any():
            continue
        unit = np.ones(len(group)) if summed else value[group]
        own = spread[np.ix_(group, group)] / np.outer(unit, unit)
        axis = np.linalg.eigh(own)[1][:, 0]
        simple = POWERS[: 2 if summed else len(POWERS)]
        off = np.abs((axis / (axis[0] or 1.0))[:, None] / simple - 1)
        weight = simple[off.argmin(1)]
        error = float(np.sqrt(max(weight @ own @ weight, 0.0)))
        relative = error / float(np.abs(weight).max() * np.sqrt(np.diag(own)).min())
        if relative < TOGETHER:
            line = _describe_combination([names[n] for n in group], weight, error, summed)
            found.append((len(group), relative, {*group}, line))
    lines, taken = list[str](), set[int]()
    for _, _, members, line in sorted(found, key=lambda item: item[:2]):
        if not taken & members:
            taken |= members
            lines.append(line)
    return lines, taken


def _describe_combination(names: list[str], weight: Array, error: float, summed: bool) -> str:
    """Say that only a sum of lengths, or a product of powers, is known."""
    below = (weight < 0).any()
    if summed and len(names) == 2:
        what = f"{'difference' if below else 'sum'} of {names[0]} and {names[1]}"
    elif summed:
        terms = zip(weight, names, strict=True)
        what = "sum " + " ".join(f"{'+' if w > 0 else '-'} {name}" for w, name in terms)[2:]
    else:
        powers = zip(np.abs(weight), names, strict=True)
        parts = np.array([name if size == 1 else f"{name}^{size:g}" for size, name in powers])
        kind = "ratio" if below and len(names) == 2 else "product"
        what = " / ".join([f"{kind} {' x '.join(parts[weight > 0])}", *parts[weight < 0]])
    size = f"{1e3 * error:.2g} mm" if summed else f"{100 * error:.2g} %"
    return f"only the {what} is known (to {size})"


def next_measurements(
    problem: Problem, z: Array, slope: Array
) -> tuple[str, tuple[Candidate, ...]]:
    """Find the drives, sensors and bands that would determine a little known parameter best.

    The parameter is the first of the least known ones that a measurement improves by `IMPROVES`,
    else the one that it improves most. Candidates have the median relative noise of the measured
    functions, and a calibration error of `GAIN`. The information J^T J of a candidate is added to
    that of the fit (Fisher).
    """
    p, scale = problem.count, problem.unknowns.scale
    scaled = slope * scale
    whole = scaled.T @ scaled
    spread = np.linalg.inv(whole + 1e-12 * np.diag(whole).max() * np.eye(len(whole)))
    at_bound = np.isnan(np.diag(problem.covariance(z, slope)))
    order = np.argsort(-np.diag(spread)[:p], kind="stable")
    least = [int(n) for n in order if not at_bound[n]][:LEAST]
    if not least:
        return "", ()
    plant = problem.experiment[0].plant(z[:p])
    known, body = signals.bodies_with_signals(plant.system), plant.system.body
    drives = [f"{SUPPORT}.{dof}" for dof in DOFS]
    drives += [f"{name}.{force}" for name in body for force in signals.FORCES]
    inputs = [signals.parse_input(text, known) for text in drives]
    outputs = [signals.parse_output(f"{name}.{dof}", known) for name in body for dof in DOFS]
    bands = [np.geomspace(a, b, PER_BAND, endpoint=False) for a, b in itertools.pairwise(BANDS)]
    response = plant.respond(np.concatenate(bands), inputs, outputs, problem.damping(z))
    value = response.value
    places = np.delete(np.arange(len(z)), problem.parts[1])
    rate = np.moveaxis(problem.state_derivatives(response, z), 0, -1) * scale[places]
    functions = problem.channels.function
    noise = [item.uncertainty / np.maximum(np.abs(item.value), 1e-300) for item in functions]
    relative = float(np.clip(np.median(np.concatenate(noise)), 1e-4, 1.0))
    part, own = spread[np.ix_(places, places)], np.diag(spread)[least]
    found: list[tuple[Float[np.ndarray, " least"], str, str, int]] = []
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
            sigma = scale[least[chosen]] * float(np.sqrt(max(variance[chosen], 0.0)))
            best[drive, sensor] = Candidate(drive, sensor, (BANDS[band], BANDS[band + 1]), sigma)
    return problem.free[least[chosen]].name, tuple(best.values())
