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
from suspension_cli.studies.parameters import Parameter

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
        if faults := [*_unknown_numbers(goals, known), *_starts_outside(goals, known)]:
            raise InputError(faults)
        start = [known[item.name] if item.start is None else item.start for item in goals.free]
        fixed = {term: known[term] for item in goals.equal for term in item.terms}
        made = FreeDesign(text, goals, np.array(start, dtype=float), fixed)
        try:
            text = made.toml(made.begin)
            reader.parse(text)
        except InputError as error:
            problem = "makes the starting design invalid"
            raise InputError(
                [
                    Fault("equal", f"{problem}: {one.key}: {one.problem}", one.remedy)
                    for one in error.faults
                ]
            ) from None
        return replace(made, text=text)

    @cached_property
    def lower(self) -> Float[np.ndarray, " number"]:
        """Lower bounds, SI."""
        return np.array([item.lower for item in self.goals.free])

    @cached_property
    def upper(self) -> Float[np.ndarray, " number"]:
        """Upper bounds, SI."""
        return np.array([item.upper for item in self.goals.free])

    @cached_property
    def _log(self) -> Bool[np.ndarray, " number"]:
        return np.array([item.scale == "log" for item in self.goals.free])

    def _scaled(self, number: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Numbers, or their logarithms where the search is logarithmic."""
        return np.log(number, out=number.copy(), where=self._log)

    @cached_property
    def begin(self) -> Float[np.ndarray, " number"]:
        """Fractions of the starting design."""
        low, high = self._scaled(self.lower), self._scaled(self.upper)
        return (self._scaled(self.start) - low) / (high - low)

    def numbers(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Compute the free numbers at fractions of the ranges."""
        low, high = self._scaled(self.lower), self._scaled(self.upper)
        found = low + fraction * (high - low)
        found = np.clip(np.exp(found, out=found, where=self._log), self.lower, self.upper)
        return np.where(fraction == self.begin, self.start, found)

    def rate(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Differentiate `numbers`."""
        span = self._scaled(self.upper) - self._scaled(self.lower)
        return span * np.where(self._log, self.numbers(fraction), 1.0)

    def values(self, fraction: Float[np.ndarray, " number"]) -> dict[str, float]:
        """Free numbers, then dependent ones, by dotted path."""
        names = (item.name for item in self.goals.free)
        free = dict(zip(names, self.numbers(fraction).tolist(), strict=True))
        known = self.fixed | free
        return free | {
            item.name: item.offset + sum(rate * known[term] for term, rate in item.terms.items())
            for item in self.goals.equal
        }

    def directions(self, fraction: Float[np.ndarray, " number"]) -> list[Parameter]:
        """Free numbers, each with those that change with it."""
        values, equal = self.values(fraction), self.goals.equal
        return [
            Parameter(
                name,
                values[name],
                tuple((one.name, one.terms[name]) for one in equal if name in one.terms),
            )
            for name in (item.name for item in self.goals.free)
        ]

    def dependent_margins(
        self, fraction: Float[np.ndarray, " number"]
    ) -> tuple[Float[np.ndarray, " bound"], Float[np.ndarray, "bound number"]]:
        """Compute distances of dependent numbers from their bounds, relative to these, and slopes.

        For each number, first from the lower, then from the upper bound, if it has these.
        """
        values, rate = self.values(fraction), self.rate(fraction)
        margins, slopes = [], []
        for item in self.goals.equal:
            slope = rate * [item.terms.get(one.name, 0.0) for one in self.goals.free]
            for bound, sign in ((item.lower, 1.0), (item.upper, -1.0)):
                if bound is not None:
                    sign /= abs(bound) or 1.0
                    margins.append(sign * (values[item.name] - bound))
                    slopes.append(sign * slope)
        return np.array(margins), np.array(slopes).reshape(-1, len(rate))

    def toml(self, fraction: Float[np.ndarray, " number"]) -> str:
        """Design as TOML."""
        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, paths.symmetric_settings(self.values(fraction)))
        return reader.write_toml(raw)

    def design(self, fraction: Float[np.ndarray, " number"]) -> Design:
        """Parsed design; raises `InputError` if it is invalid."""
        return reader.parse(self.toml(fraction))

    def design_if_valid(self, fraction: Float[np.ndarray, " number"]) -> Design | None:
        """Parsed design; None if it is invalid."""
        with contextlib.suppress(InputError):
            return self.design(fraction)
        return None


def _unknown_numbers(goals: Goals, known: dict[str, float]) -> Iterator[Fault]:
    """Faults of names that the design does not give."""
    free = [item.name for item in goals.free]
    named = [(f"free.{n}.name", name) for n, name in enumerate(free, 1)]
    for n, item in enumerate(goals.equal, 1):
        named += [(f"equal.{n}.name", item.name)]
        named += [(f"equal.{n}.terms", term) for term in item.terms if term not in free]
    for key, name in named:
        if name not in known:
            remedy = f"add it to the design (--set); {suggest(name, list(known))}"
            yield Fault(key, "the design gives no such number", remedy, format_value(name))


def _starts_outside(goals: Goals, known: dict[str, float]) -> Iterator[Fault]:
    """Faults of starting values of the design that lie outside their bounds."""
    for n, item in enumerate(goals.free, 1):
        value = known.get(item.name, item.lower) if item.start is None else item.start
        if not item.lower <= value <= item.upper:
            bounds = f"{item.lower:g} to {item.upper:g}"
            problem = f"the design's value {value:g} lies outside the bounds {bounds}"
            yield Fault(f"free.{n}", problem, "give a start between them, or widen them")
