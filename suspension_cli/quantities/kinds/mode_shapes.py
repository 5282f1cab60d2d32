"""What the damping criterion of the paper uses: energy in the top mass; and distances of modes.

Modes have any of the names of `kinds.modes`: ``test pitch``, ``lowest yaw``, ``yaw 3``, ``5``.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import NamedMode, ends_of, parse_mode, take
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class TopFraction(Quantity):
    """Fraction of the kinetic energy of a mode in the top mass of its chain.

    A mode can be damped from there if it couples (Husman et al. 2000, section 5a).
    """

    mode: NamedMode

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, 1.0)
    missing = "has no such mode"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        return take(solved.top_fraction, self.mode.number(solved))

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest fraction of the modes that share its motion."""
        return ends_of(solved.top_fraction, self.mode.weights(solved, smooth=smooth))


@dataclass(frozen=True)
class _BetweenModes(Quantity):
    """A distance of the frequencies of two modes."""

    first: NamedMode
    second: NamedMode

    steady: ClassVar[bool] = False
    vanishes: ClassVar[bool] = True
    undamped: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "has no such modes, or one is unstable"

    @abstractmethod
    def apart(
        self, one: Float[np.ndarray, "design *"], other: Float[np.ndarray, "design *"]
    ) -> Float[np.ndarray, "design *"]:
        """Distance of frequencies, Hz."""

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        one = take(solved.frequency, self.first.number(solved))
        other = take(solved.frequency, self.second.number(solved))
        with np.errstate(invalid="ignore", divide="ignore"):
            return self.apart(one, other)

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest distance of the modes that share the motions of both."""
        first = self.first.weights(solved, smooth=smooth)
        second = self.second.weights(solved, smooth=smooth)
        size = np.abs(solved.frequency_or_growth)
        # a mode has no distance from itself
        one, other = np.nonzero(~np.eye(size.shape[1], dtype=bool))
        weight = np.minimum(first[:, one], second[:, other])
        most = weight.max(1, initial=0.0, keepdims=True)
        with np.errstate(invalid="ignore", divide="ignore"):
            apart = self.apart(size[:, one], size[:, other])
        return ends_of(apart, weight / np.where(most > 0, most, 1.0))


class Distance(_BetweenModes):
    """Relative distance of the frequencies of two modes, higher over lower less 1."""

    def apart(
        self, one: Float[np.ndarray, "design *"], other: Float[np.ndarray, "design *"]
    ) -> Float[np.ndarray, "design *"]:
        """Ratio of the higher to the lower, less 1."""
        return np.maximum(one, other) / np.minimum(one, other) - 1


class Difference(_BetweenModes):
    """Difference of the frequencies of two modes, Hz."""

    def apart(
        self, one: Float[np.ndarray, "design *"], other: Float[np.ndarray, "design *"]
    ) -> Float[np.ndarray, "design *"]:
        """The higher less the lower."""
        return np.abs(one - other)


def parse_top(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``top fraction of test pitch``."""
    word, of, label = text.partition(" of ")
    if not of or word != "top fraction":
        return None
    return TopFraction(text, "1", parse_mode(label, names, option))


def parse_between(
    word: Literal["distance", "difference"], text: str, names: Names, option: str
) -> Quantity | None:
    """Parse ``distance test pitch, test longitudinal``, and ``difference`` likewise."""
    own, _, rest = text.partition(" ")
    if own != word:
        return None
    labels = [label.strip() for label in rest.split(",")]
    if len(labels) != 2:
        remedy = f"write {word} MODE, MODE: {word} test pitch, test longitudinal"
        raise InputError.of(option, "does not name two modes", remedy, format_value(text))
    first = parse_mode(labels[0], names, option)
    second = parse_mode(labels[1], names, option)
    if first == second:
        remedy = "name two modes"
        raise InputError.of(option, "names one mode twice", remedy, format_value(text))
    if word == "distance":
        return Distance(text, "1", first, second)
    return Difference(text, "Hz", first, second)


KINDS = (
    Kind(
        "top fraction of MODE",
        "top fraction of test pitch",
        "1",
        "fraction of the kinetic energy of a mode in the top mass, from which it is damped",
        parse_top,
    ),
    Kind(
        "distance MODE, MODE",
        "distance test pitch, test longitudinal",
        "1",
        "relative distance of two frequencies: higher over lower less 1",
        partial(parse_between, "distance"),
    ),
    Kind(
        "difference MODE, MODE",
        "difference test pitch, test longitudinal",
        "Hz",
        "difference of two frequencies, higher less lower",
        partial(parse_between, "difference"),
    ),
)
