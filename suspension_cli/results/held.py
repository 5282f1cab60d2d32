"""The design of a result that is on the disk already, whatever its format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py


def design_in(path: Path) -> str | None:
    """The text of the design whose result a file holds; None if there is no such file, or it is none of ours.

    Parameters
    ----------
    path : Path
        Ending in ``.h5``, ``.mat``, ``.npz`` or ``.json``.
    """
    if not path.is_file():
        return None
    try:
        return str(_READ[path.suffix](path))
    except Exception:  # whatever is wrong with it, it is no result
        return None


def _hdf5(path: Path) -> Any:
    with h5py.File(path, "r") as file:
        return file.attrs["design"]


def _mat(path: Path) -> Any:
    from scipy.io import loadmat

    return loadmat(path, variable_names=["pendsus"], simplify_cells=True)["pendsus"]["design"]


def _npz(path: Path) -> Any:
    import numpy as np

    with np.load(path) as arrays:
        return arrays["design"]


def _json(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))["design"]


_READ = {".h5": _hdf5, ".mat": _mat, ".npz": _npz, ".json": _json}
