"""A design as a function of its free numbers and of those that depend on them."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import paths, reader
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Equal, Free, Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.studies import parameters
from suspension_cli.studies.parameters import Parameter

if TYPE_CHECKING:
    from jaxtyping import Bool, Float


@dataclass(frozen=True)
class FreeDesign:
    """A design with free and dependent numbers.

    Attributes
    ----------
    text : str
        The design as TOML, with the starting values.
    equal : tuple of Equal
        Dependent numbers, linear in free and fixed ones.
    start : array
        Starting values of the free numbers, SI.
    fixed : dict of float
        Fixed numbers on which others depend, by dotted path, SI.
    """

    text: str
    free: tuple[Free, ...]
    equal: tuple[Equal, ...]
    start: Float[np.ndarray, " number"]
    fixed: dict[str, float]

    @staticmethod
    def of(text: str, goals: Goals) -> FreeDesign:
        """Look up the free numbers of goals in a design.

        Raises `InputError` if the design does not give them, or a start lies out of bounds.
        """
        known = {item.name: item.value for item in parameters.every(text)}
        faults, start = [], []
        for n, item in enumerate(goals.free, 1):
            value = item.start if item.start is not None else known.get(item.name)
            if item.name not in known:
                remedy = f"add it to the design (--set); {suggest(item.name, list(known))}"
                faults.append(
                    Fault(
                        f"free.{n}.name",
                        "the design gives no such number",
                        remedy,
                        format_value(item.name),
                    )
                )
            elif value is not None and not item.lower <= value <= item.upper:
                faults.append(
                    Fault(
                        f"free.{n}",
                        f"the design's value {value:g} lies outside the bounds"
                        f" {item.lower:g} to {item.upper:g}",
                        "give a start between them, or widen them",
                    )
                )
            start.append(value)
        free = {item.name for item in goals.free}
        for n, item in enumerate(goals.equal, 1):
            names = {
                f"equal.{n}.name": [item.name],
                f"equal.{n}.terms": [term for term in item.terms if term not in free],
            }
            for key, some in names.items():
                faults += [
                    Fault(
                        key,
                        "the design gives no such number",
                        suggest(name, list(known)),
                        format_value(name),
                    )
                    for name in some
                    if name not in known
                ]
        if faults:
            raise InputError(faults)
        fixed = {
            term: known[term] for item in goals.equal for term in item.terms if term not in free
        }
        made = FreeDesign(
            text, tuple(goals.free), tuple(goals.equal), np.array(start, dtype=float), fixed
        )
        try:
            return FreeDesign(made.toml(made.start), made.free, made.equal, made.start, fixed)
        except InputError as error:
            raise InputError(
                [
                    Fault(
                        "equal",
                        f"makes the starting design invalid: {fault.key}: {fault.problem}",
                        fault.remedy,
                    )
                    for fault in error.faults
                ]
            ) from None

    @property
    def lower(self) -> Float[np.ndarray, " number"]:
        """Lower bounds, SI."""
        return np.array([item.lower for item in self.free])

    @property
    def upper(self) -> Float[np.ndarray, " number"]:
        """Upper bounds, SI."""
        return np.array([item.upper for item in self.free])

    @cached_property
    def _log(self) -> Bool[np.ndarray, " number"]:
        return np.array([item.scale == "log" for item in self.free])

    def numbers(self, fraction: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Compute free numbers from fractions of the ranges between their bounds."""
        low, high = self.lower, self.upper
        with np.errstate(invalid="ignore", divide="ignore"):
            found = np.where(
                self._log,
                np.exp(
                    np.log(np.abs(low)) + fraction * (np.log(np.abs(high)) - np.log(np.abs(low)))
                ),
                low + fraction * (high - low),
            )
        return np.clip(found, low, high)

    def fractions(self, number: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Compute the inverse of `numbers`."""
        low, high = self.lower, self.upper
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(
                self._log,
                np.log(np.abs(number / low)) / np.log(np.abs(high / low)),
                (number - low) / (high - low),
            )

    def rate(self, number: Float[np.ndarray, " number"]) -> Float[np.ndarray, " number"]:
        """Differentiate `numbers` by the fractions."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(
                self._log, number * np.log(np.abs(self.upper / self.lower)), self.upper - self.lower
            )

    def values(self, number: Float[np.ndarray, " number"]) -> dict[str, float]:
        """Free numbers, then dependent ones, by dotted path."""
        free = {item.name: float(value) for item, value in zip(self.free, number, strict=True)}
        known = free | self.fixed
        return free | {
            item.name: item.offset
            + sum(factor * known[term] for term, factor in item.terms.items())
            for item in self.equal
        }

    def directions(self, number: Float[np.ndarray, " number"]) -> list[Parameter]:
        """Free numbers, each with those that change with it."""
        ties = [
            [(tie.name, tie.terms[name]) for tie in self.equal if name in tie.terms]
            for name in (item.name for item in self.free)
        ]
        return [
            Parameter(item.name, float(value), tuple(tied))
            for item, value, tied in zip(self.free, number, ties, strict=True)
        ]

    def ties(self) -> tuple[Float[np.ndarray, "tied number"], Float[np.ndarray, " tied"]]:
        """Bounds of dependent numbers as A and b, with A x + b >= 0 for free numbers x.

        Rows are relative to the bounds.
        """
        rows, sides = [], []
        for item in self.equal:
            row = np.array([item.terms.get(one.name, 0.0) for one in self.free])
            side = item.offset + sum(
                factor * self.fixed[term]
                for term, factor in item.terms.items()
                if term in self.fixed
            )
            for bound, sign in ((item.lower, 1.0), (item.upper, -1.0)):
                if bound is not None:
                    size = abs(bound) or 1.0
                    rows.append(sign * row / size)
                    sides.append(sign * (side - bound) / size)
        return np.array(rows).reshape(-1, len(self.free)), np.array(sides)

    def toml(self, number: Float[np.ndarray, " number"]) -> str:
        """Design as TOML; raises `InputError` if it is invalid."""
        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, paths.symmetric_settings(self.values(number)))
        reader.convert(raw)
        return reader.write_toml(raw)

    def design(self, number: Float[np.ndarray, " number"]) -> Design:
        """Parsed design; raises `InputError` if it is invalid."""
        return reader.parse(self.toml(number))
