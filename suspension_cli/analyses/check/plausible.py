"""Implausible loads and instability of a design (`design.plausibility` checks its numbers)."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace

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
from suspension_cli.analyses.growth import Growth
from suspension_cli.design import plausibility
from suspension_cli.design.plausibility import ImplausibleNumber, suggest_unit
from suspension_cli.design.schema import Design, Stage
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import eigenmodes
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry

STRAIN = 0.03
"""Largest plausible strain of a wire: steel breaks at 1 %, pristine silica at 5 %."""
SAG = 5.0
"""Largest plausible sag of a blade, m."""


LINK_SAG = 0.05
"""Largest sag of a link over its length that is a small deflection."""
LINK_PENDULUM = 0.3
"""Weight over length of a link, relative to its stiffness, that makes that uncertain."""
LINK_WEIGHT = 1e-3
"""Weight of a link over the tensions of all wires that matters."""


def find_implausible_loads(design: Design, statics: Statics) -> list[ImplausibleNumber]:
    """Find implausible stress, strain and sag of wires and blades, the worst of each stage."""
    found: list[ImplausibleNumber] = []
    for stage in design.stage:
        wires = [wire for wire in statics.wires if _stage_of(wire.label) == stage.name]
        blades = [blade for blade in statics.blades if _stage_of(blade.label) == stage.name]
        path = f"stage.{stage.name}"
        found += _check_stress(design, wires, f"{path}.wire{'s' * bool(stage.wires)}", "wire")
        found += _check_strain(stage, wires, path)
        found += _check_stress(design, blades, f"{path}.blade{'s' * bool(stage.blades)}", "blade")
        found += _check_sag(stage, blades, path)
    for link in statics.links:
        found += _check_link(link, statics)
    return found


def hangs_freely(link: LinkLoad) -> bool:
    """Whether a link sags too far for a small deflection."""
    return link.sag is not None and link.length is not None and link.sag > LINK_SAG * link.length


def _check_link(link: LinkLoad, carried: Statics) -> Iterator[ImplausibleNumber]:
    """Report a link whose weight changes its shape, its stiffness or the loads of wires."""
    if link.weight is None or link.length is None or link.sag is None:
        return
    key = f"link.{link.label}.strands"
    if hangs_freely(link):
        problem = (
            "under its weight, which the models leave out, it would sag by"
            f" {100 * link.sag / link.length:.2g} % of its length; the stiffness used is that of"
            " its shape without weight"
        )
        remedy = (
            'give the shape in which it hangs, for example "catenary", or a stiffness measured in'
            " place"
        )
        yield ImplausibleNumber(Fault(key, problem, remedy))
    pendulum, least = link.weight / link.length, min(link.stiffness)
    if pendulum > LINK_PENDULUM * least:
        problem = (
            f"its weight adds some {pendulum:.2g} N/m, which the models leave out, to the"
            f" {least:.2g} N/m of its wires"
        )
        remedy = "take its stiffness as an order of magnitude, or give one that was measured"
        yield ImplausibleNumber(Fault(key, problem, remedy))
    bodies = [wire.tension for wire in carried.wires]
    if bodies and link.weight > LINK_WEIGHT * sum(bodies):
        problem = f"weighs {link.weight:.3g} N, which the models leave out"
        remedy = "add half of its mass to each of its bodies"
        yield ImplausibleNumber(Fault(key, problem, remedy))


def _stage_of(label: str) -> str:
    return label.rsplit(".", 1)[0]


def _check_stress(
    design: Design, parts: Sequence[Stress], key: str, word: str
) -> Iterator[ImplausibleNumber]:
    """Report the part with the largest stress over strength, if above 1."""
    worst = max(parts, key=lambda part: part.fraction or 0.0, default=None)
    if worst is None or worst.strength is None or (worst.fraction or 0.0) <= 1:
        return
    ratio = worst.fraction or 0.0
    problem = (
        f"{word} {worst.label} is under {_format_stress(ratio * worst.strength)}, {ratio:.3g} times"
        f" the strength of {worst.material} ({_format_stress(worst.strength)})"
    )
    remedy = (
        f"check its dimensions (m) and the masses (kg) that it carries, or make the {word} thicker"
    )
    own = design.materials.get(worst.material)
    given = own and own.tensile_strength
    if given is not None and given < 1e6:
        hint = suggest_unit(1.0, lambda v: ratio / v <= 1, (("MPa", 1e6), ("GPa", 1e9)))
        remedy = f"tensile_strength = {given:g}: {hint}" if hint else remedy
    yield ImplausibleNumber(Fault(key, problem, remedy), serious=True)


def _format_stress(stress: float) -> str:
    return f"{stress / 1e9:.3g} GPa" if stress >= 1e9 else f"{stress / 1e6:.3g} MPa"


def _check_strain(stage: Stage, wires: list[WireLoad], path: str) -> Iterator[ImplausibleNumber]:
    """Report the wire with the largest strain, if above `STRAIN`."""
    both = [*zip(wires, list_wire_tables(stage), strict=True)]
    if not both:
        return
    wire, table = max(both, key=lambda pair: pair[0].stretch / pair[0].length)
    strain = wire.stretch / wire.length
    if strain <= STRAIN:
        return
    number = wire.label.rsplit(".", 1)[1]
    key = f"{path}.wires" if stage.wires is not None else f"{path}.wire.{number}"
    problem = (
        f"wire {wire.label} is stretched by {100 * strain:.3g} % of its length, too far for a wire"
    )
    if table.k is not None:
        hint = suggest_unit(1.0, lambda v: strain / v <= STRAIN, (("N/mm", 1e3),))
        fault = Fault(f"{key}.k", problem, hint or "give k in N/m", format_value(table.k))
        yield ImplausibleNumber(fault, serious=wire.stress is not None)
        return
    remedy = "check its cross-section, Young's modulus (Pa) and the masses (kg) that it carries"
    if strain > 1e3 and (wire.fraction or 0.0) <= 1.0:  # a sound stress: the modulus is wrong
        hint = suggest_unit(1.0, lambda v: strain / v <= 0.5, (("MPa", 1e6), ("GPa", 1e9)))
        remedy = f"Young's modulus of {wire.material}: {hint}" if hint else remedy
    yield ImplausibleNumber(Fault(key, problem, remedy), serious=True)


def _check_sag(stage: Stage, blades: list[BladeLoad], path: str) -> Iterator[ImplausibleNumber]:
    """Report the blade with the largest sag, if above `SAG` or its length."""
    worst = max(blades, key=lambda blade: blade.sag, default=None)
    if worst is None:
        return
    if stage.blades is not None:
        table, key = stage.blades, f"{path}.blades"
    else:
        name = worst.label.rsplit(".", 1)[1]
        table = next(blade for blade in stage.blade if blade.name == name)
        key = f"{path}.blade.{name}"
    length = None if table.geometry is None else table.geometry.length
    if worst.sag <= SAG and (length is None or worst.sag <= length):
        return
    against = "" if length is None else f" (its length is {length:g} m)"
    problem = f"blade {worst.label} sags by {worst.sag:.3g} m under {worst.load:.3g} N{against}"
    units = {"stiffness": (("N/mm", 1e3),), "uncoupled_frequency": (("kHz", 1e6),)}
    given = next((name for name in units if getattr(table, name) is not None), "")
    hint = suggest_unit(1.0, lambda v: worst.sag / v <= 1.0, units[given]) if given else ""
    remedy = hint or "check its stiffness (N/m), or its dimensions (m) and Young's modulus (Pa)"
    fault = Fault(key, problem, remedy)
    if given:
        fault = Fault(f"{key}.{given}", problem, remedy, format_value(getattr(table, given)))
    yield ImplausibleNumber(fault, serious=worst.sag > SAG)


def solve_stability(design: Design) -> tuple[str, Modes, Growth | None] | None:
    """Solve for the modes of the static stiffness, with wires that bend where the design says how.

    Returns the name of the model, the modes, and why motion grows, if it does; None if no model can
    be built.
    """
    for model in (registry.BEAM, registry.choose(design).model):
        with (
            contextlib.suppress(InputError, np.linalg.LinAlgError, ArithmeticError),
            np.errstate(all="ignore"),
        ):
            if not model.unsuitable(design):
                system = model.system(design)
                modes = eigenmodes.solve(system.constant)
                return model.name, modes, growth.find_growth(design, model, system)
    return None


def find_instability(level: str, grows: Growth | None) -> list[ImplausibleNumber]:
    """Report motion that grows, with the growth rate of its fastest mode."""
    if grows is None:
        return []
    fault = grows.fault
    problem = fault.problem.replace(":", f" in the {level} model:", 1)
    remedy = f"{fault.remedy}, or stiffen the flexures of legs" if grows.static else fault.remedy
    return [ImplausibleNumber(replace(fault, problem=problem, remedy=remedy))]


def find_serious(design: Design) -> list[ImplausibleNumber]:
    """Find implausible numbers and loads that make results meaningless.

    A design without equilibrium has no loads.
    """
    found = plausibility.find_implausible(design)
    with contextlib.suppress(InputError):
        found += find_implausible_loads(design, statics.solve(design))
    return [item for item in found if item.serious]
