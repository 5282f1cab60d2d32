"""Measurement of the time and error of each model for each question about a design."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from suspension_cli.analyses.growth import find_growth
from suspension_cli.analyses.tradeoff.questions import Question, ask
from suspension_cli.analyses.tradeoff.result import Entry, Tradeoff
from suspension_cli.design.reader import Source
from suspension_cli.errors import Fault, InputError
from suspension_cli.models import registry

if TYPE_CHECKING:
    from suspension_cli.design.schema import Design
    from suspension_cli.models.base import Model

REPEAT = 7
"""Samples per time, fewer where they take longer than `BUDGET`."""
BUDGET = 1.0
"""Processor time after which a function is not sampled again, s."""
RESOLUTION = time.get_clock_info("process_time").resolution
"""Least time, s, as others are divided by it."""


def measure(
    source: Source,
    quantities: Sequence[str] = (),
    report: Callable[[int, int], None] = lambda *_: None,
) -> Tradeoff:
    """Measure all models for some quantities of a design (default: all).

    `report` is called with the numbers of answered and all questions. Raises `InputError` if the
    most complete model has no stable equilibrium.
    """
    invalid = {model: _explain_invalid(model, source.design) for model in registry.MODELS}
    questions = [one for one in ask(source) if not quantities or one.quantity in quantities]
    entries: list[Entry] = []
    for number, question in enumerate(questions):
        report(number, len(questions))
        entries += _answer(question, invalid)
    report(len(questions), len(questions))
    return Tradeoff(tuple(entries))


def _answer(question: Question, invalid: dict[Model, str]) -> list[Entry]:
    """Measure all models for one question; `invalid` gives why a model is not valid, or ""."""
    reasons, results, works = dict(invalid), {}, {}
    for model in [model for model, reason in reasons.items() if not reason]:
        try:
            results[model] = question.solve(model)
            work = question.work(model)
            work()  # fills caches
            works[model] = work
        except InputError as error:
            reasons[model] = error.faults[0].problem
    exact = results[max(results, key=registry.MODELS.index)] if results else None
    errors = {
        model: (0.0, "") if found is exact else question.compare(found, exact)
        for model, found in results.items()
    }
    times = dict(zip(works, median_times([*works.values()]), strict=True))
    return [
        Entry(
            question.quantity,
            question.text,
            model.name,
            times.get(model, math.nan) / question.count,
            *errors.get(model, (math.nan, "")),
            reason,
        )
        for model, reason in reasons.items()
    ]


def _explain_invalid(model: Model, design: Design) -> str:
    """Return why a model is not valid for a design; "" if it is."""
    if why := model.unsuitable(design):
        return why
    try:
        grows = find_growth(design, model, model.system(design))
        if grows is not None:
            remedy = f"{grows.fault.remedy}; responses of an unstable design are not compared"
            raise InputError([Fault(grows.fault.key, grows.fault.problem, remedy)])
    except InputError as error:
        if model == registry.most_complete(design):
            raise
        return error.faults[0].problem
    return ""


def median_times(works: Sequence[Callable[[], object]]) -> list[float]:
    """Measure the median processor times of functions, s.

    Processor time excludes waiting. The functions take turns, so that a drift of the machine
    affects all equally.
    """
    samples: list[list[float]] = [[] for _ in works]
    for _ in range(REPEAT):
        for work, taken in zip(works, samples, strict=True):
            if sum(taken) < BUDGET:
                begin = time.process_time()
                work()
                taken.append(max(time.process_time() - begin, RESOLUTION))
    return [statistics.median(taken) for taken in samples]
