"""Requirements on quantities: whether values meet them, and by how much.

A requirement is written once, in `[[requirement]]` of a design, `[[tolerance.require]]`,
``--require`` or a file of goals; every analysis reads it as the same object.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.paths import DISPLAYED
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value, gather
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.needs import Needs
from suspension_cli.quantities.quantity import Quantity, evaluate
from suspension_cli.quantities.solved import of_designs

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

SYNTAX = "write 'QUANTITY in LEAST:LARGEST', 'QUANTITY < LIMIT' or 'QUANTITY > LIMIT', in SI units"


@dataclass(frozen=True)
class Limits:
    """Limits on a quantity by name, before it is looked up.

    Attributes
    ----------
    low, high
        Least and largest value, SI; infinite where there is no limit.
    magnitude
        Whether they limit the magnitude, and must not be equalled.
    key, low_key, high_key
        Keys or options that gave the name and either limit, for error messages.
    """

    quantity: str
    low: float = -math.inf
    high: float = math.inf
    magnitude: bool = False
    note: str = ""
    key: str = field(default="--require", compare=False)
    low_key: str = field(default="--require", compare=False)
    high_key: str = field(default="--require", compare=False)

    @property
    def text(self) -> str:
        """Text for ``--require``, exact to the last digit."""
        if math.isinf(self.low):
            return f"{self.quantity} < {self.high!r}"
        if math.isinf(self.high):
            return f"{self.quantity} > {self.low!r}"
        return f"{self.quantity} in {self.low!r}:{self.high!r}"


@dataclass(frozen=True)
class Band:
    """Values, SI, that meet a requirement.

    Attributes
    ----------
    low, high
        Least and largest one; infinite where there is no limit.
    of_magnitude
        Whether they limit the magnitude.
    open
        Whether the limits themselves do not meet it.
    """

    low: float
    high: float
    of_magnitude: bool
    open: bool

    def contains(self, values: Float[np.ndarray, "*design"]) -> Bool[np.ndarray, "*design"]:
        """Whether values meet it; NaN do not."""
        size = np.abs(values) if self.of_magnitude else np.asarray(values)
        if self.open:
            return (size > self.low) & (size < self.high)
        return (size >= self.low) & (size <= self.high)


@dataclass(frozen=True)
class Requirement:
    """A quantity of a design and the limits on it."""

    quantity: Quantity
    limits: Limits

    @property
    def displayed(self) -> tuple[str, float]:
        """Unit in which values are shown, "" for ratios, and the factor from SI to it."""
        return displayed_unit(self.quantity.unit)

    @property
    def limits_magnitude(self) -> bool:
        """Whether the sign does not matter: of a quantity with a sign, largest values alone."""
        alone = math.isinf(self.limits.low) and self.limits.high > 0
        return self.limits.magnitude or (self.quantity.signed and alone)

    @property
    def band(self) -> Band:
        """Values that meet it."""
        limits = self.limits
        return Band(limits.low, limits.high, self.limits_magnitude, limits.magnitude)

    @property
    def description(self) -> str:
        """The requirement in usual units: ``|test static pitch| < 2 mrad``."""
        unit, factor = self.displayed
        name = self.quantity.text
        if self.limits_magnitude and self.quantity.signed:
            name = f"|{name}|"
        low = self.limits.low * factor
        high = self.limits.high * factor
        below, above = ("<", ">") if self.limits.magnitude else ("<=", ">=")
        if math.isinf(self.limits.low):
            text = f"{name} {below} {high:g} {unit}"
        elif math.isinf(self.limits.high):
            text = f"{name} {above} {low:g} {unit}"
        else:
            text = f"{name} in {low:g} to {high:g} {unit}"
        return text.rstrip()

    def is_met(self, values: Float[np.ndarray, "*design"]) -> Bool[np.ndarray, "*design"]:
        """Whether designs with these values, SI, meet it; those without a value (NaN) do not."""
        return self.band.contains(values)

    def margin(self, values: Float[np.ndarray, "*design"]) -> Float[np.ndarray, "*design"]:
        """Distance from the nearer limit, relative to it: 0.01 means 1 %, negative if exceeded.

        That from a limit of 0 is relative to the other limit, or to 1 of the quantity's unit.
        """
        size = np.abs(values) if self.limits_magnitude else np.asarray(values, dtype=float)
        result = np.full(size.shape, np.inf)
        for limit, sign in ((self.limits.low, 1.0), (self.limits.high, -1.0)):
            if math.isfinite(limit):
                away = sign * (size - limit) / (abs(limit) or self._scale)
                result = np.fmin(result, away)
        return np.where(np.isnan(size), np.nan, result)

    @property
    def _scale(self) -> float:
        """Size to which differences from a limit of 0 are compared."""
        finite = [abs(one) for one in (self.limits.low, self.limits.high) if math.isfinite(one)]
        return max(finite) or 1.0


def displayed_unit(unit: str) -> tuple[str, float]:
    """Unit in which values are shown, "" for ratios, and the factor from SI to it."""
    name, factor = DISPLAYED.get(unit, (unit, 1.0))
    return ("" if name == "1" else name), factor


def of_design(design: Design) -> list[Limits]:
    """List the limits of the tables `[[requirement]]` of a design."""
    found = []
    for number, one in enumerate(design.requirement, 1):
        low = -math.inf if one.at_least is None else one.at_least
        high = math.inf if one.at_most is None else one.at_most
        table = f"requirement.{number}"
        limits = Limits(
            one.quantity,
            low,
            high,
            note=one.note,
            key=f"{table}.quantity",
            low_key=f"{table}.at_least",
            high_key=f"{table}.at_most",
        )
        found.append(limits)
    return found


def of_tolerance(design: Design) -> list[Limits]:
    """List the limits of the short form `[[tolerance.require]]`."""
    found = []
    for number, one in enumerate(design.tolerance.require if design.tolerance else (), 1):
        low, high = one.band or (one.above or -math.inf, one.below or math.inf)
        table = f"tolerance.require.{number}"
        limits = Limits(
            one.quantity,
            low,
            high,
            one.band is None,
            key=f"{table}.quantity",
            low_key=f"{table}.{'band' if one.band else 'above'}",
            high_key=f"{table}.{'band' if one.band else 'below'}",
        )
        found.append(limits)
    return found


def find(limits: Sequence[Limits], names: Names) -> tuple[Requirement, ...]:
    """Look up the quantities of limits, each once.

    Raises `InputError` with all that the design lacks, or with limits that no design can meet.
    """
    unique = list(dict.fromkeys(limits))
    found = tuple(gather(lambda one: find_one(one, names), unique))
    demand_possible(found)
    return found


def find_one(limits: Limits, names: Names) -> Requirement:
    """Look up the quantity of limits; raises `InputError` if the design has none of that name."""
    return Requirement(vocabulary.parse(limits.quantity, names, limits.key), limits)


def parse(text: str) -> Limits:
    """Parse limits as ``--require`` takes them."""

    def refused(problem: str, remedy: str = SYNTAX) -> InputError:
        return InputError.of("--require", problem, remedy, format_value(text))

    words = " ".join(text.split())  # single blanks: patterns of runs of them take long
    found = re.fullmatch(r"(.+?) (in) ([^: ]+) ?: ?([^: ]+)", words)
    found = found or re.fullmatch(r"([^<>]+?) ?([<>]) ?([^ <>]+)", words)
    if found is None:
        raise refused("is no requirement")
    name, sign, *words = found.groups()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise refused("has a limit that is no number") from None
    if not np.isfinite(numbers).all():
        raise refused("has a limit that is not finite")
    if sign == "in":
        low, high = numbers
        if not low < high:
            raise refused("is a reversed or empty band", "give LEAST:LARGEST")
        return Limits(name, low, high)
    [limit] = numbers
    if not limit > 0:
        problem = "limits a magnitude to a value that is not positive"
        raise refused(problem, "give a positive limit")
    low, high = (-math.inf, limit) if sign == "<" else (limit, math.inf)
    return Limits(name, low, high, magnitude=True)


def demand_possible(required: Sequence[Requirement]) -> None:
    """Raise `InputError` with the requirements, of one design, that no design can meet."""
    faults: list[Fault] = []
    possible: list[Requirement] = []
    for one in required:
        beyond = _find_beyond(one)
        if beyond is None:
            possible.append(one)
        else:
            faults.append(beyond)
    for first, second in itertools.permutations(possible, 2):
        if first.quantity == second.quantity and _are_apart(first, second):
            faults.append(_describe_contradiction(first, second))
    if faults:
        raise InputError(faults)


def _least(required: Requirement) -> float:
    """Least value that meets a requirement."""
    limits = required.limits
    if required.limits_magnitude and required.quantity.signed:
        return -limits.high
    return limits.low


def _are_apart(above: Requirement, below: Requirement) -> bool:
    """Whether one requirement demands more than another allows, of values or of magnitudes."""
    if above.limits_magnitude and below.limits_magnitude:
        return above.limits.low > below.limits.high
    return _least(above) > below.limits.high


def _find_beyond(required: Requirement) -> Fault | None:
    """Find a limit beyond all values that the quantity can have."""
    low, high = required.quantity.bounds
    limits = required.limits
    name = required.quantity.text
    remedy = "correct the limit"
    if limits.high < low:
        problem = f"can never be met: {name} is never below {low:g}"
        return Fault(limits.high_key, problem, remedy, f"{limits.high:g}")
    if _least(required) > high:
        problem = f"can never be met: {name} is never above {high:g}"
        return Fault(limits.low_key, problem, remedy, f"{limits.low:g}")
    return None


def _describe_contradiction(above: Requirement, below: Requirement) -> Fault:
    """Say that one requirement demands more than another allows."""
    problem = (
        f"contradicts {below.limits.high_key} = {below.limits.high:g}, on the same quantity"
        f" ({above.quantity.text}), so no design can meet both"
    )
    remedy = "correct one of the two limits"
    return Fault(above.limits.low_key, problem, remedy, f"{above.limits.low:g}")


@dataclass(frozen=True)
class Verdict:
    """A requirement and the value of its quantity in one design, SI; NaN if it has none.

    `model` is the name of the one in which it was computed.
    """

    requirement: Requirement
    value: float
    model: str

    @property
    def met(self) -> bool:
        """Whether the value meets it."""
        return bool(self.requirement.is_met(np.array(self.value)))

    @property
    def margin(self) -> float:
        """Distance from the nearer limit, relative to it; negative if exceeded, NaN if unknown."""
        return float(self.requirement.margin(np.array(self.value)))


def judge(requirements: Sequence[Requirement], design: Design, level: str) -> tuple[Verdict, ...]:
    """Compute the quantities of requirements of one design, in a model by its name.

    Quantities that need a more complete model are computed in that.
    """
    quantities = [one.quantity for one in requirements]
    values = np.full(len(quantities), np.nan)
    for _, batch in of_designs([design], level, Needs.of(quantities)):
        values = evaluate(quantities, batch)[0]
    models = [one.level(level, design) for one in quantities]
    found = zip(requirements, values.tolist(), models, strict=True)
    return tuple(Verdict(*one) for one in found)
