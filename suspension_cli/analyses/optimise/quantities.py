"""Goals as limits on, and weights of, quantities of a design.

Every quantity is a positive result of another analysis: one class serves all kinds of goals. The
margin of a lower limit is ln(value/limit): 0.01 means 1 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from suspension_cli.analyses.check import statics
from suspension_cli.analyses.optimise.mode_families import Families
from suspension_cli.conventions import DOFS
from suspension_cli.design.derive import mirror
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goal, Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.named_results import Mode

if TYPE_CHECKING:
    from jaxtyping import Float

SIGNS = {"at_least": ">=", "at_most": "<=", "equals": "="}


@dataclass(frozen=True)
class Quantity:
    """A number of a design that goals limit.

    Attributes
    ----------
    text : str
        Its name.
    method, key : str, tuple
        Method of `evaluate.Results` that computes it, and its arguments.
    """

    text: str
    unit: str
    method: str
    key: tuple[Any, ...]


@dataclass(frozen=True)
class Limit:
    """Limit on a quantity: ``at_least``, ``at_most`` or ``equals`` a value in its unit.

    `goal` and `quantity` are their numbers, from 0.
    """

    goal: int
    quantity: int
    sense: str
    value: float

    def name(self, quantity: Quantity) -> str:
        """Name the limit: ``yaw 3 <= 5 Hz``."""
        unit = "" if quantity.unit == "1" else quantity.unit
        return f"{quantity.text} {SIGNS[self.sense]} {self.value:g} {unit}".rstrip()


@dataclass(frozen=True)
class Requirements:
    """Limits and objective of a design, from a file of goals.

    Attributes
    ----------
    weight : array
        Of the logarithm of each quantity in the objective to be minimised.
    unknown : tuple of str
        Requested stresses that are unknown, and the keys that the design lacks.
    """

    quantities: tuple[Quantity, ...]
    limits: tuple[Limit, ...]
    weight: Float[np.ndarray, " quantity"]
    unknown: tuple[str, ...]


def interpret(
    goals: Goals, design: Design, modes: Modes, families: Families, known: tuple[str, ...]
) -> Requirements:
    """Interpret goals as requirements on a design.

    Parameters
    ----------
    goals : Goals
    design : Design
        The starting design.
    modes : Modes
        Its modes on the string model, to whose labels goals refer.
    families : Families
    known : tuple of str
        Names of the bodies, see `signals.bodies_with_signals`.

    Raises
    ------
    InputError
        If the design lacks something that a goal refers to.
    """
    quantities: dict[Quantity, int] = {}
    limits: list[Limit] = []
    weights: list[tuple[int, float]] = []
    unknown: dict[str, str] = {}
    faults: list[Fault] = []
    for n, goal in enumerate(goals.goal):
        try:
            if goal.response is not None:
                some = [_response(goal, n, modes, known)]
            elif goal.kind == "stress":
                some, missing = _stresses(goal, n, design)
                unknown |= missing
            elif goal.kind == "height":
                some = [_depth(goal, n, design)]
            else:
                some = _modes(goal, n, modes, families)
        except InputError as error:
            faults += error.faults
            continue
        places = tuple(quantities.setdefault(item, len(quantities)) for item in some)
        given = {sense: getattr(goal, sense) for sense in SIGNS}
        limits += [
            Limit(n, place, sense, value)
            for place in places
            for sense, value in given.items()
            if value is not None
        ]
        if goal.minimise or goal.maximise:
            weight = (goal.weight or 1.0) * (1 if goal.minimise else -1)
            weights += [(place, weight) for place in places]
    if not faults and not quantities:
        problem = "no goal names a quantity that is known for this design"
        faults.append(Fault("goal", problem, f"give {next(iter(unknown.values()))}"))
    if faults:
        raise InputError(faults)
    lacking = tuple(f"{what}: {missing} is not given" for what, missing in unknown.items())
    weight = np.zeros(len(quantities))
    for place, own in weights:
        weight[place] += own
    return Requirements(tuple(quantities), tuple(limits), weight, lacking)


def _modes(goal: Goal, n: int, modes: Modes, families: Families) -> list[Quantity]:
    """Modes of a goal by label (followed by shape), or by family and rank."""
    coupling, at = goal.kind == "coupling", f"goal.{n + 1}"
    chosen = []
    if goal.modes is not None:
        named = named_results.parse(goal.modes, modes, (), f"{at}.modes")
        chosen = [(item.text, -1, item.number) for item in named if isinstance(item, Mode)]
        if not chosen:
            remedy, value = "list labels with pendsus modes", format_value(goal.modes)
            raise InputError.of(f"{at}.modes", "names no mode", remedy, value)
    for family in dict.fromkeys(int(families.member[DOFS.index(dof)]) for dof in goal.dof or ()):
        count, name = int(families.size[family]), families.name(family)
        if (lowest := goal.lowest or count) > count:
            problem = f"the design has {count} modes of family {name}"
            raise InputError.of(f"{at}.lowest", problem, f"give at most {count}", f"{lowest}")
        chosen += [(f"{name} {rank + 1}", family, rank) for rank in range(lowest)]
    if goal.kind == "separation":
        if len(chosen) < 2:
            raise InputError.of(at, "there are no two modes to separate", "name more modes")
        hertz = goal.apart == "hertz"
        return [
            Quantity(
                f"separation of {one} and {other}",
                "Hz" if hertz else "1",
                "separation",
                (hertz, *key, *other_key),
            )
            for (one, *key), (other, *other_key) in combinations(chosen, 2)
        ]
    suffix, unit, what = (
        (" from the top mass", "1", "top_fraction") if coupling else ("", "Hz", "frequency")
    )
    return [Quantity(text + suffix, unit, "of_mode", (what, *key)) for text, *key in chosen]


def _response(goal: Goal, n: int, modes: Modes, known: tuple[str, ...]) -> Quantity:
    key = f"goal.{n + 1}.response"
    (ratio,) = named_results.parse([goal.response or ""], modes, known, key)
    assert not isinstance(ratio, Mode)
    imperfect = ", imperfect" if goal.perturbation else ""
    text = f"|{ratio.text.partition(':')[0]}| at {ratio.frequency:g} Hz{imperfect}"
    return Quantity(text, ratio.unit, "response", (ratio, tuple(goal.perturbation or ())))


def _depth(goal: Goal, n: int, design: Design) -> Quantity:
    stages, stage = [stage.name for stage in design.stage], goal.stage or mirror(design)
    if stage not in stages:
        key, remedy = f"goal.{n + 1}.stage", suggest(stage, stages)
        raise InputError.of(key, "names no stage", remedy, format_value(stage))
    return Quantity(f"height down to {stage}", "m", "depth", (stage,))


def _stresses(goal: Goal, n: int, design: Design) -> tuple[list[Quantity], dict[str, str]]:
    """Known stresses of the named wires and blades, or of all; and keys that others lack.

    One wire or blade stands for all of a symmetric set of a perfect design.
    """
    everything = goal.wires is None and goal.blades is None
    found: dict[str, Quantity] = {}
    unknown: dict[str, str] = {}
    faults, loads = [], statics.solve(design)
    for word, geometry in (("wires", "radius"), ("blades", "geometry")):
        single, key = word[:-1], f"goal.{n + 1}.{word}"
        sets = {stage.name: getattr(stage, word) for stage in design.stage}
        rows = [(*load.label.partition(".")[::2], load) for load in getattr(loads, word)]
        known = list(dict.fromkeys(stage for stage, *_ in rows))
        named = known if everything else getattr(goal, word) or []
        problem = f"names no stage with {word}"
        faults += [
            Fault(key, problem, suggest(name, known), format_value(name))
            for name in named
            if name not in known
        ]
        for place, (stage, name, load) in enumerate(rows):
            alike = sets[stage] is not None and not design.perturbation
            text = f"stress of {stage} {word}" if alike else f"stress of {single} {load.label}"
            if stage not in named or text in found | unknown:
                continue
            found[text] = Quantity(text, "of breaking", "stress", (word, place))
            if load.fraction is None:
                del found[text]
                part = word if sets[stage] is not None else f"{single}.{name}"
                missing = geometry if load.stress is None else "material"
                unknown[text] = f"stage.{stage}.{part}.{missing}"
                if load.stress is not None and load.material:
                    unknown[text] = f"materials.{load.material}.tensile_strength"
                if not everything:
                    problem, remedy = (
                        f"the {text} is unknown",
                        f"give {unknown[text]} in the design",
                    )
                    faults.append(Fault(key, problem, remedy, format_value(stage)))
    if faults:
        raise InputError(faults)
    return list(found.values()), unknown
