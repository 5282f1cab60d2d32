"""What a fit says, as text and as JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document
from suspension_cli.analyses.fit import osem_report
from suspension_cli.analyses.fit.printed_parameters import change_unit, short
from suspension_cli.analyses.fit.response_fit import ResponseFit
from suspension_cli.analyses.fit.result import SAME, Fitted
from suspension_cli.design.paths import unit_of
from suspension_cli.design.toml_edits import headed
from suspension_cli.files import documents
from suspension_cli.measurements.transfer_function import TABLES
from suspension_cli.quantities.requirements import displayed_unit
from suspension_cli.version import __version__

LINES = 10
"""Most functions, channels and priors that are printed, the worst first."""


def first_lines(found: Fitted) -> list[str]:
    """Return lines on a misfit, on wrong channels, and on values far from their priors."""
    if found.matrices is not None:
        return osem_report.first_lines(found, found.matrices)
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
    if found.matrices is not None:
        return "\n\n".join(osem_report.report(found, found.matrices))
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
    parts.append([end])
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


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


def rounding(found: Fitted) -> str:
    """Say to how many digits the written parameters are rounded."""
    return (
        f"parameters are rounded to {found.digits} digits, which changes none of their"
        " combinations by more than a tenth of its standard error"
    )


def fitted_design(found: Fitted, number: int, file: str, measured: str, command: str) -> str:
    """Return the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    if found.matrices is not None:
        head += first_lines(found)
        chi_squared = f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"
        return headed([*head, f"  {command}", chi_squared], found.toml[number])
    head += ["MISFIT: these parameters do not explain the measurements"] * found.unlikely
    head += ["MISFIT: these parameters contradict their priors"] * found.unlikely_priors
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}"]
    if found.digits:
        head.append(rounding(found))
    head += [f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
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
    if found.matrices is not None:
        made["matrices"] = documents.document(found.matrices)
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
