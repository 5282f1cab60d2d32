"""What a fit says: determined parameters, next measurements; its text and JSON.

What is determined follows from the Jacobian J of the weighted residuals at the end of the fit.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document
from suspension_cli.analyses.fit.problem import TYPICAL, Problem, stack_parts
from suspension_cli.analyses.fit.result import SAME, Candidate, Fitted, ResponseFit
from suspension_cli.conventions import DOFS, SUPPORT
from suspension_cli.design.paths import unit_of
from suspension_cli.design.toml_edits import headed
from suspension_cli.files import documents
from suspension_cli.linear import signals
from suspension_cli.measurements.transfer_function import TABLES
from suspension_cli.quantities.requirements import displayed_unit
from suspension_cli.studies.parameters import natural_step
from suspension_cli.version import __version__

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
LISTED, LINES = 6, 10
"""Most candidates, and most functions, channels and priors that are printed, the worst first."""


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


def describe(problem: Problem, slope: Array, fitted: Fitted) -> tuple[str, ...]:
    """Say which parameters the data determine without priors, one statement per line."""
    p = problem.count
    # of parameters without prior: the value that was found
    without = np.isinf(fitted.prior_sigma)
    typical = problem.unknowns.scale[:p]
    size = np.where(fitted.value != 0, np.abs(fitted.value), typical / TYPICAL)
    scale: Array = np.where(without, size, typical)
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
        if sigma[n] >= UNKNOWN:
            no.append(names[n])
        else:
            (good if sigma[n] <= KNOWN else poor).append(known)
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
        group = [*some]
        summed = all(lengths[n] for n in some)
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
    lines = list[str]()
    taken = set[int]()
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
    p = problem.count
    scale = problem.unknowns.scale
    scaled = slope * scale
    whole = scaled.T @ scaled
    spread = np.linalg.inv(whole + 1e-12 * np.diag(whole).max() * np.eye(len(whole)))
    at_bound = np.isnan(np.diag(problem.covariance(z, slope)))
    order = np.argsort(-np.diag(spread)[:p], kind="stable")
    least = [int(n) for n in order if not at_bound[n]][:LEAST]
    if not least:
        return "", ()
    plant = problem.experiment[0].plant(z[:p])
    known = signals.bodies_with_signals(plant.system)
    body = plant.system.body
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
    part = spread[np.ix_(places, places)]
    own = np.diag(spread)[least]
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


def first_lines(found: Fitted) -> list[str]:
    """Return lines on a misfit, on wrong channels, and on values far from their priors."""
    lines = []
    if found.unlikely:
        lines += [_misfit(found), _remedy(found)]
    if found.unlikely_priors:
        count = len(found.pulls)
        lines.append(
            f"MISFIT: chi^2 of the {f'{count} priors' if count > 1 else 'prior'} alone is"
            f" {found.prior_chi_squared:.4g}, so the measurements contradict the priors: a part is"
            " not as designed, these parameters absorb something that the model lacks (a spring, a"
            " cable, a stop), or the priors are too narrow"
        )
    for one in found.responses.links[:1] if found.responses is not None else ():
        lines.append(
            f"a link or cable may be missing in the design: with one {one.text}, chi^2 is"
            f" {one.chi_squared:.4g} (without it {found.chi_squared:.4g}); look for a contact, or"
            " add it as [[link]]"
        )
    if found.far:
        far = ", ".join(f"{short(name)} ({pull:+.3g} sigma)" for name, pull in found.far[:LINES])
        more = f", and {len(found.far) - LINES} more" if len(found.far) > LINES else ""
        lines.append(f"far from the priors: {far}{more}")
    for one in found.responses.corrections if found.responses is not None else ():
        lines.append(
            f"{'CHANNEL: ' if one.known else ''}{one.text}; the fit includes this (without this"
            f" chi^2 is {one.chi_squared:.4g})"
        )
    return lines


def _misfit(found: Fitted) -> str:
    """Say that chi^2 is too large, and what that does to the uncertainties."""
    head = f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
    if found.freedom > 0:
        return (
            f"{head}, so these parameters do not explain the measurements; uncertainties are given"
            f" {found.scale:.3g} times as large"
        )
    name, residual = found.worst
    return (
        f"{head}: there are at least as many parameters as data, and yet no values of them meet the"
        f" data; {name} is off by {residual:+.3g} sigma"
    )


def _freedom(found: Fitted) -> str:
    """Say how far chi^2 tests the model."""
    text = f"{found.freedom} degrees of freedom"
    if found.freedom > 0 or found.unlikely:
        return text
    if found.freedom == 0:
        return f"{text}: the data determine the parameters and test nothing"
    return f"{text}: fewer data and priors than parameters, which they do not all determine"


def _remedy(found: Fitted) -> str:
    """Say what may remove a misfit."""
    if found.exchange is None:
        channels = ", or give channels gain_uncertainty or mix_uncertainty"
        more = channels if found.responses is not None else ""
        extra = "more" if found.freedom > 0 else "other"
        return f"free {extra} parameters{more}, or check designs, labels and uncertainties"
    first, second = found.exchange.labels
    several = len(found.experiment) > 1
    where = f" in {found.experiment[found.exchange.experiment]}" if several else ""
    return (
        f'two labels may be exchanged: with "{first}" and "{second}" exchanged{where}, chi^2 is'
        f" {found.exchange.chi_squared:.4g}"
    )


def report(found: Fitted) -> str:
    """Return the text below the line on the model."""
    responses = found.responses
    parts = [first_lines(found), [_parameters(found)]]
    if found.label:
        parts.append([_modes(found)])
    if found.quantity:
        parts.append([_quantities(found)])
    if responses is not None:
        parts += [[text] for text in _response_tables(responses)]
        parts.append(_explanations(found, responses))
    if found.determined:
        parts.append(["What these data say, without the priors:", *found.determined])
    if responses is not None and responses.least:
        parts.append(_next(found, responses))
    end = f"chi^2 {found.chi_squared:.4g} for {_freedom(found)}"
    if len(found.ends) > 1:
        same = int((found.ends <= (1 + SAME) * found.ends[0]).sum())
        rest = f", the next best at {found.ends[same]:.4g}" if same < len(found.ends) else ""
        end += f"\n{same} of {len(found.ends)} searches ended there{rest}"
    parts.append([end, *rounding(found)])
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


def rounding(found: Fitted) -> list[str]:
    """Say that the parameters are rounded, if they are."""
    effect = f"changes no residual by more than {found.rounding:g} of its uncertainty"
    return [f"parameters are rounded, which {effect}"] if found.rounding else []


def format_uncertainty(found: Fitted, n: int) -> str:
    """Format the standard deviation of parameter n, or say why there is none."""
    if found.at_bound[n]:
        return "at its bound"
    sigma = found.sigma[n]
    return f"+- {sigma:.2g}" if math.isfinite(sigma) else "not determined by these data"


def negative_stiffnesses(found: Fitted) -> list[str]:
    """Describe stiffnesses that become negative in the fit."""
    lines = []
    rows = zip(found.name, found.parameters, found.value, found.start, strict=True)
    for n, (name, label, value, first) in enumerate(rows):
        if _is_stiffness(name) and value < 0 <= first:
            lines.append(
                f"{label} is fitted as {value:.4g} {_unit_of_stiffness(name)}"
                f" ({format_uncertainty(found, n)}), but no spring has a negative stiffness: give"
                " the parameter lower = 0.0, and look for what else the model lacks"
            )
    return lines


def _is_stiffness(name: str) -> bool:
    """Whether a number is a stiffness that cannot be negative; those off a diagonal may be.

    >>> _is_stiffness("link.cable.stiffness.1.1"), _is_stiffness("link.cable.stiffness.1.2")
    (True, False)
    """
    keys = name.split(".")
    if keys[-2].isdigit() and keys[-1].isdigit() and keys[-2] != keys[-1]:
        return False
    return any(key == "k" or key.endswith("stiffness") for key in keys)


def _unit_of_stiffness(name: str) -> str:
    """Unit of a stiffness; elements of a matrix of six are along, then about axes."""
    last = name.rpartition(".")[2]
    if last.isdigit():
        return "N/m" if int(last) <= 3 else "N m/rad"
    return unit_of(name) or "N/m"


def _parameters(found: Fitted) -> str:
    sigmas = [format_uncertainty(found, n) for n in range(len(found.name))]
    numbers = found.parameter_unit, found.start, found.value
    columns = {"parameter": "", "unit": "", "start": "#.6g", "fitted": "#.6g", "uncertainty": ""}
    return tables.render(columns, zip(found.parameters, *numbers, sigmas, strict=True))


def _modes(found: Fitted) -> str:
    columns = dict.fromkeys(("measured\nHz", "+-\nHz", "before\nHz", "after\nHz"), "#.5g")
    columns |= {"+-\nHz": ".2g", "residual": "+.2f", "mode": ""}
    numbers = found.measured, found.uncertainty, found.before, found.after, found.residual
    return tables.render(columns, zip(*numbers, found.modes, strict=True))


def _quantities(found: Fitted) -> str:
    columns = {"measured": ".5g", "+-": ".2g", "before": ".5g", "after": ".5g"}
    columns |= {"unit": "", "residual": "+.2f", "quantity": ""}
    rows = []
    for n, name in enumerate(found.quantities):
        unit, factor = displayed_unit(found.quantity_unit[n])
        numbers = [
            factor * float(values[n])
            for values in (
                found.value_measured,
                found.value_uncertainty,
                found.value_before,
                found.value_after,
            )
        ]
        rows.append((*numbers, unit, found.value_residual[n], name))
    return tables.render(columns, rows)


def _response_tables(found: ResponseFit) -> list[str]:
    """Tables of resonances, of functions, and of properties of sensors and actuators."""
    made = []
    if len(found.mode):
        columns = {"measured\nHz": "#.5g", "model before\n%": "+.2f", "model after\n%": "+.3f"}
        columns |= {"measured\nQ": ".3g", "in\nfunctions": ".0f", "resonance": ""}
        hz, _, before, after, q, functions = found.resonance.T
        moves = (100 * (before / hz - 1), 100 * (after / hz - 1))
        made.append(tables.render(columns, zip(hz, *moves, q, functions, found.mode, strict=True)))
    before, after = (
        chi / np.maximum(2 * found.points, 1)
        for chi in (found.chi_squared_of(found.before), found.chi_squared)
    )
    names = found.function, found.output, found.input
    columns = {"chi^2 per value\nbefore": ".3g", "\nafter": ".3g", "frequencies\n": ".0f"}
    columns |= {"function": "", "output": "", "input": ""}
    rows = [*zip(before, after, found.points, *names, strict=True)]
    made.append(_worst(columns, rows, after, "functions that fit better"))
    if found.nuisance:
        values = found.nuisance_value, found.nuisance_sigma, found.nuisance_prior
        units = {"gain": ("%", 100.0), "delay": ("ms", 1e3)}
        rows = []
        for name, *sizes in zip(found.nuisance, *values, strict=True):
            unit, by = units.get(name.rpartition(".")[2], ("SI", 1.0))
            rows.append((*(by * size for size in sizes), unit, name))
        columns = {"change": "+.3g", "+-": ".2g", "expected +-": ".2g", "unit": ""}
        columns |= {"sensor or actuator": ""}
        far = np.abs(found.nuisance_value) / found.nuisance_prior
        made.append(_worst(columns, rows, far, "more, nearer to their expected values"))
    return made


def _worst(columns: dict[str, str], rows: list, by: np.ndarray, more: str) -> str:
    """Table of the rows with the largest values; the number of others follows."""
    order = np.argsort(-by, kind="stable")[:LINES]
    text = tables.render(columns, [rows[n] for n in order])
    return text + (f"\nand {len(rows) - LINES} {more}" if len(rows) > LINES else "")


def _explanations(found: Fitted, responses: ResponseFit) -> list[str]:
    """List the single changes that explain the measurements."""
    before = responses.chi_squared_before
    if not math.isfinite(before):
        return []
    if not responses.changes or before < found.chi_squared + 4 * len(found.name):
        return [
            f"The design as given explains the measurements: chi^2 is {before:.4g} with only"
            f" sensors, actuators and losses fitted, {found.chi_squared:.4g} with all parameters"
            " and their priors"
        ]
    lines = [
        "Single changes that explain most, with sensors, actuators and losses fitted; chi^2 with"
        f" all parameters and their priors is {found.chi_squared:.4g}:"
    ]
    for one in responses.changes:
        unit, factor = change_unit(one.name, one.start)
        change = f"{short(one.name)} {one.change * factor:+.3g} {unit}"
        lines.append(f"  {change}: chi^2 {before:.4g} -> {one.chi_squared:.4g}")
    return lines


def _next(found: Fitted, responses: ResponseFit) -> list[str]:
    """List the measurements that would determine the least known parameter."""
    n = found.name.index(responses.least)
    unit, factor = change_unit(responses.least, float(found.value[n]))
    known = f"{found.sigma[n] / found.scale * factor:.2g} {unit}"
    head = f"To learn more about {short(responses.least)}, now known to {known}, measure next:"
    return [head] + [
        f"  drive {one.input}, sense {one.output}, {one.band[0]:.2g} to {one.band[1]:.2g} Hz:"
        f" to {one.sigma * factor:.2g} {unit}"
        for one in responses.candidates
    ]


def fitted_design(found: Fitted, number: int, file: str, measured: str, command: str) -> str:
    """Return the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these parameters do not explain the measurements"] * found.unlikely
    head += ["MISFIT: these parameters contradict their priors"] * found.unlikely_priors
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    head += rounding(found)
    for n in np.flatnonzero(found.shared[:, number]).tolist():
        sigma = format_uncertainty(found, n)
        value = f"{float(found.value[n]):.12g}{', ' if sigma.startswith('not') else ' '}{sigma}"
        head.append(f"  {found.name[n]} = {value}, from {found.start[n]:.6g}")
    return headed(head, found.toml[number])


def document(found: Fitted, files: Sequence[str | None]) -> Document:
    """Return the JSON document; an uncertainty is null if it is infinite or at a bound."""
    made: Document = documents.document(found)
    for key in ("modes", "quantities"):
        for row in made.get(key, ()):
            row["experiment"] = found.experiment[row["experiment"]]
    for row, shared in zip(made["parameters"], found.shared, strict=True):
        row["experiments"] = np.array(found.experiment)[shared].tolist()
    exchange = None
    if found.exchange is not None:
        exchange = documents.document(found.exchange)
        exchange["experiment"] = found.experiment[found.exchange.experiment]
    pairs = zip(found.experiment, files, strict=True)
    made |= {
        "experiments": [{"name": name, "design": file} for name, file in pairs],
        "covariance": found.covariance,
        "directions": found.direction,
        "far_from_priors": [{"name": name, "sigmas": by} for name, by in found.far],
        "exchange": exchange,
    }
    return made if found.responses is None else made | _response_document(found.responses)


def _response_document(found: ResponseFit) -> Document:
    """Return what a fit of transfer functions adds."""
    made: Document = documents.document(found)
    for row in made["wrong_channels"]:
        row["side"] = TABLES[row["side"]]
        row["also"] = row["also"] or None
    keys = ("measured_hz", "uncertainty_hz", "before_hz", "after_hz", "q", "functions")
    made["resonances"] = [
        {"label": name} | dict(zip(keys, (*row[:5], int(row[5])), strict=True))
        for name, row in zip(found.mode, found.resonance, strict=True)
    ]
    return made | {"least_known": found.least or None}
