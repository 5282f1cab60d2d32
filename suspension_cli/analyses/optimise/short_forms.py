"""Short forms of goals, `[[goal]]` with a `kind`, as names of quantities with limits.

kind = "band", dof = ["yaw"], at_most = 5.0    yaw 1, yaw 2, ... at most 5 Hz
kind = "stress", wires = ["test"], ...          stress fraction test wires
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

from suspension_cli.conventions import DOF_BY_NAME, DOFS
from suspension_cli.design.derive import mirror
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goal
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.physics.loads import BladeLoad, WireLoad
from suspension_cli.quantities import vocabulary
from suspension_cli.quantities.kinds.modes import ALL, parse_mode
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.quantity import Quantity


@dataclass(frozen=True)
class Meant:
    """What a short form stands for.

    Attributes
    ----------
    limits
        Least and largest value of each of the quantities.
    unknown
        Keys that the design lacks for stresses that are not known.
    """

    quantities: Sequence[Quantity]
    limits: tuple[float, float]
    unknown: dict[str, str]


def expand(goal: Goal, names: Names, at: str) -> Meant:
    """Look up the quantities of a goal with the key `at`.

    Raises `InputError` if the design lacks something that it refers to.
    """
    unknown: dict[str, str] = {}
    limits = _limits(goal)
    if goal.response is not None:
        quantities = [vocabulary.parse(goal.response, names, f"{at}.response")]
    elif goal.kind == "stress":
        quantities, unknown = _stresses(goal, names, at)
    elif goal.kind == "height":
        quantities = [_height(goal, names, f"{at}.stage")]
    elif goal.kind == "separation":
        quantities = _separations(goal, names, at)
        if goal.apart != "hertz":  # a ratio; a distance is less by 1
            limits = (limits[0] - 1, limits[1])
    else:
        form = "top fraction of {}" if goal.kind == "coupling" else "{}"
        modes = _mode_names(goal, names, at)
        quantities = [vocabulary.parse(form.format(mode), names, at) for mode in modes]
    return Meant(quantities, limits, unknown)


def _limits(goal: Goal) -> tuple[float, float]:
    if goal.equals is not None:
        return goal.equals, goal.equals
    low = -math.inf if goal.at_least is None else goal.at_least
    high = math.inf if goal.at_most is None else goal.at_most
    return low, high


def _mode_names(goal: Goal, names: Names, at: str) -> list[str]:
    """Names of the modes of a goal, by label or number or of families."""
    if goal.modes is not None:
        count = len(names.modes.label)
        every = [str(number) for number in range(1, count + 1)]
        chosen = [name for text in goal.modes for name in (every if text == ALL else [text])]
        return [parse_mode(name, names, f"{at}.modes").text for name in chosen]
    families = names.families
    members = [families.member[DOFS.index(DOF_BY_NAME[dof])] for dof in goal.dof or ()]
    found = []
    for family in dict.fromkeys(members):
        count = families.size[family]
        name = families.names[family]
        lowest = goal.lowest or count
        if lowest > count:
            problem = f"the design has {count} modes of family {name}"
            raise InputError.of(f"{at}.lowest", problem, f"give at most {count}", f"{lowest}")
        found += [f"{name} {rank}" for rank in range(1, lowest + 1)]
    return found


def _separations(goal: Goal, names: Names, at: str) -> list[Quantity]:
    modes = _mode_names(goal, names, at)
    if len(modes) < 2:
        raise InputError.of(at, "there are no two modes to separate", "name more modes")
    word = "difference" if goal.apart == "hertz" else "distance"
    pairs = combinations(modes, 2)
    return [vocabulary.parse(f"{word} {one}, {other}", names, at) for one, other in pairs]


def _height(goal: Goal, names: Names, at: str) -> Quantity:
    stage = goal.stage or mirror(names.design)
    if stage not in names.stages:
        remedy = suggest(stage, list(names.stages))
        raise InputError.of(at, "names no stage", remedy, format_value(stage))
    return vocabulary.parse(f"{stage} height", names, at)


def _stresses(goal: Goal, names: Names, at: str) -> tuple[list[Quantity], dict[str, str]]:
    """Known stresses of the named wires and blades, or of all; and keys that others lack.

    One quantity stands for all wires of a symmetric set of a perfect design.
    """
    everything = goal.wires is None and goal.blades is None
    found: dict[str, Quantity] = {}
    unknown: dict[str, str] = {}
    faults: list[Fault] = []
    kinds = (
        ("wires", goal.wires, names.statics.wires),
        ("blades", goal.blades, names.statics.blades),
    )
    for word, wanted, loads in kinds:
        known = list(dict.fromkeys(load.label.partition(".")[0] for load in loads))
        chosen = known if everything else wanted or []
        for name in chosen:
            if name not in known:
                problem = f"names no stage with {word}"
                remedy = suggest(name, known)
                faults.append(Fault(f"{at}.{word}", problem, remedy, format_value(name)))
        for load in loads:
            stage = load.label.partition(".")[0]
            if stage not in chosen:
                continue
            part = f"{stage} {word}" if _is_alike(names, stage, word) else load.label
            if load.fraction is not None:
                text = f"stress fraction {part}"
                found.setdefault(text, vocabulary.parse(text, names, at))
                continue
            unknown[f"stress of {part}"] = _missing_key(names, word, load)
            if not everything:
                problem = f"the stress of {part} is unknown"
                remedy = f"give {unknown[f'stress of {part}']} in the design"
                faults.append(Fault(f"{at}.{word}", problem, remedy, format_value(stage)))
    if faults:
        raise InputError(list(dict.fromkeys(faults)))
    return list(found.values()), unknown


def _is_alike(names: Names, stage: str, word: str) -> bool:
    """Whether the wires or blades of a stage are a symmetric set of a perfect design."""
    return _is_set(names, stage, word) and not names.design.perturbation


def _is_set(names: Names, stage: str, word: str) -> bool:
    [table] = [one for one in names.design.stage if one.name == stage]
    return getattr(table, word) is not None


def _missing_key(names: Names, word: str, load: WireLoad | BladeLoad) -> str:
    """Key that a design lacks for the stress of a wire or blade."""
    stage, _, number = load.label.partition(".")
    if load.stress is not None and load.material:
        return f"materials.{load.material}.tensile_strength"
    missing = "material"
    if load.stress is None:
        missing = "radius" if word == "wires" else "geometry"
    part = word if _is_set(names, stage, word) else f"{word[:-1]}.{number}"
    return f"stage.{stage}.{part}.{missing}"
