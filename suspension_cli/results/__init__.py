"""Results on disk: HDF5 files that tell what they hold and how it came about.

`docs/format.md` describes the files.  A file is put together in memory and appears under its name whole or not at all.
What each analysis puts into its group stands in a module of its own beside this one.
"""

from __future__ import annotations

import contextlib
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from suspension_cli import __version__
from suspension_cli.errors import Fault, InputError

FORMAT_VERSION = 1
"""Raised when a reader of older files would misunderstand a new one."""


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from.

    Attributes
    ----------
    design : str
        The whole design as TOML, overrides applied.
    command : str
        The command line.
    fidelity : str
        The rung of the ladder that was used.
    reason : str
        Why, and what was left out.
    sweep : str
        What identifies the points of a sweep; empty for others.
    error : float
        Estimated relative error of the rung; NaN where none was estimated.
    """

    design: str
    command: str
    fidelity: str
    reason: str
    sweep: str = ""
    error: float = math.nan


@contextlib.contextmanager
def writing_to(path: str | Path, key: str = "--out") -> Iterator[None]:
    """Tell a failure to write (no space, no permission) as a fault of `--out`, or of the path alone."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError([Fault(key, f"cannot be written ({reason})", "name a folder with space and permission", str(path))]) from None


def write_bytes(path: Path, data: bytes, key: str = "--out") -> None:
    """Write a file whole or not at all: under a temporary name first, then renamed; `key` as `writing_to` takes it."""
    with writing_to(path, key):
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            os.chmod(temporary, 0o666 & ~_umask())
            os.replace(temporary, path)
        except BaseException:
            with contextlib.suppress(OSError):
                os.unlink(temporary)
            raise


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current


def write(path: Path, origin: Provenance, fill: Callable[[h5py.File], None]) -> None:
    """Write one HDF5 file.

    Parameters
    ----------
    path : Path
    origin : Provenance
        Goes into the root attributes.
    fill : callable
        Puts the analysis's group into the open file.
    """
    with h5py.File("memory", "w", driver="core", backing_store=False) as file:
        root_attributes(file, origin)
        fill(file)
        file.flush()
        image = file.id.get_file_image()
    write_bytes(path, image)


def root_attributes(file: h5py.File, origin: Provenance) -> None:
    """What every file says of itself."""
    file.attrs["format"] = "pendsus"
    file.attrs["format_version"] = FORMAT_VERSION
    file.attrs["pendsus_version"] = __version__
    file.attrs["design"] = origin.design
    file.attrs["command"] = origin.command
    file.attrs["fidelity"] = origin.fidelity
    file.attrs["fidelity_reason"] = origin.reason
    file.attrs["estimated_error"] = origin.error


def scale(group: h5py.Group, name: str, values: Any, units: str) -> h5py.Dataset:
    """A dataset that others use as the scale of one of their axes."""
    made = dataset(group, name, values, units)
    made.make_scale(name)
    return made


def dataset(group: h5py.Group, name: str, values: Any, units: str, *axes: h5py.Dataset) -> h5py.Dataset:
    """A dataset with its units and the scales of its axes."""
    values = np.asarray(values)
    made = group.create_dataset(name, data=values.astype(h5py.string_dtype()) if values.dtype.kind == "U" else values)
    made.attrs["units"] = units
    for axis, of in zip(made.dims, axes, strict=bool(axes)):
        axis.attach_scale(of)
        axis.label = str(of.name).rsplit("/", 1)[1]
    return made


def open_results(path: str | Path) -> h5py.File:
    """Open a results file for reading.

    Raises
    ------
    InputError
        If it is no file of ours.
    """
    try:
        file = h5py.File(path, "r")
    except OSError:
        reason = "is missing" if not Path(path).exists() else "is not HDF5"
        raise InputError([Fault("", reason, "name a file that pendsus wrote")], str(path)) from None
    if file.attrs.get("format") != "pendsus" or file.attrs.get("format_version", 0) > FORMAT_VERSION:
        found = file.attrs.get("format_version", "no pendsus file")
        file.close()
        raise InputError([Fault("", f"is not in a format known here ({found})", "name a file that this version of pendsus wrote")], str(path))
    return file
