"""The results file of a sweep, into which points are written while it runs.

``NAME.h5.part`` has the layout of the finished HDF5 file from the start, and room for all points.
They are written to their places in it without HDF5, which leaves a damaged file behind if it is
killed. A further dataset marks the points that are safely on disk; so a killed run can be resumed.
When all are, the marks are deleted and the file gets its name.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.files.atomic import is_regular, writing_to
from suspension_cli.files.hdf5 import Provenance, Stored, write_root_attributes
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.job import Job
from suspension_cli.version import __version__

if TYPE_CHECKING:
    from jaxtyping import Int

UNIT = 64
"""Points per mark; chunks are multiples of it."""
SYNC_SECONDS = 2.0
"""Interval at which results are forced to disk and marked, s."""
OVERHEAD = 1 << 20
"""Bytes of an HDF5 file beyond the points, at most."""
MARKS = "unfinished"
"""Dataset with a mark for each unit of points; its attribute `sweep` is a digest of the job."""

Fill = Callable[[h5py.Group], None]
"""Writes the rest of the group beside the columns."""
After = Callable[[Path], None]
"""Completes an unfinished file that has all its points and is locked: open it without locking."""


@dataclass
class Store:
    """The points of a run that are done.

    Attributes
    ----------
    path
        Of the finished file.
    handle
        Of the unfinished one.
    places
        Byte at which each column begins in it, and the marks.
    done
        uint8: 1 for each unit that is safely on disk.
    """

    job: Job
    path: Path
    handle: int
    places: dict[str, int]
    done: Int[np.ndarray, " unit"]
    pending: list[tuple[int, int]] = field(default_factory=list)
    synced: float = field(default_factory=lambda: time.monotonic())

    @property
    def count(self) -> int:
        """Number of points."""
        return math.prod(self.job.shape)

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
        """Write the results of one chunk."""
        with writing_to(self.path):
            for column in self.job.columns:
                data = np.asarray(values[column.name], column.dtype).tobytes()
                size = len(data) // (stop - start)
                _write_all(self.handle, data, self.places[column.name] + start * size)
        self.pending.append((start, stop))
        if time.monotonic() - self.synced > SYNC_SECONDS:
            self.sync()

    def sync(self) -> None:
        """Force results to disk, then mark them.

        In this order a power cut loses work, but no missing result is ever marked.
        """
        with writing_to(self.path):
            os.fsync(self.handle)
            for start, stop in self.pending:
                self.done[start // UNIT : -(-stop // UNIT)] = 1
            _write_all(self.handle, self.done.tobytes(), self.places[MARKS])
            os.fsync(self.handle)
        self.pending.clear()
        self.synced = time.monotonic()

    def finish(self, after: After | None) -> None:
        """Let `after` fill the columns that need all points, and rename the file."""
        self.sync()
        assert self.done.all(), "every unit must have been written"
        part = part_of(self.path)
        with writing_to(self.path):
            # HDF5 hangs or crashes where there is no room
            _allocate(self.handle, os.fstat(self.handle).st_size + OVERHEAD)
            if after is not None:
                after(part)
            with h5py.File(part, "r+", locking=False) as file:
                del file[MARKS]
            os.fsync(self.handle)
            os.replace(part, self.path)


@contextlib.contextmanager
def opened(
    job: Job, path: Path, group: str, origin: Provenance, fill: Fill, resume: bool
) -> Iterator[Store]:
    """Begin or resume the file of a job; finished points are saved however the block ends."""
    part = part_of(path)
    key = (__version__, job.shape, job.columns, origin.design, origin.sweep)
    digest = hashlib.sha256(repr(key).encode()).hexdigest()
    with contextlib.ExitStack() as stack:
        with writing_to(path):
            for own in (path, part):
                if not is_regular(own):
                    remedy = "delete it, or name another folder"
                    raise InputError.of("--out", "is not a regular file", remedy, str(own))
            fresh = not (resume and part.exists())
            handle = os.open(part, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            stack.callback(os.close, handle)
            _lock(handle, path)
            if fresh:
                try:
                    _create(handle, part, job, group, origin, fill, digest)
                except BaseException:
                    part.unlink(missing_ok=True)
                    raise
            places = _find_places(part, job, group, digest)
        store = Store(job, path, handle, places, np.zeros(0, dtype=np.uint8))
        marks = os.pread(handle, -(-store.count // UNIT), places[MARKS])
        store.done = np.frombuffer(marks, dtype=np.uint8).copy()
        try:
            yield store
        except BaseException:
            with contextlib.suppress(OSError, InputError):
                store.sync()
            raise


def part_of(path: Path) -> Path:
    """Path of the unfinished file."""
    return path.with_name(path.name + ".part")


def _create(
    handle: int, part: Path, job: Job, group: str, origin: Provenance, fill: Fill, digest: str
) -> None:
    """Write the file without points, and allocate room for them.

    A full disk is then reported at once. HDF5 itself hangs or crashes on one, so there is a first
    attempt without it.
    """
    count = math.prod(job.shape)
    record = np.dtype([(column.name, column.dtype, column.shape) for column in job.columns])
    _allocate(handle, count * record.itemsize + OVERHEAD)
    allocated = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    allocated.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    allocated.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    with h5py.File(part, "w", locking=False) as file:
        write_root_attributes(file, origin)
        home = file.create_group(group)
        fill(home)
        for column in job.columns:
            shape = (*job.shape, *column.shape)
            home.create_dataset(column.name, shape, column.dtype, dcpl=allocated)
            home[column.name].attrs["units"] = column.units
        for name in job.scales:
            axis: Stored = home[name]
            if not axis.is_scale:
                axis.make_scale(name)
        for column in job.columns:
            values: Stored = home[column.name]
            for axis, name in zip(values.dims, (*job.scales, *column.axes), strict=True):
                axis.label = name
                if name != column.name:  # a scale has none itself
                    axis.attach_scale(home[name])
        file[MARKS] = np.zeros(-(-count // UNIT), dtype=np.uint8)
        file[MARKS].attrs["sweep"] = digest
    _allocate(handle, os.fstat(handle).st_size)


def _find_places(part: Path, job: Job, group: str, digest: str) -> dict[str, int]:
    """Find where columns and marks begin in the unfinished file of a job.

    Raises `InputError` if the file is another one, or is damaged.
    """
    anew = "start anew without --resume"
    try:
        with h5py.File(part, "r", locking=False) as file:
            if MARKS not in file or file[MARKS].attrs["sweep"] != digest:
                problem = f"{part.name} belongs to another design or sweep"
                remedy = f"take the same design and options, or {anew}"
                raise InputError.of("--resume", problem, remedy)
            names = (MARKS, *(f"{group}/{column.name}" for column in job.columns))
            sets: list[Stored] = [file[name] for name in names]
            return {one.name.rpartition("/")[2]: one.id.get_offset() for one in sets}
    except (OSError, RuntimeError, KeyError):
        raise InputError.of("--resume", f"{part.name} was cut off", anew) from None


def _lock(handle: int, path: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        problem, remedy = "another run is writing this file", "wait for it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(path)) from None
    except OSError:
        pass  # a file system without locks


def _allocate(handle: int, size: int) -> None:
    """Allocate the space now, so that a full disk is reported at once."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(handle, 0, size)
    else:
        system = os.fstatvfs(handle)
        if system.f_bavail * system.f_frsize < size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        os.ftruncate(handle, size)


def _write_all(handle: int, data: bytes, offset: int) -> None:
    view = memoryview(data)
    while view:
        written = os.pwrite(handle, view, offset)
        view, offset = view[written:], offset + written
