"""Doubts about names in `[control]` and `[analysis]` tables, which only the commands that take them would refuse."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from suspension_cli.analysis import control, scalars, signals
from suspension_cli.analysis.modes import Modes
from suspension_cli.analysis.statics import wire_tables
from suspension_cli.conventions import SUPPORT
from suspension_cli.design.faults import suggestion
from suspension_cli.design.plausible import Doubt
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, shown


def of_design(design: Design, found: Modes | None, paths: Callable[[str], bool]) -> list[Doubt]:
    """Doubts about names in `[control]` and `[analysis]` tables that mean nothing in this design.

    Parameters
    ----------
    design : Design
    found : Modes or None
        Its modes, for their labels; those are not looked at if there are none.
    paths : callable
        Whether a dotted path leads to a table of the design.
    """
    stages = tuple(stage.name for stage in design.stage)
    known = (SUPPORT, *stages, *(("frame",) if design.support is not None else ()))
    doubts: list[Doubt] = []
    for loop in design.control.loop if design.control is not None else ():
        doubts += _refused(lambda loop=loop: control.sensor_of(loop, stages, known))
        doubts += _refused(lambda loop=loop: control.actuator_of(loop, known))
    wires = [f"{stage.name}.{n}" for stage in design.stage for n in range(1, len(wire_tables(stage)) + 1)]
    for command, table in design.analysis.items():
        for key, value in table.items():
            where = f"analysis.{command}.{key}"
            texts = [text for text in (value if isinstance(value, list) else [value]) if isinstance(text, str)]
            if "." in key and not paths(key.rpartition(".")[0]):
                doubts.append(Doubt(Fault(where, "leads to no table of the design", "write the path as in the file: stage.test.wires.d")))
            for text in texts:
                doubts += _name(key, text, where, (known, stages, wires), paths, found)
    return doubts


def _name(key: str, text: str, where: str, names: Any, paths: Callable[[str], bool], found: Modes | None) -> list[Doubt]:
    """A doubt about one name in an `[analysis]` table."""
    known, stages, wires = names
    if key in ("input", "output", "over", "under", "impulse"):
        return _refused(lambda: signals.parse(text, where, known))
    if key == "observe":
        return _refused(lambda: signals.parse(f"{text.partition('@')[0]}.x", where, known), text)
    if key in ("wire", "body"):
        choices = wires if key == "wire" else list(stages)
        return [] if text in choices else [Doubt(Fault(where, f"names no {'wire' if key == 'wire' else 'stage'}", suggestion(text, choices), shown(text)))]
    if key == "vary":
        path = text.partition("=")[0].strip()
        return [] if paths(path.rpartition(".")[0]) else [Doubt(Fault(where, "leads to no table of the design", "write PATH=GRID", shown(text)))]
    if key == "result" and found is not None:
        return _refused(lambda: scalars.parse([text], found, known, where))
    return []


def _refused(name: Callable[[], object], text: str | None = None) -> list[Doubt]:
    """The faults with which a name is refused, as doubts: it is the command that takes the name which cannot run, not the others."""
    try:
        name()
    except InputError as error:
        return [Doubt(fault if text is None else replace(fault, value=shown(text))) for fault in error.faults]
    return []
