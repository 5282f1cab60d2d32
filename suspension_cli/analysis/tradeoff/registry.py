"""What a comparison is made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analysis.tradeoff.result import View
from suspension_cli.analysis.tradeoff.subject import Subject

Once = Callable[[Subject], Any]
Batch = Callable[[Subject], Callable[[], object]]
Error = Callable[[Subject, Any, Any], dict[str, float]]

TOP = "top"
"""In place of a rung: the highest that holds for the design."""


def suits(_: Subject) -> str:
    """Nothing speaks against it."""
    return ""


@dataclass(frozen=True)
class Method:
    """One way to a quantity.

    Attributes
    ----------
    rung, name : str
        The rung may be `TOP`.
    once : callable
        The quantity itself, from a subject.
    batch : callable or None
        From a subject, what computes a whole batch; None if a batch is done one by one.
    unsuited : callable
        Why it does not apply, beyond its rung; empty if it does.
    """

    rung: str
    name: str
    once: Once
    batch: Batch | None = None
    unsuited: Callable[[Subject], str] = suits

    def on(self, subject: Subject) -> str:
        """The rung for a design."""
        return subject.top if self.rung == TOP else self.rung


@dataclass(frozen=True)
class Comparison:
    """Something that a designer wants to know, and ways to it.

    Attributes
    ----------
    quantity, compares, title, start, item : str
        As in `result.Panel`.
    count : int
        Items in a batch.
    against : callable
        From a subject, what the reference is.
    reference : callable
        The truth, from a subject.
    error : callable
        Errors by component, from subject, what a method gave and the truth.
    methods : tuple of Method
    views : dict
        Titles to names of components; none: all together under the title.
    unsuited : callable
        Why no method applies; empty if some do.
    """

    quantity: str
    compares: str
    title: str
    start: str
    item: str
    count: int
    against: Callable[[Subject], str]
    reference: Once
    error: Error
    methods: tuple[Method, ...]
    views: dict[str, tuple[str, ...]]
    unsuited: Callable[[Subject], str] = suits

    def judged(self, components: tuple[str, ...]) -> tuple[View, ...]:
        """The views of the components found."""
        if not self.views:
            return (View(self.title, tuple(range(len(components)))),)
        return tuple(View(title, tuple(components.index(name) for name in names)) for title, names in self.views.items())


def hertz(frequency: float) -> str:
    """``50 Hz``, ``1 kHz``."""
    return f"{frequency / 1000:g} kHz" if frequency >= 1000 else f"{frequency:g} Hz"


def relative(frequencies: tuple[float, ...]) -> Error:
    """|found - true| / |true| at each frequency; |found| where the truth is 0."""

    def error(_: Subject, found: Any, wanted: Any) -> dict[str, float]:
        values = np.abs(found - wanted) / np.where(wanted == 0, 1.0, np.abs(wanted))
        return dict(zip(map(hertz, frequencies), values.tolist(), strict=True))

    return error
