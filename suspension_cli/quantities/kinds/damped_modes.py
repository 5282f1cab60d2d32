"""Decay of modes with all losses, dampers and loops: Q, decay rate, settling time, dilution.

A mode has any of its names (`kinds.modes`), by which it is found among the modes with damping;
``modes`` means the one that rings longest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.linear.energy_of_modes import EnergyOfModes
from suspension_cli.models import registry
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.kinds.modes import ALL, FrequencyByNumber, NamedMode, parse_mode
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float

    from suspension_cli.physics.modes_with_loops import DampedModes

What = Literal["Q", "decay", "settling", "dilution"]
UNITS: dict[What, str] = {"Q": "1", "decay": "1/s", "settling": "s", "dilution": "1"}


@dataclass(frozen=True)
class Decay(Quantity):
    """How one mode decays; without a name that of the longest ring-down."""

    what: What
    mode: NamedMode | None

    bends: ClassVar[bool] = True
    largest: ClassVar[float] = 1e15
    slow: ClassVar[bool] = True
    of_loops: ClassVar[bool] = True
    missing = "has no such mode that oscillates and decays"

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Compute it of each design; a mode that grows has no Q."""
        return self._compute(solved, q_of_growing=np.nan)

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest value; a mode that grows counts as one without decay."""
        del smooth
        found = self._compute(solved, q_of_growing=np.inf)
        value = np.where(solved.hangs, np.minimum(found, self.largest), np.nan)
        return value, value

    def _compute(self, solved: Solved, q_of_growing: float) -> Float[np.ndarray, " design"]:
        def read(solved: Solved) -> Float[np.ndarray, " design"]:
            result = np.full(solved.count, np.nan)
            for n, modes in enumerate(solved.damped_modes):
                if modes is not None and len(modes.decay_rate):
                    result[n] = self._of_design(modes, solved, q_of_growing)
            return result

        if registry.BEAM.unsuitable(solved.designs[0]):
            return read(solved)
        return solved.with_bending(read)

    def _of_design(self, modes: DampedModes, solved: Solved, q_of_growing: float) -> float:
        """Take the value of the mode of one design of a batch."""
        number = self._find(modes, solved)
        if number < 0:
            return np.nan
        rate = float(modes.decay_rate[number])
        q = float(modes.q[number])
        if q < -self.largest:  # grows by a rounding error
            q = np.inf
        values: dict[What, float] = {
            "Q": q if q >= 0 else q_of_growing,
            "decay": rate,
            "settling": 1 / rate if rate > 0 else np.inf,
            "dilution": float(modes.dilution[number]),
        }
        return values[self.what]

    def _find(self, modes: DampedModes, solved: Solved) -> int:
        """Find the mode, by number, among those of one design of a batch; -1 if it has none.

        A number such as 5 counts modes, so it means none where there are more than without damping:
        one that does not oscillate has two decay rates, and light has modes of its own.
        """
        if self.mode is None:
            return int(modes.decay_rate.argmin())
        undamped = solved.omega_squared.shape[1]
        if isinstance(self.mode, FrequencyByNumber) and len(modes.q) != undamped:
            return -1
        energy = EnergyOfModes(modes.fraction[None], len(solved.found.model.body))
        return int(self.mode.among(energy)[0])


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
    return Decay(text, UNITS[what], what, parse_mode(label, names, option))


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
