"""The HDF5 file that a sweep fills, and the journal of its finished points.

Every dataset is allocated in full when the file is made, and written in place. The journal lists
the points whose results are safely on disk, so that a killed run can be resumed.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import h5py
import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.files.atomic import is_regular, writing_to
from suspension_cli.files.hdf5 import Provenance, Stored, write_root_attributes
from suspension_cli.studies.builds import Column, ColumnValues
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from jaxtyping import Int

UNIT = 64
"""Points per entry of the journal; chunks are multiples of it."""
SYNC_SECONDS = 2.0
"""Interval at which results are forced to disk and entered into the journal, s."""


Place = tuple[int, np.dtype, tuple[int, ...]]
"""Offset of a column in the file, its type, and the shape of one point."""
Fill = Callable[[h5py.Group], None]
"""Writes the rest of the group beside the columns into a new file."""
After = Callable[[Path], None]
"""Completes an unfinished file that has all its points."""


class Job(Protocol):
    """A sweep's points. It is picklable, with results that do not depend on their grouping."""

    @property
    def count(self) -> int:
        """Number of points."""
        ...

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of the axes, the last varying fastest; their product is `count`."""
        ...

    @property
    def scales(self) -> tuple[str, ...]:
        """Names of the datasets that are the scales of `shape`: columns, or made by `fill`."""
        ...

    @property
    def columns(self) -> tuple[Column, ...]:
        """The results stored for each point."""
        ...

    def compute(self, start: int, stop: int) -> ColumnValues:
        """Compute the results of points start to stop - 1."""
        ...


@dataclass
class Store:
    """The file that is being filled, and the journal of its finished points."""

    count: int
    path: Path
    """Path of the finished file."""
    handle: int
    record: int
    done: Int[np.ndarray, " unit"]
    """uint8: 1 for each unit of points that is safely on disk."""
    place: dict[str, Place]
    pending: list[tuple[int, int]]
    synced: float

    def missing(self, chunk: int) -> list[tuple[int, int]]:
        """Ranges of points still to be computed, each of at most a chunk."""
        ranges: list[tuple[int, int]] = []
        for unit in np.flatnonzero(self.done == 0).tolist():
            start, stop = unit * UNIT, min((unit + 1) * UNIT, self.count)
            if ranges and ranges[-1][1] == start and stop - ranges[-1][0] <= chunk:
                ranges[-1] = (ranges[-1][0], stop)
            else:
                ranges.append((start, stop))
        return ranges

    def put(self, start: int, stop: int, values: ColumnValues) -> None:
        """Write the results of one chunk in place."""
        with writing_to(self.path):
            for name, (offset, dtype, shape) in self.place.items():
                data = np.ascontiguousarray(values[name], dtype=dtype)
                assert data.shape == (stop - start, *shape), name
                size = int(dtype.itemsize * np.prod(shape, dtype=int))
                _write_all(self.handle, data.tobytes(), offset + start * size)
        self.pending.append((start, stop))
        if time.monotonic() - self.synced > SYNC_SECONDS:
            self.sync()

    def sync(self) -> None:
        """Force results to disk, then enter them in the journal.

        In this order a power cut loses work, but the journal never lists missing results.
        """
        with writing_to(self.path):
            os.fsync(self.handle)
            for start, stop in self.pending:
                self.done[start // UNIT : -(-stop // UNIT)] = 1
            _write_all(self.record, self.done.tobytes(), JOURNAL_HEAD)
            os.fsync(self.record)
        self.pending.clear()
        self.synced = time.monotonic()

    def finish(self, after: After | None = None) -> None:
        """Let `after` fill the columns that need all points, then give the file its name."""
        self.sync()
        assert self.done.all(), "every unit must have been written"
        with writing_to(self.path):
            if after is not None:
                after(_part(self.path))
                os.fsync(self.handle)
            os.replace(_part(self.path), self.path)
            _journal(self.path).unlink()


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _journal(path: Path) -> Path:
    return path.with_name(path.name + ".journal")


JOURNAL_HEAD = 32
"""Bytes of the journal's head: a digest of the job, so that a changed design is not resumed."""


@contextlib.contextmanager
def opened(
    job: Job, path: Path, group: str, origin: Provenance, resume: bool, fill: Fill
) -> Iterator[Store]:
    """Begin or resume the file of a job; finished results are saved however the block ends."""
    with contextlib.ExitStack() as stack:
        with writing_to(path):
            for own in (path, _part(path), _journal(path)):
                if not is_regular(own):
                    remedy = "delete it, or name another folder"
                    raise InputError.of("--out", "is not a regular file", remedy, str(own))
            record = os.open(_journal(path), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            stack.callback(os.close, record)
            _lock(record, path)
            done = _resume(job, path, group, origin, record, fill) if resume else None
            if done is None:
                done = _begin(job, path, group, origin, record, fill)
            handle = os.open(_part(path), os.O_RDWR | os.O_NOFOLLOW)
            stack.callback(os.close, handle)
        store = Store(
            job.count,
            path,
            handle,
            record,
            done,
            _places(job, _part(path), group),
            [],
            time.monotonic(),
        )
        try:
            yield store
        except BaseException:
            with contextlib.suppress(OSError, InputError):
                store.sync()
            raise


def _lock(record: int, path: Path) -> None:
    try:
        fcntl.flock(record, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise InputError.of(
            "--out",
            "another run is writing this file",
            "wait for it, or name another folder",
            str(path),
        ) from None
    except OSError:
        pass  # a file system without locks


ANEW = "start anew without --resume"
"""Remedy for an unfinished file that cannot be resumed."""


def _resume(
    job: Job, path: Path, group: str, origin: Provenance, record: int, fill: Fill
) -> Int[np.ndarray, " unit"] | None:
    """Read the journal of an interrupted run; None if there is nothing to resume."""
    head = os.pread(record, JOURNAL_HEAD + _units(job) + 1, 0)
    if len(head) < JOURNAL_HEAD or not _part(path).exists():
        return None
    if head[:JOURNAL_HEAD] != _digest(job, origin) or len(head) != JOURNAL_HEAD + _units(job):
        remedy = f"take the same design and options, or {ANEW}"
        raise InputError.of(
            "--resume", f"{_part(path).name} belongs to another design or sweep", remedy
        )
    problem = _explain_mismatch(job, _part(path), group, origin, fill)
    if problem:
        raise InputError.of("--resume", f"{_part(path).name} {problem}", ANEW)
    return np.frombuffer(head[JOURNAL_HEAD:], dtype=np.uint8).copy()


def _explain_mismatch(job: Job, part: Path, group: str, origin: Provenance, fill: Fill) -> str:
    """Why an unfinished file with this job's journal is not its file; "" if it is.

    Everything is compared with the file that the job would begin; of columns only place and size.
    """
    try:
        with (
            h5py.File(part, "r") as file,
            h5py.File("expected", "w", driver="core", backing_store=False) as expected,
        ):
            home: Stored
            drawn: Stored
            write_root_attributes(expected, origin)
            fill(expected.create_group(group))
            names = [
                name
                for name in ("format", "format_version", "pendsus_version", "design", "fidelity")
                if not _has_same_attribute(file.attrs, expected.attrs, name)
            ]
            home, drawn = file.get(group, {}), expected[group]
            grids = [name for name in job.scales if name in drawn]
            names += [
                name
                for name in grids
                if name not in home or home[name][()].tolist() != drawn[name][()].tolist()
            ]
            names += [
                column.name
                for column in job.columns
                if not _is_complete(home.get(column.name), column, job.shape, part)
            ]
    except Exception as error:  # HDF5 raises many types for other files
        return "is no sound HDF5 file" + (
            " (it was cut off)" if "truncated" in str(error) or part.stat().st_size == 0 else ""
        )
    return f"is of another run, or was changed since ({names[0]})" if names else ""


def _has_same_attribute(
    found: h5py.AttributeManager, expected: h5py.AttributeManager, name: str
) -> bool:
    return name in found and bool(found[name] == expected[name])


def _is_complete(found: Stored, column: Column, shape: tuple[int, ...], part: Path) -> bool:
    """Whether a column has its place, type and size in the file."""
    if (
        not isinstance(found, h5py.Dataset)
        or found.shape != (*shape, *column.shape)
        or found.dtype != np.dtype(column.dtype)
    ):
        return False
    offset = found.id.get_offset()
    return (
        not found.external and offset is not None and offset + found.nbytes <= part.stat().st_size
    )


def _begin(
    job: Job, path: Path, group: str, origin: Provenance, record: int, fill: Fill
) -> Int[np.ndarray, " unit"]:
    """Make a new file with its journal; an older journal is emptied first."""
    try:
        os.ftruncate(record, 0)
        _create(job, _part(path), group, origin, fill)
        done = np.zeros(_units(job), dtype=np.uint8)
        _write_all(record, _digest(job, origin) + done.tobytes(), 0)
    except BaseException:
        _part(path).unlink(missing_ok=True)
        _journal(path).unlink(missing_ok=True)
        raise
    return done


def _units(job: Job) -> int:
    return -(-job.count // UNIT)


def _digest(job: Job, origin: Provenance) -> bytes:
    return hashlib.sha256(
        repr((__version__, job.count, job.columns, origin.design, origin.sweep)).encode()
    ).digest()


def _create(job: Job, part: Path, group: str, origin: Provenance, fill: Fill) -> None:
    """Allocate the whole file, with every dataset contiguous and in its final place."""
    try:
        part.unlink(missing_ok=True)
        os.close(os.open(part, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666))  # follows no link
        _allocate(part, _estimate(job))  # HDF5 crashes where it cannot write
        with h5py.File(part, "w") as file:
            write_root_attributes(file, origin)
            home = file.create_group(group)
            fill(home)
            made = [_contiguous(home, column, job.shape) for column in job.columns]
            for name in job.scales:
                axis: Stored = home[name]
                if not axis.is_scale:
                    axis.make_scale(name)
            for column, values in zip(job.columns, made, strict=True):
                values.attrs["units"] = column.units
                for axis, name in zip(values.dims, (*job.scales, *column.axes), strict=True):
                    axis.label = name
                    if name != column.name:  # a scale has none itself
                        axis.attach_scale(home[name])
        size = max(
            offset + job.count * dtype.itemsize * int(np.prod(shape, dtype=int))
            for offset, dtype, shape in _places(job, part, group).values()
        )
        _allocate(part, size)
    except OSError as error:
        if error.errno is None:
            raise
        raise OSError(error.errno, os.strerror(error.errno)) from None  # HDF5 gives a long message


def _estimate(job: Job) -> int:
    """Estimate the size of the file, bytes: columns, scales, and their descriptions."""
    each = sum(
        np.dtype(column.dtype).itemsize * int(np.prod(column.shape, dtype=int))
        for column in job.columns
    )
    return job.count * each + 16 * sum(job.shape) + HEADROOM


HEADROOM = 1 << 16
"""Bytes for attributes, names and the design's text."""


def _allocate(part: Path, size: int) -> None:
    """Allocate the space now, so that a full disk is reported at once."""
    with part.open("r+b") as stream:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(stream.fileno(), 0, max(size, part.stat().st_size))
        elif os.statvfs(part).f_bavail * os.statvfs(part).f_frsize < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _contiguous(home: h5py.Group, column: Column, shape: tuple[int, ...]) -> h5py.Dataset:
    layout = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    layout.set_layout(h5py.h5d.CONTIGUOUS)
    layout.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    layout.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    layout.set_obj_track_times(False)  # identical runs write identical bytes
    space = h5py.h5s.create_simple((*shape, *column.shape))
    kind = h5py.h5t.py_create(np.dtype(column.dtype), logical=True)
    return h5py.Dataset(h5py.h5d.create(home.id, column.name.encode(), kind, space, dcpl=layout))


def _places(job: Job, part: Path, group: str) -> dict[str, Place]:
    """Find the place of each column in the file."""
    with h5py.File(part, "r") as file:
        home: Stored = file[group]
        return {
            column.name: (home[column.name].id.get_offset(), np.dtype(column.dtype), column.shape)
            for column in job.columns
        }


def _write_all(handle: int, data: bytes, offset: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(handle, view, offset)
        view, offset = view[written:], offset + written
