"""The group `sensitivity` of a results file."""

from __future__ import annotations

import h5py

from suspension_cli.analyses.sensitivity.solve import Sensitivity
from suspension_cli.files.hdf5 import Stored, add_dataset, add_scale


def fill(group: h5py.Group, found: Sensitivity) -> None:
    """Write derivatives into the group `sensitivity`."""
    parameter = add_scale(group, "parameter", list(found.parameter), "name")
    result = add_scale(group, "result", list(found.result), "name")
    add_dataset(group, "value", found.value, "SI", parameter)
    add_dataset(group, "step", found.step, "SI", parameter)
    add_dataset(group, "step_unit", list(found.step_unit), "name", parameter)
    add_dataset(group, "free", found.free, "1", parameter)
    add_dataset(group, "result_unit", list(found.unit), "name", result)
    add_dataset(group, "nominal", found.nominal, "SI, see result_unit; Hz for modes", result)
    add_dataset(
        group,
        "derivative",
        found.derivative,
        "unit of the result over SI unit of the parameter",
        parameter,
        result,
    )
    add_dataset(
        group,
        "one_percent",
        found.one_percent,
        "%; unit of the result where nominal is 0",
        parameter,
        result,
    )
    add_dataset(
        group,
        "per_step",
        found.per_step,
        "%; unit of the result where nominal is 0",
        parameter,
        result,
    )


def load(group: Stored) -> Sensitivity:
    """Read derivatives from the group `sensitivity`."""
    return Sensitivity(
        parameter=tuple(group["parameter"].asstr()[:]),
        value=group["value"][:],
        free=group["free"][:],
        result=tuple(group["result"].asstr()[:]),
        unit=tuple(group["result_unit"].asstr()[:]),
        nominal=group["nominal"][:],
        derivative=group["derivative"][:],
    )
