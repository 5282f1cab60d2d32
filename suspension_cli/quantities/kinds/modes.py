"""Frequencies of undamped modes: by what moves in them, by number, or all.

``test pitch`` is, in each design, the mode with the largest fraction of kinetic energy in the pitch
of ``test``; where two modes share that motion it changes from one to the other. ``test pitch#2`` is
the second of the modes in which this motion has most of the energy, as `pendsus modes` numbers
them. ``lowest pitch`` is the lowest of the modes with most energy in the pitch of all bodies.
``longitudinal-pitch 2`` is the second of the modes in which motions move that couple by symmetry
(`linear.mode_families`).

Where all modes are listed, as those of random builds or of a sweep, each is followed from the
nominal design by its shape (`FollowedMode`).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from suspension_cli.conventions import DOF_BY_NAME, DOF_NAMES, DOFS
from suspension_cli.errors import InputError, format_value, suggest
from suspension_cli.linear import eigenmodes, mode_content
from suspension_cli.linear.energy_of_modes import EnergyOfModes
from suspension_cli.linear.mode_content import Motion, describe_shared
from suspension_cli.linear.mode_families import Families
from suspension_cli.quantities.kind import Kind
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity
from suspension_cli.quantities.solved import Solved

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

    from suspension_cli.linear.eigenmodes import Modes

ALL = "modes"
"""Name that stands for every mode."""


class FrequencyOfMode(Quantity):
    """Frequency of one mode of each design, Hz, undamped; NaN where it grows."""

    steady: ClassVar[bool] = False
    undamped: ClassVar[bool] = True
    within: ClassVar[tuple[float, float]] = (0.0, math.inf)
    missing = "has no such mode, or it is unstable"

    @abstractmethod
    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode in each design, from 0 in ascending order; -1 if it has none."""

    def weights(self, solved: Solved, *, smooth: bool) -> Float[np.ndarray, "design mode"]:
        """Weight from 0 to 1 with which each mode counts as the one that the name means.

        Others than the mode itself count where they share its motion; if `smooth`, they gain weight
        gradually (`mode_content.weights`).
        """
        del smooth
        modes = np.arange(solved.frequency.shape[1])
        return (modes == self.number(solved)[:, None]) * 1.0

    def content(self, solved: Solved) -> Float[np.ndarray, "design mode"] | None:
        """Fraction of the kinetic energy of each mode in the motion of the name, if it has one."""
        del solved
        return None

    def ends(
        self, solved: Solved, *, smooth: bool
    ) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
        """Smallest and largest frequency of the modes that share its motion."""
        return ends_of(solved.frequency_or_growth, self.weights(solved, smooth=smooth))

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


class NamedMode(FrequencyOfMode):
    """Frequency, Hz, of a mode that a name means in any design, and among modes with damping."""

    @abstractmethod
    def among(self, modes: EnergyOfModes) -> Int[np.ndarray, " design"]:
        """Number of the mode among those of each design, from 0; -1 if it has none."""

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode among the undamped ones."""
        return self.among(solved.energy_of_modes)


@dataclass(frozen=True)
class Frequency(NamedMode):
    """Frequency of the mode that is mostly one motion, Hz."""

    motion: Motion

    def among(self, modes: EnergyOfModes) -> Int[np.ndarray, " design"]:
        """Number of the mode with most of the motion."""
        return mode_content.find(modes.fractions, self.motion).mode

    def weights(self, solved: Solved, *, smooth: bool) -> Float[np.ndarray, "design mode"]:
        """Those of the motion."""
        return mode_content.weights(solved.fractions, self.motion, smooth=smooth)

    def content(self, solved: Solved) -> Float[np.ndarray, "design mode"]:
        """That of the motion."""
        return solved.fractions[..., self.motion.place]

    def is_shared(self, solved: Solved) -> Bool[np.ndarray, " design"]:
        """Whether another mode of each design shares the motion, so that the name may mean both."""
        return mode_content.find(solved.fractions, self.motion).shared & solved.hangs


@dataclass(frozen=True)
class FollowedMode(FrequencyOfMode):
    """Frequency, Hz, of the mode that mode number `place` of a nominal design has become.

    It has the shape that overlaps most with that of the nominal mode, one to one; over a grid,
    where all points are known, a sweep follows it from point to point (`mode_pairing.follow`).
    `place` is from 0, in the order of the nominal design's modes in the same model.
    """

    place: int
    nominal: str = field(repr=False)

    def number(self, solved: Solved) -> Int[np.ndarray, " design"]:
        """Number of the mode paired with the nominal one."""
        numbers = solved.followed(self.nominal)
        if self.place >= numbers.shape[1]:  # models may differ in their tips of blades
            return np.full(solved.count, -1)
        return numbers[:, self.place]

    def with_number(self) -> FollowedMode:
        """The mode under a name that its label alone cannot be confused with."""
        return replace(self, text=f"{self.text} (mode {self.place + 1})")


@dataclass(frozen=True)
class FrequencyByNumber(NamedMode):
    """Frequency of mode number `place`, from 0, in ascending order, Hz."""

    place: int

    def among(self, modes: EnergyOfModes) -> Int[np.ndarray, " design"]:
        """The same number in each design that has so many modes."""
        designs, count, _ = modes.fractions.shape
        return np.full(designs, self.place if self.place < count else -1)


@dataclass(frozen=True)
class LowestFrequency(NamedMode):
    """Lowest frequency of the modes with most energy in one degree of freedom of all bodies, Hz."""

    dof: int

    missing = "has no such mode, or the lowest one is unstable"

    def among(self, modes: EnergyOfModes) -> Int[np.ndarray, " design"]:
        """Number of the lowest of these modes."""
        own = modes.of_bodies.sum(-2).argmax(-1) == self.dof
        return np.where(own.any(-1), own.argmax(-1), -1)

    def weights(self, solved: Solved, *, smooth: bool) -> Float[np.ndarray, "design mode"]:
        """Weight of each mode that may be the lowest.

        That is so far as this degree of freedom may have most of its energy, and no lower mode
        certainly has most of its energy there.
        """
        energy = solved.energy.sum(-2)
        own = energy[..., self.dof]
        rest = np.delete(energy, self.dof, axis=-1).max(-1)
        with np.errstate(invalid="ignore", divide="ignore"):
            possible = mode_content.share_weight(own / rest, smooth=smooth)
            in_doubt = mode_content.share_weight(rest / own, smooth=smooth)
        none_below = np.ones_like(own)
        none_below[:, 1:] = np.minimum.accumulate(in_doubt, axis=1)[:, :-1]
        return np.minimum(possible, none_below)

    def content(self, solved: Solved) -> Float[np.ndarray, "design mode"]:
        """That of the degree of freedom of all bodies."""
        return solved.energy.sum(-2)[..., self.dof]


@dataclass(frozen=True)
class FrequencyInFamily(NamedMode):
    """Frequency of a mode by its rank, from 0, among those that couple by symmetry, Hz."""

    families: Families
    family: int
    rank: int

    def among(self, modes: EnergyOfModes) -> Int[np.ndarray, " design"]:
        """Number of the mode of this rank."""
        return modes.ranked(self.families)[self.family][:, self.rank]


def take(
    values: Float[np.ndarray, "design mode"], number: Int[np.ndarray, " design"]
) -> Float[np.ndarray, " design"]:
    """Take the value of one mode of each design; NaN where its number is -1."""
    chosen = np.take_along_axis(values, np.maximum(number, 0)[:, None], 1)[:, 0]
    return np.where(number >= 0, chosen, np.nan)


def ends_of(
    values: Float[np.ndarray, "design item"], weight: Float[np.ndarray, "design item"]
) -> tuple[Float[np.ndarray, " design"], Float[np.ndarray, " design"]]:
    """Smallest and largest of values with weights; NaN where all weights are 0."""
    low = -mode_content.largest(-values, weight)
    high = mode_content.largest(values, weight)
    known = np.asarray((weight > 0).any(-1))
    return np.where(known, low, np.nan), np.where(known, high, np.nan)


def parse_mode(text: str, names: Names, option: str) -> NamedMode:
    """Parse the name of a mode, of any kind; raises `InputError` if there is none."""
    for parse in (parse_label, parse_number, parse_lowest, parse_family):
        if found := parse(text, names, option):
            return found
    remedy = suggest(text, names.labels)
    raise InputError.of(option, "is the label of no mode", remedy, format_value(text))


def describe_shared_motions(quantities: Sequence[Quantity], modes: Modes) -> list[str]:
    """Say which modes of a design, named by their motions, share them with another mode."""
    said = []
    for one in quantities:
        if not isinstance(one, Frequency):
            continue
        text = describe_shared(one.text, one.motion, modes.fractions, modes.frequency)
        if text:
            said.append(text)
    return said


def _name_in_tables(motion: str) -> str:
    """Name of a motion as tables print it: longitudinal for x; others stay."""
    return DOF_NAMES.get(motion, motion)


def find_motion(text: str, names: Names) -> Motion | None:
    """Find the motion of a label, ``test pitch`` or ``test pitch#2``; None if it is no label."""
    label, _, rank = text.partition("#")
    body, _, motion = label.rpartition(" ")
    label = f"{body} {_name_in_tables(motion)}"
    places = {eigenmodes.describe(one): n for n, one in enumerate(names.system.coordinate[6:])}
    if label not in places or not ((rank.isascii() and rank.isdigit()) or "#" not in text):
        return None
    return Motion(places[label], int(rank or 0))


def parse_label(text: str, names: Names, option: str) -> NamedMode | None:
    """Parse the label of a mode; raises `InputError` if it has a number that is too large."""
    found = find_motion(text, names)
    if found is None:
        return None
    count = len(names.modes.label)
    if found.number > count:  # how many have this label depends on the model
        problem = f"is more than the {count} modes of the design"
        remedy = "leave the number out, or list the modes with pendsus modes"
        raise InputError.of(option, problem, remedy, format_value(text))
    return Frequency(text, "Hz", found)


def parse_number(text: str, names: Names, option: str) -> NamedMode | None:
    """Parse the number of a mode in the table of `pendsus modes`."""
    if not (text.isascii() and text.isdigit()):
        return None
    count = len(names.modes.label)
    if not 1 <= int(text) <= count:
        problem = "is no number of a mode"
        raise InputError.of(option, problem, f"give 1 to {count}", format_value(text))
    return FrequencyByNumber(text, "Hz", int(text) - 1)


def parse_lowest(text: str, names: Names, option: str) -> NamedMode | None:
    """Parse ``lowest pitch``."""
    del names
    word, _, dof = text.partition(" ")
    if word != "lowest" or dof == "violin":
        return None
    if dof not in DOF_BY_NAME:
        remedy = suggest(dof, list(DOF_BY_NAME))
        raise InputError.of(option, "is no degree of freedom", remedy, format_value(text))
    return LowestFrequency(text, "Hz", DOFS.index(DOF_BY_NAME[dof]))


def parse_family(text: str, names: Names, option: str) -> NamedMode | None:
    """Parse ``longitudinal-pitch 2``."""
    name, _, rank = text.rpartition(" ")
    if not (rank.isascii() and rank.isdigit()) or not set(name.split("-")) <= set(DOF_BY_NAME):
        return None
    families = names.families
    name = "-".join(_name_in_tables(motion) for motion in name.split("-"))
    if name not in families.names:
        problem = "names no family of modes that couple by symmetry"
        remedy = suggest(name, list(families.names))
        raise InputError.of(option, problem, remedy, format_value(text))
    family = families.names.index(name)
    count = families.size[family]
    if not 1 <= int(rank) <= count:
        problem = f"is not one of the {count} modes of this family"
        raise InputError.of(option, problem, f"give 1 to {count}", format_value(text))
    return FrequencyInFamily(text, "Hz", families, family, int(rank) - 1)


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
    Kind(
        "FAMILY N",
        "longitudinal-pitch 2",
        "Hz",
        "frequency of the N-th mode of the motions that couple: longitudinal-pitch,"
        " transverse-roll, vertical, yaw in a design with two mirror symmetries",
        parse_family,
    ),
)
