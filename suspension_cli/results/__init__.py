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
from suspension_cli.errors import Fault, InputError, shown

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
        If it is no file of ours, or leads to others.
    """
    problem = "is missing" if not Path(path).exists() else "" if Path(path).is_file() else "is no regular file"
    if not problem:
        try:
            file = h5py.File(path, "r")
        except OSError:
            problem = "is not HDF5, or was cut off"
        else:
            problem = _foreign(file) or _unsafe(file)
            if not problem:
                return file
            file.close()
    raise InputError([Fault("", problem, "name a file that this version of pendsus wrote")], str(path))


def _foreign(file: h5py.File) -> str:
    """Why a file is none of ours; empty if it is."""
    try:
        known, version = file.attrs.get("format"), file.attrs.get("format_version", 0)
    except (OSError, RuntimeError, TypeError):
        return "is not in a format known here (its attributes cannot be read)"
    if not isinstance(known, str) or known != "pendsus":
        return "is not in a format known here (no pendsus file)"
    if not isinstance(version, np.integer) or not 0 < version <= FORMAT_VERSION:
        return f"is not in a format known here ({shown(version)})"
    return ""


def _unsafe(file: h5py.File) -> str:
    """What in a file leads to other files, in a circle or to more than it holds; empty if nothing does."""
    most = max(LARGE, 8 * os.path.getsize(file.filename))
    seen: set[int] = set()
    todo: list[h5py.Group] = [file]
    try:
        while todo:
            group = todo.pop()
            for name in group:
                if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                    return f"holds a link ({shown(name)}), which is not followed"
                item = group[name]
                if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
                    return f"keeps {shown(item.name)} in another file, which is not opened"
                if isinstance(item, h5py.Dataset) and item.nbytes > most:
                    return f"is spoilt: {shown(item.name)} should have {item.size} values, more than the file can hold"
                place = h5py.h5o.get_info(item.id).addr  # pyright: ignore[reportAttributeAccessIssue]
                if isinstance(item, h5py.Group) and place not in seen:
                    todo.append(item)
                seen.add(place)
    except MemoryError:
        raise
    except Exception as error:  # HDF5 fails in many ways on spoilt bytes
        return f"is spoilt: {brief(error)}"
    return ""


LARGE = 1 << 26
"""Bytes that a dataset may have in a smaller file, which can only be compressed ones."""


def brief(error: Exception) -> str:
    """What an exception says, on one short line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 120 else f"{text[:117]}..."
