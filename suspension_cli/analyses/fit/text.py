"""Text and JSON of a fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, plain, table
from suspension_cli.analyses.fit.findings import change_unit, short
from suspension_cli.analyses.fit.result import SAME, Fit, ResponseFit
from suspension_cli.errors import escape_unprintable
from suspension_cli.measurements.transfer_function import TABLES
from suspension_cli.version import __version__

LISTED = 10
"""Most functions, properties of channels, and priors that are printed, the worst first."""


def first_lines(found: Fit) -> list[str]:
    """Return lines on a misfit, on wrong channels, and on values far from their priors."""
    lines = []
    if found.unlikely:
        lines.append(
            f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom, so"
            " these parameters do not explain the measurements; uncertainties are given"
            f" {found.scale:.3g} times as large"
        )
        lines.append(_remedy(found))
    if found.unlikely_priors:
        count = len(found.pulls)
        lines.append(
            f"MISFIT: chi^2 of the {f'{count} priors' if count > 1 else 'prior'} alone is"
            f" {found.prior_chi_squared:.4g}, so the measurements contradict the priors: a part is"
            " not as designed, these parameters absorb something that the model lacks (a spring, a"
            " cable, a stop), or the priors are too narrow"
        )
    if found.far:
        far = ", ".join(f"{short(name)} ({pull:+.3g} sigma)" for name, pull in found.far[:LISTED])
        more = f", and {len(found.far) - LISTED} more" if len(found.far) > LISTED else ""
        lines.append(f"far from the priors: {far}{more}")
    for one in found.responses.corrections if found.responses is not None else ():
        lines.append(
            f"{'CHANNEL: ' if one.known else ''}{one.text}; the fit includes this (without this"
            f" chi^2 is {one.chi_squared:.4g})"
        )
    return lines


def _remedy(found: Fit) -> str:
    """Say what may remove a misfit."""
    if found.exchange is None:
        channels = ", or give channels gain_uncertainty or mix_uncertainty"
        more = channels if found.responses is not None else ""
        return f"free more parameters{more}, or check designs, labels and uncertainties"
    first, second = found.exchange.labels
    several = len(found.experiment) > 1
    where = f" in {found.experiment[found.exchange.experiment]}" if several else ""
    return (
        f'two labels may be exchanged: with "{first}" and "{second}" exchanged{where}, chi^2 is'
        f" {found.exchange.chi_squared:.4g}"
    )


def report(found: Fit) -> str:
    """Return the text below the line on the model."""
    responses, parts = found.responses, [first_lines(found), [_parameters(found)]]
    if found.label:
        parts.append([_modes(found)])
    if responses is not None:
        parts += [[text] for text in _response_tables(responses)]
        parts.append(_explanations(found, responses))
    if found.determined:
        parts.append(["What these data say, without the priors:", *found.determined])
    if responses is not None and responses.least:
        parts.append(_next(found, responses))
    end = f"chi^2 {found.chi_squared:.4g} for {found.freedom} degrees of freedom"
    if len(found.ends) > 1:
        same = int((found.ends <= (1 + SAME) * found.ends[0]).sum())
        rest = f", the next best at {found.ends[same]:.4g}" if same < len(found.ends) else ""
        end += f"\n{same} of {len(found.ends)} searches ended there{rest}"
    return "\n\n".join("\n".join(lines) for lines in [*parts, [end]] if lines)


def format_uncertainty(found: Fit, n: int) -> str:
    """Format the standard deviation of parameter n, or say why there is none."""
    if found.at_bound[n]:
        return "at its bound"
    sigma = found.sigma[n]
    return f"+- {sigma:.2g}" if math.isfinite(sigma) else "not determined by these data"


def _parameters(found: Fit) -> str:
    sigmas = [format_uncertainty(found, n) for n in range(len(found.name))]
    numbers = found.parameter_unit, found.start, found.value
    columns = {"parameter": "", "unit": "", "start": "#.6g", "fitted": "#.6g", "uncertainty": ""}
    return tables.render(columns, zip(found.parameters, *numbers, sigmas, strict=True))


def _modes(found: Fit) -> str:
    columns = dict.fromkeys(("measured\nHz", "+-\nHz", "before\nHz", "after\nHz"), "#.5g")
    columns |= {"+-\nHz": ".2g", "residual": "+.2f", "mode": ""}
    numbers = found.measured, found.uncertainty, found.before, found.after, found.residual
    return tables.render(columns, zip(*numbers, found.modes, strict=True))


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
    order = np.argsort(-by, kind="stable")[:LISTED]
    text = tables.render(columns, [rows[n] for n in order])
    return text + (f"\nand {len(rows) - LISTED} {more}" if len(rows) > LISTED else "")


def _explanations(found: Fit, responses: ResponseFit) -> list[str]:
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


def _next(found: Fit, responses: ResponseFit) -> list[str]:
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


def fitted_design(found: Fit, number: int, file: str, measured: str, command: str) -> str:
    """Return the fitted design of an experiment (from 0), headed by comments on its origin."""
    others = ", ".join(name for n, name in enumerate(found.experiment) if n != number)
    together = f" together with {others}" if others else ""
    head = [f"{file}, fitted to {measured}{together} by pendsus {__version__}:"]
    head += ["MISFIT: these parameters do not explain the measurements"] * found.unlikely
    head += ["MISFIT: these parameters contradict their priors"] * found.unlikely_priors
    if found.responses is not None:
        head += [one.text for one in found.responses.corrections]
    head += [f"  {command}", f"chi^2 = {found.chi_squared:.4g}, {found.freedom} degrees of freedom"]
    for n in np.flatnonzero(found.shared[:, number]).tolist():
        sigma = format_uncertainty(found, n)
        value = f"{float(found.value[n])!r}{', ' if sigma.startswith('not') else ' '}{sigma}"
        head.append(f"  {found.name[n]} = {value}, from {found.start[n]:.6g}")
    lines = "".join(f"# {escape_unprintable(line)}\n" for line in head)
    return f"{lines}\n{found.design[number]}"


def document(found: Fit, files: Sequence[str | None]) -> Document:
    """Return the JSON document; an uncertainty is null if it is infinite or at a bound."""
    who = np.array(found.experiment)
    parameters = table(found, "name start value sigma prior prior_sigma at_bound")
    for row, shared in zip(parameters, found.shared, strict=True):
        row["experiments"] = who[shared].tolist()
        if row["prior_sigma"] is None:
            row["prior"] = None
    columns = "label measured_hz=measured uncertainty_hz=uncertainty before_hz=before"
    modes = table(found, f"experiment=of {columns} after_hz=after residual")
    for row in modes:
        row["experiment"] = found.experiment[row["experiment"]]
    exchange = None
    if found.exchange is not None:
        one = found.exchange
        exchange = {"experiment": found.experiment[one.experiment], "labels": [*one.labels]}
        exchange["chi_squared"] = one.chi_squared
    pairs = zip(found.experiment, files, strict=True)
    return {
        "experiments": [{"name": name, "design": file} for name, file in pairs],
        "parameters": parameters,
        "covariance": plain(found.covariance),
        "modes": modes,
        "chi_squared": found.chi_squared,
        "chi_squared_of_starts": found.ends.tolist(),
        "degrees_of_freedom": found.freedom,
        "chi_squared_of_priors": found.prior_chi_squared,
        "far_from_priors": [{"name": name, "sigmas": plain(by)} for name, by in found.far],
        "misfit": found.misfit,
        "sigma_scale": found.scale,
        "exchange": exchange,
        "singular_values": found.singular.tolist(),
        "directions": found.direction.tolist(),
        "determined": list(found.determined),
    } | (_response_document(found.responses) if found.responses is not None else {})


def _response_document(found: ResponseFit) -> Document:
    values = "change=nuisance_value sigma=nuisance_sigma prior_sigma=nuisance_prior"
    keys = ("measured_hz", "uncertainty_hz", "before_hz", "after_hz", "q", "functions")
    columns = "kind side factor claimed_otherwise=known also"
    wrong = table(found.corrections, f"{columns} chi_squared_without=chi_squared text")
    for row, one in zip(wrong, found.corrections, strict=True):
        row |= {"side": TABLES[one.side], "channels": [*one.channel], "also": one.also or None}
    return {
        "transfer_functions": table(
            found, "name=function output input frequencies=points chi_squared"
        ),
        "channels": table(found, f"name=nuisance {values}"),
        "resonances": [
            {"label": name} | dict(zip(keys, (*plain(row[:5]), int(row[5])), strict=True))
            for name, row in zip(found.mode, found.resonance, strict=True)
        ],
        "wrong_channels": wrong,
        "chi_squared_before": plain(found.chi_squared_before),
        "single_changes": table(found.changes, "name start change chi_squared"),
        "least_known": found.least or None,
        "measure_next": table(found.candidates, "input output band_hz=band sigma"),
    }
