"""How much of a mode is one motion: a fraction of its kinetic energy.

A mode near 1 is purely that motion. A mode can be damped by a loop on a motion, and is excited by
one, in proportion to this fraction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear.mode_content import Motion
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import (
    NamedMode,
    ends_of,
    find_motion,
    parse_mode,
    take,
)
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float


@dataclass(frozen=True)
class EnergyFraction(Quantity):
    """Fraction of the kinetic energy of a mode in one motion of one body."""

    motion: Motion
    mode: NamedMode

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, 1.0)
    missing = "has no such mode"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        return take(self._of_all_modes(solved), self.mode.number(solved))

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest fraction of the modes that share the motion of the mode's name."""
        return ends_of(self._of_all_modes(solved), self.mode.weights(solved, smooth=smooth))

    def _of_all_modes(self, solved: Solved) -> Float[np.ndarray, "design mode"]:
        return solved.fractions[..., self.motion.place]


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``fraction of upper yaw in yaw 3``."""
    word, of, rest = text.partition(" of ")
    if not of or word != "fraction":
        return None
    label, _, mode = rest.partition(" in ")
    motion = find_motion(label, names)
    if motion is None or motion.number:
        remedy = suggest(label, names.labels)
        raise InputError.of(option, "names no motion of a stage", remedy, format_value(text))
    if not mode:
        remedy = f"write fraction of {label} in MODE, such as {names.labels[0]}"
        raise InputError.of(option, "names no mode", remedy, format_value(text))
    return EnergyFraction(text, "1", motion, parse_mode(mode, names, option))


KINDS = (
    Kind(
        "fraction of STAGE MOTION in MODE",
        "fraction of upper pitch in test pitch",
        "1",
        "fraction of the kinetic energy of a mode in one motion of one body",
        parse,
    ),
)
