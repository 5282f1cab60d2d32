"""Definition of a comparison: a quantity, its reference and the methods that compute it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.analyses.tradeoff.result import Timed, View
from suspension_cli.analyses.tradeoff.subject import Subject

Once = Callable[[Subject], object]
"""Computes a quantity, or its reference."""
Batch = Callable[[Subject], Callable[[], object]]
"""Prepares the computation of a batch."""
Error = Callable[[Subject, Any, Any], dict[str, float]]
"""Errors by component, of the quantity and its reference."""

TOP = "top"
"""Stands for the most complete model that is valid for the design."""


def suits(_: Subject) -> str:
    """Return no reason against a method or comparison."""
    return ""


@dataclass(frozen=True)
class Method:
    """A method that computes a quantity of a subject, with a model or `TOP`.

    `batch` prepares the computation of a whole batch; None if that takes a loop. `unsuited` gives
    why the method does not apply though its model is valid; "" if it applies.
    """

    model: str
    name: str
    once: Once
    batch: Batch | None = None
    unsuited: Callable[[Subject], str] = suits

    def on(self, subject: Subject) -> str:
        """Return the name of the model for a subject."""
        return subject.top if self.model == TOP else self.model


@dataclass(frozen=True)
class Comparison(Timed):
    """A quantity, its reference and the methods to compare.

    `against` describes the reference in words. `views` are names of components by title of a view;
    None for one view of all. `unsuited` gives why no method applies; "" if some do.
    """

    against: Callable[[Subject], str]
    reference: Once
    error: Error
    methods: tuple[Method, ...]
    views: Mapping[str, tuple[str, ...]] | None = None
    unsuited: Callable[[Subject], str] = suits

    def select_views(self, components: tuple[str, ...]) -> tuple[View, ...]:
        """Return the views of these components."""
        if not self.views:
            return (View(self.title, tuple(range(len(components)))),)
        return tuple(
            View(title, tuple(components.index(name) for name in names))
            for title, names in self.views.items()
        )


def hertz(frequency: float) -> str:
    """Format a frequency: ``50 Hz``, ``1 kHz``."""
    return f"{frequency / 1000:g} kHz" if frequency >= 1000 else f"{frequency:g} Hz"


def relative(frequencies: tuple[float, ...]) -> Error:
    """Return the error |found - true| / |true| at frequencies (Hz); |found| where true is 0."""

    def error(_: Subject, found: np.ndarray, wanted: np.ndarray) -> dict[str, float]:
        values = np.abs(found - wanted) / np.where(wanted == 0, 1.0, np.abs(wanted))
        return dict(zip(map(hertz, frequencies), values.tolist(), strict=True))

    return error
