"""The results file of a sweep, and the points that are done while it runs.

During a run the points are records of one size in ``NAME.h5.part``, after a digest of the job and a
mark for each unit of points that is safely on disk; so a killed run can be resumed. From all of
them the HDF5 file is written.
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
"""Points per mark; chunks are multiples of it."""
SYNC_SECONDS = 2.0
"""Interval at which results are forced to disk and marked, s."""
HEAD = 32
"""Bytes of the digest of the job, so that a changed design is not resumed."""
BLOCK = 1 << 24
"""Bytes that are copied to the HDF5 file at once."""
OVERHEAD = 1 << 20
"""Bytes of an HDF5 file beyond the points, at most."""

Fill = Callable[[h5py.Group], None]
"""Writes the rest of the group beside the columns."""
After = Callable[[Path], None]
"""Completes an unfinished file that has all its points."""


class Job(Protocol):
    """A sweep's points; picklable."""

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
    """The points of a run that are done.

    Attributes
    ----------
    path
        Of the finished file.
    handle
        Of the unfinished one.
    done
        uint8: 1 for each unit that is safely on disk.
    record
        Type of one point.
    """

    job: Job
    path: Path
    handle: int
    done: Int[np.ndarray, " unit"]
    record: np.dtype
    pending: list[tuple[int, int]] = field(default_factory=list)
    synced: float = field(default_factory=lambda: time.monotonic())

    def missing(self, chunk: int) -> list[tuple[int, int]]:
        """Ranges of points still to be computed, each of at most a chunk."""
        ranges: list[tuple[int, int]] = []
        for unit in np.flatnonzero(self.done == 0).tolist():
            start, stop = unit * UNIT, min((unit + 1) * UNIT, self.job.count)
            if ranges and ranges[-1][1] == start and stop - ranges[-1][0] <= chunk:
                ranges[-1] = (ranges[-1][0], stop)
            else:
                ranges.append((start, stop))
        return ranges

    def put(self, start: int, stop: int, values: ColumnValues) -> None:
        """Write the results of one chunk."""
        points = np.zeros(stop - start, dtype=self.record)
        for name in self.record.names or ():
            points[name] = values[name]
        with writing_to(self.path):
            _write_all(self.handle, points.tobytes(), self._offset(start))
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
            _write_all(self.handle, self.done.tobytes(), HEAD)
            os.fsync(self.handle)
        self.pending.clear()
        self.synced = time.monotonic()

    def finish(self, group: str, origin: Provenance, fill: Fill, after: After | None) -> None:
        """Write the HDF5 file, let `after` fill the columns that need all points."""
        self.sync()
        assert self.done.all(), "every unit must have been written"
        new = self.path.with_name(self.path.name + ".new")
        with writing_to(self.path):
            try:
                new.unlink(missing_ok=True)
                with open(os.open(new, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666), "rb") as stream:
                    # HDF5 hangs or crashes where there is no room
                    _allocate(stream.fileno(), os.fstat(self.handle).st_size + OVERHEAD)
                with h5py.File(new, "w") as file:
                    write_root_attributes(file, origin)
                    self._write_group(file.create_group(group), fill)
                if after is not None:
                    after(new)
                with new.open("rb") as stream:
                    os.fsync(stream.fileno())
                os.replace(new, self.path)
            except BaseException:
                new.unlink(missing_ok=True)
                raise
            _part(self.path).unlink()

    def _write_group(self, home: h5py.Group, fill: Fill) -> None:
        job, shape = self.job, self.job.shape
        fill(home)
        for column in job.columns:
            home.create_dataset(column.name, (*shape, *column.shape), column.dtype)
            home[column.name].attrs["units"] = column.units
        for place, start, block in _blocks(shape, BLOCK // self.record.itemsize):
            size = math.prod(block) * self.record.itemsize
            points = np.frombuffer(os.pread(self.handle, size, self._offset(start)), self.record)
            for column in job.columns:
                values: Stored = home[column.name]
                values[place] = points[column.name].reshape(*block, *column.shape)
        for name in job.scales:
            axis: Stored = home[name]
            if not axis.is_scale:
                axis.make_scale(name)
        for column in job.columns:
            values = home[column.name]
            for axis, name in zip(values.dims, (*job.scales, *column.axes), strict=True):
                axis.label = name
                if name != column.name:  # a scale has none itself
                    axis.attach_scale(home[name])

    def _offset(self, point: int) -> int:
        return HEAD + len(self.done) + point * self.record.itemsize


def _blocks(
    shape: tuple[int, ...], most: int
) -> Iterator[tuple[tuple[int | slice, ...], int, tuple[int, ...]]]:
    """Divide a grid into blocks of consecutive points, if possible of at most so many.

    Yields their places in the grid, numbers of their first points, and shapes.
    """
    inner = [math.prod(shape[n + 1 :]) for n in range(len(shape))]
    axis = next(n for n, size in enumerate(inner) if size <= most or size == 1)
    step = max(1, most // inner[axis])
    for outer in np.ndindex(shape[:axis]):
        first = sum(n * size for n, size in zip(outer, inner, strict=False))
        for start in range(0, shape[axis], step):
            stop = min(start + step, shape[axis])
            block = (stop - start, *shape[axis + 1 :])
            yield (*outer, slice(start, stop)), first + start * inner[axis], block


@contextlib.contextmanager
def opened(job: Job, path: Path, origin: Provenance, resume: bool) -> Iterator[Store]:
    """Begin or resume the points of a job; finished ones are saved however the block ends."""
    record = np.dtype([(column.name, column.dtype, column.shape) for column in job.columns])
    part, units = _part(path), -(-job.count // UNIT)
    key = (__version__, job.count, job.columns, origin.design, origin.sweep)
    digest = hashlib.sha256(repr(key).encode()).digest()
    size = HEAD + units + job.count * record.itemsize
    with contextlib.ExitStack() as stack:
        with writing_to(path):
            for own in (path, part):
                if not is_regular(own):
                    remedy = "delete it, or name another folder"
                    raise InputError.of("--out", "is not a regular file", remedy, str(own))
            fresh = not part.exists()
            handle = os.open(part, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
            stack.callback(os.close, handle)
            _lock(handle, path)
            done = np.zeros(units, dtype=np.uint8)
            if resume and not fresh:
                _check(handle, part, digest, size)
                done[:] = np.frombuffer(os.pread(handle, units, HEAD), dtype=np.uint8)
            else:
                try:
                    os.ftruncate(handle, 0)
                    _allocate(handle, 2 * size + OVERHEAD)  # both files exist at the end
                    os.ftruncate(handle, size)
                    _write_all(handle, digest, 0)
                except BaseException:
                    part.unlink(missing_ok=True)
                    raise
        store = Store(job, path, handle, done, record)
        try:
            yield store
        except BaseException:
            with contextlib.suppress(OSError, InputError):
                store.sync()
            raise


def _part(path: Path) -> Path:
    return path.with_name(path.name + ".part")


def _lock(handle: int, path: Path) -> None:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        problem, remedy = "another run is writing this file", "wait for it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(path)) from None
    except OSError:
        pass  # a file system without locks


def _check(handle: int, part: Path, digest: bytes, size: int) -> None:
    """Raise `InputError` for an unfinished file that is not that of the job."""
    anew, found = "start anew without --resume", os.fstat(handle).st_size
    if found >= HEAD and os.pread(handle, HEAD, 0) != digest:
        problem = f"{part.name} belongs to another design or sweep"
        raise InputError.of("--resume", problem, f"take the same design and options, or {anew}")
    if found != size:
        raise InputError.of("--resume", f"{part.name} was cut off", anew)


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
