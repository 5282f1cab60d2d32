"""Stability margins of the loops of local control, each broken with the others closed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.physics.closed_loop import MARGINS
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Margin(Quantity):
    """A margin of one loop (`physics.margins.Margins`); of the gain the smaller one, up or down."""

    loop: int
    which: str

    largest: ClassVar[float] = 1e3
    slow: ClassVar[bool] = True
    of_loops: ClassVar[bool] = True
    missing = "has no margin: the closed loop is unstable"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Compute the margins of each design; infinite where nothing limits."""
        return solved.margins[:, self.loop, list(MARGINS).index(self.which)]


def parse(text: str, names: Names, option: str) -> Quantity | None:
    """Parse ``margin pitch.gain``, ``.phase``, ``.delay`` and ``.distance``."""
    if not text.startswith("margin "):
        return None
    loop, _, which = text.removeprefix("margin ").rpartition(".")
    loops = [] if names.design.control is None else names.design.control.loop
    known = [one.name for one in loops]
    if which not in MARGINS or not loop:
        remedy = f"write margin LOOP.{'|'.join(MARGINS)}"
        raise InputError.of(option, "is no margin", remedy, format_value(text))
    if loop not in known:
        remedy = suggest(loop, known) if known else "give [[control.loop]] tables"
        raise InputError.of(option, "names no loop", remedy, format_value(text))
    return Margin(text, MARGINS[which], known.index(loop), which)


KINDS = (
    Kind(
        "margin LOOP.gain|phase|delay|distance",
        "margin pitch.gain",
        "dB, deg, s, 1",
        "stability margin of a loop of local control, the others closed",
        parse,
    ),
)
