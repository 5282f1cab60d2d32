"""Files of numbers that others wrote: text, HDF5, MATLAB, XML of the diagnostics test tools."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from suspension_cli.errors import InputError, format_value
from suspension_cli.files import columns, dtt, whole_files
from suspension_cli.files.columns import Columns
from suspension_cli.files.dtt import Dtt
from suspension_cli.files.hdf5 import open_data, reporting_damage

if TYPE_CHECKING:
    from suspension_cli.files.hdf5 import Stored

COMPRESSED = 15
"""Type of a compressed element of a MATLAB file."""


def open_data_file(path: Path) -> Columns | Dtt:
    """Read a file of data by its contents: text, HDF5, MATLAB, XML of DTT; raises `InputError`."""
    begin = whole_files.read_head(path, 512, "a file of data")
    if not begin.strip():
        raise InputError.of("", "is empty", "give a frequency and a value per line")
    hdf5 = begin.startswith((b"\x89HDF", b"MATLAB 7.3 MAT-file"))
    if hdf5 or path.suffix.lower() in (".h5", ".hdf5", ".hdf"):
        return _read_hdf5(path)
    if begin.startswith(b"MATLAB 5.0 MAT-file") or path.suffix.lower() == ".mat":
        return _read_matlab(path)
    xml = begin.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(b"<")
    if xml or begin.startswith(b"\x1f\x8b") or path.suffix.lower() == ".xml":
        return dtt.read(path)
    return columns.read(path)


def _read_hdf5(path: Path) -> Columns:
    """List the one-dimensional datasets of numbers of a file, by their paths.

    Complex numbers are compounds of two numbers, as h5py and MATLAB write them. A series with
    attributes ``x0`` and ``dx``, as gwpy writes a FrequencySeries, also gives a column
    ``frequency`` and, if it is the only dataset, ``value``.
    """
    import h5py

    stored: dict[str, str] = {}  # the dataset of each name
    series: list[tuple[str, float, float]] = []

    def visit(name: str, item: Stored) -> None:
        if isinstance(item, h5py.Dataset) and item.size and max(item.shape, default=0) == item.size:
            stored[name] = name
            if {"x0", "dx"} <= set(item.attrs):
                start, step = (_attribute(name, key, item.attrs[key]) for key in ("x0", "dx"))
                series.append((name, start, step))

    with open_data(path) as file:
        file.visititems(visit)
    if not stored:
        problem = "has no one-dimensional dataset"
        raise InputError.of("", problem, "write frequency and value as datasets")
    has_grid = bool(series) and "frequency" not in stored
    if has_grid:
        if len(stored) == 1:
            stored["value"] = series[0][0]
        stored["frequency"] = series[0][0]
    names = [*stored]

    def column(position: int) -> np.ndarray:
        name = names[position]
        with open_data(path) as file:
            values = np.asarray(file[stored[name]]).ravel()
        if has_grid and name == "frequency":
            return series[0][1] + series[0][2] * np.arange(len(values))
        if values.dtype.names and len(values.dtype.names) == 2:
            first, second = values.dtype.names
            values = values[first] + 1j * values[second]
        if values.dtype.kind not in "iufc":
            problem = f"dataset holds {values.dtype}, not numbers"
            raise InputError.of("", problem, "name another", format_value(name))
        return values

    return Columns(names, column, lambda n: f"element {n}", noun="dataset")


def _attribute(name: str, key: str, value: Stored) -> float:
    """Return the attribute of a series as a number; raises `InputError` for anything else."""
    values = np.asarray(value)
    if values.size != 1 or values.dtype.kind not in "iuf":
        raise InputError.of(f"{name}.{key}", "must be one number", "write it as one, in Hz")
    return float(values.item())


def _read_matlab(path: Path) -> Columns:
    """List the vectors of numbers of a MATLAB file, before its version 7.3 (which is HDF5).

    Fields of structures are named with a dot: ``noise.asd``.
    """
    from scipy.io import loadmat

    remedy = "save it again in MATLAB, or as CSV"
    data = whole_files.read_bytes(path, whole_files.DATA, "a MATLAB file")
    with reporting_damage(path, remedy):
        if _size_of_matlab(data) > whole_files.DATA:
            problem = f"holds more than {whole_files.DATA / 1e6:g} MB of numbers"
            raise InputError.of("", problem, "save the spectrum alone")
        stored = loadmat(io.BytesIO(data), simplify_cells=True)
    vectors = {
        name: np.ravel(value)
        for name, value in _leaves(stored)
        if isinstance(value, np.ndarray) and value.dtype.kind in "iufc"
        if value.size and value.size == max(value.shape)
    }
    if not vectors:
        problem = "has no vector of numbers"
        raise InputError.of("", problem, "write frequency and value as vectors")
    names = [*vectors]
    read = [*vectors.values()].__getitem__
    return Columns(names, read, lambda n: f"element {n + 1}", noun="variable")


def _size_of_matlab(data: bytes) -> int:
    """Declared size of the variables of a MATLAB file in bytes, without expanding them.

    After 128 bytes there are elements with a tag each, type and size; that of a compressed one
    (type 15) begins with the tag of what is compressed (MAT-File Format, MathWorks, R2024, ch. 1).
    """
    order = ">" if data[126:128] == b"MI" else "<"
    place = 128
    size = 0
    while place + 8 <= len(data):
        kind, count = struct.unpack(f"{order}II", data[place : place + 8])
        place += 8
        if kind == COMPRESSED:
            begin = zlib.decompressobj().decompress(data[place : place + count], 8)
            size += struct.unpack(f"{order}II", begin)[1]
        else:
            size += count
        place += count
    return size


def _leaves(structure: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, object]]:
    """List the variables of a MATLAB file, and the fields of structures."""
    for name, value in structure.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{prefix}{name}.")
        elif not name.startswith("__"):
            yield f"{prefix}{name}", value
