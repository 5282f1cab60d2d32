"""Answers from the measured times and errors, one line per question."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from suspension_cli.analyses import tables
from suspension_cli.analyses.tradeoff.result import (
    COUNTS,
    Panel,
    Tradeoff,
    format_error,
    format_time,
)

MODEL_TOLERANCE = 1e-3
"""Largest error of an accurate model, as by default in all commands."""
METHOD_TOLERANCE = 1e-9
"""Largest error of an accurate method."""
SHIPPED = {
    "modes": "blocks",
    "response": "chain",
    "thermal": "dissipation",
    "coupling": "rebuilt",
    "equilibrium": "full",
}
"""Methods that the commands use."""
QUESTIONS = {
    "modes": "mode frequencies",
    "thermal": "thermal noise at 10 and 100 Hz",
    "coupling": "cross-coupling at 50 Hz",
    "equilibrium": "equilibrium of imperfect builds",
}
NAMES = {
    "Response up to 50 Hz": "response up to 50 Hz",
    "Response at 100 Hz and 1 kHz": "response from 100 Hz",
}
TIMED = 200
"""Frequencies of the responses of models."""
WORTHWHILE = 1.2
"""Ratio of times from which a faster model is named as an alternative."""


@dataclass(frozen=True)
class Option:
    """A model or method with its time (s) and largest error."""

    name: str
    time: float
    error: float


@dataclass(frozen=True)
class Answer:
    """The fastest accurate model or method, and an alternative.

    Attributes
    ----------
    best : Option
        Fastest within the tolerance; the most accurate one if none is.
    other : Option or None
        Of models the most accurate faster one. Of methods the one that the commands use, unless it
        is `best`.
    """

    compares: str
    question: str
    best: Option
    other: Option | None


def answers(found: Tradeoff) -> list[Answer]:
    """Answer all questions that the comparisons allow."""
    result = []
    for panel in (*found.compared("models"), *found.compared("methods")):
        if panel.key == "response-methods":
            result += _response_methods(found)
        else:
            result += [answer for answer, _ in _questions(found, panel)]
    return result


def choices(found: Tradeoff) -> list[tuple[Answer, list[Option]]]:
    """Compare the models for one result of each quantity: the answer, and all options.

    Responses are those at 200 frequencies up to 50 Hz.
    """
    return [_questions(found, panel)[0] for panel in found.compared("models")]


def _questions(found: Tradeoff, panel: Panel) -> list[tuple[Answer, list[Option]]]:
    """Answer the questions on a panel, with the options for each."""
    questions = {}
    if panel.key == "response-models":
        times = {one.model: one.median("first", TIMED) for one in found.response_times("models")}
        shipped = ""
        for view in panel.views:
            questions[f"{NAMES.get(view.title, view.title)}, {TIMED} frequencies"] = [
                Option(entry.model, times[entry.model], float(error))
                for entry, error in zip(panel.entries, panel.worst(view), strict=True)
            ]
    else:
        shipped = SHIPPED[panel.quantity]
        kinds = {"once": ""}
        if panel.item != "frequency":
            kinds = {"once": f", one {panel.item}", "batch": f", per {panel.item} of {panel.count}"}
        for kind, more in kinds.items():
            questions[QUESTIONS[panel.quantity] + more] = [
                Option(entry.name(panel.compares), entry.time(kind), float(entry.error.max()))
                for entry in panel.entries
            ]
    return [
        (_choose(panel.compares, question, options, shipped), options)
        for question, options in questions.items()
    ]


def _response_methods(found: Tradeoff) -> list[Answer]:
    """Compare methods for a first response, and for next ones of few and many frequencies."""
    result = []
    for occasion, count, name in (
        ("first", TIMED, "first response"),
        ("other grid", COUNTS[0], "next response"),
        ("other grid", COUNTS[-1], "next response"),
    ):
        options = [
            Option(one.method, one.median(occasion, count), one.error)
            for one in found.response_times("methods")
        ]
        question = f"{name}, {count:,} frequencies"
        result.append(_choose("methods", question, options, SHIPPED["response"]))
    return result


def _choose(compares: str, question: str, options: list[Option], shipped: str) -> Answer:
    models = compares == "models"
    tolerance = MODEL_TOLERANCE if models else METHOD_TOLERANCE
    good = [option for option in options if option.error <= tolerance]
    best = min(good, key=lambda o: o.time) if good else min(options, key=lambda o: o.error)
    if models:
        faster = [option for option in options if WORTHWHILE * option.time < best.time]
        other = min(faster, key=lambda option: option.error, default=None)
    else:
        other = next((option for option in options if option.name == shipped), None)
    return Answer(compares, question, best, None if other is best else other)


def headline(found: Tradeoff) -> str:
    """Name the models to use, in one line."""
    every = [answer for answer in answers(found) if answer.compares == "models"]
    uses: dict[str, list[str]] = {}
    for answer in every:
        question = answer.question.split(",")[0].split(" at ")[0]
        short = "" if answer.best.error <= MODEL_TOLERANCE else " (beyond the tolerance)"
        listed = uses.setdefault(answer.best.name + short, [])
        if question not in listed:
            listed.append(question)
    if not uses:
        return "no models to compare"
    named = "; ".join(f"{name} for {', '.join(listed)}" for name, listed in uses.items())
    return f"cheapest models {_within(found)}: {named}"


def _within(found: Tradeoff) -> str:
    """Tolerance and reference of models: ``within 0.1 % of violin``."""
    return f"within {100 * MODEL_TOLERANCE:g} % of {found.top}"


def text(found: Tradeoff) -> str:
    """Format the headline and a line per question."""
    every = answers(found)
    parts = [headline(found)]
    for compares, other in (("models", "faster, but less accurate"), ("methods", "pendsus uses")):
        rows = [
            (
                answer.question,
                answer.best.name,
                format_time(answer.best.time),
                format_error(answer.best.error),
                _other(answer),
            )
            for answer in every
            if answer.compares == compares
        ]
        if rows:
            heading, use = f"fastest method within {METHOD_TOLERANCE:.0e}", ""
            if compares == "models":
                heading, use = f"model {_within(found)}", "use"
            columns = (heading, use, "time", "error", other)
            parts.append(tables.render(dict.fromkeys(columns, ""), rows))
    parts.append(_left_out(found))
    return "\n\n".join(part for part in parts if part)


def _other(answer: Answer) -> str:
    best, other = answer.best, answer.other
    if other is None:
        return "the same" if answer.compares == "methods" else "-"
    if answer.compares == "models":
        return (
            f"{other.name}: {best.time / other.time:.2g} times faster, error {_size(other.error)}"
        )
    return f"{other.name}: {format_time(other.time)}, error {format_error(other.error)}"


def _size(error: float) -> str:
    """Format an error of a model: ``15 %``, ``3.1e-03``."""
    return f"{100 * error:.{0 if error >= 0.1 else 1}f} %" if error >= 1e-2 else format_error(error)


def _left_out(found: Tradeoff) -> str:
    """List quantities without a comparison, a line per reason."""
    reasons: dict[str, dict[str, None]] = {}
    for panel in found.panels:
        if not panel.entries:
            name = QUESTIONS.get(panel.quantity, panel.quantity)
            reasons.setdefault(panel.left[0].reason, {})[name] = None
    return "\n".join(f"left out: {', '.join(names)}: {reason}" for reason, names in reasons.items())


def response_table(found: Tradeoff) -> str:
    """Format the response times of models, then of methods."""
    parts = []
    for each in found.waits:
        models = each.compares == "models"
        rows = []
        for entry in each.entries:
            times = (
                " ".join(f"{'-' if np.isnan(t) else format_time(t):>8}" for t in medians)
                for medians in entry.time[:, :, 1].T
            )
            error = () if models else ("" if np.isnan(entry.error) else format_error(entry.error),)
            rows.append((entry.model if models else entry.method, *times, *error))
        columns = ["", *(f"{count:,} frequencies" for count in COUNTS)]
        columns += [] if models else ["error, 0.1 Hz to 1 kHz"]
        heading = "Response: " + ("models" if models else f"methods ({each.entries[0].model})")
        lines = [
            f"{heading}; times of the first response ({each.start}), of one on the same"
            " frequencies, of one on others",
            tables.render(dict.fromkeys(columns, ""), rows),
        ]
        if any(np.isnan(entry.time).any() for entry in each.entries):
            lines.append("  -: not measured, as the first takes long")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)
