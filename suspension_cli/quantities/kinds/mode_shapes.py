"""What the damping criterion of the paper uses: energy in the top mass; and distances of modes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import mode_content
from suspension_cli.linear.eigenmodes import find_top_masses
from suspension_cli.linear.mode_content import Motion
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import find_motion, take
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

    motion: Motion

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    missing = "has no such mode"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        model = solved.found.model
        bodies = len(model.body)
        energy = solved.fractions[..., : 6 * bodies].reshape(solved.count, -1, bodies, 6)
        flat = energy.reshape(-1, bodies, 6)
        top = find_top_masses(np.nan_to_num(flat), model.top)
        fraction = flat[np.arange(len(flat)), top].sum(-1).reshape(energy.shape[:2])
        return take(fraction, mode_content.find(solved.fractions, self.motion).mode)


@dataclass(frozen=True)
class Distance(Quantity):
    """Relative distance of the frequencies of two modes, higher over lower less 1."""

    first: Motion
    second: Motion

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    missing = "has no such modes, or one is unstable"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        one = take(solved.frequency, mode_content.find(solved.fractions, self.first).mode)
        other = take(solved.frequency, mode_content.find(solved.fractions, self.second).mode)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.maximum(one, other) / np.minimum(one, other) - 1


def _demand(label: str, names: Names, option: str) -> Motion:
    found = find_motion(label, names)
    if found is None:
        remedy = suggest(label, names.labels)
        raise InputError.of(option, "is the label of no mode", remedy, format_value(label))
    return found


def parse_top(text: str, names: Names, option: str) -> Sequence[Quantity]:
    """Parse ``top fraction of test pitch``."""
    word, of, label = text.partition(" of ")
    if not of or word != "top fraction":
        return ()
    return [TopFraction(text, "1", _demand(label, names, option))]


def parse_distance(text: str, names: Names, option: str) -> Sequence[Quantity]:
    """Parse ``distance test pitch, test longitudinal``."""
    if not text.startswith("distance "):
        return ()
    labels = [label.strip() for label in text.removeprefix("distance ").split(",")]
    if len(labels) != 2:
        remedy = "write distance MODE, MODE: distance test pitch, test longitudinal"
        raise InputError.of(option, "does not name two modes", remedy, format_value(text))
    first, second = (_demand(label, names, option) for label in labels)
    return [Distance(text, "1", first, second)]


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
        parse_distance,
    ),
)
