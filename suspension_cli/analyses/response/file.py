"""HDF5 groups `response` and `matrix` of a results file."""

from __future__ import annotations

from typing import Any

import h5py

from suspension_cli.files.hdf5 import add_dataset, add_scale
from suspension_cli.linear.response import Response


def fill(group: h5py.Group, response: Response) -> None:
    """Write responses into a group."""
    frequency = add_scale(group, "frequency", response.frequency, "Hz")
    output = add_scale(group, "output", list(response.output), "name")
    into = add_scale(group, "input", list(response.input), "name")
    add_dataset(group, "value", response.value, "SI, see unit", frequency, output, into)
    if response.closed_loop:
        group.attrs["closed_loop"] = True
    add_dataset(group, "unit", [list(row) for row in response.unit], "name", output, into)


def load(group: Any) -> Response:
    """Read responses from a group."""
    return Response(
        frequency=group["frequency"][:],
        input=tuple(group["input"].asstr()[:]),
        output=tuple(group["output"].asstr()[:]),
        unit=tuple(tuple(row) for row in group["unit"].asstr()[:]),
        value=group["value"][:],
        blocks=0,
        closed_loop=bool(group.attrs.get("closed_loop", False)),
    )
