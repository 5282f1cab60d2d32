"""Check of a design: whether it balances, its loads, and what is implausible in it.

>>> import suspension_cli as sus
>>> found = sus.check(sus.template("single"))
>>> found.stable, len(found.warnings), round(found.statics.wires[0].tension, 2)
(True, 0, 13.75)
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from suspension_cli.analyses import verdicts
from suspension_cli.analyses.named_quantities import names_of
from suspension_cli.analyses.record import Record
from suspension_cli.conventions import ANALYSES, FRAME, GROUND, SUPPORT
from suspension_cli.design import checks
from suspension_cli.design.checks import ImplausibleNumber
from suspension_cli.design.paths import value_at
from suspension_cli.design.schema import Design
from suspension_cli.errors import Fault, InputError, format_value, suggest
from suspension_cli.linear import signals
from suspension_cli.linear.eigenmodes import Modes
from suspension_cli.models import registry
from suspension_cli.physics import statics
from suspension_cli.physics.loads import Statics, WireWeights
from suspension_cli.physics.near_limits import find_implausible_loads, find_slackest, find_stability
from suspension_cli.physics.statics import list_wire_tables
from suspension_cli.physics.temperatures import find_unknown_temperatures
from suspension_cli.quantities import requirements, vocabulary
from suspension_cli.quantities.kinds.modes import ALL
from suspension_cli.quantities.names import Names
from suspension_cli.quantities.requirements import Verdict

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Analysis, Run
    from suspension_cli.design.reader import Source


@dataclass(frozen=True, eq=False, repr=False)
class Check(Record):
    """A valid design: loads of its wires and blades, and implausible numbers.

    Its model is the simplest that is valid.

    Attributes
    ----------
    statics : Statics
        Loads of wires, blades, links and legs, and the pose.
    stable, stability_model : bool, str or None
        Whether it is stable, and in which model; None if not computed.
    warnings : list of ImplausibleNumber
        What is valid but implausible.
    verdicts : tuple of Verdict
        Values of what `[[requirement]]` limits, in the stability model.
    """

    statics: Statics
    stable: bool | None
    stability_model: str | None
    warnings: list[ImplausibleNumber]
    verdicts: tuple[Verdict, ...] = ()

    @property
    def weights(self) -> WireWeights | None:
        """Weight of the wires; None if no density is known."""
        return self.statics.weights


def check(analysis: Analysis, run: Run) -> Check:
    """Check a design, and warn of what is implausible.

    Raises
    ------
    InputError
        If it does not balance, with the implausible numbers that may be the reason.
    """
    source = run.source
    design = source.design
    found = checks.find_implausible(design)
    try:
        choice = registry.choose(design)
        loads = statics.solve(design)
    except InputError as error:
        raise InputError([*error.faults, *found], source.file) from None
    found += find_implausible_loads(design, loads)
    model, modes, unstable = find_stability(design)
    level = registry.most_complete(design).name
    unknown = find_unknown_temperatures(design, level)
    found += [ImplausibleNumber.of(fault) for fault in unknown]
    found += [ImplausibleNumber.of(fault) for fault in checks.find_without_drag(design)]
    found += [*unstable, *find_slackest(loads)]
    found += find_unknown_names(source, modes)
    found_verdicts = verdicts.judge(source, model, run.log)
    stable = None if model is None else not unstable
    for item in found:
        run.log.warn(f"{run.name}: {item.line('')}")
    origin = run.origin(analysis, choice)
    return Check(loads, stable, model, found, found_verdicts, run=origin)


def find_unknown_names(source: Source, found: Modes | None) -> list[ImplausibleNumber]:
    """Find unknown names in a design; those of quantities if modes are `found`."""
    from suspension_cli.analyses import known_analyses

    design = source.design
    raw = tomllib.loads(source.text)
    stages = tuple(stage.name for stage in design.stage)
    frame = (FRAME,) if design.support is not None else ()
    on_ground = any(GROUND in item.between for _, item in design.between_bodies)
    known = (SUPPORT, *stages, *frame, *((GROUND,) if on_ground else ()))
    wires = [
        f"{stage.name}.{n}"
        for stage in design.stage
        for n in range(1, len(list_wire_tables(stage)) + 1)
    ]

    def parse_signal(text: str) -> None:
        signals.parse(text, "", known)

    def parse_path(path: str, remedy: str = "write PATH=GRID") -> None:
        table = path.partition("=")[0].strip().rpartition(".")[0]
        if value_at(raw, table) is None:
            raise InputError([Fault("", "does not lead to a table of the design", remedy)])

    def parse_among(names: list[str], kind: str, text: str) -> None:
        if text not in names:
            raise InputError([Fault("", f"names no {kind}", suggest(text, names))])

    unknown: list[ImplausibleNumber] = []
    for analysis in map(known_analyses.get, ANALYSES):
        parsers = analysis.parse_names(design, stages, known)
        unknown += [warning for parse in parsers for warning in _collect_faults(parse)]
    if found is not None:
        limits = requirements.of_tolerance(design)
        unknown += _collect_faults(partial(requirements.find, limits, names_of(source)))
    parse_text: dict[str, Callable[[str], object]] = {
        **dict.fromkeys(("input", "output", "over", "under", "impulse"), parse_signal),
        "observe": lambda text: parse_signal(f"{text.partition('@')[0]}.x"),
        "wire": partial(parse_among, wires, "wire"),
        "body": partial(parse_among, [*stages], "stage"),
        "vary": parse_path,
        "result": partial(_parse_quantity, names_of(source) if found is not None else None),
    }
    for where, key, value in _analysis_keys(design):
        if "." in key:
            parse = partial(parse_path, key, "write the path as in the file: stage.test.wires.d")
            unknown += [replace(item, key=where) for item in _collect_faults(parse)]
        elif key in parse_text and isinstance(value, str):
            faults = _collect_faults(partial(parse_text[key], value))
            unknown += [replace(item, key=where, value=format_value(value)) for item in faults]
    return unknown


def _parse_quantity(names: Names | None, text: str) -> None:
    """Raise `InputError` if a design has no such quantity; nothing is known without modes."""
    if names is not None and text != ALL:
        vocabulary.parse(text, names, "")


def _analysis_keys(design: Design) -> Iterator[tuple[str, str, object]]:
    """Iterate over paths, keys and values of the defaults of commands; over lists of texts too."""
    for command, table in design.analysis.items():
        for key, value in table.items():
            for text in value if isinstance(value, list) and "." not in key else [value]:
                yield f"analysis.{command}.{key}", key, text


def _collect_faults(parse: Callable[[], object]) -> list[ImplausibleNumber]:
    """Return the faults of parsing a name as warnings."""
    try:
        parse()
    except InputError as error:
        return [ImplausibleNumber.of(fault) for fault in error.faults]
    return []
