"""HDF5 groups `response` and `matrix` of a results file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale
from suspension_cli.linear.response import Peaks, Response

if TYPE_CHECKING:
    from suspension_cli.analyses.response.measured import Comparison


def fill(group: h5py.Group, response: Response) -> None:
    """Write responses into a group."""
    frequency = add_scale(group, "frequency", response.frequency, "Hz")
    output = add_scale(group, "output", list(response.output), "name")
    into = add_scale(group, "input", list(response.input), "name")
    add_dataset(group, "value", response.value, "SI, see unit", frequency, output, into)
    if response.closed_loop:
        group.attrs["closed_loop"] = True
    add_dataset(group, "unit", [list(row) for row in response.unit], "name", output, into)
    if response.largest is not None:
        size, at = response.largest.size, response.largest.frequency
        add_dataset(group, "largest", size, "SI, see unit", output, into)
        add_dataset(group, "largest_frequency", at, "Hz", output, into)
    for number, one in enumerate(getattr(response, "measured", ()), 1):
        _fill_measured(group.create_group(f"measured/{number}"), one)


def load(group: Stored) -> Response:
    """Read responses from a group."""
    plain = Response(
        frequency=group["frequency"][:],
        input=tuple(group["input"].asstr()[:]),
        output=tuple(group["output"].asstr()[:]),
        unit=tuple(tuple(row) for row in group["unit"].asstr()[:]),
        value=group["value"][:],
        blocks=0,
        closed_loop=bool(group.attrs.get("closed_loop", False)),
        largest=Peaks(group["largest_frequency"][:], group["largest"][:])
        if "largest" in group
        else None,
    )
    if "measured" not in group:
        return plain
    from suspension_cli.analyses.response.measured import ComparedResponse

    stored = group["measured"]
    found = tuple(_load_measured(stored[name]) for name in sorted(stored, key=int))
    return ComparedResponse(**vars(plain), measured=found)


_LABELS = ("name", "input", "output", "unit", "file")
"""Attributes of the group of a measured transfer function."""


def _fill_measured(group: h5py.Group, one: Comparison) -> None:
    data = one.data
    for label in _LABELS:
        group.attrs[label] = getattr(data, label)
    at = add_scale(group, "frequency", data.frequency, "Hz")
    add_dataset(group, "value", data.value, data.unit, at)
    add_dataset(group, "uncertainty", data.uncertainty, data.unit, at)
    add_dataset(group, "model", one.predicted, data.unit, at)
    add_dataset(group, "coherence", data.coherence, "1", at)
    fine = add_scale(group, "curve_frequency", one.curve_frequency, "Hz")
    add_dataset(group, "curve", one.curve, data.unit, fine)
    if len(one.peak):
        mode = add_scale(group, "mode", list(one.mode), "name")
        add_dataset(group, "measured_resonance", one.peak, "Hz", mode)
        add_dataset(group, "model_resonance", one.pole, "Hz", mode)


def _load_measured(group: Stored) -> Comparison:
    from suspension_cli.analyses.response.measured import Comparison
    from suspension_cli.measurements.transfer_function import MeasuredResponse

    data = MeasuredResponse(
        frequency=group["frequency"][:],
        value=group["value"][:],
        uncertainty=group["uncertainty"][:],
        coherence=group["coherence"][:],
        **{label: str(group.attrs[label]) for label in _LABELS},
    )
    some = "mode" in group
    return Comparison(
        data,
        group["model"][:],
        group["curve_frequency"][:],
        group["curve"][:],
        group["measured_resonance"][:] if some else np.array([]),
        group["model_resonance"][:] if some else np.array([]),
        tuple(group["mode"].asstr()[:]) if some else (),
    )
