"""HDF5 files of results, which name their units and record how they were made; and what design a
results file of any format has.

`docs/format.md` describes them. A file is written whole or not at all: built in memory or, of many
builds, under another name. Each analysis defines the content of its group.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import shlex
import tomllib
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import h5py
import numpy as np

from suspension_cli.errors import InputError, attribute_faults_to, format_value, one_line
from suspension_cli.files.mapped_arrays import BLOCK, blocks
from suspension_cli.files.whole_files import replace_file, write_bytes, writing_to
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Stored = Any
"""A group or dataset to read: the types of h5py do not distinguish items of a group."""
FORMAT_VERSION = 3
"""Raised when a reader of older files would misunderstand a new one."""
MARK, WIDTH = "#= ", 90
"""Start of lines of comment that hold a design, and letters of it in each."""


@dataclass(frozen=True)
class Provenance:
    """Origin of a result: the whole design as TOML with overrides, the command line, the model.

    `reason` says why this model, and what it neglects; `error` is its estimated relative error, NaN
    where none was estimated. `warnings` are those of the run.
    """

    design: str
    command: str
    fidelity: str
    reason: str
    error: float = math.nan
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reserved:
    """Shape of an array of real numbers that are written later."""

    shape: tuple[int, ...]

    @property
    def ndim(self) -> int:
        """Number of dimensions."""
        return len(self.shape)


def write(path: Path, origin: Provenance, fill: Callable[[h5py.File], None]) -> None:
    """Write one HDF5 file, whole or not at all: its root attributes, and what `fill` adds."""
    with in_memory() as file:
        write_root_attributes(file, origin)
        fill(file)
        file.flush()
        image = file.id.get_file_image()
    write_bytes(path, image)


def write_large(path: Path, origin: Provenance, fill: Callable[[h5py.File], None]) -> None:
    """Write a regular file as `write` does, but not in memory first."""

    def write_into(stream: IO[bytes]) -> None:
        with h5py.File(stream, "w") as file:
            write_root_attributes(file, origin)
            fill(file)

    with writing_to(path):
        replace_file(path, write_into)


def in_memory() -> h5py.File:
    """Make a file that is never written to disk."""
    return h5py.File("memory", "w", driver="core", backing_store=False)


def write_root_attributes(file: h5py.File, origin: Provenance) -> None:
    """Write the root attributes that every file has."""
    file.attrs.update(
        format="pendsus",
        format_version=FORMAT_VERSION,
        pendsus_version=__version__,
        design=origin.design,
        command=origin.command,
        fidelity=origin.fidelity,
        fidelity_reason=origin.reason,
        estimated_error=origin.error,
    )
    write_warnings(file, origin.warnings)


def write_warnings(file: h5py.File, lines: Sequence[str]) -> None:
    """Write what was warned of, each line once, as a root attribute; none without any."""
    if lines:
        file.attrs["warnings"] = [*dict.fromkeys(lines)]


def add_scale(
    group: h5py.Group, name: str, values: ArrayLike | Reserved, units: str
) -> h5py.Dataset:
    """Add a dataset that serves as scale of an axis of others."""
    result = add_dataset(group, name, values, units)
    result.make_scale(name)
    return result


def add_dataset(
    group: h5py.Group, name: str, values: ArrayLike | Reserved, units: str, *axes: h5py.Dataset
) -> h5py.Dataset:
    """Add a dataset with its units and, optionally, the scales of all its axes."""
    if isinstance(values, Reserved):
        result = group.create_dataset(name, values.shape, float)
    else:
        values = np.asarray(values)
        data = values.astype(h5py.string_dtype()) if values.dtype.kind == "U" else values
        result = _create(group, name, data)
    result.attrs["units"] = units
    for axis, of in zip(result.dims, axes, strict=bool(axes)):
        axis.attach_scale(of)
        axis.label = str(of.name).rsplit("/", 1)[1]
    return result


def _create(group: h5py.Group, name: str, data: np.ndarray) -> h5py.Dataset:
    """Add a dataset, of large arrays block by block."""
    if data.nbytes <= BLOCK:
        return group.create_dataset(name, data=data)
    result = group.create_dataset(name, data.shape, data.dtype)
    for part in blocks(data):
        result[part] = data[part]
    return result


@contextlib.contextmanager
def open_results(path: str | Path) -> Iterator[h5py.File]:
    """Open a results file for reading; failures inside are reported as of `reporting_damage`.

    Raises `InputError` if pendsus did not write it, it refers to other files, or is damaged.
    """
    remedy = "name a file that this version of pendsus wrote"
    with reporting_damage(path, "run the analysis again"), _opened(path, remedy) as file:
        if problem := _foreign(file) or _unsafe(file, links=False):
            raise InputError.of("", problem, remedy)
        yield file


@contextlib.contextmanager
def open_data(path: str | Path) -> Iterator[h5py.File]:
    """Open HDF5 from elsewhere for reading, as `open_results` does; links are not followed."""
    remedy = "name a CSV, HDF5, MATLAB or DTT XML file"
    with reporting_damage(path, remedy), _opened(path, remedy) as file:
        if problem := _unsafe(file, links=True):
            raise InputError.of("", problem, remedy)
        yield file


def is_results_file(path: str | Path) -> bool:
    """Whether a file holds results of pendsus."""
    remedy = "name a whole file"
    if not h5py.is_hdf5(path):
        return False
    with reporting_damage(path, remedy), _opened(path, remedy) as file:
        return str(file.attrs.get("format")) == "pendsus"


@contextlib.contextmanager
def reporting_damage(path: str | Path, remedy: str) -> Iterator[None]:
    """Report any failure inside as a fault of the file, whose contents caused it."""
    with attribute_faults_to(str(path)), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers that are not finite
        try:
            yield
        except (InputError, MemoryError):
            raise
        except KeyError as error:
            raise InputError.of("", f"is incomplete: {error.args[0]}", remedy) from error
        except Exception as error:  # HDF5 fails in many ways on corrupt bytes
            raise InputError.of("", f"is damaged: {one_line(error)}", remedy) from error


def _opened(path: str | Path, remedy: str) -> h5py.File:
    problem = "is not a regular file" if os.path.exists(path) else "is missing"
    if os.path.isfile(path):
        try:
            return h5py.File(path, "r")
        except OSError:
            problem = "is not HDF5, or was cut off"
    raise InputError.of("", problem, remedy)


def _foreign(file: h5py.File) -> str:
    """Why a file is not one of pendsus; empty if it is."""
    version = file.attrs.get("format_version", 0)
    if str(file.attrs.get("format")) != "pendsus":
        return "is not in a known format (not a pendsus file)"
    if not isinstance(version, np.integer) or version != FORMAT_VERSION:
        return f"is not in a known format (version {format_value(version)})"
    return ""


def _unsafe(file: h5py.File, *, links: bool) -> str:
    """Why a file must not be read; empty if it may be.

    Datasets that refer to other files, sizes beyond what the file can contain, and links, unless
    the file may have some that the reader does not follow. Groups are visited once, as they may
    contain each other.
    """
    largest = max(LARGE, 8 * os.path.getsize(file.filename))
    seen: set[int] = set()
    pending: list[h5py.Group] = [file]
    while pending:
        group = pending.pop()
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                if links:
                    continue
                return f"contains a link ({format_value(name)}), which is not followed"
            item: Stored = group[name]
            if isinstance(item, h5py.Dataset) and (problem := _damage(item, largest, links)):
                return problem
            place = h5py.h5o.get_info(item.id).addr  # pyright: ignore[reportAttributeAccessIssue]
            if isinstance(item, h5py.Group) and place not in seen:
                pending.append(item)
            seen.add(place)
    return ""


def _damage(item: h5py.Dataset, largest: int, foreign: bool) -> str:
    """Why a dataset must not be read; the scales of `foreign` ones are not used."""
    name = format_value(item.name)
    if item.external or item.is_virtual:
        return f"keeps {name} in another file, which is not opened"
    if (item.size or 0) * item.id.get_type().get_size() > largest:
        return f"is damaged: {name} should have {item.size} values, more than the file can contain"
    scales = {"DIMENSION_LIST": "O", "DIMENSION_LABELS": "O", "REFERENCE_LIST": "V"}
    for key, kind in () if foreign else scales.items():
        if key in item.attrs:
            found = item.attrs.get_id(key)
            is_text = h5py.check_string_dtype(found.dtype) is not None
            has_shape = key == "REFERENCE_LIST" or found.shape == (item.ndim,)
            is_label = key == "DIMENSION_LABELS"
            if found.dtype.kind != kind or not has_shape or is_text != is_label:
                return f"is damaged: the scales of {name} cannot be read"
    return ""


LARGE = 1 << 26
"""Largest dataset accepted in a much smaller (compressed) file, bytes."""


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
            case ".json":
                found = json.loads(path.read_text(encoding="utf-8"))["design"]
            case _:
                lines = path.read_text(encoding="utf-8").splitlines()
                found = json.loads("".join(one.partition(MARK)[2] for one in lines))
    except Exception:  # whatever the failure, it is not a result
        return None
    return str(found)


def read_command(path: Path) -> list[str]:
    """Read the words of the command line from an HDF5 result; none from any other file."""
    if not path.is_file():  # opening a pipe would wait
        return []
    try:
        with h5py.File(path, "r") as file:
            return shlex.split(str(file.attrs["command"]))
    except (OSError, KeyError, ValueError):
        return []


def comment_design(text: str) -> list[str]:
    """Write a design as lines of comment for a text file, which `read_design` reads.

    Where # starts no comment, put before each line what does.
    """
    whole = json.dumps(text)
    return [MARK + whole[n : n + WIDTH] for n in range(0, len(whole), WIDTH)]


def reads_alike(one: str, other: str) -> bool:
    """Whether two texts of designs differ at most in comments, order and layout."""
    if one == other:
        return True
    try:
        return tomllib.loads(one) == tomllib.loads(other)
    except tomllib.TOMLDecodeError:  # of a damaged file
        return False
