"""Result of `pendsus tradeoff`: time and error of each model, and which one to use."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby

from suspension_cli.files.declared import INLINE, along, in_unit
from suspension_cli.models.choice import TOLERANCE, percent

WORTHWHILE = 1.2
"""Ratio of times from which a faster model is named as an alternative."""


@dataclass(frozen=True)
class Entry:
    """Time and error of one model for one question about a design.

    `time` is the median processor time of one result, design or build, s; `left_out` says why it is
    NaN. `error` is the largest relative one against the most complete model that has a result (its
    own is 0; NaN without a result), `where` its mode or frequency.
    """

    quantity: str
    question: str
    model: str
    time: float = field(metadata=in_unit("s"))
    error: float
    where: str
    left_out: str

    @property
    def size(self) -> str:
        """The error in words: ``15 % (test pitch)``."""
        return percent(self.error) + (f" ({self.where})" if self.where else "")


@dataclass(frozen=True)
class Answer:
    """All models on one question, from the simplest to the most complete."""

    entries: tuple[Entry, ...]

    @property
    def question(self) -> str:
        """What is asked."""
        return self.entries[0].question

    @property
    def reference(self) -> str:
        """Name of the model against which errors are taken; "" if there is none."""
        return next((e.model for e in reversed(self.entries) if not math.isnan(e.error)), "")

    @property
    def options(self) -> list[Entry]:
        """The models that are not left out."""
        return [entry for entry in self.entries if 0 < entry.time < math.inf]

    @property
    def best(self) -> Entry | None:
        """The fastest model within the tolerance, else the most accurate; None if there is none."""
        good = [entry for entry in self.options if entry.error <= TOLERANCE]
        if good:
            return min(good, key=lambda entry: entry.time)
        return min(self.options, key=lambda entry: entry.error, default=None)

    @property
    def advice(self) -> str:
        """Which model to use and why, in one sentence."""
        best = self.best
        if best is None:
            return f"left out: {self.entries[-1].left_out}"
        if best.error > TOLERANCE:
            return f"Use {best.model}: it is off by {best.size}, the others by more."
        faster = [entry for entry in self.options if WORTHWHILE * entry.time < best.time]
        if faster:
            other = min(faster, key=lambda entry: entry.error)
            ratio = best.time / other.time
            return (
                f"Use {best.model}: {other.model} is {ratio:.{2 if ratio < 100 else 3}g} times"
                f" faster, but off by {other.size}."
            )
        fastest = best.time <= min(entry.time for entry in self.options)
        why = "no other model is faster" if fastest else "simpler models save hardly any time"
        return f"Use {best.model}: {why}."


@dataclass(frozen=True)
class Tradeoff:
    """Times and errors of all models for all questions about a design."""

    entries: tuple[Entry, ...] = field(metadata=along("entry") | INLINE)

    @cached_property
    def answers(self) -> list[Answer]:
        """The entries by question."""
        return [Answer(tuple(part)) for _, part in groupby(self.entries, lambda e: e.question)]

    @property
    def within(self) -> str:
        """Tolerance and reference of the advice: ``within 0.1 % of violin``."""
        names = dict.fromkeys(answer.reference for answer in self.answers if answer.reference)
        return f"within {percent(TOLERANCE)} of {' or '.join(names)}"


def unit_of_time(seconds: float) -> tuple[str, float]:
    """Return the unit in which a time is at least 1, and its size in s."""
    units = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
    return next((unit for unit in units if seconds >= unit[1]), units[-1])


def format_time(seconds: float) -> str:
    """Format a time with two digits: ``2.3 ms``."""
    unit, size = unit_of_time(seconds)
    return f"{float(f'{seconds / size:.2g}'):g} {unit}"
