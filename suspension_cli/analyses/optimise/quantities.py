"""Goals as limits on, and weights of, positive quantities of a design.

The margin of a lower limit is ln(value/limit): 0.01 means 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import msgspec

from suspension_cli.analyses.optimise import loads
from suspension_cli.analyses.optimise.loads import Part
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import mirror
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goal, Goals
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Ratio


@dataclass(frozen=True)
class OfMode:
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

    text: str
    unit: str
    fraction: bool
    family: int = -1
    rank: int = -1
    number: int = -1


@dataclass(frozen=True)
class OfResponse:
    """Magnitude of a response, or of a ratio of two, of a design with imperfections."""

    text: str
    unit: str
    ratio: Ratio
    perturbation: tuple[Perturbation, ...] = ()


@dataclass(frozen=True)
class OfPart:
    """Stress of a wire or blade over its tensile strength."""

    text: str
    unit: str
    part: Part


@dataclass(frozen=True)
class OfDepth:
    """Depth of the COM of a stage below the suspension point, m."""

    text: str
    unit: str
    stage: str


Quantity = OfMode | OfResponse | OfPart | OfDepth


def with_imperfections(design: Design, perturbation: tuple[Perturbation, ...]) -> Design:
    """Add imperfections to those of a design."""
    return msgspec.structs.replace(design, perturbation=[*design.perturbation, *perturbation])


@dataclass(frozen=True)
class Limit:
    """Limit on a quantity, or on the separation of two.

    Attributes
    ----------
    goal, quantity : int
        Their numbers, from 0.
    other : int
        Number of the lower mode of a separation; else -1.
    sense : str
        ``at_least``, ``at_most`` or ``equals``.
    value : float
        Limit in the unit of the quantity; for a separation a ratio or a difference in Hz.
    hertz : bool
        Whether a separation is a difference.
    """

    goal: int
    quantity: int
    sense: str
    value: float
    other: int = -1
    hertz: bool = False


@dataclass(frozen=True)
class ObjectiveTerm:
    """Weighted logarithm of a quantity in the objective."""

    goal: int
    quantity: int
    weight: float


@dataclass(frozen=True)
class Requirements:
    """Limits and objective of a design, from a file of goals.

    Attributes
    ----------
    separations : tuple of (goal, modes, value, hertz)
        Sets of modes to be kept apart; neighbours depend on the design.
    unknown : tuple of (str, str)
        Requested stresses that are unknown, and the keys that the design lacks.
    """

    quantities: tuple[Quantity, ...]
    limits: tuple[Limit, ...]
    separations: tuple[tuple[int, tuple[int, ...], float, bool], ...]
    terms: tuple[ObjectiveTerm, ...]
    unknown: tuple[tuple[str, str], ...]


def interpret(
    goals: Goals,
    design: Design,
    found: Modes,
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
    found : Modes
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
    terms: list[ObjectiveTerm] = []
    unknown: dict[tuple[str, str], None] = {}
    faults: list[Fault] = []
    for n, goal in enumerate(goals.goal):
        try:
            some, missing = _of_goal(goal, f"goal.{n + 1}", design, found, families, known, level)
        except InputError as error:
            faults += error.faults
            continue
        places = tuple(quantities.setdefault(item, len(quantities)) for item in some)
        unknown |= dict.fromkeys(missing)
        if goal.kind == "separation":
            separations.append((n, places, goal.at_least or 0.0, goal.apart == "hertz"))
            continue
        given = [
            (sense, value)
            for sense in ("at_least", "at_most", "equals")
            if (value := getattr(goal, sense)) is not None
        ]
        limits += [Limit(n, place, sense, value) for place in places for sense, value in given]
        if goal.minimise or goal.maximise:
            terms += [
                ObjectiveTerm(n, place, (goal.weight or 1.0) * (1 if goal.minimise else -1))
                for place in places
            ]
    if not faults and not quantities:
        faults.append(
            Fault(
                "goal",
                "no goal names a quantity that is known for this design",
                f"give {next(iter(unknown))[1]}",
            )
        )
    if faults:
        raise InputError(faults)
    return Requirements(
        tuple(quantities), tuple(limits), tuple(separations), tuple(terms), tuple(unknown)
    )


def _of_goal(
    goal: Goal,
    key: str,
    design: Design,
    found: Modes,
    families: Families,
    known: tuple[str, ...],
    level: str,
) -> tuple[list[Quantity], list[tuple[str, str]]]:
    """Quantities of one goal, and those whose value is unknown."""
    if goal.kind in ("band", "separation", "coupling"):
        chosen = _of_modes(goal, key, found, families, level)
        if goal.kind == "separation" and len(chosen) < 2:
            raise InputError([Fault(key, "there are no two modes to separate", "name more modes")])
        return list(chosen), []
    if goal.kind in ("isolation", "cross-coupling"):
        (ratio,) = named_results.parse([goal.response or ""], found, known, f"{key}.response")
        assert isinstance(ratio, Ratio)
        text = f"|{ratio.text.partition(':')[0]}| at {ratio.frequency:g} Hz" + (
            ", imperfect" if goal.perturbation else ""
        )
        return [OfResponse(text, ratio.unit, ratio, tuple(goal.perturbation or ()))], []
    if goal.kind == "stress":
        return _of_parts(goal, key, design)
    stages = [stage.name for stage in design.stage]
    if goal.stage is not None and goal.stage not in stages:
        raise InputError(
            [
                Fault(
                    f"{key}.stage",
                    "names no stage",
                    suggest(goal.stage, stages),
                    format_value(goal.stage),
                )
            ]
        )
    stage = goal.stage or mirror(design)
    return [OfDepth(f"height down to {stage}", "m", stage)], []


def _of_modes(goal: Goal, key: str, found: Modes, families: Families, level: str) -> list[OfMode]:
    fraction, unit = goal.kind == "coupling", "1" if goal.kind == "coupling" else "Hz"
    if goal.modes is not None:
        named = [
            item
            for item in named_results.parse(goal.modes, found, (), f"{key}.modes")
            if isinstance(item, named_results.Mode)
        ]
        if not named:
            raise InputError(
                [
                    Fault(
                        f"{key}.modes",
                        "names no mode",
                        f"list labels with pendsus modes --fidelity {level}",
                        format_value(goal.modes),
                    )
                ]
            )
        return [OfMode(item.text, unit, fraction, number=item.number) for item in named]
    chosen = []
    for family in dict.fromkeys(int(families.member[DOFS.index(dof)]) for dof in goal.dof or ()):
        count = int(families.size[family])
        if goal.lowest is not None and goal.lowest > count:
            problem = f"the design has {count} modes of family {families.name(family)}"
            raise InputError(
                [
                    Fault(
                        f"{key}.lowest", problem, f"give at most {count}", format_value(goal.lowest)
                    )
                ]
            )
        chosen += [
            OfMode(f"{families.name(family)} {rank + 1}", unit, fraction, family, rank)
            for rank in range(goal.lowest or count)
        ]
    return chosen


def _of_parts(goal: Goal, key: str, design: Design) -> tuple[list[Quantity], list[tuple[str, str]]]:
    """Known stresses of the named wires and blades, or of all; and the unknown ones."""
    every = loads.parts(design)
    chosen, faults = [], []
    for blade, names in enumerate((goal.wires, goal.blades)):
        mine = [part for part in every if part.blade == bool(blade)]
        word = "blades" if blade else "wires"
        for name in names or ():
            some = [part for part in mine if part.stage == name]
            if not some:
                faults.append(
                    Fault(
                        f"{key}.{word}",
                        f"names no stage with {word}",
                        suggest(name, list(dict.fromkeys(p.stage for p in mine))),
                        format_value(name),
                    )
                )
            faults += [
                Fault(
                    f"{key}.{word}",
                    f"the stress of {part.label} is unknown",
                    f"give {part.missing} in the design",
                    format_value(name),
                )
                for part in some
                if part.missing
            ]
            chosen += some
    if faults:
        raise InputError(faults)
    if goal.wires is None and goal.blades is None:
        chosen = every
    stressed: list[Quantity] = [
        OfPart(f"stress of {part.label}", "of breaking", part)
        for part in chosen
        if not part.missing
    ]
    return stressed, [(f"stress of {part.label}", part.missing) for part in chosen if part.missing]
