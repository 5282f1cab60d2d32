"""Result of `pendsus optimise`: the design found, and its numbers, limits and modes as arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.analyses.record import Record
from suspension_cli.design import reader
from suspension_cli.design.paths import unit_of
from suspension_cli.files.declared import ADDED, ATTRIBUTE, along, derived, in_unit, scale_of
from suspension_cli.files.documents import Layout

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.design.reader import Source

HERTZ = in_unit("Hz")
SI = in_unit("{unit}")
EQUAL = 1e-6
"""Difference of logarithms, and of fractions of ranges, that count as equal."""


@dataclass(frozen=True)
class Numbers:
    """Free numbers, then dependent ones (`tied`), by dotted path, SI; NaN where there is no bound.

    `bound` is -1 at the lower bound, 1 at the upper one, 0 between them. `multiplier` is the
    decrease of the objective per shift of the bound outwards, in units of the range between the
    bounds; NaN for a dependent number with only one bound.
    """

    in_json: ClassVar = Layout(
        rows={"number": ""}, names={"name": "name", "tied": "follows", "bound": "at_bound"}
    )
    name: tuple[str, ...] = field(metadata=scale_of("number"))
    tied: Bool[np.ndarray, " number"]
    before: Float[np.ndarray, " number"] = field(metadata=SI)
    after: Float[np.ndarray, " number"] = field(metadata=SI)
    lower: Float[np.ndarray, " number"] = field(metadata=SI)
    upper: Float[np.ndarray, " number"] = field(metadata=SI)
    bound: Int[np.ndarray, " number"]
    multiplier: Float[np.ndarray, " number"]

    @property
    @derived(along="number")
    def unit(self) -> tuple[str, ...]:
        """SI unit of each number."""
        return tuple(unit_of(name) or "1" for name in self.name)


@dataclass(frozen=True)
class Quantities:
    """Quantities that goals refer to, in both designs; NaN for an unstable mode.

    `mode` is the number of the mode in the optimised design, from 0; -1 for other quantities.
    `weight` in the objective is positive to minimise, negative to maximise. `model` is that in
    which the quantity is computed.
    """

    in_json: ClassVar = Layout(rows={"quantity": ""}, names={"name": "name"}, without="mode")
    name: tuple[str, ...] = field(metadata=scale_of("quantity"))
    unit: tuple[str, ...] = field(metadata=along("quantity"))
    before: Float[np.ndarray, " quantity"] = field(metadata=SI)
    after: Float[np.ndarray, " quantity"] = field(metadata=SI)
    mode: Int[np.ndarray, " quantity"]
    weight: Float[np.ndarray, " quantity"]
    model: tuple[str, ...] = field(metadata=along("quantity"))


@dataclass(frozen=True)
class Limits:
    """Limits on the quantities, named like ``yaw 3 <= 5 Hz``.

    `group` names what is reported together, and `quantity` is the number of the quantity, from 0.
    `before` and `value` are what the limit takes of both designs: a magnitude, or of two modes that
    share a motion the worse one. Differences from the limit are relative to `scale`, and margins
    logarithms if `logarithmic`. `active` limits constrain the optimum; `multiplier` is the decrease
    of the objective per unit by which the margin may shrink.
    """

    in_json: ClassVar = Layout(
        rows={"limit": ""},
        names={"name": "limit", "group": "goal"},
        without="quantity scale logarithmic",
        also="room",
    )
    name: tuple[str, ...] = field(metadata=scale_of("limit"))
    group: tuple[str, ...] = field(metadata=along("limit"))
    quantity: Int[np.ndarray, " limit"]
    sense: tuple[str, ...] = field(metadata=along("limit"))
    unit: tuple[str, ...] = field(metadata=along("limit"))
    asked: Float[np.ndarray, " limit"] = field(metadata=SI)
    scale: Float[np.ndarray, " limit"] = field(metadata=SI)
    logarithmic: Bool[np.ndarray, " limit"]
    before: Float[np.ndarray, " limit"] = field(metadata=SI)
    value: Float[np.ndarray, " limit"] = field(metadata=SI)
    active: Bool[np.ndarray, " limit"]
    multiplier: Float[np.ndarray, " limit"]

    @property
    @derived()
    def margin(self) -> Float[np.ndarray, " limit"]:
        """ln of value over limit, or of limit over value: negative if not met, or not equal.

        Of quantities with a sign the relative distance from the limit.
        """
        positive = np.where(self.logarithmic, self.value, 1.0)
        limit = np.where(self.logarithmic, self.asked, 1.0)
        with np.errstate(divide="ignore"):
            log = np.log(positive) - np.log(limit)
        return self._signed(np.where(self.logarithmic, log, (self.value - self.asked) / self.scale))

    @property
    @derived()
    def met(self) -> Bool[np.ndarray, " limit"]:
        """Whether each limit is met, an equality to 1e-6; not if the value is NaN."""
        tolerance = [EQUAL if sense == "equals" else 0.0 for sense in self.sense]
        return self.margin >= -np.array(tolerance)

    @property
    def room(self) -> Float[np.ndarray, " limit"]:
        """Relative distance of each value from its limit, negative if not met."""
        return self._relative_room(self.value)

    @property
    def room_before(self) -> Float[np.ndarray, " limit"]:
        """Relative distance of each value of the starting design from its limit."""
        return self._relative_room(self.before)

    def _relative_room(self, value: Float[np.ndarray, " limit"]) -> Float[np.ndarray, " limit"]:
        """Distances of values from the limits relative to these; of equalities at most 0.

        As `quantities.requirements.Requirement.margin` of other commands.
        """
        size = np.where(self.asked == 0, self.scale, np.abs(self.asked))
        return self._signed((value - self.asked) / size) + 0.0  # -0.0 becomes 0.0

    def _signed(self, above: Float[np.ndarray, " limit"]) -> Float[np.ndarray, " limit"]:
        sense = np.array(self.sense, dtype=str)
        above = np.where(sense == "at_most", -above, above)
        return np.where(sense == "equals", -np.abs(above), above)


@dataclass(frozen=True)
class ModeTable:
    """All modes by family and rank (``longitudinal-pitch 1``): Hz, NaN for an unstable mode.

    `label` (as of `pendsus modes`) and `number` (from 0) are those in the optimised design;
    fractions are of the kinetic energy in the top mass.
    """

    in_json: ClassVar = Layout(
        rows={"mode": ""},
        names={
            "name": "name",
            "fraction_before": "top_mass_fraction_before",
            "fraction_after": "top_mass_fraction_after",
        },
        without="number",
    )
    name: tuple[str, ...] = field(metadata=scale_of("mode"))
    label: tuple[str, ...] = field(metadata=along("mode"))
    before: Float[np.ndarray, " mode"] = field(metadata=HERTZ)
    after: Float[np.ndarray, " mode"] = field(metadata=HERTZ)
    fraction_before: Float[np.ndarray, " mode"]
    fraction_after: Float[np.ndarray, " mode"]
    number: Int[np.ndarray, " mode"]


@dataclass(frozen=True)
class Starts:
    """Starts of the search; the first is the given design.

    `origin` is ``file``, ``velocity damping``, with the quality factor of the modes, or ``random``.
    `before` and `after` are largest violations, 0 if there is none, NaN for an invalid design: of a
    limit its negative `Limits.margin`, to which the margin of the goals is added; of a bound of a
    dependent number that over its range.
    `place` is the number of the design reached, from 1, equal for equal designs; 0 if none.
    """

    in_json: ClassVar = Layout(
        rows={"start": ""},
        names={
            "origin": "from",
            "before": "violation_before",
            "after": "violation_after",
            "place": "arrived_at",
        },
    )
    origin: tuple[str, ...] = field(metadata=along("start"))
    before: Float[np.ndarray, " start"]
    after: Float[np.ndarray, " start"]
    objective: Float[np.ndarray, " start"]
    place: Int[np.ndarray, " start"]


@dataclass(frozen=True, eq=False)
class Found:
    """A design optimised to meet goals.

    Attributes
    ----------
    numbers, quantities, limits, modes, starts
        Tables: free and dependent numbers, quantities of goals, limits on them, all modes, and the
        starts of the search.
    unknown
        Requested quantities that are unknown, with the keys that the design lacks.
    objective
        What was minimised, in words.
    stationarity
        That of `search.Search.multipliers`.
    fidelity, reason, error
        Model of search and check, why, and its estimated relative error.
    toml
        The optimised design.
    digits
        Significant digits to which its free numbers are rounded; 0 if they are not.
    rounding
        By how much the rounding may change a quantity, relative.
    goals
        Text of the file of goals.
    remarks
        Which modes share a motion in the optimised design.
    """

    in_json: ClassVar = Layout(
        names={"numbers": "parameters", "fidelity": "checked_on", "met": "goals_met"},
        without="reason error toml rounding goals goals_file",
    )
    numbers: Numbers
    quantities: Quantities
    limits: Limits
    modes: ModeTable
    starts: Starts
    unknown: tuple[str, ...]
    objective: str
    stationarity: float
    fidelity: str
    reason: str
    error: float
    toml: str = field(metadata=in_unit("", name="design"))
    digits: int = 0
    rounding: float = 0.0
    goals: str = ""
    remarks: tuple[str, ...] = field(default=(), metadata=ATTRIBUTE)

    @property
    @derived()
    def met(self) -> bool:
        """Whether all limits are met and all requested quantities are known."""
        return bool(self.limits.met.all()) and not self.unknown

    @property
    def levels(self) -> list[str]:
        """Models with which the quantities were computed."""
        return sorted({level for level in self.quantities.model if level} or {self.fidelity})

    @property
    def checked(self) -> str:
        """Models with which the quantities were computed, in words."""
        levels = self.levels
        return f"checked with the {' and '.join(levels)} model{'s' * (len(levels) > 1)}"


@dataclass(frozen=True, eq=False, repr=False)
class Optimum(Record, Found):
    """A design optimised to meet goals, and the run; `run.design` is where the search started.

    Attributes
    ----------
    goals_file
        Path of the file of goals.
    """

    goals_file: str = field(default="", metadata=ADDED)

    @property
    def design(self) -> Source:
        """The design that was found."""
        return reader.with_text(self.run.design, self.toml)
