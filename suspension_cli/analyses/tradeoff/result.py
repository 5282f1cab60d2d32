"""Results of `pendsus tradeoff`: times and errors of models and methods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.scene.arrays import Array

ROUNDING = 1e-12
"""Relative error below which results are equally accurate."""
LAST_DIGIT = 1.1e-16
"""Largest relative rounding error of a double."""
GAIN = 0.01
"""Least relative decrease of an error by which a slower method is an improvement."""
QUARTILES = ("lower", "median", "upper")
KINDS = ("once", "batch")
"""Kinds of time: per evaluation, or per item of a batch."""
COMPARED = ("models", "methods")
"""A panel compares models, which neglect physics, or methods for one model, which differ by
arithmetic and approximations."""


@dataclass(frozen=True)
class Entry:
    """Relative error by component, and time of one method for one model.

    `once` and `batch` are quartiles (lower, median, upper) of the time per evaluation and per item
    of a batch, s; equal unless the method is `vectorised`.
    """

    model: str
    method: str
    error: Float[np.ndarray, " component"]
    once: Float[np.ndarray, " 3"]
    batch: Float[np.ndarray, " 3"]
    vectorised: bool

    @property
    def label(self) -> str:
        """Model and method, ``string, chain``."""
        return f"{self.model}, {self.method}"

    def name(self, compares: str) -> str:
        """Return the label in a chart: model or method."""
        return self.model if compares == "models" else self.method

    def time(self, kind: str) -> float:
        """Return the median time, s, of kind ``once`` or ``batch``."""
        return float(getattr(self, kind)[1])


@dataclass(frozen=True)
class Omission:
    """A method that does not apply, and why."""

    model: str
    method: str
    reason: str


@dataclass(frozen=True)
class View:
    """Components of a quantity that are judged by their largest error."""

    title: str
    components: tuple[int, ...]


@dataclass(frozen=True)
class Timed:
    """A quantity that several models or methods compute.

    Attributes
    ----------
    quantity, compares : str
        One of `comparisons.QUANTITIES`, and of `COMPARED`.
    item, count : str, int
        Item of a batch (``design``, ``frequency``, ``build``), and items per batch.
    start : str
        Timed steps, in words.
    """

    quantity: str
    compares: str
    title: str
    item: str
    count: int
    start: str


@dataclass(frozen=True)
class Panel(Timed):
    """Errors and times for one quantity, of all models, or of all methods for one model.

    `component` names the components of `Entry.error`: kinds of modes, frequencies, ...
    """

    reference: str
    component: tuple[str, ...]
    entries: tuple[Entry, ...]
    left: tuple[Omission, ...]
    views: tuple[View, ...]

    @property
    def key(self) -> str:
        """Name in files, ``modes-models``."""
        return f"{self.quantity}-{self.compares}"

    @property
    def left_out(self) -> dict[str, list[str]]:
        """Models or methods that do not apply, by reason."""
        reasons: dict[str, list[str]] = {}
        for item in self.left:
            name = item.model if self.compares == "models" else item.method
            reasons.setdefault(item.reason, []).append(name)
        return reasons

    def fastest(self, kind: str) -> float:
        """Find the shortest median time, s, of kind ``once`` or ``batch``."""
        return min((entry.time(kind) for entry in self.entries), default=np.nan)

    def worst(self, view: View) -> Float[np.ndarray, " entry"]:
        """Find the largest error of each entry over the components of a view."""
        return np.array([entry.error[list(view.components)].max() for entry in self.entries])

    def front(self, kind: str, view: View) -> list[int]:
        """Find the entries of the Pareto front in time and error, fastest first."""
        return front(np.array([entry.time(kind) for entry in self.entries]), self.worst(view))


OCCASIONS = ("first", "same grid", "other grid")
"""A first response, one on the same frequencies, and one on others."""
COUNTS = (5, 200, 20_000)
"""Numbers of frequencies of these responses."""


@dataclass(frozen=True)
class ResponseTime:
    """Time of a response by one method.

    Attributes
    ----------
    error : float
        Largest relative error over 200 frequencies from 0.1 Hz to 1 kHz; NaN between models, which
        differ by any amount near resonances.
    time : array
        Seconds; NaN for next responses that were not measured as the first took long.
    """

    model: str
    method: str
    error: float
    time: Float[np.ndarray, "occasion count quartile"]

    def median(self, occasion: str, count: int) -> float:
        """Median time, s."""
        return float(self.time[OCCASIONS.index(occasion), COUNTS.index(count), 1])


@dataclass(frozen=True)
class ResponseTimes:
    """Response times of every model, or of every method for one model.

    `start` names the steps in the first time.
    """

    compares: str
    start: str
    entries: tuple[ResponseTime, ...]


@dataclass(frozen=True)
class Tradeoff:
    """Times and errors of all models and methods for one design.

    `repeat` is the number of samples per time, `threads` that of linear algebra (0: unknown),
    `waits` are the response times of models and of methods, if compared.
    """

    panels: tuple[Panel, ...]
    repeat: int
    threads: int
    waits: tuple[ResponseTimes, ...] = ()

    def compared(self, compares: str) -> list[Panel]:
        """List the panels of models, or of methods, with entries."""
        return [panel for panel in self.panels if panel.compares == compares and panel.entries]

    @property
    def top(self) -> str:
        """Name of the reference model."""
        return self.compared("models")[0].entries[-1].model

    def response_times(self, compares: str) -> list[ResponseTime]:
        """List the response times of models, or of methods."""
        return [one for each in self.waits if each.compares == compares for one in each.entries]


def front(time: Array | Sequence[float], error: Array | Sequence[float]) -> list[int]:
    """Find the Pareto front in time and error: indices, ascending in time.

    Errors below `ROUNDING`, or that differ by less than `GAIN`, count as equal.

    >>> front([1.0, 2.0, 3.0], [0.1, 0.2, 0.01])
    [0, 2]
    """
    level = np.maximum(np.asarray(error, dtype=float), ROUNDING)
    kept: list[int] = []
    for n in np.lexsort((level, np.asarray(time))).tolist():
        if not kept or level[n] < (1 - GAIN) * level[kept[-1]]:
            kept.append(n)
    return kept


def format_time(seconds: float) -> str:
    """Format a time with three digits: ``83 µs``."""
    unit, size = unit_of_time(seconds)
    return f"{seconds / size:.3g} {unit}"


def unit_of_time(seconds: float) -> tuple[str, float]:
    """Return the unit in which a time is at least 1, and its size in s."""
    units = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6), ("ns", 1e-9))
    return next((unit for unit in units if seconds >= unit[1]), units[-1])


def format_error(error: float) -> str:
    """Format a relative error: ``3.8e-07``; ``0`` below `LAST_DIGIT`."""
    return f"{error:.1e}" if error > LAST_DIGIT else "0"
