"""Doubts about a design that take its statics or its modes; those about its numbers alone are in `design.plausible`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from suspension_cli.analysis import auto, modes, statics
from suspension_cli.analysis.asked import Frequencies
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.statics import BladeLoad, Carried, WireLoad, wire_tables
from suspension_cli.design import plausible
from suspension_cli.design.plausible import Doubt, suspected_unit
from suspension_cli.design.schema import Design, Stage
from suspension_cli.errors import Fault, InputError, shown
from suspension_cli.models.fidelity import Choice

STRETCH = 0.03
"""Strain that wires do not bear: steel breaks at 1 %, pristine silica at 5 %, and none is used near that."""
SAG = 5.0
"""m; no blade sags so far."""


def of_loads(design: Design, carried: Carried) -> list[Doubt]:
    """Doubts about what wires and blades carry, the worst of each stage.

    Parameters
    ----------
    design : Design
    carried : Carried
        Of that design.
    """
    found: list[Doubt] = []
    for stage in design.stage:
        wires = [wire for wire in carried.wires if _stage_of(wire.label) == stage.name]
        blades = [blade for blade in carried.blades if _stage_of(blade.label) == stage.name]
        path = f"stage.{stage.name}"
        found += _stress(design, wires, f"{path}.{'wires' if stage.wires is not None else 'wire'}", "wire")
        found += _stretch(stage, wires, path)
        found += _stress(design, blades, f"{path}.{'blades' if stage.blades is not None else 'blade'}", "blade")
        found += _sag(stage, blades, path)
    return found


def _stage_of(label: str) -> str:
    return label.rsplit(".", 1)[0]


def _stress(design: Design, parts: list[WireLoad] | list[BladeLoad], key: str, word: str) -> Iterator[Doubt]:
    """The part nearest to breaking, if it is beyond."""
    worst = max((part for part in parts if part.share is not None), key=lambda part: part.share or 0.0, default=None)
    if worst is None or worst.share is None or worst.strength is None or worst.share <= 1:
        return
    share = worst.share
    given = design.materials[worst.material].tensile_strength if worst.material in design.materials else None
    hint = suspected_unit(1.0, lambda v: share / v <= 1, (("MPa", 1e6), ("GPa", 1e9))) if given is not None and given < 1e6 else ""
    name = f"tensile_strength = {given:g}: " if hint else ""
    stress = share * worst.strength
    problem = f"{word} {worst.label} is under {_pascal(stress)}, {share:.3g} times the strength of {worst.material} ({_pascal(worst.strength)})"
    remedy = name + hint if hint else f"check its dimensions (m) and the masses (kg) that it carries, or make the {word} thicker"
    yield Doubt(Fault(key, problem, remedy), serious=True)


def _pascal(stress: float) -> str:
    return f"{stress / 1e9:.3g} GPa" if stress >= 1e9 else f"{stress / 1e6:.3g} MPa"


def _stretch(stage: Stage, wires: list[WireLoad], path: str) -> Iterator[Doubt]:
    """The wire that is strained most, if it is too much."""
    strained = [(wire.stretch / wire.length, wire, table) for wire, table in zip(wires, wire_tables(stage), strict=True)]
    strain, wire, table = max(strained, key=lambda item: item[0], default=(0.0, None, None))
    if wire is None or table is None or strain <= STRETCH:
        return
    key = f"{path}.wires" if stage.wires is not None else f"{path}.wire.{wire.label.rsplit('.', 1)[1]}"
    problem = f"wire {wire.label} is stretched by {100 * strain:.3g} % of its length, which no wire bears"
    if table.k is not None:
        hint = suspected_unit(1.0, lambda v: strain / v <= STRETCH, (("N/mm", 1e3),))
        yield Doubt(Fault(f"{key}.k", problem, hint or "give k in N/m", shown(table.k)), serious=wire.stress is not None)
        return
    hint = suspected_unit(1.0, lambda v: strain / v <= 0.5, (("MPa", 1e6), ("GPa", 1e9))) if strain > 1e3 else ""
    remedy = f"Young's modulus of {wire.material}: {hint}" if hint else "check its cross-section, Young's modulus (Pa) and the masses (kg) that it carries"
    yield Doubt(Fault(key, problem, remedy), serious=True)


def _sag(stage: Stage, blades: list[BladeLoad], path: str) -> Iterator[Doubt]:
    """The blade that sags most, if it is further than a blade can."""
    worst = max(blades, key=lambda blade: blade.sag, default=None)
    if worst is None:
        return
    table = stage.blades if stage.blades is not None else next(blade for blade in stage.blade if blade.name == worst.label.rsplit(".", 1)[1])
    key = f"{path}.blades" if stage.blades is not None else f"{path}.blade.{worst.label.rsplit('.', 1)[1]}"
    length = None if table.geometry is None else table.geometry.length
    if worst.sag <= SAG and (length is None or worst.sag <= length):
        return
    against = "" if length is None else f", and is {length:g} m long"
    problem = f"blade {worst.label} sags by {worst.sag:.3g} m under {worst.load:.3g} N{against}"
    given = "stiffness" if table.stiffness is not None else "uncoupled_frequency" if table.uncoupled_frequency is not None else ""
    units = {"stiffness": (("N/mm", 1e3),), "uncoupled_frequency": (("kHz", 1e6),)}
    hint = suspected_unit(1.0, lambda v: worst.sag / v <= 1.0, units[given]) if given else ""
    remedy = hint or "check its stiffness (N/m), or its dimensions (m) and Young's modulus (Pa)"
    yield Doubt(Fault(f"{key}.{given}" if given else key, problem, remedy, shown(getattr(table, given)) if given else None), serious=worst.sag > SAG)


def stability(design: Design) -> tuple[Choice, Modes] | None:
    """The model that `auto` takes for the frequencies, and the modes of its static stiffness; None if it cannot be built."""
    try:
        with np.errstate(all="ignore"):
            decision = auto.decide(design, lambda _: Frequencies())
            return decision.choice, modes.solve(replace(decision.model, terms=()))
    except (InputError, np.linalg.LinAlgError, ArithmeticError):
        return None


def of_modes(choice: Choice, found: Modes) -> list[Doubt]:
    """A doubt about an equilibrium that is unstable."""
    if found.stable:
        return []
    worst = f"{found.label[0]} grows at {found.growth_rate[0]:.4g} 1/s"
    return [Doubt(Fault("stage", f"the equilibrium is unstable in the {choice.level} model: {worst}", "attach wires higher above the COM (raise d, say)"))]


def serious(design: Design) -> list[Doubt]:
    """The doubts with which the answers of an analysis mean nothing; loads are left out where they cannot be found."""
    found = plausible.of_design(design)
    with contextlib.suppress(InputError):
        found += of_loads(design, statics.solve(design))
    return [doubt for doubt in found if doubt.serious]
