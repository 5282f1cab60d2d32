"""Warnings of a design: implausible loads, how close it is to its limits, and unknown names.

`design.checks` checks its numbers; `results/stability.md` shows where each limit matters.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.design import checks
from suspension_cli.design.checks import ImplausibleNumber
from suspension_cli.design.schema import Design, Stage
from suspension_cli.equilibrium.nominal import expand
from suspension_cli.equilibrium.tree import carried_weights
from suspension_cli.errors import InputError, format_value
from suspension_cli.linear import batch_modes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.linear.solver import Solver
from suspension_cli.models import registry
from suspension_cli.physics import growth, statics
from suspension_cli.physics.loads import FilterLoad, LegLoad, LinkLoad, Statics
from suspension_cli.physics.statics import list_wire_tables
from suspension_cli.physics.temperatures import find_unknown_temperatures

if TYPE_CHECKING:
    from suspension_cli.linear.system import LinearSystem
    from suspension_cli.physics.log import Log
    from suspension_cli.scene.arrays import Array

STRAIN = 0.03
"""Largest plausible strain of a wire: steel breaks at 1 %, pristine silica at 5 %."""
SAG = 5.0
"""Largest plausible sag of a blade, m."""
LINK_WEIGHT = 1e-3
"""Weight of a link over the tensions of all wires that matters."""
TIPPING_LOAD = 1e-3
"""Relative margin of an inverted pendulum to its tipping load below which there is a warning."""
WORKING_RANGE = 5e-3
"""Largest plausible displacement of a keystone from its working point, m: blades are soft within
millimetres."""
TIPPING = 1e-4
"""Lowering of the wires that makes a body unstable, m, below which there is a warning."""
SLACK = 0.01
"""Fraction of the mean tension of its stage below which a wire is about to go slack."""


def find_implausible_loads(design: Design, loads: Statics) -> list[ImplausibleNumber]:
    """Find implausible loads: the worst wire and blade of each stage, links, legs and filters."""
    rules = [rule(stage, loads) for stage in design.stage for rule in (_stress, _strain, _sag)]
    rules += [_link(link, loads) for link in loads.links]
    rules += [_legs(design, legs) for legs in loads.legs]
    rules += [_filter(own) for own in loads.filters]
    return [warning for rule in rules for warning in rule]


def _stress(stage: Stage, loads: Statics) -> Iterator[ImplausibleNumber]:
    """Report the wire and the blade with the largest stress over strength, if above 1."""
    for word, every, given in (
        ("wire", loads.wires, stage.wires),
        ("blade", loads.blades, stage.blades),
    ):
        parts = [part for part in every if part.stage == stage.name]
        worst = max(parts, key=lambda part: part.fraction or 0.0, default=None)
        if worst is not None and worst.strength and worst.fraction and worst.fraction > 1:
            problem = (
                f"{word} {worst.label} is under {_pressure(worst.fraction * worst.strength)},"
                f" {worst.fraction:.3g} times the strength of {worst.material}"
                f" ({_pressure(worst.strength)})"
            )
            remedy = f"check its dimensions (m) and the masses (kg) it bears, or thicken the {word}"
            key = f"stage.{stage.name}.{word}{'s' * bool(given)}"
            yield ImplausibleNumber(key, problem, remedy, serious=True)


def _pressure(stress: float) -> str:
    return f"{stress / 1e9:.3g} GPa" if stress >= 1e9 else f"{stress / 1e6:.3g} MPa"


def _strain(stage: Stage, loads: Statics) -> Iterator[ImplausibleNumber]:
    """Report the wire with the largest strain, if above `STRAIN`."""
    wires = [wire for wire in loads.wires if wire.stage == stage.name]
    both = zip(wires, list_wire_tables(stage), strict=True)
    for wire, table in sorted(both, key=lambda pair: -pair[0].strain)[:1]:
        if wire.strain <= STRAIN:
            return
        key = f"stage.{stage.name}.wire{'s' if stage.wires is not None else f'.{wire.number}'}"
        problem = f"wire {wire.label} is stretched by {100 * wire.strain:.3g} % of its length"
        remedy = "check its cross-section (m), Young's modulus (Pa) and the masses (kg) it bears"
        if table.k is None:
            yield ImplausibleNumber(key, problem, remedy, serious=True)
        else:
            serious = wire.stress is not None
            given = f"{key}.k", problem, "did you mean N/mm?", format_value(table.k)
            yield ImplausibleNumber(*given, serious=serious)


def _sag(stage: Stage, loads: Statics) -> Iterator[ImplausibleNumber]:
    """Report the blade with the largest sag, if above `SAG` or its length."""
    blades = [blade for blade in loads.blades if blade.stage == stage.name]
    for worst in sorted(blades, key=lambda blade: -blade.sag)[:1]:
        table = stage.blades or next(one for one in stage.blade if one.name == worst.number)
        key = f"stage.{stage.name}.blade{'s' if stage.blades is not None else f'.{worst.number}'}"
        problem = f"blade {worst.label} sags by {worst.sag:.3g} m under {worst.load:.3g} N"
        if table.geometry is not None:
            remedy = "check its dimensions (m) and Young's modulus (Pa)"
            shown = None
        else:
            given = "stiffness" if table.stiffness is not None else "uncoupled_frequency"
            remedy = f"did you mean {'N/mm' if table.stiffness is not None else 'kHz'}?"
            key = f"{key}.{given}"
            shown = format_value(getattr(table, given))
        if worst.sag > SAG or (table.geometry is not None and worst.sag > table.geometry.length):
            yield ImplausibleNumber(key, problem, remedy, shown, serious=worst.sag > SAG)


def _link(link: LinkLoad, loads: Statics) -> Iterator[ImplausibleNumber]:
    """Report a link whose weight, which the models leave out, changes its shape or loads wires."""
    key = f"link.{link.label}.strands"
    wires = sum(wire.tension for wire in loads.wires)
    if link.hangs_freely and link.sag is not None and link.length is not None:
        problem = (
            "under its weight, which the models leave out, it would sag by"
            f" {100 * link.sag / link.length:.2g} % of its length, and be stiffer or softer"
        )
        remedy = 'give the shape in which it hangs, such as "catenary", or a measured stiffness'
        yield ImplausibleNumber(key, problem, remedy)
    if link.weight is not None and link.weight > LINK_WEIGHT * wires > 0:
        problem = f"weighs {link.weight:.3g} N, which the models leave out"
        yield ImplausibleNumber(key, problem, "add half of its mass to each of its bodies")


def _legs(design: Design, legs: LegLoad) -> Iterator[ImplausibleNumber]:
    """Report an inverted pendulum that tips over, or nearly."""
    table = {stage.name: stage for stage in design.stage}[legs.stage].inverted_pendulum
    if legs.margin < TIPPING_LOAD and table is not None:
        state = "tips over" if legs.margin <= 0 else "is near tipping"
        side = "above" if legs.margin <= 0 else f"{100 * legs.margin:.2g} % below"
        problem = (
            f"{state}: its load of {legs.load:.6g} N is {side} the critical load of"
            f" {legs.critical:.6g} N"
        )
        least = legs.flexure + (legs.load - legs.critical) * table.length / len(legs.thrust)
        remedy = f"reduce the load, or give flexures well above {least:.6g} N m/rad"
        yield ImplausibleNumber(f"stage.{legs.stage}.inverted_pendulum", problem, remedy)


def _filter(own: FilterLoad) -> Iterator[ImplausibleNumber]:
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
    found = checks.find_implausible(design)
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


def is_far_from_tipping(design: Design, system: LinearSystem) -> bool:
    """Whether `describe_tipping` has nothing to say, by a factorisation of the stiffness alone.

    The stiffness K less that which a lowering by `TIPPING` takes, h times a diagonal D, is then
    positive definite, so omega^2 = x^T K x > h x^T D x of every mode x of unit modal mass. Of some
    designs that are far from tipping this does not tell so: of those with rigid modes.
    """
    weights = carried_weights(expand(design))
    softening = np.zeros(system.size)
    turns = 6 * np.arange(1, len(weights) + 1)[:, None] + [3, 4]
    softening[turns] = TIPPING * weights[:, None]
    return batch_modes.is_clearly_stable(system, softening)


def find_slackest(loads: Statics) -> list[ImplausibleNumber]:
    """Find the wire with the smallest fraction of its stage's mean tension, if below `SLACK`."""
    fractions = {}
    for wire in loads.wires:
        own = [other.tension for other in loads.wires if other.stage == wire.stage]
        fractions[wire.label] = wire.tension * len(own) / sum(own)
    label, least = min(fractions.items(), key=lambda item: item[1], default=("", 1.0))
    problem = (
        f"wire {label} is about to go slack: it carries {100 * least:.2g} % of the mean tension of"
        " its stage"
    )
    remedy = "move its ends, or give it its share of the load"
    return [ImplausibleNumber("", problem, remedy)] if least < SLACK else []


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
            solver = Solver(system)
            modes = solver.constant.modes
            found = []
            if grows := growth.find_growth(design, model, solver):
                fault = grows.fault
                problem = fault.problem.replace(":", f" in the {model.name} model:", 1)
                remedy = fault.remedy + ", or stiffen the flexures of legs" * (fault.key == "stage")
                found.append(ImplausibleNumber(fault.key, problem, remedy, fault.value))
            return model.name, modes, found
    return None, None, []


def warn_implausible(design: Design, log: Log) -> None:
    """Warn of implausible numbers that make results meaningless."""
    for item in find_serious(design):
        log.warn(f"{design.design.name}: {item.line('')}")


def warn(design: Design, modes: Modes | None, log: Log) -> None:
    """Warn of implausible numbers of a design, of a mode about to tip over and of slack wires.

    The modes are None if they are far from tipping over.
    """
    warn_implausible(design, log)
    if modes is not None and (tipping := describe_tipping(design, modes)):
        log.warn(f"{design.design.name}: {tipping}")
    # tensions differ in a stage; bending alone may balance the wires
    if design.perturbation or any(stage.wire for stage in design.stage):
        with contextlib.suppress(InputError):
            for item in find_slackest(statics.solve(design)):
                log.warn(f"{design.design.name}: {item.line('')}")


def describe_falsified_losses(design: Design, level: str) -> list[str]:
    """Describe what makes losses wrong in the model `level`, one line each.

    Materials at temperatures at which what they need is unknown, and bodies on which gas exerts no
    drag, as their surface is unknown.
    """
    found = find_unknown_temperatures(design, level) + checks.find_without_drag(design)
    return [f"{design.design.name}: {fault.line('')}" for fault in found]


def warn_of_tables(design: Design, frequency: Array, log: Log) -> None:
    """Warn of links whose tables of stiffness do not reach frequencies (f,) in Hz."""
    for link in design.link:
        if link.table is None:
            continue
        low = link.table.frequency[0]
        high = link.table.frequency[-1]
        if min(frequency) < low or max(frequency) > high:
            log.warn(
                f"{design.design.name}: the table of link {link.name} covers {low:g} to {high:g}"
                " Hz; outside, its stiffness is taken as constant; extend the table if that matters"
            )
