"""Time and error of all models, for all questions about some designs and for all modes."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

from suspension_cli.analyses.tradeoff.measure import Question, ask, measure, median_times
from suspension_cli.design.reader import Source, read
from suspension_cli.errors import InputError
from suspension_cli.models import registry
from tests.support.paths import ROOT
from tools.tradeoff.measurement import Measurement

DESIGNS = [
    *sorted((ROOT / "configs" / "husman2000").glob("*.toml")),
    *(ROOT / "configs" / f"{name}.toml" for name in ("double", "geo-silica-triple", "quadruple")),
]
"""Designs of which every question is asked."""
EVERY_MODE = "modes of all shipped designs"


def measure_questions(file: Path) -> list[Measurement]:
    """Measure all models for all questions about a design."""
    source = read(file)
    found = measure(source)
    best = [answer.best for answer in found.answers]
    name = source.design.design.name
    return [
        Measurement(
            entry.question,
            name,
            entry.model,
            0,
            entry.time,
            None if math.isnan(entry.error) else entry.error,
            "best" if entry in best else "",
        )
        for entry in found.entries
        if not entry.left_out
    ]


def measure_modes(source: Source) -> list[Measurement]:
    """Measure the modes of a design in every model that is valid for it."""
    question = ask(source)[0]
    found: dict[str, Any] = {}
    for model in registry.MODELS:
        if model.unsuitable(source.design):
            continue
        try:
            found[model.name] = question.solve(model)
        except InputError:  # no stable equilibrium in this model
            continue
    works = [lambda name=name: question.solve(registry.by_name(name)) for name in found]
    assert question.choose is not None
    chosen = question.choose().level
    # with too many wire modes, `modes` leaves out wire mass and states what that changes
    taken_by_auto = chosen if chosen in found else list(found)[-1]
    exact = found[list(found)[-1]]
    name = source.design.design.name
    return [
        Measurement(
            EVERY_MODE,
            name,
            model,
            0,
            taken,
            _error(question, modes, exact),
            "auto" if model == taken_by_auto else "",
        )
        for (model, modes), taken in zip(found.items(), median_times(works), strict=True)
    ]


def _error(question: Question, modes: Any, exact: Any) -> float:
    return 0.0 if modes is exact else question.compare(modes, exact)[0]


def measure_all() -> list[Measurement]:
    """Measure all questions of `DESIGNS`, and the modes of every shipped design."""
    rows: list[Measurement] = []
    for file in DESIGNS:
        print(file.stem, file=sys.stderr)
        rows += measure_questions(file)
    for file in sorted((ROOT / "configs").rglob("*.toml")):
        print(file.stem, file=sys.stderr)
        rows += measure_modes(read(file))
    return rows
