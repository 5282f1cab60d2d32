"""Warnings of a design: implausible loads, how close it is to its limits, and unknown names.

`design.plausibility` checks its numbers; `results/stability.md` shows where each limit matters.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.analyses import growth
from suspension_cli.analyses.check import statics
from suspension_cli.analyses.check.statics import (
    BladeLoad,
    LinkLoad,
    Statics,
    Stress,
    WireLoad,
    list_wire_tables,
)
from suspension_cli.analyses.check.towers import FilterLoad, LegLoad
from suspension_cli.conventions import ANALYSES, FRAME, GROUND, SUPPORT
from suspension_cli.design import plausibility
from suspension_cli.design.plausibility import ImplausibleNumber
from suspension_cli.design.schema import Design, Stage
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.tree import carried_weights
from suspension_cli.errors import Fault, InputError, format_value, suggest
from suspension_cli.linear import eigenmodes, named_results, signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Log
    from suspension_cli.scene.arrays import Array

STRAIN = 0.03
"""Largest plausible strain of a wire: steel breaks at 1 %, pristine silica at 5 %."""
SAG = 5.0
"""Largest plausible sag of a blade, m."""
LINK_WEIGHT = 1e-3
"""Weight of a link over the tensions of all wires that matters."""
TIPPING_LOAD = 1e-3
"""Margin of an inverted pendulum to its tipping load, over the load, below which there is a
warning."""
WORKING_RANGE = 5e-3
"""Largest plausible displacement of a keystone from its working point, m: blades are soft within
millimetres."""
TIPPING = 1e-4
"""Lowering of the wires that makes a body unstable, m, below which there is a warning."""
SLACK = 0.01
"""Fraction of the mean tension of its stage below which a wire is about to go slack."""


def find_implausible_loads(design: Design, loads: Statics) -> list[ImplausibleNumber]:
    """Find implausible loads: the worst wire and blade of each stage, links, legs and filters."""
    found: list[ImplausibleNumber] = []
    for stage in design.stage:
        path = f"stage.{stage.name}"
        wires = [wire for wire in loads.wires if wire.stage == stage.name]
        blades = [blade for blade in loads.blades if blade.stage == stage.name]
        found += _check_stress(wires, f"{path}.wire{'s' * bool(stage.wires)}", "wire")
        found += _check_stress(blades, f"{path}.blade{'s' * bool(stage.blades)}", "blade")
        found += _check_strain(stage, wires, path)
        found += _check_sag(stage, blades, path)
        if stage.inverted_pendulum is not None:
            legs = next(legs for legs in loads.legs if legs.stage == stage.name)
            found += _check_legs(legs, stage.inverted_pendulum.length)
    for link in loads.links:
        found += _check_link(link, loads)
    return found + [warning for own in loads.filters for warning in _check_filter(own)]


def _check_stress(parts: Sequence[Stress], key: str, word: str) -> Iterator[ImplausibleNumber]:
    """Report the part with the largest stress over strength, if above 1."""
    worst = max(parts, key=lambda part: part.fraction or 0.0, default=None)
    if worst is not None and worst.strength is not None and (worst.fraction or 0.0) > 1:
        ratio = worst.fraction or 0.0
        problem = (
            f"{word} {worst.label} is under {_format_stress(ratio * worst.strength)}, {ratio:.3g}"
            f" times the strength of {worst.material} ({_format_stress(worst.strength)})"
        )
        remedy = f"check its dimensions (m) and the masses (kg) it bears, or thicken the {word}"
        yield ImplausibleNumber(key, problem, remedy, serious=True)


def _format_stress(stress: float) -> str:
    return f"{stress / 1e9:.3g} GPa" if stress >= 1e9 else f"{stress / 1e6:.3g} MPa"


def _check_strain(
    stage: Stage, wires: Sequence[WireLoad], path: str
) -> Iterator[ImplausibleNumber]:
    """Report the wire with the largest strain, if above `STRAIN`."""
    both = [*zip(wires, list_wire_tables(stage), strict=True)]
    wire, table = max(both, key=lambda pair: pair[0].strain, default=(None, None))
    if wire is None or table is None or wire.strain <= STRAIN:
        return
    key = f"{path}.wires" if stage.wires is not None else f"{path}.wire.{wire.number}"
    problem = f"wire {wire.label} is stretched by {100 * wire.strain:.3g} % of its length"
    if table.k is None:
        remedy = "check its cross-section (m), Young's modulus (Pa) and the masses (kg) it bears"
        yield ImplausibleNumber(key, problem, remedy, serious=True)
    else:
        remedy = "did you mean N/mm?" if wire.strain <= 1e3 * STRAIN else "give it in N/m"
        serious = wire.stress is not None
        yield ImplausibleNumber(f"{key}.k", problem, remedy, format_value(table.k), serious)


def _check_sag(stage: Stage, blades: Sequence[BladeLoad], path: str) -> Iterator[ImplausibleNumber]:
    """Report the blade with the largest sag, if above `SAG` or its length."""
    worst = max(blades, key=lambda blade: blade.sag, default=None)
    if worst is None:
        return
    table = stage.blades or next(one for one in stage.blade if one.name == worst.number)
    key = f"{path}.blades" if stage.blades is not None else f"{path}.blade.{worst.number}"
    problem = f"blade {worst.label} sags by {worst.sag:.3g} m under {worst.load:.3g} N"
    remedy, shown = "check its dimensions (m) and Young's modulus (Pa)", None
    if table.geometry is None:
        given = "stiffness" if table.stiffness is not None else "uncoupled_frequency"
        unit, meant, factor = ("N/m", "N/mm", 1e3) if table.stiffness else ("Hz", "kHz", 1e6)
        remedy = f"did you mean {meant}?" if worst.sag <= factor * SAG else f"give it in {unit}"
        key, shown = f"{key}.{given}", format_value(getattr(table, given))
    if worst.sag > SAG or (table.geometry is not None and worst.sag > table.geometry.length):
        yield ImplausibleNumber(key, problem, remedy, shown, serious=worst.sag > SAG)


def _check_link(link: LinkLoad, loads: Statics) -> Iterator[ImplausibleNumber]:
    """Report a link whose weight, which the models leave out, changes its shape or loads wires."""
    key, wires = f"link.{link.label}.strands", sum(wire.tension for wire in loads.wires)
    if link.hangs_freely and link.sag is not None and link.length is not None:
        problem = (
            "under its weight, which the models leave out, it would sag by"
            f" {100 * link.sag / link.length:.2g} % of its length, and be stiffer or softer"
        )
        remedy = 'give the shape in which it hangs, such as "catenary", or a measured stiffness'
        yield ImplausibleNumber(key, problem, remedy)
    if link.weight is not None and link.weight > LINK_WEIGHT * wires > 0:
        problem = f"weighs {link.weight:.3g} N, which the models leave out"
        remedy = "add half of its mass to each of its bodies"
        yield ImplausibleNumber(key, problem, remedy)


def _check_legs(legs: LegLoad, length: float) -> Iterator[ImplausibleNumber]:
    """Report an inverted pendulum that tips over, or nearly."""
    if legs.margin < TIPPING_LOAD:
        state = "tips over" if legs.margin <= 0 else "is near tipping"
        side = "above" if legs.margin <= 0 else f"{100 * legs.margin:.2g} % below"
        problem = (
            f"{state}: its load of {legs.load:.6g} N is {side} the critical load of"
            f" {legs.critical:.6g} N"
        )
        least = legs.flexure + (legs.load - legs.critical) * length / len(legs.thrust)
        remedy = f"reduce the load, or give flexures well above {least:.6g} N m/rad"
        yield ImplausibleNumber(f"stage.{legs.stage}.inverted_pendulum", problem, remedy)


def _check_filter(own: FilterLoad) -> Iterator[ImplausibleNumber]:
    """Report a keystone off its working point."""
    if abs(own.sag) > WORKING_RANGE:
        problem = (
            f"the keystone is {1e3 * abs(own.sag):.3g} mm {'below' if own.sag > 0 else 'above'} its"
            f" working point: it carries {own.carried:.6g} N, not {own.load:.6g} N"
        )
        remedy = f"give load = {own.carried:.6g}, leave it out, or change the mass below"
        key = f"stage.{own.stage}.filter.load"
        yield ImplausibleNumber(key, problem, remedy, format_value(own.load))


def find_serious(design: Design) -> list[ImplausibleNumber]:
    """Find implausible numbers and loads that make results meaningless.

    A design without equilibrium has no loads.
    """
    found = plausibility.find_implausible(design)
    with contextlib.suppress(InputError):
        found += find_implausible_loads(design, statics.solve(design))
    return [item for item in found if item.serious]


def describe_tipping(design: Design, modes: Modes) -> str:
    """Describe the mode closest to instability; "" if that is further off than `TIPPING`.

    Lowering the wires' lower ends by h reduces the stiffness of each body against roll and pitch by
    W h, with the weight W that it carries (gravity terms of equations 10 to 14 of Husman et al.
    (2000)). A mode of unit modal mass is unstable at h sum of W (roll^2 + pitch^2) = omega^2.
    """
    turns = modes.shape[:, : 6 * len(modes.body)].reshape(len(modes.shape), -1, 6)[:, :, 3:5]
    per_metre = ((turns**2).sum(-1) * carried_weights(expand(design))).sum(-1)
    stiff = (modes.order == 0) & (modes.omega_squared > 0) & (per_metre > 0)
    height = np.where(stiff, modes.omega_squared / np.where(stiff, per_metre, 1.0), np.inf)
    lowest = int(height.argmin())
    if not height[lowest] < TIPPING:
        return ""
    return (
        f"{modes.label[lowest]} is close to unstable: attaching the wires"
        f" {1e3 * height[lowest]:.2g} mm lower makes it unstable; raise d"
    )


def find_slackest(loads: Statics) -> list[ImplausibleNumber]:
    """Find the wire with the smallest fraction of its stage's mean tension, if below `SLACK`."""
    fractions = {}
    for wire in loads.wires:
        own = [other.tension for other in loads.wires if other.stage == wire.stage]
        fractions[wire.label] = wire.tension * len(own) / sum(own)
    label, least = min(fractions.items(), key=lambda item: item[1], default=("", 1.0))
    if least >= SLACK:
        return []
    problem = (
        f"wire {label} is about to go slack: it carries {100 * least:.2g} % of the mean tension of"
        " its stage"
    )
    remedy = "move its ends, or give it its share of the load"
    return [ImplausibleNumber("", problem, remedy)]


def find_stability(
    design: Design,
) -> tuple[str | None, Modes | None, list[ImplausibleNumber]]:
    """Find whether motion grows, with wires that bend where the design gives their section.

    Returns the name of the model, its modes, and a warning if one grows; None if no model is valid.
    """
    complete = registry.most_complete(design, massless=True)
    for model in (complete, registry.choose(design).model):
        with (
            contextlib.suppress(InputError, np.linalg.LinAlgError, ArithmeticError),
            np.errstate(all="ignore"),
        ):
            system = model.system(design)
            modes, found = eigenmodes.solve(system.constant), []
            if grows := growth.find_growth(design, model, system):
                fault = grows.fault
                problem = fault.problem.replace(":", f" in the {model.name} model:", 1)
                remedy = fault.remedy + ", or stiffen the flexures of legs" * (fault.key == "stage")
                found.append(ImplausibleNumber(fault.key, problem, remedy, fault.value))
            return model.name, modes, found
    return None, None, []


def find_unknown_names(
    design: Design, found: Modes | None, paths: Callable[[str], bool]
) -> list[ImplausibleNumber]:
    """Find unknown names in a design.

    Labels of modes are checked if modes are `found`. `paths` tells whether a dotted path leads to a
    table of the design.
    """
    from suspension_cli.analyses import registry as analyses

    stages = tuple(stage.name for stage in design.stage)
    frame = (FRAME,) if design.support is not None else ()
    on_ground = any(GROUND in item.between for _, item in design.between_bodies)
    known = (SUPPORT, *stages, *frame, *((GROUND,) if on_ground else ()))
    parsers: list[Callable[[], object]] = []
    for analysis in map(analyses.get, ANALYSES):
        parsers += analysis.parse_names(design, stages, known)
        if found is not None:
            parsers += analysis.parse_results(design, found, stages, known)
    unknown = [warning for parse in parsers for warning in _collect_faults(parse)]
    wires = [
        f"{stage.name}.{n}"
        for stage in design.stage
        for n in range(1, len(list_wire_tables(stage)) + 1)
    ]

    def parse_signal(text: str) -> None:
        signals.parse(text, "", known)

    def parse_path(path: str, remedy: str = "write PATH=GRID") -> None:
        table = path.partition("=")[0].strip().rpartition(".")[0]
        _demand(paths(table), "does not lead to a table of the design", remedy)

    parse_text: dict[str, Callable[[str], object]] = {
        **dict.fromkeys(("input", "output", "over", "under", "impulse"), parse_signal),
        "observe": lambda text: parse_signal(f"{text.partition('@')[0]}.x"),
        "wire": lambda text: _demand(text in wires, "names no wire", suggest(text, wires)),
        "body": lambda text: _demand(text in stages, "names no stage", suggest(text, [*stages])),
        "vary": parse_path,
        "result": lambda text: found and named_results.parse([text], found, known),
    }
    for where, key, value in _analysis_keys(design):
        if "." in key:
            parse = partial(parse_path, key, "write the path as in the file: stage.test.wires.d")
            unknown += [replace(item, key=where) for item in _collect_faults(parse)]
        elif key in parse_text and isinstance(value, str):
            given = {"key": where, "value": format_value(value)}
            faults = _collect_faults(partial(parse_text[key], value))
            unknown += [replace(item, **given) for item in faults]
    return unknown


def _analysis_keys(design: Design) -> Iterator[tuple[str, str, object]]:
    """Iterate over paths, keys and values of the defaults of commands; over lists of texts too."""
    for command, table in design.analysis.items():
        for key, value in table.items():
            for text in value if isinstance(value, list) and "." not in key else [value]:
                yield f"analysis.{command}.{key}", key, text


def _demand(good: bool, problem: str, remedy: str) -> None:
    if not good:
        raise InputError([Fault("", problem, remedy)])


def _collect_faults(parse: Callable[[], object]) -> list[ImplausibleNumber]:
    """Return the faults of parsing a name as warnings."""
    try:
        parse()
    except InputError as error:
        return [ImplausibleNumber.of(fault) for fault in error.faults]
    return []


def warn_implausible(design: Design, log: Log) -> None:
    """Warn of implausible numbers that make results meaningless."""
    for item in find_serious(design):
        log.warn(f"{design.design.name}: {item.line('')}")


def warn(design: Design, modes: Modes, log: Log) -> None:
    """Warn of implausible numbers of a design, of a mode about to tip over and of slack wires."""
    warn_implausible(design, log)
    if tipping := describe_tipping(design, modes):
        log.warn(f"{design.design.name}: {tipping}")
    # tensions differ in a stage; bending alone may balance the wires
    if design.perturbation or any(stage.wire for stage in design.stage):
        with contextlib.suppress(InputError):
            for item in find_slackest(statics.solve(design)):
                log.warn(f"{design.design.name}: {item.line('')}")


def warn_of_tables(design: Design, frequency: Array, log: Log) -> None:
    """Warn of links whose tables of stiffness do not reach frequencies (f,) in Hz."""
    for link in design.link:
        if link.table is None:
            continue
        low, high = link.table.frequency[0], link.table.frequency[-1]
        if min(frequency) < low or max(frequency) > high:
            log.warn(
                f"{design.design.name}: the table of link {link.name} covers {low:g} to {high:g}"
                " Hz; outside, its stiffness is taken as constant; extend the table if that matters"
            )
