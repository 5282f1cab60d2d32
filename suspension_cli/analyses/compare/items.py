"""Reading of designs, results files and measurements that are compared."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value

if TYPE_CHECKING:
    from suspension_cli.analyses.analysis import Result, Run
    from suspension_cli.design.measured import Measured, Mode
    from suspension_cli.design.reader import Source
    from suspension_cli.measurements.transfer_function import MeasuredResponse

    Given = str | Path | Result | Source

COMPARED = ("modes", "response", "thermal")
"""Results that can be compared."""
RESULT, MEASUREMENT = (".h5", ".hdf5"), (".csv", ".txt", ".dat", ".xml", ".h5", ".hdf5")
"""Endings of results files, and of files of measured data."""


@dataclass(frozen=True)
class Item:
    """A design to be analysed (`run`), a result or a measurement.

    `name` heads its column; a result has a `source`, too.
    """

    name: str
    source: Source | None = None
    run: Run | None = None
    result: Result | None = None
    modes: Sequence[Mode] = ()
    responses: Sequence[MeasuredResponse] = ()

    @property
    def kind(self) -> str:
        """``"design"``, ``"result"`` or ``"measurement"``."""
        return "design" if self.run else "result" if self.result else "measurement"


def read(ask: Callable[..., Run], given: Sequence[Given]) -> list[Item]:
    """Read all items, the variants of the first design after it, and give them different names.

    Parameters
    ----------
    ask : callable
        Reads one design, see `Analysis.read`.
    given : sequence
        Paths of files, or results and designs of the Python API.

    Raises
    ------
    InputError
        If there are fewer than two items, none has a design, or a file is of another kind.
    """
    items, files = [_read(ask, one) for one in given], [*given]
    if all(item.source is None for item in items):
        problem = "only measurements are given"
        raise InputError([Fault("", problem, "name a design or a result beside them")])
    first = next(n for n, item in enumerate(items) if item.source is not None)
    base = items[first]
    run = base.run or ask(base.source)
    changes = run.setting["variants"]
    if changes and base.run is None:
        problem, remedy = "needs a design to change", "name the design, not a result"
        raise InputError.of("--variant", problem, remedy, format_value(changes[0]))
    made = [_variant(ask, run.source, text) for text in changes]
    items[first + 1 : first + 1] = made
    files[first + 1 : first + 1] = [item.name for item in made]
    if len(items) < 2:
        problem = "compare needs at least two items"
        remedy = (
            "name designs (.toml), results (.h5) or measurements (.toml, .csv, .xml, .h5), or add"
            " a --variant of the design"
        )
        raise InputError([Fault("", problem, remedy)])
    return _with_own_names(items, files)


def _variant(ask: Callable[..., Run], base: Source, text: str) -> Item:
    """Read the design with the changes of ``NAME: PATH=VALUE; PATH=VALUE``.

    Without NAME, the changes are the name.
    """
    from suspension_cli.design import reader

    head, colon, tail = text.partition(":")
    named = bool(colon) and "=" in tail
    changes = [part.strip() for part in (tail if named else text).split(";")]
    name = head.strip() if named else ", ".join(one.removeprefix("stage.") for one in changes)
    if not name or not all("=" in change for change in changes):
        problem, remedy = "is no variant", 'write "d = 3 mm: stage.test.wires.d=3e-3"'
        raise InputError.of("--variant", problem, remedy, format_value(text))
    raw = reader.read_toml(base.file, base.text)
    with attribute_faults_to(base.file):
        reader.apply_overrides(raw, tuple(changes))
        whole = reader.write_toml(raw)
        run = ask(reader.Source(reader.parse(whole), whole, base.file))
    return Item(name, run.source, run)


def _read(ask: Callable[..., Run], given: Given) -> Item:
    from suspension_cli.analyses.analysis import Result
    from suspension_cli.design import measured, reader

    if isinstance(given, Result):
        return _of_result(given)
    if isinstance(given, reader.Source):
        run = ask(given)
        return Item(run.name, run.source, run)
    if not isinstance(given, (str, Path)):
        problem, remedy = "cannot be compared", "give designs, results or paths of files"
        raise InputError.of("items", problem, remedy, format_value(repr(given)).strip('"'))
    path = Path(given)
    ending = path.suffix.lower()
    if ending in RESULT and os.path.isfile(path):
        found = _result(path)
        if found is not None:
            return _of_result(found)
    if ending in MEASUREMENT:
        from suspension_cli.measurements.read import read_bare

        return Item(path.stem, responses=read_bare(path))
    raw = reader.read_toml(path)
    if "stage" not in raw and {"mode", "transfer_function"} & set(raw):
        tables = measured.read(path)
        return Item(path.stem, modes=tables.mode or (), responses=_calibrated(tables, path))
    run = ask(str(given))
    return Item(run.name, run.source, run)


def _calibrated(tables: Measured, path: Path) -> list[MeasuredResponse]:
    """Read transfer functions, converted from readings and drives to signals of the design."""
    from suspension_cli.measurements.read import read_all
    from suspension_cli.measurements.transfer_function import Channels

    found = []
    for one in read_all(tables, path):
        channels = Channels.of(tables, [one])
        for end in (item for side in channels.transducer for item in side.values()):
            if end.mix:
                problem = "has a mix, so it reads several signals of the design at once"
                remedy = "compare it with pendsus response DESIGN --measured FILE"
                raise InputError([Fault("", problem, remedy, format_value(end.name))], str(path))
        sensed, driven = (channels.weights(side, one.frequency)[:, 0, 0] for side in (0, 1))
        output, into = (names[0] for names in channels.signal)
        value, uncertainty = one.value / (sensed * driven), one.uncertainty / abs(sensed * driven)
        found.append(replace(one, input=into, output=output, value=value, uncertainty=uncertainty))
    return found


def _result(path: Path) -> Result | None:
    """Read a results file of pendsus; None if it is HDF5 from elsewhere."""
    import h5py

    from suspension_cli.analyses import registry
    from suspension_cli.files.hdf5 import is_results_file, open_results

    if h5py.is_hdf5(path) and not is_results_file(path):
        return None
    with open_results(path) as file:  # reports what is not HDF5
        return registry.loaded(file, str(path))


def _of_result(result: Result) -> Item:
    if result.analysis.name not in COMPARED:
        problem = f"has results of {result.analysis.command_name}, which are not compared"
        names = f"{', '.join(COMPARED[:-1])} or {COMPARED[-1]}"
        fault = Fault("", problem, f"name results of {names}, or the designs themselves")
        raise InputError([fault], result.source.file)
    return Item(result.name, result.source, result=result)


def _with_own_names(items: list[Item], given: Sequence[Given]) -> list[Item]:
    """Name items of equal name after their files, then by numbers."""

    def name(n: int, item: Item) -> str:
        if [other.name for other in items].count(item.name) == 1:
            return item.name
        one = given[n]
        path = one if isinstance(one, (str, Path)) else item.source and item.source.file
        return Path(path).stem if path else item.name

    names = [name(n, item) for n, item in enumerate(items)]
    numbered = [
        f"{one} ({names[: n + 1].count(one)})" if names.count(one) > 1 else one
        for n, one in enumerate(names)
    ]
    return [replace(item, name=one) for item, one in zip(items, numbered, strict=True)]


def resolve_signals(item: Item, inputs: Sequence[str], outputs: Sequence[str]) -> Item:
    """Give data without names the signals of the command.

    Raises
    ------
    InputError
        If neither a file nor the command names its signals.
    """
    if all(_is_signal(one.input) and _is_signal(one.output) for one in item.responses):
        return item
    first = item.responses[0]
    if len(inputs) != 1 or len(outputs) != 1 or len(item.responses) != 1:
        problem = "does not say which signals were measured"
        remedy = "add --input and --output, one each, or describe it in a TOML file"
        raise InputError([Fault("", problem, remedy, format_value(item.name))], first.file)
    return replace(item, responses=[replace(first, input=inputs[0], output=outputs[0])])


def _is_signal(name: str) -> bool:
    """Whether a name is that of a signal, not of a channel (``H1:SUS-...``) or empty."""
    return "." in name and ":" not in name
