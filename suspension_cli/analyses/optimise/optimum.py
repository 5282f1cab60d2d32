"""Result of `pendsus optimise` as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design.path_units import unit_of
from suspension_cli.files.declared import along, derived, in_unit, scale_of

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int


@dataclass(frozen=True)
class Numbers:
    """Free numbers, then dependent ones.

    Attributes
    ----------
    name : tuple of str
        Dotted paths.
    tied : array
        Whether a number depends on others.
    before, after, lower, upper : arrays
        Values and bounds, SI; NaN where there is no bound.
    bound : array
        -1 at the lower bound, 1 at the upper one, 0 between them.
    multiplier : array
        Decrease of the objective per shift of the bound outwards, in units of the range between
        the bounds; NaN for a dependent number with only one bound.
    """

    name: tuple[str, ...] = field(metadata=scale_of("number"))
    tied: Bool[np.ndarray, " number"]
    before: Float[np.ndarray, " number"] = field(metadata=in_unit("{unit}"))
    after: Float[np.ndarray, " number"] = field(metadata=in_unit("{unit}"))
    lower: Float[np.ndarray, " number"] = field(metadata=in_unit("{unit}"))
    upper: Float[np.ndarray, " number"] = field(metadata=in_unit("{unit}"))
    bound: Int[np.ndarray, " number"]
    multiplier: Float[np.ndarray, " number"]

    @property
    @derived(along="number")
    def unit(self) -> tuple[str, ...]:
        """SI unit of each number."""
        return tuple(unit_of(name) or "1" for name in self.name)


@dataclass(frozen=True)
class Quantities:
    """Quantities that goals refer to.

    Attributes
    ----------
    name, unit : tuple of str
    before, after : arrays
        Values of both designs; NaN for an unstable mode.
    mode : array
        Number of the mode in the optimised design, from 0; -1 for other quantities.
    weight : array
        Weight in the objective: positive to minimise, negative to maximise, 0 for others.
    model : tuple of str
        Model of each mode and response; "" for loads of straight wires.
    """

    name: tuple[str, ...] = field(metadata=scale_of("quantity"))
    unit: tuple[str, ...] = field(metadata=along("quantity"))
    before: Float[np.ndarray, " quantity"] = field(metadata=in_unit("{unit}"))
    after: Float[np.ndarray, " quantity"] = field(metadata=in_unit("{unit}"))
    mode: Int[np.ndarray, " quantity"]
    weight: Float[np.ndarray, " quantity"]
    model: tuple[str, ...] = field(metadata=along("quantity"))


@dataclass(frozen=True)
class Limits:
    """Limits on the quantities.

    Attributes
    ----------
    name : tuple of str
        ``yaw 3 <= 5 Hz``.
    goal : array
        Number of the goal in its file, from 1.
    quantity, other : array
        Number of the quantity, and of the one below it in a separation (-1: none).
    sense : tuple of str
        ``at_least``, ``at_most`` or ``equals``.
    unit : tuple of str
        Of limit and value.
    asked, value : arrays
        Limit and value; ratios or differences of separations.
    margin : array
        ln of value over limit, or of limit over value, negative if not met; minus the absolute
        value for an equality.
    met, active : array
        Active limits constrain the optimum.
    multiplier : array
        Decrease of the objective per unit by which the margin may shrink.
    """

    name: tuple[str, ...] = field(metadata=scale_of("limit"))
    goal: Int[np.ndarray, " limit"]
    quantity: Int[np.ndarray, " limit"]
    other: Int[np.ndarray, " limit"]
    sense: tuple[str, ...] = field(metadata=along("limit"))
    unit: tuple[str, ...] = field(metadata=along("limit"))
    asked: Float[np.ndarray, " limit"] = field(metadata=in_unit("{unit}"))
    value: Float[np.ndarray, " limit"] = field(metadata=in_unit("{unit}"))
    margin: Float[np.ndarray, " limit"]
    met: Bool[np.ndarray, " limit"]
    active: Bool[np.ndarray, " limit"]
    multiplier: Float[np.ndarray, " limit"]

    @property
    def room(self) -> Float[np.ndarray, " limit"]:
        """Relative distance of each value from its limit, negative if not met."""
        return relative_room(self.value, self.asked, self.sense)


def relative_room(
    value: Float[np.ndarray, " limit"], asked: Float[np.ndarray, " limit"], sense: tuple[str, ...]
) -> Float[np.ndarray, " limit"]:
    """Distances from limits relative to these, negative if not met; of equalities at most 0."""
    away, senses = value / asked - 1, np.array(sense, dtype=str)
    away = np.where(senses == "at_most", -away, away)
    return np.where(senses == "equals", -np.abs(away), away) + 0.0  # -0.0 becomes 0.0


@dataclass(frozen=True)
class ModeTable:
    """All modes by family and rank.

    Attributes
    ----------
    name : tuple of str
        Family and rank, ``longitudinal-pitch 1``.
    label, number : tuple of str, array
        Label and number (from 0) in the optimised design.
    before, after : arrays
        Frequencies, Hz; NaN for an unstable mode.
    fraction_before, fraction_after : arrays
        Fraction of the kinetic energy in the top mass.
    """

    name: tuple[str, ...] = field(metadata=scale_of("mode"))
    label: tuple[str, ...] = field(metadata=along("mode"))
    before: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    after: Float[np.ndarray, " mode"] = field(metadata=in_unit("Hz"))
    fraction_before: Float[np.ndarray, " mode"]
    fraction_after: Float[np.ndarray, " mode"]
    number: Int[np.ndarray, " mode"]


@dataclass(frozen=True)
class Starts:
    """Starts of the search; the first is the given design.

    Attributes
    ----------
    before, after : arrays
        Largest violation of a limit (logarithm); NaN for an invalid design.
    objective : array
    place : array
        Number of the design reached, from 1, equal for equal designs; 0 if none.
    """

    before: Float[np.ndarray, " start"]
    after: Float[np.ndarray, " start"]
    objective: Float[np.ndarray, " start"]
    place: Int[np.ndarray, " start"]


@dataclass(frozen=True)
class Optimum:
    """A design optimised to meet goals.

    Attributes
    ----------
    unknown : tuple of str
        Requested quantities that are unknown, and the keys that the design lacks.
    objective : str
        Description of the function that was minimised.
    stationarity : float
        See `ActiveSet`.
    fidelity, reason, error : str, str, float
        Model of the modes, why, and its estimated relative error.
    design : str
        The optimised design as TOML.
    goals : str
        Text of the file of goals.
    """

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
    design: str
    goals: str = ""

    @property
    @derived()
    def met(self) -> bool:
        """Whether all limits are met and all requested quantities are known."""
        return bool(self.limits.met.all()) and not self.unknown

    @property
    def checked(self) -> str:
        """Models with which the quantities were computed, in words."""
        levels = sorted({level for level in self.quantities.model if level} or {self.fidelity})
        return f"checked with the {' and '.join(levels)} model{'s' * (len(levels) > 1)}"
