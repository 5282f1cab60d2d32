"""Design of an existing result file, in any format."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py


def read_design(path: Path) -> str | None:
    """Read the text of the design from a result file; None if it is missing or not a result.

    Parameters
    ----------
    path
        Ending in ``.h5``, ``.mat``, ``.npz`` or ``.json``; or a folder for gwinc.
    """
    path = path / "suspension.npz" if path.is_dir() else path
    if not os.path.isfile(path):
        return None
    try:
        match path.suffix:
            case ".h5":
                with h5py.File(path, "r") as file:
                    return str(file.attrs["design"])
            case ".mat":
                from scipy.io import loadmat

                stored = loadmat(path, variable_names=["pendsus"], simplify_cells=True)
                return str(stored["pendsus"]["design"])
            case ".npz":
                import numpy as np

                with np.load(path) as arrays:
                    return str(arrays["design"])
            case _:
                return str(json.loads(path.read_text(encoding="utf-8"))["design"])
    except Exception:  # whatever the failure, it is not a result
        return None


@contextlib.contextmanager
def replacing(path: Path, text: str, say: Callable[[str], None]) -> Iterator[None]:
    """Report that a results file was written, and whether it replaced that of another design.

    Parameters
    ----------
    text
        The design whose result is written.
    say
        Takes the message.
    """
    before = read_design(path)
    yield
    replaced = before is not None and before != text
    note = " (replaced the result of another design of this name; to keep both, give --name)"
    say(f"wrote {path}{note if replaced else ''}")
