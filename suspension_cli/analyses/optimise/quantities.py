"""Goals as limits on, and weights of, positive quantities of a design.

The residual of a lower limit is ln(value/limit): 0.01 means 1 %.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.check.statics import Statics
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import com_positions, mirror
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goal, Goals
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Ratio

if TYPE_CHECKING:
    from jaxtyping import Float


@dataclass(frozen=True)
class Quantity:
    """A quantity of a design.

    Attributes
    ----------
    text : str
        Its name.
    """

    text: str
    unit: str


@dataclass(frozen=True)
class OfMode(Quantity):
    """Frequency of a mode (Hz), or the fraction of its kinetic energy in the top mass.

    Attributes
    ----------
    fraction : bool
        Whether it is the energy fraction.
    family, rank : int
        Family of the mode and rank there, from 0; -1 if it is followed by shape.
    number : int
        Number in the starting design, from 0; -1 if family and rank identify the mode.
    """

    fraction: bool
    family: int = -1
    rank: int = -1
    number: int = -1


@dataclass(frozen=True)
class OfResponse(Quantity):
    """Magnitude of a response, or of a ratio of two, of a design with imperfections."""

    ratio: Ratio
    perturbation: tuple[Perturbation, ...] = ()


@dataclass(frozen=True)
class OfStatics(Quantity):
    """Stress over tensile strength, or depth of a COM below the suspension point (m).

    Attributes
    ----------
    part : str
        ``wires`` or ``blades``, or the stage whose depth is meant.
    place : int
        Number of the wire or blade among those of the design, from 0; -1 for a depth.
    """

    part: str
    place: int = -1

    def value(self, design: Design, found: Statics) -> float:
        """Value in the statics of a design; NaN if unknown."""
        if self.place >= 0:
            return float(getattr(found, self.part)[self.place].fraction or np.nan)
        (shift,) = (body.shift for body in found.bodies if body.name == self.part)
        return -(com_positions(design)[self.part][2] + shift[2])


@dataclass(frozen=True)
class Limit:
    """Limit on a quantity, or on the separation of two.

    Attributes
    ----------
    goal, quantity : int
        Their numbers, from 0.
    sense : str
        ``at_least``, ``at_most`` or ``equals``.
    value : float
        Limit in the unit of the quantity; for a separation a ratio or a difference in Hz.
    other : int
        Number of the lower mode of a separation; else -1.
    hertz : bool
        Whether a separation is a difference.
    """

    goal: int
    quantity: int
    sense: str
    value: float
    other: int = -1
    hertz: bool = False

    def margin(self, log: Float[np.ndarray, " quantity"]) -> tuple[float, dict[int, float]]:
        """Compute the margin (of an equality: ln of value over limit), and its derivatives.

        `log` are logarithms of the quantities; derivatives are by these.
        """
        here = float(log[self.quantity])
        if self.other < 0:
            sign = -1.0 if self.sense == "at_most" else 1.0
            return sign * (here - np.log(self.value)), {self.quantity: sign}
        there = float(log[self.other])
        if self.hertz:
            high, low = np.exp(here) / self.value, np.exp(there) / self.value
            return high - low - 1, {self.quantity: high, self.other: -low}
        return here - there - np.log(self.value), {self.quantity: 1.0, self.other: -1.0}

    def of(self, value: Float[np.ndarray, " quantity"]) -> float:
        """Quantity, ratio or difference that is limited."""
        if self.other < 0:
            return float(value[self.quantity])
        high, low = value[self.quantity], value[self.other]
        return float(high - low if self.hertz else high / low)

    def name(self, quantities: tuple[Quantity, ...]) -> str:
        """Name the limit: ``yaw 3 <= 5 Hz``."""
        item, sign = quantities[self.quantity], SIGNS[self.sense]
        unit = (
            " Hz" if self.hertz else "" if item.unit == "1" or self.other >= 0 else f" {item.unit}"
        )
        between = " - " if self.hertz else " / "
        other = "" if self.other < 0 else between + quantities[self.other].text
        return f"{item.text}{other} {sign} {self.value:g}{unit}"


SIGNS = {"at_least": ">=", "at_most": "<=", "equals": "="}


@dataclass(frozen=True)
class Requirements:
    """Limits and objective of a design, from a file of goals.

    Attributes
    ----------
    separations : tuple of (goal, places, value, hertz)
        Sets of modes to be kept apart, by their numbers among the quantities.
    terms : tuple of (place, weight)
        Weights of logarithms of quantities in the objective to be minimised.
    unknown : tuple of str
        Requested stresses that are unknown, and the keys that the design lacks.
    """

    quantities: tuple[Quantity, ...]
    limits: tuple[Limit, ...]
    separations: tuple[tuple[int, tuple[int, ...], float, bool], ...]
    terms: tuple[tuple[int, float], ...]
    unknown: tuple[str, ...]

    def neighbours(self, log: Float[np.ndarray, " quantity"]) -> Iterator[Limit]:
        """Separations of the modes that are neighbours at the logarithms of the quantities."""
        for goal, places, value, hertz in self.separations:
            for low, high in pairwise(sorted(places, key=lambda n: log[n])):
                yield Limit(goal, high, "at_least", value, low, hertz)


def interpret(
    goals: Goals,
    design: Design,
    modes: Modes,
    families: Families,
    known: tuple[str, ...],
    level: str,
) -> Requirements:
    """Interpret goals as requirements on a design.

    Parameters
    ----------
    goals : Goals
    design : Design
        The starting design.
    modes : Modes
        Its modes, to whose labels goals refer.
    families : Families
    known : tuple of str
        Names of the bodies, see `signals.bodies_with_signals`.
    level : str
        Name of the model of the modes.

    Raises
    ------
    InputError
        If the design lacks something that a goal refers to.
    """
    quantities: dict[Quantity, int] = {}
    limits: list[Limit] = []
    separations: list[tuple[int, tuple[int, ...], float, bool]] = []
    terms: list[tuple[int, float]] = []
    unknown: dict[str, str] = {}
    faults: list[Fault] = []
    for n, goal in enumerate(goals.goal):
        key, some = f"goal.{n + 1}", list[Quantity]()
        try:
            if goal.kind in ("band", "separation", "coupling"):
                some += _modes(goal, key, modes, families, level)
            elif goal.kind in ("isolation", "cross-coupling"):
                some.append(_response(goal, key, modes, known))
            elif goal.kind == "height":
                some.append(_depth(goal, key, design))
            else:
                stresses, missing = _stresses(goal, key, design)
                some, unknown = [*stresses], unknown | missing
        except InputError as error:
            faults += error.faults
            continue
        places = tuple(quantities.setdefault(item, len(quantities)) for item in some)
        if goal.kind == "separation":
            separations.append((n, places, goal.at_least or 0.0, goal.apart == "hertz"))
            continue
        given = [
            (sense, getattr(goal, sense)) for sense in SIGNS if getattr(goal, sense) is not None
        ]
        limits += [Limit(n, place, sense, value) for place in places for sense, value in given]
        if goal.minimise or goal.maximise:
            weight = (goal.weight or 1.0) * (1 if goal.minimise else -1)
            terms += [(place, weight) for place in places]
    if not faults and not quantities:
        problem = "no goal names a quantity that is known for this design"
        faults.append(Fault("goal", problem, f"give {next(iter(unknown.values()))}"))
    if faults:
        raise InputError(faults)
    lacking = tuple(f"{what}: {missing} is not given" for what, missing in unknown.items())
    return Requirements(tuple(quantities), tuple(limits), tuple(separations), tuple(terms), lacking)


def _modes(goal: Goal, key: str, modes: Modes, families: Families, level: str) -> list[OfMode]:
    """Modes of a goal by label, or by family and rank."""
    fraction, unit = goal.kind == "coupling", "1" if goal.kind == "coupling" else "Hz"
    suffix = " from the top mass" if fraction else ""
    chosen = []
    if goal.modes is not None:
        chosen = [
            OfMode(item.text + suffix, unit, fraction, number=item.number)
            for item in named_results.parse(goal.modes, modes, (), f"{key}.modes")
            if isinstance(item, named_results.Mode)
        ]
        if not chosen:
            remedy = f"list labels with pendsus modes --fidelity {level}"
            named = format_value(goal.modes)
            raise InputError.of(f"{key}.modes", "names no mode", remedy, named)
    for family in dict.fromkeys(int(families.member[DOFS.index(dof)]) for dof in goal.dof or ()):
        count, name = int(families.size[family]), families.name(family)
        if (lowest := goal.lowest or count) > count:
            problem = f"the design has {count} modes of family {name}"
            raise InputError.of(f"{key}.lowest", problem, f"give at most {count}", f"{lowest}")
        chosen += [
            OfMode(f"{name} {rank + 1}{suffix}", unit, fraction, family, rank)
            for rank in range(lowest)
        ]
    if goal.kind == "separation" and len(chosen) < 2:
        raise InputError.of(key, "there are no two modes to separate", "name more modes")
    return chosen


def _response(goal: Goal, key: str, modes: Modes, known: tuple[str, ...]) -> OfResponse:
    (ratio,) = named_results.parse([goal.response or ""], modes, known, f"{key}.response")
    assert isinstance(ratio, Ratio)
    imperfect = ", imperfect" if goal.perturbation else ""
    text = f"|{ratio.text.partition(':')[0]}| at {ratio.frequency:g} Hz{imperfect}"
    return OfResponse(text, ratio.unit, ratio, tuple(goal.perturbation or ()))


def _depth(goal: Goal, key: str, design: Design) -> OfStatics:
    stages = [stage.name for stage in design.stage]
    stage = goal.stage or mirror(design)
    if stage not in stages:
        named = format_value(stage)
        raise InputError.of(f"{key}.stage", "names no stage", suggest(stage, stages), named)
    return OfStatics(f"height down to {stage}", "m", stage)


def _stresses(goal: Goal, key: str, design: Design) -> tuple[list[OfStatics], dict[str, str]]:
    """Known stresses of the named wires and blades, or of all; and keys that others lack.

    One wire or blade stands for all of a symmetric set of a perfect design.
    """
    parts: dict[OfStatics, str] = {}
    faults, loads = [], statics.solve(design)
    for word, geometry in (("wires", "radius"), ("blades", "geometry")):
        sets = {stage.name: getattr(stage, word) for stage in design.stage}
        named, known, single = getattr(goal, word), dict[str, dict[OfStatics, str]](), word[:-1]
        for place, load in enumerate(getattr(loads, word)):
            stage, _, name = load.label.partition(".")
            alike = sets[stage] is not None and not design.perturbation
            item = OfStatics(
                f"stress of {stage} {word}" if alike else f"stress of {single} {load.label}",
                "of breaking",
                word,
                place,
            )
            table = f"stage.{stage}.{f'{single}.{name}' if sets[stage] is None else word}"
            missing = f"{table}.{geometry if load.stress is None else 'material'}"
            if load.stress is not None and load.material:
                missing = f"materials.{load.material}.tensile_strength"
            if not (alike and stage in known):
                own = known.setdefault(stage, {})
                own[item] = "" if load.fraction is not None else missing
        everything = goal.wires is None and goal.blades is None
        for name in known if everything else named or ():
            if name not in known:
                problem, remedy = f"names no stage with {word}", suggest(name, list(known))
                faults.append(Fault(f"{key}.{word}", problem, remedy, format_value(name)))
            parts |= known.get(name, {})
            for item, missing in known.get(name, {}).items():
                if missing and not everything:
                    problem, remedy = f"the {item.text} is unknown", f"give {missing} in the design"
                    faults.append(Fault(f"{key}.{word}", problem, remedy, format_value(name)))
    if faults:
        raise InputError(faults)
    unknown = {item.text: missing for item, missing in parts.items() if missing}
    return [item for item, missing in parts.items() if not missing], unknown
