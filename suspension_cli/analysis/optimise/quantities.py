"""What goals are about: single numbers of a design, all positive, and the limits that are set to them.

A limit is judged by its margin in logarithms, ln(value/limit) for one from below: 0.01 is 1 % of room.
"""

from __future__ import annotations

from dataclasses import dataclass

from suspension_cli.analysis import scalars
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.optimise import loads
from suspension_cli.analysis.optimise.families import Families
from suspension_cli.analysis.optimise.loads import Part
from suspension_cli.analysis.scalars import Ratio
from suspension_cli.conventions import DOFS
from suspension_cli.design.faults import suggestion
from suspension_cli.design.goals import Goal, Goals
from suspension_cli.design.schema import Design, Perturbation
from suspension_cli.errors import Fault, InputError, shown


@dataclass(frozen=True)
class OfMode:
    """A mode's frequency (Hz), or the share of its kinetic energy in the top mass.

    Attributes
    ----------
    text, unit : str
    share : bool
        Which of the two.
    family, rank : int
        Its family and its place there, from 0; -1 where it is followed by its shape.
    number : int
        Its place among the modes of the starting design, from 0; -1 where its family and rank name it.
    """

    text: str
    unit: str
    share: bool
    family: int = -1
    rank: int = -1
    number: int = -1


@dataclass(frozen=True)
class OfResponse:
    """Size of a response, or of the ratio of two, of a design with some imperfections."""

    text: str
    unit: str
    ratio: Ratio
    perturbation: tuple[Perturbation, ...] = ()


@dataclass(frozen=True)
class OfPart:
    """Stress of a wire or blade, as a share of what breaks it."""

    text: str
    unit: str
    part: Part


@dataclass(frozen=True)
class OfDepth:
    """How far below the suspension point the COM of a stage hangs, m."""

    text: str
    unit: str
    stage: str


Quantity = OfMode | OfResponse | OfPart | OfDepth


@dataclass(frozen=True)
class Limit:
    """What a goal asks of one quantity, or of two.

    Attributes
    ----------
    goal : int
        From 0.
    quantity : int
    other : int
        Of a separation, the second mode; else -1.
    sense : str
        ``at_least``, ``at_most`` or ``equals``.
    value : float
        Of a separation, the least ratio, or difference in Hz.
    hertz : bool
        Which of the two.
    """

    goal: int
    quantity: int
    sense: str
    value: float
    other: int = -1
    hertz: bool = False


@dataclass(frozen=True)
class Wish:
    """A quantity to make small (weight above 0) or large (below): the logarithm times its weight counts."""

    goal: int
    quantity: int
    weight: float


@dataclass(frozen=True)
class Wanted:
    """What a file of goals asks of a design.

    Attributes
    ----------
    quantities : tuple of Quantity
    limits : tuple of Limit
    separations : tuple of (goal, modes, value, hertz)
        Sets of modes that are to lie apart: which neighbours are is up to the design.
    wishes : tuple of Wish
    unknown : tuple of (str, str)
        Wires and blades whose stress was asked for, and what would have to be given for it.
    """

    quantities: tuple[Quantity, ...]
    limits: tuple[Limit, ...]
    separations: tuple[tuple[int, tuple[int, ...], float, bool], ...]
    wishes: tuple[Wish, ...]
    unknown: tuple[tuple[str, str], ...]


def wanted(goals: Goals, design: Design, found: Modes, families: Families, known: tuple[str, ...]) -> Wanted:
    """What goals ask of a design.

    Parameters
    ----------
    goals : Goals
    design : Design
        The starting design.
    found : Modes
        Its modes, whose labels goals may bear.
    families : Families
    known : tuple of str
        Bodies, see `signals.bodies`.

    Raises
    ------
    InputError
        If a goal is about something that the design has not.
    """
    quantities: dict[Quantity, int] = {}
    limits: list[Limit] = []
    separations: list[tuple[int, tuple[int, ...], float, bool]] = []
    wishes: list[Wish] = []
    unknown: dict[tuple[str, str], None] = {}
    faults: list[Fault] = []
    for n, goal in enumerate(goals.goal):
        try:
            some, missing = _asked(goal, f"goal.{n + 1}", design, found, families, known)
        except InputError as error:
            faults += error.faults
            continue
        places = tuple(quantities.setdefault(item, len(quantities)) for item in some)
        unknown |= dict.fromkeys(missing)
        if goal.kind == "separation":
            separations.append((n, places, goal.at_least or 0.0, goal.apart == "hertz"))
            continue
        given = [(sense, value) for sense in ("at_least", "at_most", "equals") if (value := getattr(goal, sense)) is not None]
        limits += [Limit(n, place, sense, value) for place in places for sense, value in given]
        if goal.minimise or goal.maximise:
            wishes += [Wish(n, place, (goal.weight or 1.0) * (1 if goal.minimise else -1)) for place in places]
    if not faults and not quantities:
        faults.append(Fault("goal", "asks for nothing that is known of this design", f"give {next(iter(unknown))[1]}"))
    if faults:
        raise InputError(faults)
    return Wanted(tuple(quantities), tuple(limits), tuple(separations), tuple(wishes), tuple(unknown))


def _asked(goal: Goal, key: str, design: Design, found: Modes, families: Families, known: tuple[str, ...]) -> tuple[list[Quantity], list[tuple[str, str]]]:
    """The quantities of one goal, and those whose value is not known."""
    if goal.kind in ("band", "separation", "coupling"):
        chosen = _of_modes(goal, key, found, families)
        if goal.kind == "separation" and len(chosen) < 2:
            raise InputError([Fault(key, "there are no two modes to lie apart", "name more modes")])
        return list(chosen), []
    if goal.kind in ("isolation", "cross-coupling"):
        (ratio,) = scalars.parse([goal.response or ""], found, known, f"{key}.response")
        assert isinstance(ratio, Ratio)
        text = f"|{ratio.text.partition(':')[0]}| at {ratio.frequency:g} Hz" + (", imperfect" if goal.perturbation else "")
        return [OfResponse(text, ratio.unit, ratio, tuple(goal.perturbation or ()))], []
    if goal.kind == "stress":
        return _of_parts(goal, key, design)
    stages = [stage.name for stage in design.stage]
    if goal.stage is not None and goal.stage not in stages:
        raise InputError([Fault(f"{key}.stage", "names no stage", suggestion(goal.stage, stages), shown(goal.stage))])
    stage = goal.stage or stages[-1]
    return [OfDepth(f"height down to {stage}", "m", stage)], []


def _of_modes(goal: Goal, key: str, found: Modes, families: Families) -> list[OfMode]:
    share, unit = goal.kind == "coupling", "1" if goal.kind == "coupling" else "Hz"
    if goal.modes is not None:
        picked = [item for item in scalars.parse(goal.modes, found, (), f"{key}.modes") if isinstance(item, scalars.Mode)]
        if not picked:
            raise InputError([Fault(f"{key}.modes", "names no mode", "see pendsus modes --fidelity string", shown(goal.modes))])
        return [OfMode(item.text, unit, share, number=item.number) for item in picked]
    chosen = []
    for family in dict.fromkeys(int(families.member[DOFS.index(dof)]) for dof in goal.dof or ()):
        count = int(families.size[family])
        if goal.lowest is not None and goal.lowest > count:
            problem = f"the design has {count} modes of family {families.name(family)}"
            raise InputError([Fault(f"{key}.lowest", problem, f"give at most {count}", shown(goal.lowest))])
        chosen += [OfMode(f"{families.name(family)} {rank + 1}", unit, share, family, rank) for rank in range(goal.lowest or count)]
    return chosen


def _of_parts(goal: Goal, key: str, design: Design) -> tuple[list[Quantity], list[tuple[str, str]]]:
    """Wires and blades named; without names all whose stress is known, and the others."""
    every = loads.parts(design)
    chosen, faults = [], []
    for blade, names in enumerate((goal.wires, goal.blades)):
        mine = [part for part in every if part.blade == bool(blade)]
        word = "blades" if blade else "wires"
        for name in names or ():
            some = [part for part in mine if part.stage == name]
            if not some:
                faults.append(Fault(f"{key}.{word}", f"names no stage with {word}", suggestion(name, list(dict.fromkeys(p.stage for p in mine))), shown(name)))
            faults += [
                Fault(f"{key}.{word}", f"the stress of {part.label} is not known", f"give {part.missing} in the design", shown(name))
                for part in some
                if part.missing
            ]
            chosen += some
    if faults:
        raise InputError(faults)
    if goal.wires is None and goal.blades is None:
        chosen = every
    stressed: list[Quantity] = [OfPart(f"stress of {part.label}", "of breaking", part) for part in chosen if not part.missing]
    return stressed, [(f"stress of {part.label}", part.missing) for part in chosen if part.missing]
