"""The group `sensitivity` of a results file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py

from suspension_cli.analysis.sensitivity import Sensitivity
from suspension_cli.results import Provenance, dataset, scale, write


def save(path: Path, found: Sensitivity, origin: Provenance) -> None:
    """Write derivatives: group `sensitivity`."""

    def fill(file: h5py.File) -> None:
        group = file.create_group("sensitivity")
        parameter = scale(group, "parameter", list(found.parameter), "name")
        result = scale(group, "result", list(found.result), "name")
        dataset(group, "value", found.value, "SI", parameter)
        dataset(group, "free", found.free, "1", parameter)
        dataset(group, "result_unit", list(found.unit), "name", result)
        dataset(group, "nominal", found.nominal, "SI, see result_unit; Hz for modes", result)
        dataset(group, "derivative", found.derivative, "unit of the result over SI unit of the parameter", parameter, result)
        dataset(group, "one_percent", found.one_percent, "%; unit of the result where nominal is 0", parameter, result)

    write(path, origin, fill)


def load(group: Any) -> Sensitivity:
    """Derivatives from their group."""
    return Sensitivity(
        parameter=tuple(group["parameter"].asstr()[:]),
        value=group["value"][:],
        free=group["free"][:],
        result=tuple(group["result"].asstr()[:]),
        unit=tuple(group["result_unit"].asstr()[:]),
        nominal=group["nominal"][:],
        derivative=group["derivative"][:],
    )
