"""The groups `response` and `matrix` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py

from suspension_cli.analysis.response import Response
from suspension_cli.results import Provenance, dataset, scale, write


def save(path: Path, response: Response, origin: Provenance, group: str = "response") -> None:
    """Write the responses of one design into a group."""
    write(path, origin, lambda file: fill(file.create_group(group), response))


def fill(group: h5py.Group, response: Response) -> None:
    """Put responses into a group."""
    frequency = scale(group, "frequency", response.frequency, "Hz")
    output = scale(group, "output", list(response.output), "name")
    into = scale(group, "input", list(response.input), "name")
    dataset(group, "value", response.value, "SI, see unit", frequency, output, into)
    dataset(group, "unit", [list(row) for row in response.unit], "name", output, into)


def load(group: Any) -> Response:
    """The responses that a group holds."""
    return Response(
        frequency=group["frequency"][:],
        input=tuple(group["input"].asstr()[:]),
        output=tuple(group["output"].asstr()[:]),
        unit=tuple(tuple(row) for row in group["unit"].asstr()[:]),
        value=group["value"][:],
        blocks=0,
    )
