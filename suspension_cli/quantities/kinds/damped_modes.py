"""Decay of modes with all losses, dampers and loops: Q, decay rate, settling time, dilution.

A mode is meant by its label, as for frequencies, or ``modes`` means the one that rings longest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import mode_content
from suspension_cli.linear.mode_content import Motion
from suspension_cli.models import registry
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import ALL, find_motion
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.physics.closed_loop import DampedModes

What = Literal["Q", "decay", "settling", "dilution"]
UNITS: dict[What, str] = {"Q": "1", "decay": "1/s", "settling": "s", "dilution": "1"}


@dataclass(frozen=True)
class Decay(Quantity):
    """How one mode decays; without a name that of the longest ring-down."""

    what: What
    motion: Motion | None

    bends: ClassVar[bool] = True
    largest: ClassVar[float] = 1e15
    slow: ClassVar[bool] = True
    missing = "has no such mode that oscillates and decays"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Compute it of each design."""
        if registry.BEAM.unsuitable(solved.designs[0]):
            return self._read(solved)
        return solved.with_bending(self._read)

    def _read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        return np.array([np.nan if one is None else self.of(one) for one in solved.damped_modes])

    def of(self, modes: DampedModes) -> float:
        """Take the value of the mode of one design."""
        if not len(modes.decay_rate):
            return np.nan
        if self.motion is None:
            number = int(modes.decay_rate.argmin())
        else:
            number = int(mode_content.find(modes.fraction, self.motion).mode)
        if number < 0:
            return np.nan
        rate = float(modes.decay_rate[number])
        values: dict[What, float] = {
            "Q": float(modes.q[number]),
            "decay": rate,
            "settling": 1 / rate if rate > 0 else np.inf,
            "dilution": float(modes.dilution[number]),
        }
        return values[self.what]


def parse(what: What, text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``Q of test pitch`` and ``settling of modes``."""
    word, of, label = text.partition(" of ")
    if not of or word != what:
        return None
    if what == "dilution" and names.design.control is not None and names.design.control.loop:
        problem = "is not known: loops store and take energy"
        remedy = f"take Q of {label}, or leave out [[control.loop]]"
        raise InputError.of(option, problem, remedy, format_value(text))
    if label == ALL:
        return Decay(text, UNITS[what], what, None)
    motion = find_motion(label, names)
    if motion is None:
        remedy = suggest(label, [*names.labels, ALL])
        raise InputError.of(option, "is the label of no mode", remedy, format_value(text))
    return Decay(text, UNITS[what], what, motion)


SUMMARIES: dict[What, str] = {
    "Q": "quality factor of a mode with all losses, dampers and loops",
    "decay": "decay rate of its amplitude",
    "settling": "time in which its amplitude falls to 1/e",
    "dilution": "its energy over that in lossy elements; of a design without loops",
}
KINDS = tuple(
    Kind(f"{what} of MODE", f"{what} of test pitch", UNITS[what], about, partial(parse, what))
    for what, about in SUMMARIES.items()
)
