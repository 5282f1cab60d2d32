"""A file of goals for one design: free numbers, families of modes, quantities and limits.

Every quantity is a positive result of another analysis. The margin of a lower limit is
ln(value/limit): 0.01 means 1 %.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.analyses.optimise.optimum import Limits
from suspension_cli.conventions import DOF_NAMES, DOFS, PARITY_X, PARITY_Y
from suspension_cli.design import paths, reader
from suspension_cli.design.derive import mirror
from suspension_cli.design.faults import suggest
from suspension_cli.design.goals import Goal, Goals
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.mode_content import Motion
from suspension_cli.linear.mode_pairing import pair_by_overlap
from suspension_cli.linear.named_results import Mode
from suspension_cli.physics import statics
from suspension_cli.studies import parameters

if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int

FOLLOWED, LABELLED = -1, -2
"""Families of modes that are followed by their shapes from the starting design, by number there,
and of those that a label means in each design, by their motion."""
SIGNS = {"at_least": ">=", "at_most": "<=", "equals": "="}


@dataclass(frozen=True)
class FreeDesign:
    """A design whose free numbers are fractions u in [0, 1] of the ranges between their bounds.

    Other numbers depend on these linearly. `known` are all numbers of the starting design by dotted
    path, SI. Arrays list the free ones, then the dependent ones.
    """

    text: str
    goals: Goals
    known: dict[str, float]

    @staticmethod
    def of(text: str, goals: Goals) -> FreeDesign:
        """Look up the free numbers of goals in a design (TOML).

        Raises `InputError` if the design does not give them, or a start lies out of bounds.
        """
        given = {item.name: item.value for item in parameters.every(text)}
        starts = {item.name: item.start for item in goals.free if item.start is not None}
        if faults := [*_faults(goals, given, starts)]:
            raise InputError(faults)
        freed = FreeDesign(text, goals, given | starts)
        try:
            freed.design(freed.begin)
        except InputError as error:
            problem = "makes the starting design invalid: {0.key}: {0.problem}"
            faults = [Fault("equal", problem.format(one), one.remedy) for one in error.faults]
            raise InputError(faults) from None
        return freed

    @cached_property
    def start(self) -> Float[np.ndarray, " free"]:
        """Starting values of the free numbers."""
        return np.array([self.known[item.name] for item in self.goals.free])

    @cached_property
    def bounds(self) -> Float[np.ndarray, "side number"]:
        """Lower and upper bounds; NaN without a bound."""
        items = [*self.goals.free, *self.goals.equal]
        return np.array([[one.lower, one.upper] for one in items], dtype=float).T

    @cached_property
    def bounded(self) -> Bool[np.ndarray, "side number"]:
        """Which bounds of dependent numbers there are."""
        known = np.isfinite(self.bounds)
        known[:, : len(self.start)] = False
        return known

    @cached_property
    def begin(self) -> Float[np.ndarray, " free"]:
        """Fractions of the starting design, in logarithms where the search is logarithmic."""
        log = np.array([item.scale == "log" for item in self.goals.free])
        rows = np.array([self.start, *self.bounds[:, : len(log)]])
        here, low, high = np.log(rows, out=rows, where=log)
        return (here - low) / (high - low)

    def values(self, fraction: Float[np.ndarray, " free"]) -> dict[str, float]:
        """All numbers by dotted path; starts and bounds are exact."""
        free = {}
        for n, item in enumerate(self.goals.free):
            u, low, high = float(fraction[n]), item.lower, item.upper
            exact = {0.0: low, 1.0: high, float(self.begin[n]): float(self.start[n])}
            between = low * (high / low) ** u if item.scale == "log" else low + u * (high - low)
            free[item.name] = exact.get(u, between)
        known = self.known | free
        return free | {
            item.name: item.offset + sum(rate * known[term] for term, rate in item.terms.items())
            for item in self.goals.equal
        }

    def margins(self, fraction: Float[np.ndarray, " free"]) -> Float[np.ndarray, "side number"]:
        """Distances from the bounds over the range between these, or over a single bound.

        Infinite where there is no bound.
        """
        low, high = self.bounds
        single = np.fmax(np.abs(low), np.abs(high))
        span = np.where(np.isnan(high - low), np.where(single > 0, single, 1.0), high - low)
        value = np.array([*self.values(fraction).values()])
        away = np.array([value - low, high - value]) / span
        away[:, : len(fraction)] = fraction, 1 - fraction
        return np.where(np.isnan(away), np.inf, away)

    def toml(self, fraction: Float[np.ndarray, " free"]) -> str:
        """Design as TOML."""
        raw = tomllib.loads(self.text)
        reader.apply_overrides(raw, paths.symmetric_settings(self.values(fraction)))
        return reader.write_toml(raw)

    @cached_property
    def _varied(self) -> reader.VariedDesign:
        return reader.VariedDesign.of(self.text)

    def design(self, fraction: Float[np.ndarray, " free"]) -> Design:
        """Parsed design; raises `InputError` if it is invalid."""
        numbers = self.values(fraction).items()
        return self._varied.at({key: value for name, value in numbers for key in paths.twins(name)})

    def design_if_valid(self, fraction: Float[np.ndarray, " free"]) -> Design | None:
        """Parsed design; None if it is invalid."""
        try:
            return self.design(fraction)
        except InputError:
            return None


def _faults(goals: Goals, known: dict[str, float], starts: dict[str, float]) -> Iterator[Fault]:
    """Faults of names that the design does not give, and of starts out of bounds."""
    free = [item.name for item in goals.free]
    named = [(f"free.{n}.name", name) for n, name in enumerate(free, 1)]
    for n, item in enumerate(goals.equal, 1):
        named += [(f"equal.{n}.name", item.name)]
        named += [(f"equal.{n}.terms", term) for term in item.terms if term not in free]
    for key, name in named:
        if name not in known:
            remedy = f"add it to the design (--set); {suggest(name, list(known))}"
            yield Fault(key, "the design gives no such number", remedy, format_value(name))
    for n, item in enumerate(goals.free, 1):
        value = (known | starts).get(item.name, item.lower)
        if not item.lower <= value <= item.upper:
            bounds = f"{item.lower:g} to {item.upper:g}"
            problem = f"the design's value {value:g} lies outside the bounds {bounds}"
            yield Fault(f"free.{n}", problem, "give a start between them, or widen them")


@dataclass(frozen=True)
class Families:
    """Families of motions that do not couple, by mirror symmetry: yaw, longitudinal with pitch, ...

    Within a family, frequencies generally do not cross (von Neumann and Wigner, Phys. Z. 30, 467
    (1929)), so that the rank of a mode identifies it in any design, and its frequency changes
    smoothly. `member` is the family of each degree of freedom, `size` the number of modes of each
    family.
    """

    member: Int[np.ndarray, " 6"]
    size: Int[np.ndarray, " family"]

    @staticmethod
    def of(mirrors: Bool[np.ndarray, " 2"], energy: Float[np.ndarray, "mode body 6"]) -> Families:
        """Find the families of a design that is symmetric in x and in y, or not (`mirrors`).

        `energy` are fractions of the kinetic energy of each mode.
        """
        parity = list(map(tuple, (mirrors[:, None] * np.array([PARITY_X, PARITY_Y])).T.tolist()))
        kinds = list(dict.fromkeys(parity))
        member = np.array([kinds.index(one) for one in parity])
        none = Families(member, np.zeros(len(kinds), dtype=int))
        return Families(member, np.bincount(none.energy(energy).argmax(1), minlength=len(kinds)))

    def energy(self, energy: Float[np.ndarray, "mode body 6"]) -> Float[np.ndarray, "mode family"]:
        """Fraction of the kinetic energy of each mode in each family."""
        return energy.sum(-2) @ np.eye(len(self.size))[self.member]

    def name(self, family: int) -> str:
        """Name a family, ``longitudinal-pitch``."""
        return "-".join(DOF_NAMES[DOFS[n]] for n in np.flatnonzero(self.member == family))

    def ranked(self, energy: Float[np.ndarray, "mode body 6"]) -> list[Int[np.ndarray, " _"]]:
        """List the numbers of the modes of each family, ascending in frequency.

        Where imperfections mix families, each keeps its number of modes.
        """
        slots = np.repeat(np.arange(len(self.size)), self.size)
        place = pair_by_overlap(self.energy(energy)[:, slots])
        own = np.where(place >= 0, slots[place], -1)
        return [np.flatnonzero(own == family) for family in range(len(self.size))]


class Quantity(NamedTuple):
    """A number of a design that goals limit.

    `method` of `evaluate.Results`, with the arguments `key`, computes it.
    """

    text: str
    unit: str
    method: str
    key: tuple[Any, ...]


@dataclass(frozen=True)
class Requirements:
    """Limits (without values) and objective of a design, from a file of goals.

    `weight` is that of the logarithm of each quantity in the objective to be minimised; `unknown`
    lists requested stresses that are unknown, and the keys that the design lacks.
    """

    quantities: tuple[Quantity, ...]
    limits: Limits
    weight: Float[np.ndarray, " quantity"]
    unknown: tuple[str, ...]


def interpret(
    goals: Goals, design: Design, modes: Modes, families: Families, known: tuple[str, ...]
) -> Requirements:
    """Interpret goals as requirements on a starting design.

    `modes` are those of the string model, to whose labels goals refer, `known` the bodies with
    signals. Raises `InputError` if the design lacks something that a goal refers to.
    """
    weight: dict[Quantity, float] = {}
    limits: list[tuple[str, int, int, str, str, float]] = []
    unknown: dict[str, str] = {}
    faults: list[Fault] = []
    for n, goal in enumerate(goals.goal):
        at = f"goal.{n + 1}"
        try:
            if goal.response is not None:
                some = [_response(goal, f"{at}.response", modes, known)]
            elif goal.kind == "stress":
                some, missing = _stresses(goal, at, design)
                unknown |= missing
            elif goal.kind == "height":
                some = [_depth(goal, f"{at}.stage", design)]
            else:
                some = _modes(goal, at, modes, families)
        except InputError as error:
            faults += error.faults
            continue
        for item in some:
            sign = goal.minimise - goal.maximise
            weight[item] = weight.get(item, 0.0) + sign * (goal.weight or 1.0)
            place = list(weight).index(item)
            given = ((sense, getattr(goal, sense)) for sense in SIGNS)
            limits += [
                (_name_limit(item, sense, value), n + 1, place, sense, item.unit, value)
                for sense, value in given
                if value is not None
            ]
    if not faults and not weight:
        problem = "no goal names a quantity that is known for this design"
        faults.append(Fault("goal", problem, f"give {next(iter(unknown.values()))}"))
    if faults:
        raise InputError(faults)
    count = len(limits)
    name, number, quantity, sense, unit, asked = zip(*limits, strict=True) if count else [()] * 6
    return Requirements(
        tuple(weight),
        Limits(
            name=name,
            goal=np.array(number, dtype=int),
            quantity=np.array(quantity, dtype=int),
            sense=sense,
            unit=unit,
            asked=np.array(asked, dtype=float),
            value=np.full(count, np.nan),
            active=np.zeros(count, dtype=bool),
            multiplier=np.zeros(count),
        ),
        np.array([*weight.values()]),
        tuple(f"{what}: {missing} is not given" for what, missing in unknown.items()),
    )


def _name_limit(quantity: Quantity, sense: str, value: float) -> str:
    unit = "" if quantity.unit == "1" else quantity.unit
    return f"{quantity.text} {SIGNS[sense]} {value:g} {unit}".rstrip()


def _modes(goal: Goal, at: str, modes: Modes, families: Families) -> list[Quantity]:
    """Quantities of modes, each identified by family and rank; see `FOLLOWED` and `LABELLED`."""
    chosen: list[tuple[str, int, int | Motion]] = []
    if goal.modes is not None:
        named = named_results.parse(goal.modes, modes, (), f"{at}.modes")
        chosen = [
            (item.text, FOLLOWED, item.number)
            if item.motion is None
            else (item.text, LABELLED, item.motion)
            for item in named
            if isinstance(item, Mode)
        ]
        if not chosen:
            remedy, value = "list labels with pendsus modes", format_value(goal.modes)
            raise InputError.of(f"{at}.modes", "names no mode", remedy, value)
    for family in dict.fromkeys(int(families.member[DOFS.index(dof)]) for dof in goal.dof or ()):
        count, name = int(families.size[family]), families.name(family)
        if (lowest := goal.lowest or count) > count:
            problem = f"the design has {count} modes of family {name}"
            raise InputError.of(f"{at}.lowest", problem, f"give at most {count}", f"{lowest}")
        chosen += [(f"{name} {rank + 1}", family, rank) for rank in range(lowest)]
    if goal.kind == "coupling":
        how = "1", "of_mode"
        return [
            Quantity(f"{text} from the top mass", *how, ("top_fraction", *key))
            for text, *key in chosen
        ]
    if goal.kind == "band":
        return [Quantity(text, "Hz", "of_mode", ("frequency", *key)) for text, *key in chosen]
    if len(chosen) < 2:
        raise InputError.of(at, "there are no two modes to separate", "name more modes")
    hertz = goal.apart == "hertz"
    how = "Hz" if hertz else "1", "separation"
    return [
        Quantity(f"separation of {one} and {other}", *how, (hertz, *key, *other_key))
        for (one, *key), (other, *other_key) in combinations(chosen, 2)
    ]


def _response(goal: Goal, at: str, modes: Modes, known: tuple[str, ...]) -> Quantity:
    (ratio,) = named_results.parse([goal.response or ""], modes, known, at)
    assert not isinstance(ratio, Mode)
    imperfect = ", imperfect" if goal.perturbation else ""
    text = f"|{ratio.text.partition(':')[0]}| at {ratio.frequency:g} Hz{imperfect}"
    return Quantity(text, ratio.unit, "response", (ratio, tuple(goal.perturbation or ())))


def _depth(goal: Goal, at: str, design: Design) -> Quantity:
    stages, stage = [stage.name for stage in design.stage], goal.stage or mirror(design)
    if stage not in stages:
        raise InputError.of(at, "names no stage", suggest(stage, stages), format_value(stage))
    return Quantity(f"height down to {stage}", "m", "depth", (stage,))


def _stresses(goal: Goal, at: str, design: Design) -> tuple[list[Quantity], dict[str, str]]:
    """Known stresses of the named wires and blades, or of all; and keys that others lack.

    One wire or blade stands for all of a symmetric set of a perfect design.
    """
    everything = goal.wires is None and goal.blades is None
    found: dict[str, Quantity] = {}
    unknown: dict[str, str] = {}
    faults, loads = [], statics.solve(design)
    for word, dimension in (("wires", "radius"), ("blades", "geometry")):
        single, key = word[:-1], f"{at}.{word}"
        in_set = {stage.name for stage in design.stage if getattr(stage, word) is not None}
        rows = [(load.label.partition(".")[0], load) for load in getattr(loads, word)]
        known = list(dict(rows))
        named = known if everything else getattr(goal, word) or []
        for name in named:
            if name not in known:
                problem, remedy = f"names no stage with {word}", suggest(name, known)
                faults.append(Fault(key, problem, remedy, format_value(name)))
        for place, (stage, load) in enumerate(rows):
            alike = stage in in_set and not design.perturbation
            text = f"stress of {stage} {word}" if alike else f"stress of {single} {load.label}"
            if stage not in named or text in found | unknown:
                continue
            if load.fraction is not None:
                found[text] = Quantity(text, "of breaking", "stress", (word, place))
                continue
            part = word if stage in in_set else f"{single}.{load.label.partition('.')[2]}"
            missing = dimension if load.stress is None else "material"
            unknown[text] = f"stage.{stage}.{part}.{missing}"
            if load.stress is not None and load.material:
                unknown[text] = f"materials.{load.material}.tensile_strength"
            if not everything:
                problem, remedy = f"the {text} is unknown", f"give {unknown[text]} in the design"
                faults.append(Fault(key, problem, remedy, format_value(stage)))
    if faults:
        raise InputError(faults)
    return list(found.values()), unknown
