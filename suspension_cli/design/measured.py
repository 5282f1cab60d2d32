"""Files of measured modes, and of the numbers to fit to them, for `pendsus fit`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from suspension_cli.design import faults, reader
from suspension_cli.design.units import Frequency, Stem, Table, of_unit
from suspension_cli.errors import Fault, InputError, attribute_faults_to, format_value

Number = Annotated[float, Meta(ge=-1e20, le=1e20)]
Positive = Annotated[float, Meta(gt=0, le=1e20)]


class Mode(Table, frozen=True):
    """One measured mode."""

    frequency: Frequency
    uncertainty: Annotated[float, of_unit("Hz", gt=0, le=1e6, description="standard deviation, Hz")]
    label: (
        Annotated[
            str,
            Meta(
                description=(
                    "as pendsus modes prints it with the model of the fit; default: the nearest"
                )
            ),
        ]
        | None
    ) = None
    dof: (
        Annotated[
            list[Literal["x", "y", "z", "roll", "pitch", "yaw"]],
            Meta(
                min_length=1,
                description="without a label: coordinates of which one must dominate the mode",
            ),
        ]
        | None
    ) = None


class Experiment(Table, frozen=True):
    """A design and its measured modes."""

    design: Annotated[
        str, Meta(min_length=1, description="path of a design file, from the folder of this one")
    ]
    mode: Annotated[list[Mode], Meta(min_length=1)]
    name: (
        Annotated[
            Stem,
            Meta(
                description=(
                    "letters, digits, . _ and -, unique; default: the stem of the design file"
                )
            ),
        ]
        | None
    ) = None
    set: Annotated[list[str], Meta(description="overrides as --set takes them")] = msgspec.field(
        default_factory=list
    )

    @property
    def title(self) -> str:
        """Name of the experiment, given or the stem of its design file."""
        return self.name or Path(self.design).stem


class Free(Table, frozen=True):
    """One number of the design to be fitted."""

    name: Annotated[str, Meta(description="dotted path, as --set takes it")]
    start: (
        Annotated[Number, Meta(description="where to begin; default: the design's value")] | None
    ) = None
    prior: Annotated[Number, Meta(description="best value from other knowledge")] | None = None
    uncertainty: Annotated[Positive, Meta(description="standard deviation of the prior")] | None = (
        None
    )
    lower: Number | None = None
    upper: Number | None = None
    experiments: (
        Annotated[
            list[str],
            Meta(min_length=1, description="names of the experiments that share it; default: all"),
        ]
        | None
    ) = None


class Measured(Table, frozen=True):
    """A file of measured modes: of one design, or of several experiments."""

    parameter: Annotated[list[Free], Meta(min_length=1)]
    mode: Annotated[list[Mode], Meta(min_length=1)] | None = None
    experiment: Annotated[list[Experiment], Meta(min_length=1)] | None = None
    title: str = ""
    reference: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the experiments; one empty name for a design given beside the file."""
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
        """Make the key path of an experiment, a prefix for those of its modes."""
        return "" if self.experiment is None else f"experiment.{self.experiment[n].name or n + 1}."

    def shares(self, n: int) -> tuple[bool, ...]:
        """Whether each experiment depends on a parameter."""
        given = self.parameter[n].experiments
        return tuple(given is None or name in given for name in self.names)


def read(file: str | Path, text: str | None = None) -> Measured:
    """Read and check a file of measured modes, or its text if that was read before.

    Raises
    ------
    InputError
        With all its faults.
    """
    raw = reader.read_toml(file, text)
    if "stage" in raw:
        raise InputError(
            [
                Fault(
                    "",
                    "is a design, not a file of measured modes",
                    "write pendsus fit DESIGN MEASURED",
                )
            ],
            str(file),
        )
    with attribute_faults_to(str(file)):
        measured = faults.convert(raw, Measured)
        found = [*_check_experiments(measured), *_check_parameters(measured)]
        if found:
            raise InputError(found)
    return measured


def _check_experiments(measured: Measured) -> list[Fault]:
    if measured.mode is None and measured.experiment is None:
        return [
            Fault(
                "mode",
                "missing",
                "give [[mode]] for one design, or [[experiment]] with modes for several",
            )
        ]
    if measured.mode is not None and measured.experiment is not None:
        return [
            Fault(
                "mode",
                "conflicts with [[experiment]]",
                "write [[experiment.mode]] under each experiment",
            )
        ]
    found, names = [], measured.names
    for n, (name, modes) in enumerate(zip(names, measured.modes, strict=True)):
        if name in names[:n]:
            found.append(
                Fault(
                    f"experiment.{n + 1}.name",
                    "is also the name of an earlier experiment",
                    "give each its own name",
                    format_value(name),
                )
            )
        for m, item in enumerate(modes, 1):
            if item.label is not None and item.dof is not None:
                found.append(
                    Fault(
                        f"{measured.where(n)}mode.{m}.dof",
                        "conflicts with label, which determines it",
                        "give one of them",
                        format_value(item.dof),
                    )
                )
    return found


def _check_parameters(measured: Measured) -> list[Fault]:
    found, names = [], measured.names
    for n, item in enumerate(measured.parameter):
        path = f"parameter.{n + 1}"
        found += _check_parameter(item, path)
        unknown = [name for name in item.experiments or () if name not in names]
        if measured.experiment is None and item.experiments is not None:
            found.append(
                Fault(
                    f"{path}.experiments",
                    "there are no [[experiment]]",
                    "remove it",
                    format_value(item.experiments),
                )
            )
        elif unknown:
            found.append(
                Fault(
                    f"{path}.experiments",
                    "names no experiment",
                    faults.suggest(unknown[0], list(names)),
                    format_value(unknown[0]),
                )
            )
        before = [m for m in range(n) if measured.parameter[m].name == item.name]
        if any(
            here and there
            for m in before
            for here, there in zip(measured.shares(n), measured.shares(m), strict=True)
        ):
            found.append(
                Fault(
                    f"{path}.name",
                    "is named twice",
                    "give each number once (in an experiment)",
                    format_value(item.name),
                )
            )
    return found


def _check_parameter(item: Free, path: str) -> list[Fault]:
    found = []
    if (item.prior is None) != (item.uncertainty is None):
        found.append(Fault(path, "prior and uncertainty go together", "give both or neither"))
    low, high = (
        (-float("inf") if item.lower is None else item.lower),
        (float("inf") if item.upper is None else item.upper),
    )
    if low >= high:
        found.append(
            Fault(
                f"{path}.lower",
                f"is not below the upper bound {high:g}",
                "exchange them",
                format_value(item.lower),
            )
        )
    elif item.start is not None and not low <= item.start <= high:
        found.append(
            Fault(
                f"{path}.start",
                "lies outside the bounds",
                "start within them",
                format_value(item.start),
            )
        )
    return found
