"""What rungs and methods cost against what they get wrong: the results of `pendsus tradeoff`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array

ROUNDING = 1e-12
"""Errors below this are rounding: to a designer none of them is better than another."""
LAST_DIGIT = 1.1e-16
"""Relative rounding error of a double, at most."""
GAIN = 0.01
"""Share by which an error must fall to be worth any time."""
QUARTILES = ("lower", "median", "upper")
KINDS = ("once", "batch")
"""Of time: for one evaluation, and for one item of a batch."""
COMPARED = ("rungs", "methods")
"""What a panel compares: rungs by what physics they leave out, or methods on one rung by what arithmetic and approximations cost."""


@dataclass(frozen=True)
class Entry:
    """One method on one rung.

    Attributes
    ----------
    rung, method : str
    error : (c,) array
        Relative, by component.
    once, batch : (3,) arrays
        Quartiles (lower, median, upper) of the time in s for one evaluation, and for one item of a batch.
    vectorised : bool
        Whether it takes a whole batch at once; if not, an item costs what one evaluation costs.
    """

    rung: str
    method: str
    error: Array
    once: Array
    batch: Array
    vectorised: bool

    @property
    def label(self) -> str:
        """``string, chain``."""
        return f"{self.rung}, {self.method}"

    def name(self, compares: str) -> str:
        """What tells it from the others in a chart: its rung or its method."""
        return self.rung if compares == "rungs" else self.method

    def time(self, kind: str) -> float:
        """Median time in s, ``once`` or in a ``batch``."""
        return float(getattr(self, kind)[1])


@dataclass(frozen=True)
class Left:
    """A method that does not apply, and why."""

    rung: str
    method: str
    reason: str


@dataclass(frozen=True)
class View:
    """Components of a quantity that are judged together, by the worst of them."""

    title: str
    components: tuple[int, ...]


@dataclass(frozen=True)
class Panel:
    """All rungs, or all methods on one rung, for one quantity.

    Attributes
    ----------
    quantity : str
        ``modes``, ``response``, ...
    compares : str
        One of `COMPARED`.
    title : str
    start : str
        From where to where the time runs.
    item : str
        What a batch is made of: ``design``, ``frequency``, ``build``.
    count : int
        How many of them were in the batch.
    reference : str
        What errors are taken against.
    component : tuple of str
        What `Entry.error` is told of: kinds of modes, frequencies, ...
    entries : tuple of Entry
    left : tuple of Left
    views : tuple of View
    """

    quantity: str
    compares: str
    title: str
    start: str
    item: str
    count: int
    reference: str
    component: tuple[str, ...]
    entries: tuple[Entry, ...]
    left: tuple[Left, ...]
    views: tuple[View, ...]

    @property
    def key(self) -> str:
        """``modes-rungs``."""
        return f"{self.quantity}-{self.compares}"

    def fastest(self, kind: str) -> float:
        """Shortest median time in s, ``once`` or in a ``batch``."""
        return min((entry.time(kind) for entry in self.entries), default=np.nan)

    def worst(self, view: View) -> Array:
        """Largest error of each entry (e,) over the components of a view."""
        return np.array([entry.error[list(view.components)].max() for entry in self.entries])

    def front(self, kind: str, view: View) -> list[int]:
        """The entries that no other beats in both time and error, from the fastest on."""
        return front(np.array([entry.time(kind) for entry in self.entries]), self.worst(view))


@dataclass(frozen=True)
class Tradeoff:
    """Everything measured for one design.

    Attributes
    ----------
    panels : tuple of Panel
    repeat : int
        How often every time was taken.
    threads : int
        Of linear algebra; 0 if unknown.
    """

    panels: tuple[Panel, ...]
    repeat: int
    threads: int


def front(time: Any, error: Any) -> list[int]:
    """Pareto front: the points that no other beats in one and equals or beats in the other.

    Parameters
    ----------
    time, error : (n,) arrays
        Errors below `ROUNDING`, and errors closer to each other than `GAIN`, are alike.

    Returns
    -------
    list of int
        In ascending order of time, errors strictly falling.
    """
    level = np.maximum(np.asarray(error, dtype=float), ROUNDING)
    kept: list[int] = []
    for n in np.lexsort((level, time)).tolist():
        if not kept or level[n] < (1 - GAIN) * level[kept[-1]]:
            kept.append(n)
    return kept


def spell(seconds: float) -> str:
    """A time in the unit that suits it: ``83 µs``."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def told(error: float) -> str:
    """A relative error: ``3.8e-07``; 0 where it is below the last digit of a double."""
    return f"{error:.1e}" if error > LAST_DIGIT else "0"
