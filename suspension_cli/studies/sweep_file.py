"""The results file of a sweep, into which points are written while it runs.

``NAME.h5.part`` has the layout of the finished HDF5 file from the start, and room for all points.
They are written to their places in it without HDF5, which leaves a damaged file behind if it is
killed. A further dataset has checksums of the points that are done; so a killed run can be resumed,
also after a power cut. When all are done it is deleted, and the file gets its name.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import math
import os
import shutil
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import h5py
import numpy as np

from suspension_cli.errors import InputError
from suspension_cli.files.atomic import is_regular, writing_to
from suspension_cli.files.hdf5 import Provenance, Stored, write_root_attributes
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.job import Job
from suspension_cli.version import __version__

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

UNIT = 64
"""Points per checksum; chunks are multiples of it."""
OVERHEAD = 1 << 20
"""Bytes of an HDF5 file beyond the points, at most."""
SUMS = "unfinished"
"""Dataset with the checksum of each unit of points; its attribute `sweep` identifies the job."""
SUM = np.dtype("u4")
"""Type of a checksum (CRC-32); 0 for points that are missing."""

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
    stream
        The unfinished one.
    places
        Byte at which each column begins in it, and the checksums.
    """

    job: Job
    path: Path
    stream: BinaryIO
    places: dict[str, int]

    @property
    def count(self) -> int:
        """Number of points."""
        return math.prod(self.job.shape)

    def missing(self, chunk: int) -> list[tuple[int, int]]:
        """Ranges of points still to be computed, each of at most a chunk."""
        ranges: list[tuple[int, int]] = []
        size = -(-self.count // UNIT) * SUM.itemsize
        sums = np.frombuffer(_read(self.stream, size, self.places[SUMS]), SUM)
        for unit, known in enumerate(sums.tolist()):
            start, stop = unit * UNIT, min((unit + 1) * UNIT, self.count)
            if known and known == self._sum_in_file(start, stop):
                continue
            if ranges and ranges[-1][1] == start and stop - ranges[-1][0] <= chunk:
                ranges[-1] = (ranges[-1][0], stop)
            else:
                ranges.append((start, stop))
        return ranges

    def put(self, start: int, stop: int, values: ColumnValues) -> None:
        """Write the results of one chunk, then their checksums."""
        data = [np.asarray(values[column.name], column.dtype) for column in self.job.columns]
        with writing_to(self.path):
            for (place, _), part in zip(self._ranges(start, stop), data, strict=True):
                _write(self.stream, part.tobytes(), place)
            sums = [
                checksum(part[n : n + UNIT].tobytes() for part in data)
                for n in range(0, stop - start, UNIT)
            ]
            place = self.places[SUMS] + start // UNIT * SUM.itemsize
            _write(self.stream, np.array(sums, SUM).tobytes(), place)

    def finish(self, after: After | None) -> None:
        """Let `after` fill the columns that need all points, and rename the file."""
        part = part_of(self.path)
        with writing_to(self.path):
            _demand_room(part, OVERHEAD)
            if after is not None:
                after(part)
            with h5py.File(part, "r+", locking=False) as file:
                del file[SUMS]
            os.fsync(self.stream.fileno())
            if fcntl is None:
                self.stream.close()  # Windows renames no open file
            os.replace(part, self.path)

    def _sum_in_file(self, start: int, stop: int) -> int:
        """Checksum of the points of a unit as they are in the file."""
        return checksum(_read(self.stream, n, place) for place, n in self._ranges(start, stop))

    def _ranges(self, start: int, stop: int) -> Iterator[tuple[int, int]]:
        """First byte, and number of bytes, of points in each column."""
        for column in self.job.columns:
            size = math.prod(column.shape) * np.dtype(column.dtype).itemsize
            yield self.places[column.name] + start * size, (stop - start) * size


def checksum(parts: Iterable[bytes]) -> int:
    """Checksum of the bytes of a unit of points; never 0, which stands for none."""
    result = 0
    for part in parts:
        result = zlib.crc32(part, result)
    return result or 1


@contextlib.contextmanager
def opened(
    job: Job, path: Path, group: str, origin: Provenance, fill: Fill, resume: bool
) -> Iterator[Store]:
    """Begin or resume the file of a job."""
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
            known = (getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_BINARY"))  # not everywhere
            flags = os.O_RDWR | os.O_CREAT | sum(known)
            stream = stack.enter_context(os.fdopen(os.open(part, flags, 0o666), "r+b"))
            _lock(stream, path)
            if fresh:
                try:
                    _create(part, job, group, origin, fill, digest)
                except BaseException:
                    part.unlink(missing_ok=True)
                    raise
            places = _find_places(part, job, group, digest)
        yield Store(job, path, stream, places)


def part_of(path: Path) -> Path:
    """Path of the unfinished file."""
    return path.with_name(path.name + ".part")


def _create(part: Path, job: Job, group: str, origin: Provenance, fill: Fill, digest: str) -> None:
    """Write the file without points, if there is room for them."""
    count = math.prod(job.shape)
    record = np.dtype([(column.name, column.dtype, column.shape) for column in job.columns])
    _demand_room(part, count * record.itemsize + OVERHEAD)
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
        file[SUMS] = np.zeros(-(-count // UNIT), SUM)
        file[SUMS].attrs["sweep"] = digest


def _find_places(part: Path, job: Job, group: str, digest: str) -> dict[str, int]:
    """Find where columns and checksums begin in the unfinished file of a job.

    Raises `InputError` if the file is another one, or is damaged.
    """
    anew = "start anew without --resume"
    try:
        with h5py.File(part, "r", locking=False) as file:
            if SUMS not in file or file[SUMS].attrs["sweep"] != digest:
                problem = f"{part.name} belongs to another design or sweep"
                remedy = f"take the same design and options, or {anew}"
                raise InputError.of("--resume", problem, remedy)
            names = (SUMS, *(f"{group}/{column.name}" for column in job.columns))
            sets: list[Stored] = [file[name] for name in names]
            return {one.name.rpartition("/")[2]: one.id.get_offset() for one in sets}
    except (OSError, RuntimeError, KeyError):
        raise InputError.of("--resume", f"{part.name} was cut off", anew) from None


def _lock(stream: BinaryIO, path: Path) -> None:
    """Raise `InputError` if another run has the file; where locks are unknown it is not noticed."""
    if fcntl is None:
        return
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        problem, remedy = "another run is writing this file", "wait for it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(path)) from None
    except OSError:
        pass  # a file system without locks


def _demand_room(part: Path, size: int) -> None:
    """Raise `OSError` if a file cannot grow by so many bytes, as HDF5 hangs or crashes then."""
    if shutil.disk_usage(part.parent).free < size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    os.truncate(part, part.stat().st_size + size)


def _read(stream: BinaryIO, size: int, place: int) -> bytes:
    stream.seek(place)
    return stream.read(size)


def _write(stream: BinaryIO, data: bytes, place: int) -> None:
    stream.seek(place)
    stream.write(data)
    stream.flush()
