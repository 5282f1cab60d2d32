"""What `pendsus optimise` finds, as plain arrays: numbers, quantities, limits, modes, starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from suspension_cli.design.scene import Array


@dataclass(frozen=True)
class Numbers:
    """The numbers that changed: the free ones, then those that follow from them; (n,) arrays.

    Attributes
    ----------
    name : tuple of str
        Dotted paths.
    tied : bool array
    before, after, lower, upper : arrays
        SI; NaN where there is no bound.
    bound : int array
        -1 at the lower bound, 1 at the upper one, 0 between them.
    multiplier : array
        What the objective would gain if the bound gave way, for all of the way between the bounds; NaN of a number that follows and has one bound alone.
    """

    name: tuple[str, ...]
    tied: Any
    before: Array
    after: Array
    lower: Array
    upper: Array
    bound: Any
    multiplier: Array


@dataclass(frozen=True)
class Quantities:
    """What goals are about, (q,).

    Attributes
    ----------
    name, unit : tuple of str
    before, after : arrays
        As the ordinary analyses have them; NaN for an unstable mode.
    searched : array
        As the search had them, on `string`.
    mode : int array
        Place of the mode that each is about among those of the new design, from 0; -1 for others.
    weight : array
        Of what was to be made small (above 0) or large (below 0); 0 for others.
    """

    name: tuple[str, ...]
    unit: tuple[str, ...]
    before: Array
    after: Array
    searched: Array
    mode: Any
    weight: Array


@dataclass(frozen=True)
class Limits:
    """What was asked of them, (k,).

    Attributes
    ----------
    name : tuple of str
        ``yaw 3 <= 5 Hz``.
    goal : int array
        Number of the goal in its file, from 1.
    quantity, other : int arrays
        Place of the quantity, and of the one that it is to lie apart from (-1: none).
    sense : tuple of str
        ``at_least``, ``at_most`` or ``equals``.
    asked, value : arrays
        Of a separation, ratios or differences.
    margin : array
        Logarithm of value over limit, or of limit over value: below 0 the limit is not met; of an equality, less its absolute value.
    met, active : bool arrays
        Active limits are those that hold the search back.
    multiplier : array
        What the objective would gain a unit of margin.
    """

    name: tuple[str, ...]
    goal: Any
    quantity: Any
    other: Any
    sense: tuple[str, ...]
    asked: Array
    value: Array
    margin: Array
    met: Any
    active: Any
    multiplier: Array

    @property
    def room(self) -> Array:
        """How far each value lies on the right side of its limit, as a share of the limit; below 0 on the wrong one, of an equality either."""
        away = self.value / self.asked - 1
        sense = np.array(self.sense, dtype=str)
        return np.where(sense == "equals", -np.abs(away), np.where(sense == "at_most", -away, away)) + 0.0  # no minus before a zero


@dataclass(frozen=True)
class Every:
    """All modes, by family and rank, (m,).

    Attributes
    ----------
    name : tuple of str
    label : tuple of str
        Of the new design, as `pendsus modes` has it.
    before, after : arrays
        Hz; NaN for an unstable one.
    share_before, share_after : arrays
        Share of the kinetic energy in the top mass.
    number : int array
        Place among the modes of the new design, from 0.
    """

    name: tuple[str, ...]
    label: tuple[str, ...]
    before: Array
    after: Array
    share_before: Array
    share_after: Array
    number: Any


@dataclass(frozen=True)
class Starts:
    """Where the search began, (s,); the first start is the design as drawn.

    Attributes
    ----------
    before, after : arrays
        Largest violation of a limit (logarithm); NaN where there is no design.
    objective : array
    place : int array
        Number of the design at which each arrived, from 1: the same number for the same design; 0 where there is none.
    """

    before: Array
    after: Array
    objective: Array
    place: Any


@dataclass(frozen=True)
class Optimum:
    """A design that was made to meet goals.

    Attributes
    ----------
    numbers, quantities, limits, modes, starts
    unknown : tuple of str
        What was asked for but is not known, and what the design would have to give.
    objective : str
        What was made small.
    stationarity : float
        What multipliers leave of the objective's gradient, of all of it.
    rounds : int
        Times that the search was corrected for what a higher rung finds.
    fidelity, reason : str
        The rung of the modes.
    error : float
        Its estimated relative error.
    design : str
        TOML.
    """

    numbers: Numbers
    quantities: Quantities
    limits: Limits
    modes: Every
    starts: Starts
    unknown: tuple[str, ...]
    objective: str
    stationarity: float
    rounds: int
    fidelity: str
    reason: str
    error: float
    design: str

    @property
    def met(self) -> bool:
        """Whether all limits are, and nothing that was asked for is unknown."""
        return bool(self.limits.met.all()) and not self.unknown
