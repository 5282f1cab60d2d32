"""Design of an existing result file, in any format."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator
from pathlib import Path

import h5py

MARK, WIDTH = "#= ", 90
"""Start of lines of comment that hold a design, and letters of it in each."""


def read_design(path: Path) -> str | None:
    """Read the text of the design from a result file; None if it is missing or not a result.

    A folder is a noise budget of gwinc.
    """
    path = path / "suspension.npz" if path.is_dir() else path
    if not path.is_file():
        return None
    try:
        match path.suffix:
            case ".h5":
                with h5py.File(path, "r") as file:
                    found = file.attrs["design"]
            case ".mat":
                from scipy.io import loadmat

                stored = loadmat(path, variable_names=["pendsus"], simplify_cells=True)
                found = stored["pendsus"]["design"]
            case ".npz":
                import numpy as np

                with np.load(path) as arrays:
                    found = arrays["design"]
            case ".txt":
                lines = path.read_text(encoding="utf-8").splitlines()
                marked = (one.removeprefix(MARK) for one in lines if one.startswith(MARK))
                found = json.loads("".join(marked))
            case _:
                found = json.loads(path.read_text(encoding="utf-8"))["design"]
    except Exception:  # whatever the failure, it is not a result
        return None
    return str(found)


def comment_design(text: str) -> list[str]:
    """Write a design as lines of comment for a text file, which `read_design` reads."""
    whole = json.dumps(text)
    return [MARK + whole[n : n + WIDTH] for n in range(0, len(whole), WIDTH)]


@contextlib.contextmanager
def replacing(path: Path, text: str, say: Callable[[str], None]) -> Iterator[None]:
    """Report that the result of a design (`text`) was written, and if it replaced another's."""
    before = read_design(path)
    yield
    replaced = before is not None and before != text
    note = " (replaced the result of another design of this name; to keep both, give --name)"
    say(f"wrote {path}{note if replaced else ''}")
