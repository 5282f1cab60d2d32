"""Measured modes and the numbers to be learned from them: the file that `pendsus fit` reads beside a design."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from suspension_cli.design import faults, reader
from suspension_cli.design.quantities import Frequency
from suspension_cli.design.schema import Table
from suspension_cli.errors import Fault, InputError, shown

Number = Annotated[float, Meta(ge=-1e20, le=1e20)]
Positive = Annotated[float, Meta(gt=0, le=1e20)]


class Mode(Table, frozen=True):
    """One measured mode."""

    frequency: Frequency
    uncertainty: Annotated[float, Meta(gt=0, le=1e6, description="standard deviation, Hz")]
    label: Annotated[str, Meta(description="as pendsus modes tells it; matched to the nearest mode if left out")] | None = None


class Free(Table, frozen=True):
    """One number of the design to be learned."""

    name: Annotated[str, Meta(description="dotted path, as --set takes it")]
    start: Annotated[Number, Meta(description="where to begin; default: the design's value")] | None = None
    prior: Annotated[Number, Meta(description="what was known before")] | None = None
    uncertainty: Annotated[Positive, Meta(description="standard deviation of that")] | None = None
    lower: Number | None = None
    upper: Number | None = None


class Measured(Table, frozen=True):
    """A file of measured modes."""

    mode: Annotated[list[Mode], Meta(min_length=1)]
    parameter: Annotated[list[Free], Meta(min_length=1)]
    title: str = ""
    reference: str = ""


def read(file: str | Path) -> Measured:
    """Read and check a file of measured modes; raises `InputError` with all its faults."""
    raw = reader.document(file)
    found = faults.of_table(raw, Measured)
    if not found:
        measured = msgspec.convert(raw, Measured)
        found = [fault for number, item in enumerate(measured.parameter, 1) for fault in _of_parameter(item, f"parameter.{number}")]
        names = [item.name for item in measured.parameter]
        found += [Fault(f"parameter.{n + 1}.name", "is named twice", "give each number once", shown(name)) for n, name in enumerate(names) if name in names[:n]]
        if not found:
            return measured
    raise InputError(found, str(file))


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
