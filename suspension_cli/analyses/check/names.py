"""Unknown names in `[analysis]` tables and in tables that a single analysis reads.

These are warnings: only the command that uses a name refuses it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from suspension_cli.analyses import registry
from suspension_cli.analyses.check.statics import list_wire_tables
from suspension_cli.conventions import ANALYSES, FRAME, GROUND, SUPPORT
from suspension_cli.design.faults import suggest
from suspension_cli.design.plausibility import ImplausibleNumber
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value
from suspension_cli.linear import named_results, signals
from suspension_cli.linear.eigenmodes import Modes

NO_TABLE = "does not lead to a table of the design"


def find_unknown_names(
    design: Design, found: Modes | None, paths: Callable[[str], bool]
) -> list[ImplausibleNumber]:
    """Find names in a design that nothing in it has.

    Labels of modes are checked if modes are `found`. `paths` is whether a dotted path leads to
    a table of the design.
    """
    stages = tuple(stage.name for stage in design.stage)
    frame = (FRAME,) if design.support is not None else ()
    on_ground = any(GROUND in item.between for _, item in design.between_bodies)
    known = (SUPPORT, *stages, *frame, *((GROUND,) if on_ground else ()))
    unknown: list[ImplausibleNumber] = []
    for analysis in map(registry.get, ANALYSES):
        for parse in analysis.parse_names(design, stages, known):
            unknown += _collect_faults(parse)
        if found is not None:
            for parse in analysis.parse_results(design, found, stages, known):
                unknown += _collect_faults(parse)
    wires = [
        f"{stage.name}.{n}"
        for stage in design.stage
        for n in range(1, len(list_wire_tables(stage)) + 1)
    ]
    for command, table in design.analysis.items():
        for key, value in table.items():
            where = f"analysis.{command}.{key}"
            if "." in key and not paths(key.rpartition(".")[0]):
                remedy = "write the path as in the file: stage.test.wires.d"
                unknown.append(ImplausibleNumber(Fault(where, NO_TABLE, remedy)))
            for text in value if isinstance(value, list) else [value]:
                if isinstance(text, str):
                    unknown += _check_name(key, text, where, (known, stages, wires), paths, found)
    return unknown


def _check_name(
    key: str,
    text: str,
    where: str,
    names: tuple[tuple[str, ...], tuple[str, ...], list[str]],
    paths: Callable[[str], bool],
    found: Modes | None,
) -> list[ImplausibleNumber]:
    """Check one name in an `[analysis]` table."""
    known, stages, wires = names
    if key in ("input", "output", "over", "under", "impulse"):
        return _collect_faults(lambda: signals.parse(text, where, known))
    if key == "observe":
        return _collect_faults(
            lambda: signals.parse(f"{text.partition('@')[0]}.x", where, known), text
        )
    if key in ("wire", "body"):
        choices, word = (wires, "wire") if key == "wire" else (list(stages), "stage")
        if text in choices:
            return []
        fault = Fault(where, f"names no {word}", suggest(text, choices), format_value(text))
        return [ImplausibleNumber(fault)]
    if key == "vary":
        if paths(text.partition("=")[0].strip().rpartition(".")[0]):
            return []
        return [ImplausibleNumber(Fault(where, NO_TABLE, "write PATH=GRID", format_value(text)))]
    if key == "result" and found is not None:
        return _collect_faults(lambda: named_results.parse([text], found, known, where))
    return []


def _collect_faults(
    parse: Callable[[], object], text: str | None = None
) -> list[ImplausibleNumber]:
    """Faults that parsing a name raises, as warnings, with `text` as their value if given."""
    try:
        parse()
    except InputError as error:
        given = {} if text is None else {"value": format_value(text)}
        return [ImplausibleNumber(replace(fault, **given)) for fault in error.faults]
    return []
