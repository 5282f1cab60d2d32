"""Measured modes and the numbers to be learned from them: the file that `pendsus fit` reads, beside a design or naming several itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from suspension_cli.design import faults, reader
from suspension_cli.design.quantities import Frequency, Stem
from suspension_cli.design.schema import Table
from suspension_cli.errors import Fault, InputError, shown

Number = Annotated[float, Meta(ge=-1e20, le=1e20)]
Positive = Annotated[float, Meta(gt=0, le=1e20)]


class Mode(Table, frozen=True):
    """One measured mode."""

    frequency: Frequency
    uncertainty: Annotated[float, Meta(gt=0, le=1e6, description="standard deviation, Hz")]
    label: Annotated[str, Meta(description="as pendsus modes tells it on the rung of the fit; if left out, the nearest mode")] | None = None
    dof: Annotated[list[Literal["x", "y", "z", "roll", "pitch", "yaw"]], Meta(min_length=1, description="without a label: what may move most in it")] | None = (
        None
    )


class Experiment(Table, frozen=True):
    """A design and what was measured of it."""

    design: Annotated[str, Meta(min_length=1, description="path of a design file, from the folder of this one")]
    mode: Annotated[list[Mode], Meta(min_length=1)]
    name: Annotated[Stem, Meta(description="letters, digits, . _ and -, of its own; default: the stem of the design file")] | None = None
    set: Annotated[list[str], Meta(description="overrides as --set takes them")] = msgspec.field(default_factory=list)

    @property
    def title(self) -> str:
        """What it goes by."""
        return self.name or Path(self.design).stem


class Free(Table, frozen=True):
    """One number of the design to be learned."""

    name: Annotated[str, Meta(description="dotted path, as --set takes it")]
    start: Annotated[Number, Meta(description="where to begin; default: the design's value")] | None = None
    prior: Annotated[Number, Meta(description="what was known before")] | None = None
    uncertainty: Annotated[Positive, Meta(description="standard deviation of that")] | None = None
    lower: Number | None = None
    upper: Number | None = None
    experiments: Annotated[list[str], Meta(min_length=1, description="names of those that share it; default: all")] | None = None


class Measured(Table, frozen=True):
    """A file of measured modes: of one design, or of several experiments."""

    parameter: Annotated[list[Free], Meta(min_length=1)]
    mode: Annotated[list[Mode], Meta(min_length=1)] | None = None
    experiment: Annotated[list[Experiment], Meta(min_length=1)] | None = None
    title: str = ""
    reference: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the experiments; one without a name where the design is given beside the file."""
        return ("",) if self.experiment is None else tuple(item.title for item in self.experiment)

    @property
    def modes(self) -> tuple[list[Mode], ...]:
        """What was measured in each experiment."""
        return (self.mode or [],) if self.experiment is None else tuple(item.mode for item in self.experiment)

    def where(self, n: int) -> str:
        """Key path of an experiment, to put before that of its modes."""
        return "" if self.experiment is None else f"experiment.{self.experiment[n].name or n + 1}."

    def shares(self, n: int) -> tuple[bool, ...]:
        """Whether each experiment has part in a parameter."""
        asked = self.parameter[n].experiments
        return tuple(asked is None or name in asked for name in self.names)


def read(file: str | Path, text: str | None = None) -> Measured:
    """Read and check a file of measured modes, or its text if that was read before; raises `InputError` with all its faults."""
    raw = reader.document(file, text)
    if "stage" in raw:
        raise InputError([Fault("", "is a design, not a file of measured modes", "write pendsus fit DESIGN MEASURED")], str(file))
    found = faults.of_table(raw, Measured)
    if not found:
        measured = msgspec.convert(raw, Measured)
        found = [*_of_experiments(measured), *_of_parameters(measured)]
        if not found:
            return measured
    raise InputError(found, str(file))


def _of_experiments(measured: Measured) -> list[Fault]:
    if measured.mode is None and measured.experiment is None:
        return [Fault("mode", "missing", "give [[mode]] for one design, or [[experiment]] with modes for several")]
    if measured.mode is not None and measured.experiment is not None:
        return [Fault("mode", "stands beside [[experiment]]", "write [[experiment.mode]] under each experiment")]
    found, names = [], measured.names
    for n, (name, modes) in enumerate(zip(names, measured.modes, strict=True)):
        if name in names[:n]:
            found.append(Fault(f"experiment.{n + 1}.name", "is that of an experiment before", "give each its own name", shown(name)))
        for m, item in enumerate(modes, 1):
            if item.label is not None and item.dof is not None:
                found.append(Fault(f"{measured.where(n)}mode.{m}.dof", "stands beside a label, which says it already", "give one of them", shown(item.dof)))
    return found


def _of_parameters(measured: Measured) -> list[Fault]:
    found, names = [], measured.names
    for n, item in enumerate(measured.parameter):
        path = f"parameter.{n + 1}"
        found += _of_parameter(item, path)
        unknown = [name for name in item.experiments or () if name not in names]
        if measured.experiment is None and item.experiments is not None:
            found.append(Fault(f"{path}.experiments", "there are no [[experiment]]", "remove it", shown(item.experiments)))
        elif unknown:
            found.append(Fault(f"{path}.experiments", "names no experiment", faults.suggestion(unknown[0], list(names)), shown(unknown[0])))
        before = [m for m in range(n) if measured.parameter[m].name == item.name]
        if any(here and there for m in before for here, there in zip(measured.shares(n), measured.shares(m), strict=True)):
            found.append(Fault(f"{path}.name", "is named twice", "give each number once (in an experiment)", shown(item.name)))
    return found


def _of_parameter(item: Free, path: str) -> list[Fault]:
    found = []
    if (item.prior is None) != (item.uncertainty is None):
        found.append(Fault(path, "prior and uncertainty go together", "give both or neither"))
    low, high = (-float("inf") if item.lower is None else item.lower), (float("inf") if item.upper is None else item.upper)
    if low >= high:
        found.append(Fault(f"{path}.lower", f"is not below the upper bound {high:g}", "exchange them", shown(item.lower)))
    elif item.start is not None and not low <= item.start <= high:
        found.append(Fault(f"{path}.start", "lies outside the bounds", "start within them", shown(item.start)))
    return found
