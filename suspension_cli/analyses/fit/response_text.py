"""Findings of a fit of transfer functions in words and as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.analysis import Document, plain
from suspension_cli.analyses.fit.channels import TABLES
from suspension_cli.analyses.fit.findings import change_unit, short
from suspension_cli.analyses.fit.response_fit import Candidate, ResponseFit, SingleChange
from suspension_cli.analyses.fit.solve import Fit

NUISANCES = 12
"""Sensors' and actuators' properties that are printed: those furthest from their priors."""
FUNCTIONS = 8
"""Functions that are printed: those that fit worst."""


def corrections(found: ResponseFit) -> list[str]:
    """Lines on channels and modes that no geometry explains, with what they do to chi^2."""
    lines = []
    for one in found.corrections:
        wrong = "CHANNEL: " if one.known else ""
        without = (
            f"; chi^2 without this: {one.chi_squared:.4g}" if math.isfinite(one.chi_squared) else ""
        )
        lines.append(f"{wrong}{one.text}; the fit assumes so{without}")
    if found.stiffened:
        parts = ", ".join(
            f"{name} (frequency +{100 * excess:.2g} %, Q {q:.3g})"
            for name, excess, q in found.stiffened
        )
        lines.append(
            f"RUBBING? too stiff and too lossy at once, which no number of the design explains:"
            f" {parts}; look for a wire, a cable or a stop that touches"
        )
    return lines


def report(found: Fit) -> list[str]:
    """Sections of the text on transfer functions."""
    responses = found.responses
    assert responses is not None
    parts = [_resonances(responses), _functions(responses)]
    if responses.nuisance:
        parts.append(_nuisances(responses))
    parts.append("\n".join(_explanations(found, responses)))
    if responses.sentences:
        parts.append("\n".join(["What these data say, without the priors:", *responses.sentences]))
    parts.append("\n".join(_next(found, responses)))
    return [part for part in parts if part]


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
    text = tables.render(columns, rows)
    left = len(found.function) - len(rows)
    return text + (f"\nand {left} functions that fit better" if left else "")


def _nuisances(found: ResponseFit) -> str:
    pull = np.abs(found.nuisance_value) / found.nuisance_prior
    rows = []
    for n in np.argsort(-pull, kind="stable")[:NUISANCES]:
        unit, factor = nuisance_unit(found.nuisance[n])
        rows.append(
            (
                f"{found.nuisance_value[n] * factor:+.3g}",
                f"{found.nuisance_sigma[n] * factor:.2g}",
                f"{found.nuisance_prior[n] * factor:.2g}",
                unit,
                found.nuisance[n],
            )
        )
    left = len(found.nuisance) - len(rows)
    heads = ("change", "+-", "expected +-", "unit", "sensor or actuator")
    columns: dict[str, str] = dict.fromkeys(heads, "")
    text = tables.render(columns, rows)
    return text + (f"\nand {left} more, nearer to what was expected" if left else "")


def nuisance_unit(name: str) -> tuple[str, float]:
    """Unit in which a property of a sensor or an actuator is printed, and the factor to it.

    >>> nuisance_unit("sensor.osem-x.gain")
    ('%', 100.0)
    """
    if name.endswith(".gain"):
        return "%", 100.0
    return ("ms", 1e3) if name.endswith(".delay") else ("SI", 1.0)


def describe_change(one: SingleChange) -> str:
    """Describe a change of one number: ``upper.d -2.1 mm``."""
    unit, factor = change_unit(one.name, one.start)
    return f"{short(one.name)} {one.change * factor:+.3g} {unit}"


def _explanations(found: Fit, responses: ResponseFit) -> list[str]:
    before = responses.chi_squared_before
    if not math.isfinite(before):
        return []
    if not responses.changes or before < found.chi_squared + 4 * len(found.name):
        return [
            f"The design as given explains the measurements: chi^2 {before:.4g} with only sensors,"
            f" actuators and losses fitted, {found.chi_squared:.4g} with all numbers and their"
            " priors"
        ]
    lines = [
        "Single changes that explain most (sensors, actuators and losses fitted), against"
        f" chi^2 {found.chi_squared:.4g} with all numbers and their priors:"
    ]
    for one in responses.changes:
        text = describe_change(one)
        lines.append(f"  {text}: chi^2 {before:.4g} -> {one.chi_squared:.4g}")
    return lines


def _next(found: Fit, responses: ResponseFit) -> list[str]:
    if not responses.candidates or not responses.least:
        return []
    n = found.name.index(responses.least)
    unit, factor = change_unit(responses.least, float(found.value[n]))
    sigma = found.sigma[n]
    lines = [
        f"To learn more about {short(responses.least)}, now known to {sigma * factor:.2g} {unit},"
        " measure next:"
    ]
    for one in responses.candidates:
        lines.append(f"  {describe_candidate(one)}: to {one.sigma * factor:.2g} {unit}")
    return lines


def describe_candidate(one: Candidate) -> str:
    """A measurement in words: drive, sensor and band."""
    return f"drive {one.input}, sense {one.output}, {one.band[0]:.2g} to {one.band[1]:.2g} Hz"


def document(found: ResponseFit) -> Document:
    """Findings as JSON."""
    functions = zip(
        found.function, found.output, found.input, found.points // 2, found.chi_squared, strict=True
    )
    channels = zip(
        found.nuisance,
        found.nuisance_value,
        found.nuisance_sigma,
        found.nuisance_prior,
        strict=True,
    )
    return {
        "transfer_functions": _rows("name output input frequencies chi_squared", functions),
        "channels": _rows("name change sigma prior_sigma", channels),
        "resonances": _rows(
            "label measured_hz uncertainty_hz before_hz after_hz q functions",
            (
                (name, *row[:5], int(row[5]))
                for name, row in zip(found.mode, found.resonance, strict=True)
            ),
        ),
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
        "too_stiff_and_lossy": _rows("label excess q", found.stiffened),
        "chi_squared_before": plain(found.chi_squared_before),
        "single_changes": _rows("name start change chi_squared", map(astuple, found.changes)),
        "determined": list(found.sentences),
        "least_known": found.least or None,
        "measure_next": _rows("input output band_hz sigma", map(astuple, found.candidates)),
    }


def _rows(keys: str, rows: Iterable[Sequence[object]]) -> list[Document]:
    """Convert rows of texts and numbers for JSON."""
    return [
        {
            key: value if isinstance(value, str) else plain(value)
            for key, value in zip(keys.split(), row, strict=True)
        }
        for row in rows
    ]
