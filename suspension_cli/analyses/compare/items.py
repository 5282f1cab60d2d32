"""Reading of designs, results files and measurements that are compared."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from suspension_cli.analyses import options
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value
from suspension_cli.files.declared import in_unit
from suspension_cli.scene.arrays import Array

if TYPE_CHECKING:
    from jaxtyping import Complex, Float

    from suspension_cli.analyses.analysis import Run
    from suspension_cli.analyses.record import Record
    from suspension_cli.design.measured import Measured, Mode
    from suspension_cli.design.reader import Source
    from suspension_cli.measurements.transfer_function import MeasuredResponse

    Given = str | Path | Record | Source

COMPARED = ("modes", "response", "thermal")
"""Results that can be compared."""
RESULT = (".h5", ".hdf5")
"""Endings of results files."""
MEASUREMENT = (".csv", ".txt", ".dat", ".xml", ".h5", ".hdf5")
"""Endings of files of measured data."""
MEASURED_TABLES = ("mode", "quantity", "transfer_function")
"""Tables by which a file of measurements is known."""


class CurveName(NamedTuple):
    """What a curve shows: its kind ("response" or "noise"), output, and input ("" of a noise)."""

    kind: str
    output: str
    input: str


@dataclass(frozen=True)
class Curve:
    """A response, or amplitude spectral density of a noise, and its ratio to the reference.

    `item` is the number of the item, from 0. Uncertainties are those of measured real and imaginary
    parts; NaN where unknown. The ratio of the reference is empty. `fine` is the value of a model at
    more frequencies, which resolve resonances; None if measured, or where a file has none.
    """

    item: int
    frequency: Float[np.ndarray, " frequency"] = field(metadata=in_unit("Hz"))
    value: Complex[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    uncertainty: Float[np.ndarray, " frequency"] = field(metadata=in_unit("{unit}"))
    ratio_frequency: Float[np.ndarray, " ratio_frequency"] = field(
        default_factory=lambda: np.zeros(0), metadata=in_unit("Hz")
    )
    ratio: Complex[np.ndarray, " ratio_frequency"] = field(
        default_factory=lambda: np.zeros(0, dtype=complex)
    )
    fine_frequency: Float[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("Hz")
    )
    fine: Complex[np.ndarray, " fine_frequency"] | None = field(
        default=None, metadata=in_unit("{unit}")
    )


@dataclass(frozen=True)
class Item:
    """A design to be analysed (`run`), a result or a measurement.

    `name` heads its column; a result has a `source`, too. `curves` are the given ones with their
    units, `modes` measured modes, `values` measured quantities by name, SI; `file` is where it was
    read.
    """

    name: str
    source: Source | None = None
    run: Run | None = None
    result: Any = None
    modes: Sequence[Mode] = ()
    curves: dict[CurveName, tuple[Curve, str]] = field(default_factory=dict)
    values: dict[str, float] = field(default_factory=dict)
    file: str = ""

    @property
    def kind(self) -> str:
        """``"design"``, ``"result"`` or ``"measurement"``."""
        if self.run:
            return "design"
        return "result" if self.result else "measurement"


def read(ask: Callable[..., Run], given: Sequence[Given]) -> Run:
    """Read all items, the variants of the first design after it, and give them different names.

    Options are those of the first design. `ask` reads one design (`Analysis.read`). Raises
    `InputError` if there are fewer than two items, none has a design, or a file is of another kind.
    """
    items = [_read(ask, one) for one in given]
    first = next((n for n, item in enumerate(items) if item.source is not None), None)
    if first is None:
        problem = "only measurements are given"
        raise InputError([Fault("", problem, "name a design or a result beside them")])
    base = items[first]
    run = base.run or ask(base.source)
    changes = run.setting["variants"]
    if changes and base.run is None:
        problem = "needs a design to change"
        remedy = "name the design, not a result"
        raise InputError.of("--variant", problem, remedy, format_value(changes[0]))
    items[first + 1 : first + 1] = [_variant(ask, run.source, text) for text in changes]
    if len(items) < 2:
        kinds = "designs (.toml), results (.h5) or measurements (.toml, .csv, .xml, .h5)"
        remedy = f"name {kinds}, or add a --variant of the design"
        raise InputError([Fault("", "compare needs at least two items", remedy)])
    inputs = run.setting["inputs"]
    outputs = run.setting["outputs"]
    items = [_resolve_signals(item, inputs, outputs) for item in _with_own_names(items)]
    return replace(run, inputs={"items": items})


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
        problem = "is no variant"
        remedy = 'write "d = 3 mm: stage.test.wires.d=3e-3"'
        raise InputError.of("--variant", problem, remedy, format_value(text))
    raw = reader.read_toml(base.file, base.text)
    with attribute_faults_to(base.file):
        reader.apply_overrides(raw, tuple(changes))
        whole = reader.write_toml(raw, base.text)
        run = ask(reader.Source(reader.parse(whole), whole, base.file))
    return Item(name, run.source, run)


def _read(ask: Callable[..., Run], given: Given) -> Item:
    import h5py

    from suspension_cli.analyses import known_analyses
    from suspension_cli.analyses.record import Record
    from suspension_cli.design import measured, reader
    from suspension_cli.files.hdf5 import is_results_file, open_results
    from suspension_cli.measurements.read import read_bare

    if isinstance(given, Record):
        return _of_result(given, given.run.design.file)
    if isinstance(given, reader.Source):
        run = ask(given)
        return Item(run.name, run.source, run, file=given.file)
    if not isinstance(given, (str, Path)):
        problem = "cannot be compared"
        remedy = "give designs, results or paths of files"
        raise InputError.of("items", problem, remedy, options.shown(given))
    path = Path(given)
    file = str(given)
    ending = path.suffix.lower()
    is_data = h5py.is_hdf5(path) and not is_results_file(path)
    if ending in RESULT and os.path.isfile(path) and not is_data:
        with open_results(path) as stored:  # reports what is not HDF5
            return _of_result(known_analyses.loaded(stored, file), file)
    if ending in MEASUREMENT:
        return Item(path.stem, curves=_measured(read_bare(path)), file=file)
    raw = reader.read_toml(path)
    if "stage" not in raw and any(name in raw for name in MEASURED_TABLES):
        tables = measured.read(path)
        return Item(
            path.stem,
            modes=tables.mode or (),
            curves=_measured(_calibrated(tables, path)),
            values={one.name: one.value for one in tables.quantity or ()},
            file=file,
        )
    run = ask(file)
    return Item(run.name, run.source, run, file=file)


def _measured(responses: Sequence[MeasuredResponse]) -> dict[CurveName, tuple[Curve, str]]:
    """Curves of measured responses by their signals, or by the names of channels."""
    curves = {}
    for one in responses:
        curve = Curve(0, one.frequency, one.value, one.uncertainty)
        curves[CurveName("response", one.output, one.input)] = curve, one.unit
    return curves


def curves_of(result: Any) -> dict[CurveName, tuple[Curve, str]]:
    """Curves of a result of `response` or `thermal` and their units; they have no uncertainty."""
    curves: dict[CurveName, tuple[Curve, str]] = {}

    def add(
        what: CurveName, unit: str, frequency: Array, value: Array, more: Array, fine: Array
    ) -> None:
        unknown = np.full(len(frequency), np.nan)
        curve = Curve(0, frequency, value + 0j, unknown, fine_frequency=more, fine=fine + 0j)
        curves[what] = curve, unit

    if result.run.analysis.name == "response":
        more, fine = result.curve
        for o, out in enumerate(result.output):
            for i, into in enumerate(result.input):
                values = result.frequency, result.value[:, o, i], more, fine[:, o, i]
                add(CurveName("response", out, into), result.unit[o][i], *values)
    elif result.run.analysis.name == "thermal":
        for noise, fine in zip(result.motions, result.curves, strict=True):
            both = (values for one in (noise, fine) for values in (one.frequency, one.amplitude))
            add(CurveName("noise", noise.output, ""), f"{noise.unit}/sqrt(Hz)", *both)
    return curves


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
        value = one.value / (sensed * driven)
        uncertainty = one.uncertainty / abs(sensed * driven)
        found.append(replace(one, input=into, output=output, value=value, uncertainty=uncertainty))
    return found


def _of_result(result: Record, file: str) -> Item:
    run = result.run
    if run.analysis.name not in COMPARED:
        problem = f"has results of {run.analysis.command_name}, which are not compared"
        names = f"{', '.join(COMPARED[:-1])} or {COMPARED[-1]}"
        fault = Fault("", problem, f"name results of {names}, or the designs themselves")
        raise InputError([fault], run.design.file)
    return Item(run.name, run.design, result=result, curves=curves_of(result), file=file)


def _with_own_names(items: list[Item]) -> list[Item]:
    """Name items of equal name after their files, then by numbers."""
    given = [item.name for item in items]
    names = [
        item.name if given.count(item.name) == 1 else Path(item.file).stem or item.name
        for item in items
    ]
    return [
        replace(item, name=f"{one} ({names[:n].count(one) + 1})" if names.count(one) > 1 else one)
        for n, (item, one) in enumerate(zip(items, names, strict=True))
    ]


def _resolve_signals(item: Item, inputs: Sequence[str], outputs: Sequence[str]) -> Item:
    """Give measured data without names of signals those of the command.

    Raises `InputError` if neither a file nor the command names its signals.
    """
    # channels (``H1:SUS-...``) are no signals
    ends = [end for what in item.curves for end in (what.output, what.input)]
    if item.kind != "measurement" or all("." in end and ":" not in end for end in ends):
        return item
    if len(inputs) != 1 or len(outputs) != 1 or len(item.curves) != 1:
        problem = "does not say which signals were measured"
        remedy = "add --input and --output, one each, or describe it in a TOML file"
        raise InputError([Fault("", problem, remedy, format_value(item.name))], item.file)
    curve = next(iter(item.curves.values()))
    return replace(item, curves={CurveName("response", outputs[0], inputs[0]): curve})
