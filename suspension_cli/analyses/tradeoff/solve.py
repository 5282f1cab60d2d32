"""Measurement of the errors and times of all methods."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields

import numpy as np

from suspension_cli.analyses.tradeoff import response_times, timing
from suspension_cli.analyses.tradeoff.comparison import Comparison
from suspension_cli.analyses.tradeoff.comparisons import COMPARISONS
from suspension_cli.analyses.tradeoff.result import Entry, Omission, Panel, Timed, Tradeoff
from suspension_cli.analyses.tradeoff.subject import Subject
from suspension_cli.design.schema import Design


def measure(
    design: Design,
    quantities: Sequence[str] = (),
    repeat: int = 7,
    report: Callable[[int, int], None] = lambda *_: None,
    budget: float = timing.BUDGET,
) -> Tradeoff:
    """Compare all models and methods for one design.

    Parameters
    ----------
    design : Design
        A stable suspension.
    quantities : sequence of str
        Some of `comparisons.QUANTITIES`; empty for all.
    repeat : int
        Samples per time; fewer where they take longer than the processor time `budget`, s.
    report : callable
        Called with the numbers of finished and all comparisons.
    """
    subject, panels, waits = Subject(design), [], []
    wanted = [item for item in COMPARISONS if not quantities or item.quantity in quantities]
    for number, item in enumerate(wanted):
        report(number, len(wanted))
        panels.append(_panel(subject, item, repeat, budget))
        if item.quantity == "response":
            waits.append(response_times.measure(subject, item.compares, repeat, budget))
    report(len(wanted), len(wanted))
    return Tradeoff(tuple(panels), repeat, timing.threads(), tuple(waits))


def _panel(subject: Subject, item: Comparison, repeat: int, budget: float) -> Panel:
    all_unsuited = item.unsuited(subject)
    reasons = {
        method: all_unsuited or subject.unsuited[method.on(subject)] or method.unsuited(subject)
        for method in item.methods
    }
    methods = [method for method, reason in reasons.items() if not reason]
    first = [timing.call(lambda method=method: method.once(subject)) for method in methods]
    found = [values for values, _ in first]
    truth = item.reference(subject) if methods else None
    errors = [item.error(subject, values, truth) for values in found]
    components = tuple(errors[0]) if errors else ()
    works = [lambda method=method: method.once(subject) for method in methods]
    batches = {method: method.batch(subject) for method in methods if method.batch is not None}
    known = [taken for _, taken in first]
    times = timing.quartiles([*works, *batches.values()], repeat, known, budget)
    once = dict(zip(methods, times[: len(methods)], strict=True))
    many = dict(zip(batches, times[len(methods) :] / item.count, strict=True))
    return Panel(
        **{field.name: getattr(item, field.name) for field in fields(Timed)},
        reference=item.against(subject) if methods else "",
        component=components,
        entries=tuple(
            Entry(
                method.on(subject),
                method.name,
                np.array([error[name] for name in components]),
                once[method],
                many.get(method, once[method]),
                method in many,
            )
            for method, error in zip(methods, errors, strict=True)
        ),
        left=tuple(
            Omission(method.on(subject), method.name, reason)
            for method, reason in reasons.items()
            if reason
        ),
        views=item.select_views(components) if components else (),
    )
