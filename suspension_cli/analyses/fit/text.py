"""Text and JSON of a fit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, plain, table
from suspension_cli.analyses.fit.channels import TABLES
from suspension_cli.analyses.fit.findings import change_unit, short
from suspension_cli.analyses.fit.result import SAME, Candidate, Fit, ResponseFit, SingleChange

LARGEST = 6
"""Parameters of a combination that are printed."""
NUISANCES = 12
"""Most properties of channels that are printed: those farthest from their priors."""
FUNCTIONS = 8
"""Most functions that are printed: those that fit worst."""
LISTED = 6
"""Most values far from their priors that are named in a misfit."""


def first_lines(found: Fit) -> list[str]:
    """Return lines on a misfit, on wrong channels, and on values far from their priors."""
    lines = _misfit(found)
    return lines + corrections(found.responses) if found.responses is not None else lines


def _misfit(found: Fit) -> list[str]:
    lines = []
    far = ", ".join(f"{_short(name)} ({pull:+.3g} sigma)" for name, pull in found.far[:LISTED])
    more = f", and {len(found.far) - LISTED} more" if len(found.far) > LISTED else ""
    if found.unlikely:
        lines.append(
            f"MISFIT: chi^2 is {found.chi_squared:.4g} for {found.freedom} degrees of freedom, so"
            " these parameters do not explain the measurements; uncertainties are given"
            f" {found.scale:.3g} times as large"
        )
        if found.responses is not None:
            lines.append(
                "no exchange or sign of channels removes the misfit: free more parameters, give"
                " sensors and actuators gain_uncertainty or mix_uncertainty, or check uncertainties"
            )
        elif found.exchange is None:
            lines.append(
                "no exchange of two labels removes the misfit: free more parameters, or check"
                " designs, labels and uncertainties"
            )
        else:
            first, second = found.exchange.labels
            several = len(found.experiment) > 1
            where = f" in {found.experiment[found.exchange.experiment]}" if several else ""
            lines.append(
                f'two labels may be exchanged: with "{first}" and "{second}" exchanged{where},'
                f" chi^2 is {found.exchange.chi_squared:.4g}"
            )
    if found.unlikely_priors:
        count = len(found.pulls)
        lines.append(
            f"MISFIT: chi^2 of the {f'{count} priors' if count > 1 else 'prior'} alone is"
            f" {found.prior_chi_squared:.4g}, so the measurements contradict the priors: a part is"
            " not as designed, these parameters absorb something that the model lacks (a spring, a"
            " cable, a stop), or the priors are too narrow"
        )
    if far:
        lines.append(f"far from the priors: {far}{more}")
    return lines


def _short(name: str) -> str:
    """Shorten a path that may be followed by experiments."""
    path, space, rest = name.partition(" ")
    return short(path) + space + rest


def corrections(found: ResponseFit) -> list[str]:
    """Describe channels and modes that no geometry explains, with their effect on chi^2."""
    lines = []
    for one in found.corrections:
        known = math.isfinite(one.chi_squared)
        without = f" (without this chi^2 is {one.chi_squared:.4g})" if known else ""
        channel = "CHANNEL: " if one.known else ""
        lines.append(f"{channel}{one.text}; the fit includes this{without}")
    if found.stiffened:
        parts = ", ".join(
            f"{mode.label} (frequency +{100 * mode.excess:.2g} %, Q {mode.q:.3g})"
            for mode in found.stiffened
        )
        lines.append(
            "RUBBING? these modes are both stiffer and more lossy than any parameter of the design"
            f" explains: {parts}; look for a wire, a cable or a stop that touches"
        )
    return lines


def report(found: Fit) -> str:
    """Return the text below the line on the model."""
    responses = found.responses
    parts = ["\n".join(first_lines(found)), _parameters(found)]
    if found.label:
        parts.append(_modes(found))
    ends = _search_ends(found)
    if responses is None:
        parts.append("\n".join([*ends, "", *_combinations(found)]))
    else:
        said = responses.sentences
        parts += [
            _resonances(responses),
            _functions(responses),
            _nuisances(responses),
            "\n".join(_explanations(found, responses)),
            "\n".join(["What these data say, without the priors:", *said] if said else []),
            "\n".join(_next(found, responses)),
            "\n".join(ends),
        ]
    return "\n\n".join(part for part in parts if part)


def format_uncertainty(found: Fit, n: int) -> str:
    """Format the standard deviation of parameter n, or say why there is none."""
    if found.at_bound[n]:
        return "at its bound"
    sigma = found.scale * found.sigma[n]
    return f"+- {sigma:.2g}" if math.isfinite(sigma) else "not determined by these data"


def _parameters(found: Fit) -> str:
    from suspension_cli.design.paths import unit_of

    names = zip(found.parameters, found.name, strict=True)
    rows = [
        (label, unit_of(name), found.start[n], found.value[n], format_uncertainty(found, n))
        for n, (label, name) in enumerate(names)
    ]
    columns = {"parameter": "", "unit": "", "start": "#.6g", "fitted": "#.6g", "uncertainty": ""}
    return tables.render(columns, rows)


def _modes(found: Fit) -> str:
    modelled = (
        [value if math.isfinite(value) else "unstable" for value in values]
        for values in (found.before, found.after)
    )
    columns = dict.fromkeys(("measured\nHz", "+-\nHz", "before\nHz", "after\nHz"), "#.5g")
    columns |= {"+-\nHz": ".2g", "residual": "+.2f", "mode": ""}
    rows = zip(
        found.measured, found.uncertainty, *modelled, found.residual, found.modes, strict=True
    )
    return tables.render(columns, rows)


def _search_ends(found: Fit) -> list[str]:
    lines = [f"chi^2 {found.chi_squared:.4g} for {found.freedom} degrees of freedom"]
    if len(found.ends) > 1:
        same = int((found.ends <= (1 + SAME) * found.ends[0]).sum())
        rest = f", the next best at {found.ends[same]:.4g}" if same < len(found.ends) else ""
        lines.append(f"{same} of {len(found.ends)} searches ended there{rest}")
    return lines


def _combinations(found: Fit) -> list[str]:
    """Uncertainties of combinations of parameters."""
    lines = ["uncertainties of combinations of relative changes, from the modes without priors:"]
    for value, row in zip(found.singular, found.direction, strict=True):
        pairs = sorted(zip(row, found.parameters, strict=True), key=lambda item: -abs(item[0]))
        parts = " ".join(
            f"{part:+.2f} {name}" for part, name in pairs[:LARGEST] if abs(part) >= 0.05
        )
        known = value > 1e-9 * found.singular[0]
        lines.append(f"  {f'{100 / value:.2g} %' if known else 'undetermined'}: {parts}")
    left = len(found.name) - len(found.singular)
    if left > 0:
        lines.append(f"  {left} more are not determined, as there are more parameters than modes")
    return lines


def _resonances(found: ResponseFit) -> str:
    columns = {
        "measured\nHz": "#.5g",
        "model before\n%": "+.2f",
        "model after\n%": "+.3f",
        "measured\nQ": ".3g",
        "in\nfunctions": "d",
        "resonance": "",
    }
    rows = [
        (hz, 100 * (before / hz - 1), 100 * (after / hz - 1), q, int(functions), name)
        for (hz, _, before, after, q, functions), name in zip(
            found.resonance, found.mode, strict=True
        )
    ]
    return tables.render(columns, rows) if rows else ""


def _functions(found: ResponseFit) -> str:
    ratio = found.chi_squared / np.maximum(found.points, 1)
    order = np.argsort(-ratio, kind="stable")[:FUNCTIONS]
    before = np.abs((found.before - found.measured) / found.uncertainty) ** 2
    start = np.bincount(found.of, before, len(found.function)) / np.maximum(found.points, 1)
    names = [*zip(found.function, found.output, found.input, strict=True)]
    rows = [(float(start[n]), float(ratio[n]), int(found.points[n] // 2), *names[n]) for n in order]
    columns = {
        "chi^2 per value\nbefore": ".3g",
        "\nafter": ".3g",
        "frequencies\n": "d",
        "function": "",
        "output": "",
        "input": "",
    }
    left = len(found.function) - len(rows)
    more = f"\nand {left} functions that fit better" if left else ""
    return tables.render(columns, rows) + more


def _nuisances(found: ResponseFit) -> str:
    if not found.nuisance:
        return ""
    order = np.argsort(-np.abs(found.nuisance_value) / found.nuisance_prior, kind="stable")
    rows = []
    for n in order[:NUISANCES]:
        unit, factor = nuisance_unit(found.nuisance[n])
        change, sigma, prior = (
            factor * part[n]
            for part in (found.nuisance_value, found.nuisance_sigma, found.nuisance_prior)
        )
        rows.append((f"{change:+.3g}", f"{sigma:.2g}", f"{prior:.2g}", unit, found.nuisance[n]))
    left = len(found.nuisance) - len(rows)
    columns = ("change", "+-", "expected +-", "unit", "sensor or actuator")
    text = tables.render(dict.fromkeys(columns, ""), rows)
    return text + (f"\nand {left} more, nearer to their expected values" if left else "")


def nuisance_unit(name: str) -> tuple[str, float]:
    """Printed unit of a property of a sensor or an actuator, and the factor to it.

    >>> nuisance_unit("sensor.osem-x.gain")
    ('%', 100.0)
    """
    if name.endswith(".gain"):
        return "%", 100.0
    return ("ms", 1e3) if name.endswith(".delay") else ("SI", 1.0)


def describe_change(one: SingleChange) -> str:
    """Describe a change of one parameter: ``upper.d -2.1 mm``."""
    unit, factor = change_unit(one.name, one.start)
    return f"{short(one.name)} {one.change * factor:+.3g} {unit}"


def _explanations(found: Fit, responses: ResponseFit) -> list[str]:
    before = responses.chi_squared_before
    if not math.isfinite(before):
        return []
    if not responses.changes or before < found.chi_squared + 4 * len(found.name):
        return [
            f"The design as given explains the measurements: chi^2 is {before:.4g} with only"
            f" sensors, actuators and losses fitted, {found.chi_squared:.4g} with all parameters"
            " and their priors"
        ]
    head = (
        "Single changes that explain most, with sensors, actuators and losses fitted; chi^2 with"
        f" all parameters and their priors is {found.chi_squared:.4g}:"
    )
    return [head] + [
        f"  {describe_change(one)}: chi^2 {before:.4g} -> {one.chi_squared:.4g}"
        for one in responses.changes
    ]


def _next(found: Fit, responses: ResponseFit) -> list[str]:
    if not responses.candidates or not responses.least:
        return []
    n = found.name.index(responses.least)
    unit, factor = change_unit(responses.least, float(found.value[n]))
    head = (
        f"To learn more about {short(responses.least)}, now known to"
        f" {found.sigma[n] * factor:.2g} {unit}, measure next:"
    )
    return [head] + [
        f"  {describe_candidate(one)}: to {one.sigma * factor:.2g} {unit}"
        for one in responses.candidates
    ]


def describe_candidate(one: Candidate) -> str:
    """Describe a measurement: drive, sensor and band."""
    return f"drive {one.input}, sense {one.output}, {one.band[0]:.2g} to {one.band[1]:.2g} Hz"


def document(found: Fit, files: Sequence[str | None]) -> Document:
    """Return the JSON document; an uncertainty is null if it is infinite or at a bound."""
    who = np.array(found.experiment)
    parameters = table(
        found, "name start value sigma=scaled_sigma prior prior_sigma at_bound experiments=shared"
    )
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
        exchange = {
            "experiment": found.experiment[found.exchange.experiment],
            "labels": list(found.exchange.labels),
            "chi_squared": found.exchange.chi_squared,
        }
    return {
        "experiments": [
            {"name": name, "design": file}
            for name, file in zip(found.experiment, files, strict=True)
        ],
        "parameters": parameters,
        "covariance": plain(found.scaled_covariance),
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
    } | (_response_document(found.responses) if found.responses is not None else {})


def _response_document(found: ResponseFit) -> Document:
    functions = table(found, "name=function output input frequencies=points chi_squared")
    for row in functions:
        row["frequencies"] //= 2
    values = "change=nuisance_value sigma=nuisance_sigma prior_sigma=nuisance_prior"
    keys = ("measured_hz", "uncertainty_hz", "before_hz", "after_hz", "q", "functions")
    resonances = [
        {"label": name} | dict(zip(keys, (*plain(row[:5]), int(row[5])), strict=True))
        for name, row in zip(found.mode, found.resonance, strict=True)
    ]
    return {
        "transfer_functions": functions,
        "channels": table(found, f"name=nuisance {values}"),
        "resonances": resonances,
        "wrong_channels": [
            {
                "kind": one.kind,
                "side": TABLES[one.side],
                "channels": list(one.channel),
                "factor": plain(one.factor),
                "claimed_otherwise": one.known,
                "also": one.also or None,
                "chi_squared_without": plain(one.chi_squared),
                "text": one.text,
            }
            for one in found.corrections
        ],
        "too_stiff_and_lossy": table(found.stiffened, "label excess q"),
        "chi_squared_before": plain(found.chi_squared_before),
        "single_changes": table(found.changes, "name start change chi_squared"),
        "determined": list(found.sentences),
        "least_known": found.least or None,
        "measure_next": table(found.candidates, "input output band_hz=band sigma"),
    }
