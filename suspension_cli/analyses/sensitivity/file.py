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
    per_parameter = "unit of the result over SI unit of the parameter"
    add_dataset(group, "derivative", found.derivative, per_parameter, parameter, result)
    for name in ("one_percent", "per_step"):
        unit = "%; unit of the result where nominal is 0"
        add_dataset(group, name, getattr(found, name), unit, parameter, result)


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
