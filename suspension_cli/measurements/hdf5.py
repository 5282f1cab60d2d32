"""Measured transfer functions in datasets of HDF5 files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.measurements.columns import Columns

if TYPE_CHECKING:
    from suspension_cli.files.hdf5 import Stored


def is_results_file(path: Path) -> bool:
    """Whether a file holds results of pendsus."""
    import h5py

    if not h5py.is_hdf5(path):
        return False
    with h5py.File(path, "r") as file:
        return file.attrs.get("format") == "pendsus"


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
                start, step = (np.asarray(item.attrs[key]).item() for key in ("x0", "dx"))
                series.append((name, start, step))

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except OSError as error:
        problem = "cannot be read" if not path.exists() else "is not HDF5, or was cut off"
        remedy = "check the path" if not path.exists() else "name a CSV, HDF5 or DTT XML file"
        raise InputError.of("", f"{problem} ({error.strerror or 'HDF5'})", remedy) from None
    if not names:
        problem = "has no one-dimensional dataset"
        raise InputError.of("", problem, "write frequency and value as datasets")

    stored = list(names)
    if series and "frequency" not in names:
        names += ["frequency", "value"] if len(stored) == 1 else ["frequency"]
        stored += [series[0][0]] * (len(names) - len(stored))

    def column(position: int) -> np.ndarray:
        with h5py.File(path, "r") as file:
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
