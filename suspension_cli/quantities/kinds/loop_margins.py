"""Stability margins of the loops of local control, each broken with the others closed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.physics.closed_loop_margins import MARGINS
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Margin(Quantity):
    """A margin of one loop (`physics.margins.Margins`); of the gain the smaller one, up or down.

    Without a loop it is the smallest of all.
    """

    loop: int | None
    which: str

    largest: ClassVar[float] = 1e3
    slow: ClassVar[bool] = True
    of_loops: ClassVar[bool] = True
    missing = "has no margin: the closed loop is unstable"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Compute the margins of each design; infinite where nothing limits."""
        found = solved.margins[:, :, list(MARGINS).index(self.which)]
        return found.min(1) if self.loop is None else found[:, self.loop]


@dataclass(frozen=True)
class Stable(Quantity):
    """Whether no pole grows with all loops closed: 1 or 0, so that its mean is a yield."""

    slow: ClassVar[bool] = True
    jumps: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, 1.0)
    missing = "has poles that were not found"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Find the poles of each design."""
        return solved.is_stable_closed


STABLE = "stable"
"""Name of this quantity."""
ALL = "loops"
"""Stands for the loop with the smallest margin."""


def parse_stable(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``stable``."""
    if text != STABLE:
        return None
    if names.design.control is None or not names.design.control.loop:
        problem = "needs loops"
        remedy = "give [[control.loop]] tables; pendsus modes tells whether a design hangs stably"
        raise InputError.of(option, problem, remedy, format_value(text))
    return Stable(text, "1")


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``margin pitch.gain``, ``.phase``, ``.delay``, ``.distance``; ``margin loops.gain``."""
    if not text.startswith("margin "):
        return None
    loop, _, which = text.removeprefix("margin ").rpartition(".")
    loops = [] if names.design.control is None else names.design.control.loop
    known = [one.name for one in loops]
    if which not in MARGINS or not loop:
        remedy = f"write margin LOOP.{'|'.join(MARGINS)}"
        raise InputError.of(option, "is no margin", remedy, format_value(text))
    if known and loop == ALL and loop not in known:
        return Margin(text, MARGINS[which], None, which)
    if loop not in known:
        remedy = suggest(loop, known) if known else "give [[control.loop]] tables"
        raise InputError.of(option, "names no loop", remedy, format_value(text))
    return Margin(text, MARGINS[which], known.index(loop), which)


KINDS = (
    Kind(
        "margin LOOP.gain|phase|delay|distance",
        "margin pitch.gain",
        "dB, deg, s, 1",
        "stability margin of a loop, the others closed; the smallest of all: margin loops.gain",
        parse,
    ),
    Kind(
        STABLE,
        STABLE,
        "1",
        "1 if no pole grows with all loops closed, else 0",
        parse_stable,
    ),
)
