"""A design whose free numbers are fractions of the ranges between their bounds."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import paths, reader
from suspension_cli.design.goals import Goals
from suspension_cli.design.schema import Design
from suspension_cli.design.significant_digits import round_to_digits
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.studies import parameters

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class FreeDesign:
    """A design whose free numbers are fractions u in [0, 1] of the ranges between their bounds.

    Other numbers depend on these linearly. `known` are all numbers of the starting design by dotted
    path, SI. Arrays list the free ones, then the dependent ones. `digits` are the significant ones
    to which free numbers are rounded, within their bounds: to the nearest value, or up or down
    where `side` is 1 or -1. All digits are kept if it is 0.
    """

    text: str
    goals: Goals
    known: dict[str, float]
    digits: int = 0
    side: tuple[int, ...] = ()

    @staticmethod
    def of(text: str, goals: Goals) -> FreeDesign:
        """Look up the free numbers of goals in a design (TOML).

        Raises `InputError` if the design does not give them, or a start lies out of bounds.
        """
        given = {item.name: item.value for item in parameters.every(text)}
        starts = {item.name: item.start for item in goals.free if item.start is not None}
        if faults := [*_faults(text, goals, given, starts)]:
            raise InputError(faults)
        freed = FreeDesign(text, goals, given | starts)
        try:
            freed.design(freed.begin)
        except InputError as error:
            problem = "makes the starting design invalid: {0.key}: {0.problem}"
            faults = [Fault("equal", problem.format(one), one.remedy) for one in error.faults]
            raise InputError(faults) from None
        return freed

    @cached_property
    def start(self) -> Float[np.ndarray, " free"]:
        """Starting values of the free numbers."""
        return np.array([self.known[item.name] for item in self.goals.free])

    @cached_property
    def bounds(self) -> Float[np.ndarray, "side number"]:
        """Lower and upper bounds; NaN without a bound."""
        items = [*self.goals.free, *self.goals.equal]
        return np.array([[one.lower, one.upper] for one in items], dtype=float).T

    @cached_property
    def bounded(self) -> Bool[np.ndarray, "side number"]:
        """Which bounds of dependent numbers there are."""
        known = np.isfinite(self.bounds)
        known[:, : len(self.start)] = False
        return known

    @cached_property
    def begin(self) -> Float[np.ndarray, " free"]:
        """Fractions of the starting design, in logarithms where the search is logarithmic."""
        return self.fractions(self.start)

    def fractions(self, values: Float[np.ndarray, " free"]) -> Float[np.ndarray, " free"]:
        """Convert values of the free numbers to fractions, as `values` does the other way."""
        log = np.array([item.scale == "log" for item in self.goals.free])
        rows = np.array([values, *self.bounds[:, : len(log)]])
        np.log(rows, out=rows, where=log)
        here, low, high = rows
        return (here - low) / (high - low)

    def values(self, fraction: Float[np.ndarray, " free"]) -> dict[str, float]:
        """All numbers by dotted path; starts and bounds are exact."""
        free = {}
        for n, item in enumerate(self.goals.free):
            u = float(fraction[n])
            if item.scale == "log":
                between = item.lower * (item.upper / item.lower) ** u
            else:
                between = item.lower + u * (item.upper - item.lower)
            if self.digits:
                rounded = round_to_digits(between, self.digits, self.side[n] if self.side else 0)
                between = min(max(rounded, item.lower), item.upper)
            begin = float(self.begin[n])
            exact = {0.0: item.lower, 1.0: item.upper, begin: float(self.start[n])}
            free[item.name] = exact.get(u, between)
        known = self.known | free
        return free | {
            item.name: item.offset + sum(rate * known[term] for term, rate in item.terms.items())
            for item in self.goals.equal
        }

    def margins(self, fraction: Float[np.ndarray, " free"]) -> Float[np.ndarray, "side number"]:
        """Distances from the bounds over the range between these, or over a single bound.

        Infinite where there is no bound.
        """
        low, high = self.bounds
        single = np.fmax(np.abs(low), np.abs(high))
        span = np.where(np.isnan(high - low), np.where(single > 0, single, 1.0), high - low)
        value = np.array([*self.values(fraction).values()])
        away = np.array([value - low, high - value]) / span
        away[:, : len(fraction)] = fraction, 1 - fraction
        return np.where(np.isnan(away), np.inf, away)

    def toml(self, fraction: Float[np.ndarray, " free"]) -> str:
        """Design as TOML."""
        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, paths.symmetric_settings(self.values(fraction)))
        return reader.write_toml(raw, self.text)

    @cached_property
    def _varied(self) -> reader.VariedDesign:
        return reader.VariedDesign.of(self.text)

    def design(self, fraction: Float[np.ndarray, " free"]) -> Design:
        """Parsed design; raises `InputError` if it is invalid."""
        numbers = self.values(fraction).items()
        return self._varied.at({key: value for name, value in numbers for key in paths.twins(name)})

    def design_if_valid(self, fraction: Float[np.ndarray, " free"]) -> Design | None:
        """Parsed design; None if it is invalid."""
        try:
            return self.design(fraction)
        except InputError:
            return None


def _faults(
    text: str, goals: Goals, known: dict[str, float], starts: dict[str, float]
) -> Iterator[Fault]:
    """Faults of names that the design does not give, and of starts out of bounds."""
    free = [item.name for item in goals.free]
    named = [(f"free.{n}.name", name) for n, name in enumerate(free, 1)]
    for n, item in enumerate(goals.equal, 1):
        named += [(f"equal.{n}.name", item.name)]
        named += [(f"equal.{n}.terms", term) for term in item.terms if term not in free]
    for key, name in named:
        if name not in known:
            problem, remedy = parameters.why_unknown(text, name, known)
            yield Fault(key, problem, remedy, format_value(name))
    for n, item in enumerate(goals.free, 1):
        value = (known | starts).get(item.name, item.lower)
        if not item.lower <= value <= item.upper:
            bounds = f"{item.lower:g} to {item.upper:g}"
            problem = f"the design's value {value:g} lies outside the bounds {bounds}"
            yield Fault(f"free.{n}", problem, "give a start between them, or widen them")
