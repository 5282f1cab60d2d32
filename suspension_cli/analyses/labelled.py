"""Results as labelled arrays: the contents of a results file as an `xarray.Dataset`."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from suspension_cli.files.hdf5 import open_results

if TYPE_CHECKING:
    import xarray

    from suspension_cli.files.hdf5 import Stored


@contextlib.contextmanager
def stored_group(result: Any) -> Iterator[Stored]:
    """Open the HDF5 group of an `analysis.Result`: in its file, or as its file would have it."""
    stored = result.stored_file()
    if stored is not None:
        with open_results(stored) as file:
            yield file[result.analysis.name]
    else:
        with h5py.File("memory", "w", driver="core", backing_store=False) as file:
            result.analysis.fill(file, result)
            yield file[result.analysis.name]


def to_xarray(result: Any) -> xarray.Dataset:
    """Convert an `analysis.Result`; dimensions and coordinates are the scales of its file.

    Each array has its `units`; attributes name design, model and estimated error.
    """
    import xarray  # pyright: ignore[reportMissingImports]

    with stored_group(result) as group:
        variables = _variables(group)
    about = {
        "design": result.name,
        "model": result.model,
        "estimated_error": result.estimated_error,
    }
    return xarray.Dataset(variables, attrs=about)


def _variables(group: Stored) -> dict[str, tuple[list[str], np.ndarray, dict[str, str]]]:
    """Dimensions, values and attributes of every dataset of a group.

    Datasets of subgroups have dotted names.
    """
    found = {}

    def add(path: str, data: Stored) -> None:
        if not isinstance(data, h5py.Dataset):
            return
        name = _dotted(path)
        scales = [data if data.is_scale else dim[0] if len(dim) else None for dim in data.dims]
        names = [
            f"{name}_{n}"
            if scale is None
            else _dotted(str(scale.name).removeprefix(f"{group.name}/"))
            for n, scale in enumerate(scales)
        ]
        found[name] = (
            names,
            np.asarray(values_of(data)),
            {"units": str(data.attrs.get("units", ""))},
        )

    group.visititems(add)
    return found


def values_of(data: h5py.Dataset) -> Stored:
    """Read all values of a dataset: numbers, or text."""
    return data.asstr()[...] if h5py.check_string_dtype(data.dtype) else data[...]


def _dotted(path: str) -> str:
    """A path within a group as the name of a variable."""
    return path.replace("/", ".")
