"""Large arrays in temporary files: they take memory only while they are read or written.

The system keeps such pages until it needs them elsewhere, and counts them as memory of the program.
`release` gives them back: whoever goes through a large array does so in blocks, and calls it.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from jaxtyping import Inexact

MAPPED = 10_000
"""Rows from which an array is kept in a file."""
BLOCK = 1 << 22
"""Bytes that are read or written at once."""
CAN_RELEASE = hasattr(mmap, "MADV_DONTNEED")
"""Whether pages can be given back; on Windows arrays are in memory."""


def new_array(folder: Path, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Make an array to be filled, from `MAPPED` rows on in a file of a folder, without a name.

    Raises `OSError` if the disk is full.
    """
    size = int(np.prod(shape, dtype=int)) * np.dtype(dtype).itemsize
    if not CAN_RELEASE or shape[0] < MAPPED or not size:
        return np.empty(shape, dtype)
    with tempfile.TemporaryFile(dir=folder) as stream:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(stream.fileno(), 0, size)  # or a full disk would end the program
        return np.memmap(stream, dtype, "r+", shape=shape)


def release(array: np.ndarray) -> None:
    """Give back the memory of an array of `new_array`, or of a part of one; others stay."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    if CAN_RELEASE and isinstance(base, mmap.mmap):
        base.madvise(mmap.MADV_DONTNEED)


def blocks(array: np.ndarray) -> Iterator[slice]:
    """Ranges of the first axis of an array, whose memory is given back after each."""
    row = max(array[:1].nbytes, 1)
    length = max(BLOCK // row, 1)
    for start in range(0, len(array), length):
        yield slice(start, start + length)
        release(array)


def copy_column(
    array: Inexact[np.ndarray, "row column"], number: int
) -> Inexact[np.ndarray, " row"]:
    """Copy one column of an array."""
    found = np.empty(len(array), array.dtype)
    for part in blocks(array):
        found[part] = array[part, number]
    return found
