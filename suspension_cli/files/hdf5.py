"""HDF5 files of results, which name their units and record how they were made.

`docs/format.md` describes them. A file is built in memory and written whole or not at all. Each
analysis defines the content of its group.
"""

from __future__ import annotations

import contextlib
import math
import os
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from suspension_cli.errors import InputError, attribute_faults_to, format_value, one_line
from suspension_cli.files.atomic import write_bytes
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Stored = Any
"""A group or dataset to read: the types of h5py do not distinguish items of a group."""
FORMAT_VERSION = 3
"""Raised when a reader of older files would misunderstand a new one."""


@dataclass(frozen=True)
class Provenance:
    """Origin of a result.

    Attributes
    ----------
    design
        Whole design as TOML, overrides applied.
    command
        Command line.
    fidelity
        Name of the model.
    reason
        Why this model, and what it neglects.
    error
        Estimated relative error of the model; NaN where none was estimated.
    """

    design: str
    command: str
    fidelity: str
    reason: str
    error: float = math.nan


def write(path: Path, origin: Provenance, fill: Callable[[h5py.File], None]) -> None:
    """Write one HDF5 file, whole or not at all.

    Parameters
    ----------
    origin
        Written to the root attributes.
    fill
        Adds the group of the analysis to the open file.
    """
    with in_memory() as file:
        write_root_attributes(file, origin)
        fill(file)
        file.flush()
        image = file.id.get_file_image()
    write_bytes(path, image)


def in_memory() -> h5py.File:
    """Make a file that is never written to disk."""
    return h5py.File("memory", "w", driver="core", backing_store=False)


def write_root_attributes(file: h5py.File, origin: Provenance) -> None:
    """Write the root attributes that every file has."""
    file.attrs["format"] = "pendsus"
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["pendsus_version"] = __version__
    file.attrs["design"] = origin.design
    file.attrs["command"] = origin.command
    file.attrs["fidelity"] = origin.fidelity
    file.attrs["fidelity_reason"] = origin.reason
    file.attrs["estimated_error"] = origin.error


def add_scale(group: h5py.Group, name: str, values: ArrayLike, units: str) -> h5py.Dataset:
    """Add a dataset that serves as scale of an axis of others."""
    result = add_dataset(group, name, values, units)
    result.make_scale(name)
    return result


def add_dataset(
    group: h5py.Group, name: str, values: ArrayLike, units: str, *axes: h5py.Dataset
) -> h5py.Dataset:
    """Add a dataset with its units and, optionally, the scales of all its axes."""
    values = np.asarray(values)
    data = values.astype(h5py.string_dtype()) if values.dtype.kind == "U" else values
    result = group.create_dataset(name, data=data)
    result.attrs["units"] = units
    for axis, of in zip(result.dims, axes, strict=bool(axes)):
        axis.attach_scale(of)
        axis.label = str(of.name).rsplit("/", 1)[1]
    return result


@contextlib.contextmanager
def open_results(path: str | Path) -> Iterator[h5py.File]:
    """Open a results file for reading; failures inside are reported as of `reporting_damage`.

    Raises
    ------
    InputError
        If it was not written by pendsus, refers to other files, or is damaged.
    """
    remedy = "name a file that this version of pendsus wrote"
    with reporting_damage(path, "run the analysis again"), _opened(path, remedy) as file:
        problem = _foreign(file) or _unsafe(file, links=False)
        if problem:
            raise InputError.of("", problem, remedy)
        yield file


@contextlib.contextmanager
def open_data(path: str | Path) -> Iterator[h5py.File]:
    """Open HDF5 from elsewhere for reading, as `open_results` does; links are not followed."""
    remedy = "name a CSV, HDF5 or DTT XML file"
    with reporting_damage(path, remedy), _opened(path, remedy) as file:
        if problem := _unsafe(file, links=True):
            raise InputError.of("", problem, remedy)
        yield file


def is_results_file(path: str | Path) -> bool:
    """Whether a file holds results of pendsus."""
    if not h5py.is_hdf5(path):
        return False
    remedy = "name a whole file"
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
    if not os.path.exists(path):
        problem = "is missing"
    elif not Path(path).is_file():
        problem = "is not a regular file"
    else:
        try:
            return h5py.File(path, "r")
        except OSError:
            problem = "is not HDF5, or was cut off"
    raise InputError.of("", problem, remedy)


def _foreign(file: h5py.File) -> str:
    """Why a file is not one of pendsus; empty if it is."""
    try:
        known, version = file.attrs.get("format"), file.attrs.get("format_version", 0)
    except (OSError, RuntimeError, TypeError):
        return "is not in a known format (its attributes cannot be read)"
    if not isinstance(known, str) or known != "pendsus":
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
            if isinstance(item, h5py.Dataset):
                if item.external or item.is_virtual:
                    return f"keeps {format_value(item.name)} in another file, which is not opened"
                if (item.size or 0) * item.id.get_type().get_size() > largest:
                    return (
                        f"is damaged: {format_value(item.name)} should have {item.size} values,"
                        " more than the file can contain"
                    )
                if not links and not _has_sound_scales(item):
                    return f"is damaged: the scales of {format_value(item.name)} cannot be read"
            place = h5py.h5o.get_info(item.id).addr  # pyright: ignore[reportAttributeAccessIssue]
            if isinstance(item, h5py.Group) and place not in seen:
                pending.append(item)
            seen.add(place)
    return ""


def _has_sound_scales(item: h5py.Dataset) -> bool:
    """Whether the attributes of scales have the types and sizes that HDF5 takes for granted."""
    expected = {
        "DIMENSION_LIST": ("O", (item.ndim,)),
        "DIMENSION_LABELS": ("O", (item.ndim,)),
        "REFERENCE_LIST": ("V", None),
    }
    for name, (kind, shape) in expected.items():
        if name in item.attrs:
            found = item.attrs.get_id(name)
            is_text = h5py.check_string_dtype(found.dtype) is not None
            if found.dtype.kind != kind or (shape or found.shape) != found.shape:
                return False
            if is_text != (name == "DIMENSION_LABELS"):
                return False
    return True


LARGE = 1 << 26
"""Largest dataset accepted in a much smaller (compressed) file, bytes."""
