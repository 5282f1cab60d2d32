"""A design as a function of its free numbers and of those that depend on them."""

from __future__ import annotations

import contextlib
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.studies import parameters

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class FreeDesign:
    """A design whose free numbers are fractions u in [0, 1] of the ranges between their bounds.

    Attributes
    ----------
    text : str
        The design as TOML, with the starting values.
    goals : Goals
        With the free numbers, and the dependent ones, which are linear in free and fixed ones.
    start : array
        Starting values of the free numbers, SI.
    fixed : dict of float
        Fixed numbers on which others depend, by dotted path, SI.
    """

    text: str
    goals: Goals
    start: Float[np.ndarray, " number"]
    fixed: dict[str, float]

    @staticmethod
    def of(text: str, goals: Goals) -> FreeDesign:
        """Look up the free numbers of goals in a design.

        Raises `InputError` if the design does not give them, or a start lies out of bounds.
        """
        known = {item.name: item.value for item in parameters.every(text)}
        if faults := [*_faults(goals, known)]:
            raise InputError(faults)
        start = [known[item.name] if item.start is None else item.start for item in goals.free]
        fixed = {term: known[term] for item in goals.equal for term in item.terms}
        made = FreeDesign(text, goals, np.array(start, dtype=float), fixed)
        try:
            made.design(made.begin)
        except InputError as error:
            problem = "makes the starting design invalid"
            raise InputError(
                [
                    Fault("equal", f"{problem}: {one.key}: {one.problem}", one.remedy)
                    for one in error.faults
                ]
            ) from None
        return replace(made, text=made.toml(made.begin))

    @cached_property
    def bounds(self) -> Float[np.ndarray, "side number"]:
        """Lower and upper bounds of free numbers, then of dependent ones; NaN without a bound."""
        items = [*self.goals.free, *self.goals.equal]
        return np.array([[one.lower, one.upper] for one in items], dtype=float).T

    @cached_property
    def begin(self) -> Float[np.ndarray, " number"]:
        """Fractions of the starting design, in logarithms where the search is logarithmic."""
        log = np.array([item.scale == "log" for item in self.goals.free])
        rows = np.array([self.start, *self.bounds[:, : len(log)]])
        here, low, high = np.log(rows, out=rows, where=log)
        return (here - low) / (high - low)

    def values(self, fraction: Float[np.ndarray, " number"]) -> dict[str, float]:
        """Free numbers at fractions of the ranges, then dependent ones, by dotted path."""
        free = {}
        for n, item in enumerate(self.goals.free):
            u, low, high = float(fraction[n]), item.lower, item.upper
            known = {0.0: low, 1.0: high, float(self.begin[n]): float(self.start[n])}
            between = low * (high / low) ** u if item.scale == "log" else low + u * (high - low)
            free[item.name] = known.get(u, between)
        known = self.fixed | free
        return free | {
            item.name: item.offset + sum(rate * known[term] for term, rate in item.terms.items())
            for item in self.goals.equal
        }

    def margins(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, "side number"]:
        """Distances of all numbers from their bounds; infinite where there is no bound.

        Of free numbers as fractions, of dependent ones over the distance between the bounds, or
        over a single bound.
        """
        count, (low, high) = len(fraction), self.bounds
        single = np.fmax(np.abs(low), np.abs(high))
        span = np.where(np.isnan(high - low), np.where(single > 0, single, 1.0), high - low)
        tied = np.array([*self.values(fraction).values()])[count:]
        away = np.array([tied - low[count:], high[count:] - tied]) / span[count:]
        found = np.hstack([[fraction, 1 - fraction], away])
        return np.where(np.isnan(found), np.inf, found)

    @cached_property
    def bounded(self) -> Bool[np.ndarray, "side number"]:
        """Which bounds of dependent numbers there are."""
        known = np.isfinite(self.bounds)
        return known & (np.arange(known.shape[1]) >= len(self.start))

    def toml(self, fraction: Float[np.ndarray, " number"]) -> str:
        """Design as TOML."""
        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, paths.symmetric_settings(self.values(fraction)))
        return reader.write_toml(raw)

    @cached_property
    def _varied(self) -> reader.VariedDesign:
        return reader.VariedDesign.of(self.text)

    def design(self, fraction: Float[np.ndarray, " number"]) -> Design:
        """Parsed design; raises `InputError` if it is invalid."""
        numbers = self.values(fraction).items()
        twins = paths.twins
        return self._varied.at({path: value for name, value in numbers for path in twins(name)})

    def design_if_valid(self, fraction: Float[np.ndarray, " number"]) -> Design | None:
        """Parsed design; None if it is invalid."""
        with contextlib.suppress(InputError):
            return self.design(fraction)
        return None


def _faults(goals: Goals, known: dict[str, float]) -> Iterator[Fault]:
    """Faults of names that the design does not give, and of starts out of bounds."""
    free = [item.name for item in goals.free]
    named = [(f"free.{n}.name", name) for n, name in enumerate(free, 1)]
    for n, item in enumerate(goals.equal, 1):
        named += [(f"equal.{n}.name", item.name)]
        named += [(f"equal.{n}.terms", term) for term in item.terms if term not in free]
    for key, name in named:
        if name not in known:
            remedy = f"add it to the design (--set); {suggest(name, list(known))}"
            yield Fault(key, "the design gives no such number", remedy, format_value(name))
    for n, item in enumerate(goals.free, 1):
        value = known.get(item.name, item.lower) if item.start is None else item.start
        if not item.lower <= value <= item.upper:
            bounds = f"{item.lower:g} to {item.upper:g}"
            problem = f"the design's value {value:g} lies outside the bounds {bounds}"
            yield Fault(f"free.{n}", problem, "give a start between them, or widen them")
