"""Frequencies of undamped modes: by what moves in them, by number, or all.

``test pitch`` is, in each design, the mode with the largest fraction of kinetic energy in the pitch
of ``test``; where two modes share that motion it changes from one to the other. ``test pitch#2`` is
the second of the modes in which this motion has most of the energy, as `pendsus modes` numbers
them. ``lowest pitch`` is the lowest of the modes with most energy in the pitch of all bodies.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import DOF_NAMES, DOFS
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import eigenmodes, mode_content
from suspension_cli.linear.mode_content import Motion
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Float, Int

ALL = "modes"
"""Name that stands for every mode."""
DEGREES = {name: dof for dof, name in DOF_NAMES.items()} | {dof: dof for dof in DOFS}
"""Degree of freedom by its name in tables (longitudinal), or its own (x)."""


class FrequencyOfMode(Quantity):
    """Frequency of one mode of each design, Hz, undamped; NaN where it grows."""

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    missing = "has no such mode, or it is unstable"

    @abstractmethod
    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode in each design, from 0 in ascending order; -1 if it has none."""

    def read(self, solved: Solved) -> Float[np.ndarray, " design"]:
        """Read it of each design."""
        return take(solved.frequency, self.number(solved))

    def change(self, old: Solved, new: Solved) -> Float[np.ndarray, " design"]:
        """Relative change from one model to a more complete one.

        Where frequencies meet, shapes mix differently in both models. So the mode's partner is the
        one of most similar shape or, if that changes it less, the one that the name means in both.
        Wires with mass change a mode by Rayleigh's quotient (`models.choice.shifts`).
        """
        here = self.number(new)
        before = self.values(old)
        after = self.values(new)
        result = np.full(new.count, np.nan)
        for n in np.flatnonzero(old.hangs & new.hangs).tolist():
            if here[n] < 0:
                continue
            by_shape = float(new.shifts_from(old, n)[here[n]])
            if new.has_wire_mass or not (before[n] > 0 and after[n] > 0):
                result[n] = by_shape
            else:
                result[n] = min(by_shape, abs(before[n] / after[n] - 1))
        return np.where(old.hangs != new.hangs, np.inf, result)


@dataclass(frozen=True)
class Frequency(FrequencyOfMode):
    """Frequency of the mode that a name means, Hz."""

    motion: Motion

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode with most of the motion."""
        return mode_content.find(solved.fractions, self.motion).mode


@dataclass(frozen=True)
class FrequencyByNumber(FrequencyOfMode):
    """Frequency of mode number `place`, from 0, in ascending order, Hz."""

    place: int

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """The same number in each design that has so many modes."""
        count = solved.frequency.shape[1]
        return np.full(solved.count, self.place if self.place < count else -1)


@dataclass(frozen=True)
class LowestFrequency(FrequencyOfMode):
    """Lowest frequency of the modes with most energy in one degree of freedom of all bodies, Hz."""

    dof: int

    missing = "has no such mode, or the lowest one is unstable"

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the lowest of these modes."""
        bodies = 6 * len(solved.found.model.body)
        fraction = solved.fractions[..., :bodies]
        by_dof = fraction.reshape(*fraction.shape[:-1], -1, 6).sum(-2)
        own = by_dof.argmax(-1) == self.dof
        return np.where(own.any(-1), own.argmax(-1), -1)


def take(
    values: Float[np.ndarray, "design mode"], number: Int[np.ndarray, " design"]
) -> Float[np.ndarray, " design"]:
    """Take the value of one mode of each design; NaN where its number is -1."""
    chosen = np.take_along_axis(values, np.maximum(number, 0)[:, None], 1)[:, 0]
    return np.where(number >= 0, chosen, np.nan)


def find_motion(text: str, names: Names) -> Motion | None:
    """Find the motion of a label, ``test pitch`` or ``test pitch#2``; None if it is no label."""
    label, _, rank = text.partition("#")
    places = {eigenmodes.describe(one): n for n, one in enumerate(names.system.coordinate[6:])}
    if label not in places or not ((rank.isascii() and rank.isdigit()) or "#" not in text):
        return None
    return Motion(places[label], int(rank or 0))


def parse_label(text: str, names: Names, option: str) -> Sequence[Quantity]:
    """Parse the label of a mode; raises `InputError` if it has a number that is too large."""
    found = find_motion(text, names)
    if found is None:
        return ()
    count = names.modes.label.count(text.partition("#")[0])
    if found.number > count:
        problem = f"is more than the {count} modes of this label"
        remedy = "leave the number out, or list the modes with pendsus modes"
        raise InputError.of(option, problem, remedy, format_value(text))
    return [Frequency(text, "Hz", found)]


def parse_number(text: str, names: Names, option: str) -> Sequence[Quantity]:
    """Parse the number of a mode in the table of `pendsus modes`."""
    if not (text.isascii() and text.isdigit()):
        return ()
    count = len(names.modes.label)
    if not 1 <= int(text) <= count:
        problem = "is no number of a mode"
        raise InputError.of(option, problem, f"give 1 to {count}", format_value(text))
    return [FrequencyByNumber(text, "Hz", int(text) - 1)]


def parse_lowest(text: str, names: Names, option: str) -> Sequence[Quantity]:
    """Parse ``lowest pitch``."""
    del names
    word, _, dof = text.partition(" ")
    if word != "lowest" or dof == "violin":
        return ()
    if dof not in DEGREES:
        remedy = suggest(dof, list(DEGREES))
        raise InputError.of(option, "is no degree of freedom", remedy, format_value(text))
    return [LowestFrequency(text, "Hz", DOFS.index(DEGREES[dof]))]


KINDS = (
    Kind(
        "STAGE MOTION, STAGE MOTION#N",
        "test pitch",
        "Hz",
        "frequency of the mode that is mostly that motion (its label in `pendsus modes`)",
        parse_label,
    ),
    Kind("N", "5", "Hz", "frequency of mode number N", parse_number),
    Kind(
        "lowest MOTION",
        "lowest pitch",
        "Hz",
        "frequency of the lowest mode that is mostly that motion, of any body",
        parse_lowest,
    ),
)
