"""Chunks of an unfinished run on disk: arrays of numbers whose every bit is checked.

A chunk is a SHA-256 digest, a line of JSON and the bytes of its arrays. The digest is of all that
follows and of the job and first point, so it is also wrong for chunks of other jobs and for ones
that were renamed. Nothing is interpreted before it is compared.
"""

from __future__ import annotations

import hashlib
import math
import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from suspension_cli.files.whole_files import is_regular

ENDING = ".chunk"
"""Ending of the names of chunks."""
DIGEST = hashlib.sha256().digest_size
"""Length of the digest, bytes."""
KINDS = "biufc"
"""Kinds of numbers that a chunk may hold: truth values, integers, real and complex numbers."""

Columns = dict[str, Any]
"""Arrays of results by name, with the points along the first axis."""


class _Layout(msgspec.Struct, frozen=True):
    """Name, kind of number and shape of one array."""

    name: str
    dtype: str
    shape: tuple[int, ...]


def path_of(folder: Path, start: int) -> Path:
    """Path of the chunk that begins with a point."""
    return folder / f"{start}{ENDING}"


def start_of(path: Path) -> int | None:
    """First point of the chunk of a path; None for the name of no chunk."""
    is_chunk = re.fullmatch(rf"(0|[1-9][0-9]{{0,17}})\{ENDING}", path.name)
    return int(path.stem) if is_chunk else None


def write(path: Path, key: str, start: int, columns: Columns) -> None:
    """Write the results of points from `start` on, of the job with a key."""
    arrays = {name: np.ascontiguousarray(values) for name, values in columns.items()}
    for name, one in arrays.items():
        if one.dtype.kind not in KINDS:
            raise TypeError(f"{name} holds no numbers but {one.dtype}")
    layout = [_Layout(name, one.dtype.str, one.shape) for name, one in arrays.items()]
    parts = [msgspec.json.encode(layout) + b"\n", *(one.tobytes() for one in arrays.values())]
    with path.open("wb") as stream:
        stream.write(_digest(key, start, *parts))
        stream.writelines(parts)


def read(path: Path, key: str, count: int) -> Columns | None:
    """Read a chunk of a job of `count` points; None if anything in it is not as it was written."""
    start = start_of(path)
    if start is None or not is_regular(path):
        return None
    try:
        return decode(path.read_bytes(), key, start, count)
    except OSError:
        return None


def decode(content: bytes, key: str, start: int, count: int) -> Columns | None:
    """Take the arrays from the bytes of a chunk; None if these are not as they were written."""
    digest = content[:DIGEST]
    rest = content[DIGEST:]
    if digest != _digest(key, start, rest):
        return None
    head, _, numbers = rest.partition(b"\n")
    try:
        return _arrays(head, numbers, count - start)
    except Exception:  # whatever the failure, the chunk is computed again
        return None


def _digest(key: str, start: int, *parts: bytes) -> bytes:
    digest = hashlib.sha256(f"{key} {start} ".encode())
    for part in parts:
        digest.update(part)
    return digest.digest()


def _arrays(head: bytes, numbers: bytes, most: int) -> Columns | None:
    """Take arrays of 1 to `most` points from their bytes; None if their layout does not fit."""
    layout = msgspec.json.decode(head, type=list[_Layout])
    result: Columns = {}
    at = 0
    for one in layout:
        dtype = np.dtype(one.dtype)
        if dtype.kind not in KINDS or not one.shape or min(one.shape) < 0:
            return None
        count = math.prod(one.shape)
        result[one.name] = np.frombuffer(numbers, dtype, count, at).reshape(one.shape)
        at += count * dtype.itemsize
    lengths = {len(values) for values in result.values()}
    fits = at == len(numbers) and len(lengths) == 1 and 0 < min(lengths) <= most
    return result if fits else None
