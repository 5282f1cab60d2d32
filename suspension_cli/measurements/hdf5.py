"""Measured transfer functions in datasets of HDF5 files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.files.hdf5 import open_data
from suspension_cli.measurements.columns import Columns

if TYPE_CHECKING:
    from suspension_cli.files.hdf5 import Stored


def read(path: Path) -> Columns:
    """List the one-dimensional datasets of numbers of a file, by their paths.

    Complex numbers are compounds of two numbers, as h5py and MATLAB write them. A series with
    attributes ``x0`` and ``dx``, as gwpy writes a FrequencySeries, also gives a column
    ``frequency`` and, if it is the only dataset, ``value``. Raises `InputError` if the file is not
    HDF5 or has no such dataset.
    """
    import h5py

    names: list[str] = []
    series: list[tuple[str, float, float]] = []

    def visit(name: str, item: Stored) -> None:
        if isinstance(item, h5py.Dataset) and item.size and max(item.shape, default=0) == item.size:
            names.append(name)
            if {"x0", "dx"} <= set(item.attrs):
                start, step = (_number(name, key, item.attrs[key]) for key in ("x0", "dx"))
                series.append((name, start, step))

    with open_data(path) as file:
        file.visititems(visit)
    if not names:
        problem = "has no one-dimensional dataset"
        raise InputError.of("", problem, "write frequency and value as datasets")

    stored = list(names)
    if series and "frequency" not in names:
        names += ["frequency", "value"] if len(stored) == 1 else ["frequency"]
        stored += [series[0][0]] * (len(names) - len(stored))

    def column(position: int) -> np.ndarray:
        with open_data(path) as file:
            values = np.asarray(file[stored[position]]).ravel()
        if names[position] == "frequency" and stored[position] != "frequency":
            return series[0][1] + series[0][2] * np.arange(len(values))
        if values.dtype.names and len(values.dtype.names) == 2:
            first, second = values.dtype.names
            values = values[first] + 1j * values[second]
        if values.dtype.kind not in "iufc":
            problem = f"dataset holds {values.dtype}, not numbers"
            raise InputError.of("", problem, "name another", format_value(names[position]))
        return values

    return Columns(names, column, lambda n: f"element {n}", numbered=False, noun="dataset")


def _number(name: str, key: str, value: Stored) -> float:
    """Return the attribute of a series as a number; raises `InputError` for anything else."""
    values = np.asarray(value)
    if values.size != 1 or values.dtype.kind not in "iuf":
        raise InputError.of(f"{name}.{key}", "must be one number", "write it as one, in Hz")
    return float(values.item())
