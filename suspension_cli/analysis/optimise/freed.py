"""A design some of whose numbers are free and some follow from others: what it is for values of the free ones."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from suspension_cli.analysis import parameters
from suspension_cli.analysis.parameters import twins
from suspension_cli.design import reader
from suspension_cli.design.faults import suggestion
from suspension_cli.design.goals import Equal, Free, Goals
from suspension_cli.design.scene import Array
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, shown


@dataclass(frozen=True)
class Freed:
    """A design and the numbers that may change.

    Attributes
    ----------
    text : str
        The design as TOML, with the numbers that the search starts from.
    free : tuple of Free
    equal : tuple of Equal
    start : (p,) array
        Of the free numbers.
    fixed : dict of float
        Numbers of the design that others follow from, by dotted path.
    """

    text: str
    free: tuple[Free, ...]
    equal: tuple[Equal, ...]
    start: Array
    fixed: dict[str, float]

    @staticmethod
    def of(text: str, goals: Goals) -> Freed:
        """Look up what goals free; raises `InputError` if the design has no such numbers, or starts out of bounds."""
        known = {item.name: item.value for item in parameters.every(text)}
        faults, start = [], []
        for n, item in enumerate(goals.free, 1):
            value = item.start if item.start is not None else known.get(item.name)
            if item.name not in known:
                remedy = suggestion(item.name, list(known)) + "; one left out can be given by --set"
                faults.append(Fault(f"free.{n}.name", "is no number that the design gives", remedy, shown(item.name)))
            elif value is not None and not item.lower <= value <= item.upper:
                faults.append(Fault(f"free.{n}", f"the design's value {value:g} lies outside the bounds", "give a start within them"))
            start.append(value)
        free = {item.name for item in goals.free}
        for n, item in enumerate(goals.equal, 1):
            names = {f"equal.{n}.name": [item.name], f"equal.{n}.terms": [term for term in item.terms if term not in free]}
            for key, some in names.items():
                faults += [Fault(key, "is no number that the design gives", suggestion(name, list(known)), shown(name)) for name in some if name not in known]
        if faults:
            raise InputError(faults)
        fixed = {term: known[term] for item in goals.equal for term in item.terms if term not in free}
        made = Freed(text, tuple(goals.free), tuple(goals.equal), np.array(start, dtype=float), fixed)
        try:
            return Freed(made.toml(made.start), made.free, made.equal, made.start, fixed)
        except InputError as error:
            raise InputError(
                [Fault("equal", f"does not start from a sound design: {fault.key}: {fault.problem}", fault.remedy) for fault in error.faults]
            ) from None

    @property
    def lower(self) -> Array:
        """Bounds (p,)."""
        return np.array([item.lower for item in self.free])

    @property
    def upper(self) -> Array:
        """Bounds (p,)."""
        return np.array([item.upper for item in self.free])

    @cached_property
    def _log(self) -> Array:
        return np.array([item.scale == "log" for item in self.free])

    def numbers(self, share: Array) -> Array:
        """Free numbers (p,) for shares (p,) of the way from the lower to the upper bound."""
        low, high = self.lower, self.upper
        with np.errstate(invalid="ignore", divide="ignore"):
            found = np.where(self._log, np.exp(np.log(np.abs(low)) + share * (np.log(np.abs(high)) - np.log(np.abs(low)))), low + share * (high - low))
        return np.clip(found, low, high)

    def shares(self, number: Array) -> Array:
        """The inverse of `numbers`."""
        low, high = self.lower, self.upper
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self._log, np.log(np.abs(number / low)) / np.log(np.abs(high / low)), (number - low) / (high - low))

    def rate(self, number: Array) -> Array:
        """Derivative (p,) of `numbers`."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self._log, number * np.log(np.abs(self.upper / self.lower)), self.upper - self.lower)

    def values(self, number: Array) -> dict[str, float]:
        """All numbers that change, by dotted path: the free ones, then those that follow."""
        free = {item.name: float(value) for item, value in zip(self.free, number, strict=True)}
        known = free | self.fixed
        return free | {item.name: item.offset + sum(factor * known[term] for term, factor in item.terms.items()) for item in self.equal}

    def directions(self) -> list[dict[str, float]]:
        """For each free number, the rates of all that change with it."""
        return [{item.name: 1.0} | {tie.name: tie.terms[item.name] for tie in self.equal if tie.terms.get(item.name)} for item in self.free]

    def ties(self) -> tuple[Array, Array]:
        """Bounds of numbers that follow, as rows of A and b with A x + b >= 0 for the free numbers x."""
        rows, sides = [], []
        for item in self.equal:
            row = np.array([item.terms.get(one.name, 0.0) for one in self.free])
            side = item.offset + sum(factor * self.fixed[term] for term, factor in item.terms.items() if term in self.fixed)
            for bound, sign in ((item.lower, 1.0), (item.upper, -1.0)):
                if bound is not None:
                    size = abs(bound) or 1.0
                    rows.append(sign * row / size)
                    sides.append(sign * (side - bound) / size)
        return np.array(rows).reshape(-1, len(self.free)), np.array(sides)

    def toml(self, number: Array) -> str:
        """The design as TOML; raises `InputError` if there is none."""
        raw = tomllib.loads(self.text)
        overrides = tuple(f"{path}={value!r}" for name, value in self.values(number).items() for path in twins(name))
        reader.apply_overrides(raw, overrides)
        reader.convert(raw)
        return reader.dump(raw)

    def design(self, number: Array) -> Design:
        """The design; raises `InputError` if there is none."""
        return reader.parse(self.toml(number))
