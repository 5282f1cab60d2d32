"""Files of measurements: modes, transfer functions, and the numbers to fit to them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal, Protocol

import msgspec
from msgspec import Meta

from suspension_cli.design import faults, reader
from suspension_cli.design.faults import fault_of
from suspension_cli.design.units import Frequency, Schema, Stem, Table, doc, of_unit
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value

Number = Annotated[float, Meta(ge=-1e20, le=1e20)]
Positive = Annotated[float, Meta(gt=0, le=1e20)]


class Mode(Table, frozen=True):
    """One measured mode."""

    frequency: Frequency
    uncertainty: Annotated[float, of_unit("Hz", "standard deviation, Hz", gt=0, le=1e6)]
    label: (
        Annotated[
            str,
            doc("as pendsus modes prints it with the model of the fit; default: the nearest mode"),
        ]
        | None
    ) = None
    dof: (
        Annotated[
            list[Literal["x", "y", "z", "roll", "pitch", "yaw"]],
            doc("without a label: coordinates of which one must dominate the mode", min_length=1),
        ]
        | None
    ) = None


Column = Annotated[str, Meta(min_length=1)] | Annotated[int, Meta(ge=1)]
"""Heading of a column of a text file, or its number from 1; name of a dataset or of a channel."""

Factor = Annotated[float, Meta(ge=-1e20, le=1e20)]


class TransferFunction(Table, frozen=True):
    """A measured transfer function in a file of data, output over input.

    The complex value stands in two columns, `real` and `imaginary` or `magnitude` and `phase`, or
    in one dataset of complex numbers, `value`. In DTT XML, `input` and `output` are found by
    `input_channel` and `output_channel`.
    """

    file: Annotated[
        str,
        doc("CSV or text, HDF5, or DTT XML; from the folder of this file", min_length=1),
    ]
    input: Annotated[str, doc("what was driven: a signal of the design, or an [[actuator]]")]
    output: Annotated[str, doc("what was observed: a signal of the design, or a [[sensor]]")]
    name: Annotated[str, doc("default: the stem of the file")] | None = None
    frequency: Column | None = None
    real: Column | None = None
    imaginary: Column | None = None
    magnitude: Column | None = None
    phase: Column | None = None
    value: Column | None = None
    coherence: Column | None = None
    uncertainty: (
        Annotated[
            Column | Annotated[float, Meta(gt=0, le=10)],
            doc(
                "column of the standard deviation of real and imaginary part, in the unit of"
                " the value; or a number, relative to the value"
            ),
        ]
        | None
    ) = None
    input_channel: str | None = None
    output_channel: str | None = None
    magnitude_unit: (
        Annotated[Literal["1", "dB"], doc('"1" or "dB"; default: that of the heading, or 1')] | None
    ) = None
    phase_unit: (
        Annotated[
            Literal["deg", "rad"],
            doc('"deg" or "rad"; default: that of the heading, or deg'),
        ]
        | None
    ) = None
    frequency_unit: (
        Annotated[
            Literal["Hz", "rad/s"],
            doc('"Hz" or "rad/s"; default: that of the heading, or Hz'),
        ]
        | None
    ) = None
    averages: (
        Annotated[
            float,
            doc("number of averages; with the coherence, gives the uncertainty", ge=1, le=1e9),
        ]
        | None
    ) = None
    gain: Annotated[Factor, doc("factor from the file's numbers to SI units: 1e-6 for um/N")] = 1.0
    band: (
        Annotated[
            list[Frequency],
            doc("use frequencies from, to, Hz", min_length=2, max_length=2),
        ]
        | None
    ) = None


class Transducer(Table, frozen=True):
    """A sensor or an actuator: how its channel relates to signals of the design.

    A sensor reads ``gain exp(-2 pi i f delay) (signal + sum of mix[other] other)``; an actuator
    with a drive of 1 exerts this combination of forces. Gains and entries of `mix` with an
    uncertainty are fitted, with that prior; `mix` covers misalignment (a sensor of upper.x that is
    turned by 0.01 rad reads 0.01 upper.y too) and cross-talk.
    """

    name: Annotated[str, Meta(pattern=r"^[A-Za-z][A-Za-z0-9_:-]*$", max_length=60)]
    signal: Annotated[str, doc("upper.x (sensor), upper.force_x (actuator)")]
    gain: Annotated[
        Factor, doc("reading over signal (a sensor), force over drive (an actuator)")
    ] = 1.0
    gain_uncertainty: (
        Annotated[
            float,
            doc("relative standard deviation; the gain is then fitted", gt=0, le=10),
        ]
        | None
    ) = None
    sign_known: Annotated[bool, doc("false: fit tries the other sign of the gain, too")] = True
    delay: Annotated[float, doc("delay of the channel, s", ge=-10, le=10)] = 0.0
    delay_uncertainty: (
        Annotated[float, doc("standard deviation, s; the delay is then fitted", gt=0, le=10)] | None
    ) = None
    unit: (
        Annotated[
            str,
            doc("unit of the reading or the drive: V; default: SI unit of signal", max_length=20),
        ]
        | None
    ) = None
    mix: Annotated[
        dict[str, Factor], doc("other signals that the channel contains, and how much")
    ] = {}
    mix_uncertainty: Annotated[
        dict[str, Annotated[float, Meta(gt=0, le=1e20)]],
        doc("standard deviations of entries of mix, which are then fitted from 0 or mix"),
    ] = {}


class Experiment(Table, frozen=True):
    """A design and its measured modes."""

    design: Annotated[str, doc("path of a design file, from the folder of this one", min_length=1)]
    mode: Annotated[list[Mode], Meta(min_length=1)]
    name: (
        Annotated[
            Stem,
            doc("letters, digits, . _ and -, unique; default: the stem of the design file"),
        ]
        | None
    ) = None
    set: Annotated[list[str], doc("overrides as --set takes them")] = []

    @property
    def title(self) -> str:
        """Name of the experiment, given or the stem of its design file."""
        return self.name or Path(self.design).stem


class Free(Table, frozen=True):
    """One number of the design to be fitted."""

    name: Annotated[str, doc("dotted path, as --set takes it")]
    start: Annotated[Number, doc("where to begin; default: the design's value")] | None = None
    prior: Annotated[Number, doc("best value from other knowledge")] | None = None
    uncertainty: Annotated[Positive, doc("standard deviation of the prior")] | None = None
    lower: Number | None = None
    upper: Number | None = None
    experiments: (
        Annotated[
            list[str],
            doc("names of the experiments that share it; default: all", min_length=1),
        ]
        | None
    ) = None


class Measured(Table, frozen=True):
    """A file of measurements: of one design, or of modes in several experiments."""

    parameter: list[Free] = []
    mode: Annotated[list[Mode], Meta(min_length=1)] | None = None
    transfer_function: list[TransferFunction] = []
    sensor: list[Transducer] = []
    actuator: list[Transducer] = []
    experiment: Annotated[list[Experiment], Meta(min_length=1)] | None = None
    title: str = ""
    reference: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the experiments; one empty name in a file of one design."""
        return ("",) if self.experiment is None else tuple(item.title for item in self.experiment)

    @property
    def modes(self) -> tuple[list[Mode], ...]:
        """Measured modes of each experiment."""
        return (
            (self.mode or [],)
            if self.experiment is None
            else tuple(item.mode for item in self.experiment)
        )

    def where(self, n: int) -> str:
        """Key path of an experiment, as prefix for its modes."""
        return "" if self.experiment is None else f"experiment.{self.experiment[n].name or n + 1}."

    def shares(self, n: int) -> tuple[bool, ...]:
        """Whether each experiment depends on a parameter."""
        given = self.parameter[n].experiments
        return tuple(given is None or name in given for name in self.names)


def read(file: str | Path, text: str | None = None) -> Measured:
    """Read and check a file of measurements, or its text if given; raises `InputError`."""
    raw = reader.read_toml(file, text)
    with attribute_faults_to(str(file)):
        if "stage" in raw:
            problem = "is a design, not a file of measurements"
            remedy = (
                "name the design first, then a TOML file with [[mode]] or [[transfer_function]]"
            )
            raise InputError.of("", problem, remedy)
        measured = faults.convert(raw, Measured)
        found = [
            *_check_experiments(measured),
            *_check_parameters(measured),
            *_check_transducers(measured),
            *_check_transfer_functions(measured),
        ]
        if found:
            raise InputError(found)
    return measured


def json_schema() -> Schema:
    """Make the JSON Schema of files of measurements (draft 2020-12)."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "pendsus file of measurements",
    } | msgspec.json.schema(Measured)


def _check_experiments(measured: Measured) -> Iterator[Fault]:
    of_one_design = [name for name in ("mode", "transfer_function") if getattr(measured, name)]
    if not of_one_design and measured.experiment is None:
        remedy = "give [[mode]] or [[transfer_function]] for one design, or [[experiment]] with"
        yield Fault("mode", "missing", f"{remedy} modes for several")
    elif of_one_design and measured.experiment is not None:
        remedy = "write [[experiment.mode]] under each experiment"
        yield Fault(of_one_design[0], "conflicts with [[experiment]]", remedy)
    else:
        names = measured.names
        for n, (name, modes) in enumerate(zip(names, measured.modes, strict=True)):
            if name in names[:n]:
                yield _repeated(f"experiment.{n + 1}", "experiment", name)
            for m, item in enumerate(modes, 1):
                if item.label is not None and item.dof is not None:
                    path, problem = f"{measured.where(n)}mode.{m}", "conflicts with label"
                    problem = f"{problem}, which determines it"
                    yield fault_of(item, path, "dof", problem, "give one of them")


def _repeated(path: str, kind: str, name: str) -> Fault:
    """Fault of a name that an earlier table of the kind has."""
    problem = f"is also the name of an earlier {kind}"
    return Fault(f"{path}.name", problem, "give each its own name", format_value(name))


def _check_transducers(measured: Measured) -> Iterator[Fault]:
    for kind, among in (("sensor", measured.sensor), ("actuator", measured.actuator)):
        for n, one in enumerate(among):
            path = f"{kind}.{one.name}"
            if one.name in [other.name for other in among[:n]]:
                yield _repeated(f"{kind}.{n + 1}", kind, one.name)
            if one.gain == 0:
                yield Fault(f"{path}.gain", "must not be zero", "give the gain", "0")
            for key, name in [("signal", one.signal), *(("mix", name) for name in one.mix)]:
                if "." not in name:
                    example = "upper.x" if kind == "sensor" else "upper.force_x"
                    remedy = f"write a body and a direction: {example}"
                    yield Fault(f"{path}.{key}", "is not a signal", remedy, format_value(name))


def _check_transfer_functions(measured: Measured) -> Iterator[Fault]:
    names = [one.name for one in measured.transfer_function]
    for n, one in enumerate(measured.transfer_function):
        path = f"transfer_function.{one.name or n + 1}"
        if one.name is not None and one.name in names[:n]:
            path = f"transfer_function.{n + 1}"
            yield _repeated(path, "transfer function", one.name)
        for key, kind, among, example in (
            ("input", "actuator", measured.actuator, "upper.force_x"),
            ("output", "sensor", measured.sensor, "upper.x"),
        ):
            name, known = getattr(one, key), [item.name for item in among]
            if "." not in name and name not in known:
                remedy = f"give a signal such as {example}"
                remedy = f"{remedy}; {faults.suggest(name, known)}" if known else remedy
                problem = f"is neither a signal nor the name of a [[{kind}]]"
                yield fault_of(one, path, key, problem, remedy)
        if one.gain == 0:
            yield Fault(f"{path}.gain", "must not be zero", "give the factor", "0")
        if one.band is not None and one.band[0] >= one.band[1]:
            remedy = "give the lower frequency first"
            yield fault_of(one, path, "band", "ends before it begins", remedy)


def _check_parameters(measured: Measured) -> Iterator[Fault]:
    names = measured.names
    for n, item in enumerate(measured.parameter):
        path = f"parameter.{n + 1}"
        if (item.prior is None) != (item.uncertainty is None):
            yield Fault(path, "prior and uncertainty go together", "give both or neither")
        yield from check_bounds(item, path, item.start)
        unknown = [name for name in item.experiments or () if name not in names]
        if measured.experiment is None and item.experiments is not None:
            yield fault_of(item, path, "experiments", "there are no [[experiment]]", "remove it")
        elif unknown:
            remedy, value = faults.suggest(unknown[0], list(names)), format_value(unknown[0])
            yield Fault(f"{path}.experiments", "names no experiment", remedy, value)
        shares = measured.shares(n)
        for m in range(n):
            both = zip(shares, measured.shares(m), strict=True)
            if measured.parameter[m].name == item.name and any(a and b for a, b in both):
                remedy = "give each number once (in an experiment)"
                yield fault_of(item, path, "name", "is named twice", remedy)
                break


class Bounded(Protocol):
    """A table with bounds of a number."""

    @property
    def lower(self) -> float | None:
        """None for no bound."""
        ...

    @property
    def upper(self) -> float | None:
        """None for no bound."""
        ...


def check_bounds(item: Bounded, path: str, start: float | None = None) -> Iterator[Fault]:
    """Check the bounds of a number, if any, and that a search starts within them."""
    low = -math.inf if item.lower is None else item.lower
    high = math.inf if item.upper is None else item.upper
    if low >= high:
        yield fault_of(
            item, path, "lower", f"is not below the upper bound {high:g}", "exchange them"
        )
    elif start is not None and not low <= start <= high:
        yield fault_of(item, path, "start", "lies outside the bounds", "start within them")
