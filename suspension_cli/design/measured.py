"""Files of measurements: modes, quantities, transfer functions, and the numbers to fit to them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from msgspec import Meta

from suspension_cli.design import faults, key_rules, reader, typed_tables
from suspension_cli.design.typed_tables import Problems, Schema, Table, key
from suspension_cli.design.units import Frequency, NamedDof, Number, Positive, Stem
from suspension_cli.errors import format_value


class Mode(Table, frozen=True):
    """One measured mode."""

    frequency: Frequency
    uncertainty: float = key("standard deviation, Hz", unit="Hz", gt=0, le=1e6)
    label: str | None = key(
        "as pendsus modes prints it for the model of the fit; default the nearest mode"
    )
    dof: list[NamedDof] | None = key(
        "without a label: coordinates of which one dominates the mode", min_length=1
    )

    rules = (key_rules.excludes("label", "dof"),)


class MeasuredQuantity(Table, frozen=True):
    """One measured scalar: a quantity by name, as `[[requirement]]` takes it."""

    name: str = key(
        "name of a quantity, such as 'stress test.1' or 'Q of test pitch'", max_length=200
    )
    value: Number = key("measured value, in the quantity's unit")
    uncertainty: Positive = key("standard deviation, in the same unit")


Column = Annotated[str, Meta(min_length=1)] | Annotated[int, Meta(ge=1)]
"""Heading of a column of a text file, or its number from 1; name of a dataset or of a channel."""


class TransferFunction(Table, frozen=True):
    """A measured transfer function in a file of data, output over input.

    The complex value stands in two columns, `real` and `imaginary` or `magnitude` and `phase`, or
    in one dataset of complex numbers, `value`. In DTT XML, `input` and `output` are found by
    `input_channel` and `output_channel`.
    """

    file: str = key("CSV or text, HDF5, or DTT XML; from the folder of this file", min_length=1)
    input: str = key("what was driven: a signal of the design, or an [[actuator]]")
    output: str = key("what was observed: a signal of the design, or a [[sensor]]")
    name: str | None = key("default: the stem of the file")
    frequency: Column | None = None
    real: Column | None = None
    imaginary: Column | None = None
    magnitude: Column | None = None
    phase: Column | None = None
    value: Column | None = None
    coherence: Column | None = None
    uncertainty: Column | Annotated[float, Meta(gt=0, le=10)] | None = key(
        "column of the standard deviation of real and imaginary part; or relative to the value"
    )
    input_channel: str | None = None
    output_channel: str | None = None
    magnitude_unit: Literal["1", "dB"] | None = key("default that of the heading, or 1")
    phase_unit: Literal["deg", "rad"] | None = key("default that of the heading, or deg")
    frequency_unit: Literal["Hz", "rad/s"] | None = key("default that of the heading, or Hz")
    averages: float | None = key("number of averages, for the uncertainty", ge=1, le=1e9)
    gain: Number = key("factor from the file's numbers to SI units: 1e-6 for um/N", 1.0)
    band: list[Frequency] | None = key("use frequencies from, to, Hz", count=2)

    rules = (key_rules.nonzero("gain"), key_rules.ascending("band"))


class Transducer(Table, frozen=True):
    """A sensor or an actuator: how its channel relates to signals of the design.

    A sensor reads ``gain exp(-2 pi i f delay) (signal + sum of mix[other] other)``; an actuator
    with a drive of 1 exerts this combination of forces. Gains and entries of `mix` with an
    uncertainty are fitted, with that prior; `mix` covers misalignment (a sensor of upper.x that is
    turned by 0.01 rad reads 0.01 upper.y too) and cross-talk.
    """

    name: str = key(pattern=r"^[A-Za-z][A-Za-z0-9_:-]*$", max_length=60)
    signal: str = key("upper.x (sensor), upper.force_x (actuator)")
    gain: Number = key("reading over signal (a sensor), force over drive (an actuator)", 1.0)
    gain_uncertainty: float | None = key("relative, of a gain that is then fitted", gt=0, le=10)
    sign_known: bool = key("false: fit tries the other sign of the gain, too", True)
    delay: float = key("delay of the channel, s", 0.0, ge=-10, le=10)
    delay_uncertainty: float | None = key("of a delay that is then fitted, s", gt=0, le=10)
    unit: str | None = key(
        "of the reading or the drive: V; default SI unit of signal", max_length=20
    )
    mix: dict[str, Number] = key("other signals that the channel contains, and how much", {})
    mix_uncertainty: dict[str, Positive] = key(
        "of entries of mix, which are then fitted from 0 or mix", {}
    )

    @property
    def signals(self) -> tuple[str, ...]:
        """Signals of the design in the channel, with those fitted from 0 (`mix_uncertainty`)."""
        return (self.signal, *self.mix, *self.mix_uncertainty)

    def check(self) -> Problems:
        """Check that it has signals of the design."""
        for name, signal in [("signal", self.signal), *(("mix", signal) for signal in self.mix)]:
            if "." not in signal:
                remedy = "write a body and a direction: upper.x, or upper.force_x of an actuator"
                yield name, f"{format_value(signal)} is not a signal", remedy

    rules = (key_rules.nonzero("gain"),)


class Experiment(Table, frozen=True):
    """A design and its measured modes and quantities."""

    design: str = key("path of a design file, from the folder of this one", min_length=1)
    mode: list[Mode] | None = key(min_length=1)
    quantity: list[MeasuredQuantity] | None = key(min_length=1)
    name: Stem | None = key("letters, digits, . _ and -, unique; default the design's file name")
    set: list[str] = key("overrides as --set takes them", [])

    @property
    def title(self) -> str:
        """Name of the experiment, given or the stem of its design file."""
        return self.name or Path(self.design).stem

    rules = (key_rules.any_of("mode", "quantity"),)


class Free(Table, frozen=True):
    """One number of the design to be fitted."""

    name: str = key("dotted path, as --set takes it")
    start: Number | None = key("where to begin; default: the design's value")
    prior: Number | None = key("best value from other knowledge")
    uncertainty: Positive | None = key("standard deviation of the prior")
    lower: Number | None = None
    upper: Number | None = None
    experiments: list[str] | None = key("names of those that share it; default all", min_length=1)

    rules = (key_rules.together("prior", "uncertainty"), key_rules.bounded)


class Measured(Table, frozen=True):
    """A file of measurements: of one design, or of modes and quantities in several experiments."""

    parameter: list[Free] = []
    mode: list[Mode] | None = key(min_length=1)
    quantity: list[MeasuredQuantity] | None = key(min_length=1)
    transfer_function: list[TransferFunction] = []
    sensor: list[Transducer] = []
    actuator: list[Transducer] = []
    experiment: list[Experiment] | None = key(min_length=1)
    title: str = ""
    reference: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the experiments; one empty name in a file of one design."""
        return ("",) if self.experiment is None else tuple(item.title for item in self.experiment)

    @property
    def modes(self) -> tuple[list[Mode], ...]:
        """Measured modes of each experiment."""
        if self.experiment is None:
            return (self.mode or [],)
        return tuple(item.mode or [] for item in self.experiment)

    @property
    def quantities(self) -> tuple[list[MeasuredQuantity], ...]:
        """Measured quantities of each experiment."""
        if self.experiment is None:
            return (self.quantity or [],)
        return tuple(item.quantity or [] for item in self.experiment)

    def where(self, n: int) -> str:
        """Key path of an experiment, as prefix for its modes."""
        return "" if self.experiment is None else f"experiment.{self.experiment[n].name or n + 1}."

    def shares(self, n: int) -> tuple[bool, ...]:
        """Whether each experiment depends on a parameter."""
        given = self.parameter[n].experiments
        return tuple(given is None or name in given for name in self.names)

    def check(self) -> Problems:
        """Check names of experiments, signals, and numbers that are fitted."""
        for n, title in enumerate(self.names):
            if title in self.names[:n]:
                remedy = "give each a name of its own"
                yield f"experiment.{n + 1}.name", f"{title} is also that of an earlier one", remedy
        for n, one in enumerate(self.transfer_function, 1):
            for end, kind, example in (
                ("input", "actuator", "upper.force_x"),
                ("output", "sensor", "upper.x"),
            ):
                name = getattr(one, end)
                known = [item.name for item in getattr(self, kind)]
                if "." not in name and name not in known:
                    remedy = f"give a signal such as {example}"
                    remedy = f"{remedy}; {faults.suggest(name, known)}" if known else remedy
                    problem = f"is neither a signal nor the name of a [[{kind}]]"
                    yield f"transfer_function.{one.name or n}.{end}", problem, remedy
        for n, item in enumerate(self.parameter):
            path = f"parameter.{n + 1}"
            unknown = [name for name in item.experiments or () if name not in self.names]
            if self.experiment is None and item.experiments is not None:
                yield f"{path}.experiments", "there are no [[experiment]]", "remove it"
            elif unknown:
                remedy = faults.suggest(unknown[0], list(self.names))
                yield f"{path}.experiments", f"{unknown[0]} names no experiment", remedy
            for m in range(n):
                both = zip(self.shares(n), self.shares(m), strict=True)
                if self.parameter[m].name == item.name and any(a and b for a, b in both):
                    remedy = "give each number once (in an experiment)"
                    yield f"{path}.name", "is named twice", remedy
                    break

    rules = (
        key_rules.any_of("mode", "quantity", "transfer_function", "experiment"),
        key_rules.excludes("experiment", "mode", "quantity", "transfer_function"),
        key_rules.unique("sensor"),
        key_rules.unique("actuator"),
        key_rules.unique("transfer_function"),
    )


def read(file: str | Path, text: str | None = None) -> Measured:
    """Read and check a file of measurements, or its text if given; raises `InputError`."""
    return reader.read_as(Measured, "file of measurements", file, text)


def json_schema() -> Schema:
    """Make the JSON Schema of files of measurements."""
    return typed_tables.json_schema(Measured, "pendsus file of measurements")
