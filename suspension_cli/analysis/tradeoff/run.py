"""Measure: every method's errors, and its times in turns with all others."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from suspension_cli.analysis.tradeoff import timing
from suspension_cli.analysis.tradeoff.registry import QUANTITIES, Method, Quantity
from suspension_cli.analysis.tradeoff.result import Entry, Left, Panel, Tradeoff
from suspension_cli.analysis.tradeoff.subject import Subject
from suspension_cli.design.schema import Design


def measured(design: Design, quantities: Sequence[str] = (), repeat: int = 7, told: Callable[[str], None] = lambda _: None) -> Tradeoff:
    """Compare all methods for one design.

    Parameters
    ----------
    design : Design
        Of a stable suspension.
    quantities : sequence of str
        Names in `registry.QUANTITIES`; none means all.
    repeat : int
        Samples of every time.
    told : callable
        Gets the title of each quantity before it is measured.

    Returns
    -------
    Tradeoff
    """
    subject, panels = Subject(design), []
    for name in quantities or QUANTITIES:
        told(QUANTITIES[name].title)
        panels.append(_panel(subject, QUANTITIES[name], repeat))
    return Tradeoff(tuple(panels), repeat)


def _panel(subject: Subject, quantity: Quantity, repeat: int) -> Panel:
    reasons = {method: _reason(subject, quantity, method) for method in quantity.methods}
    methods = [method for method, reason in reasons.items() if not reason]
    found = [method.once(subject) for method in methods]
    truth = quantity.reference(subject) if methods else None
    errors = [quantity.error(subject, values, truth) for values in found]
    components = tuple(errors[0]) if errors else ()
    batches = [method for method in methods if method.batch is not None]
    works = [lambda method=method: method.once(subject) for method in methods]
    works += [method.batch(subject) for method in batches if method.batch is not None]
    times = timing.quartiles(works, repeat)
    once = dict(zip(methods, times[: len(methods)], strict=True))
    many = dict(zip(batches, times[len(methods) :] / quantity.count, strict=True))
    return Panel(
        quantity=quantity.name,
        title=quantity.title,
        start=quantity.start,
        item=quantity.item,
        count=quantity.count,
        reference=quantity.against.format(top=subject.top),
        component=components,
        entries=tuple(
            Entry(method.rung, method.name, np.array([error[name] for name in components]), once[method], many.get(method, once[method]), method in many)
            for method, error in zip(methods, errors, strict=True)
        ),
        left=tuple(Left(method.rung, method.name, reason) for method, reason in reasons.items() if reason),
        views=quantity.judged(components) if components else (),
    )


def _reason(subject: Subject, quantity: Quantity, method: Method) -> str:
    """Why a method does not apply; empty if it does."""
    return quantity.unsuited(subject) or subject.unsuited[method.rung] or method.unsuited(subject)
