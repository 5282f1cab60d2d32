"""Run a job: chunks of points, on processes or a Dask cluster, whose results are kept on disk.

A job computes any range of its points independently, so number of workers and engine do not matter.
Finished points are in ``NAME.h5.part``: a line that identifies the job, then an array as in a npy
file, with a record of each point's checksum and results. A run that is killed, also by a power cut,
continues from there with ``resume``. When all points are done, the results file is written.
"""

from __future__ import annotations

import contextlib
import errno
import gc
import hashlib
import itertools
import os
import shutil
import signal
import threading
import time
import zlib
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import h5py
import numpy as np

from suspension_cli.errors import InputError, PendsusError
from suspension_cli.files.atomic import is_regular, writing_to
from suspension_cli.files.hdf5 import Provenance, write_root_attributes
from suspension_cli.studies import cluster
from suspension_cli.version import __version__

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

STARTUP = 5.0
"""Time, s, that a run must still take for further processes to start: they import the program."""
OVERHEAD = 1 << 20
"""Bytes of a results file beyond the points, at most."""
SUM = ("checksum", "<u4")
"""First field of a record: CRC-32 of the others."""

Range = tuple[int, int]
"""First point, and one after the last."""
Columns = dict[str, Any]
"""Arrays of results by name, with the points along the first axis."""
Results = Generator[tuple[int, Columns], None, None]
Write = Callable[[h5py.Group, Columns], None]
"""Writes the results of all points, with all that describes them, into a group."""
Progress = Callable[[int, int, float], None]
"""Called with points done, total points, and points per second."""


class Job(Protocol):
    """Points whose results are computed in any ranges; picklable."""

    @property
    def count(self) -> int:
        """Number of points."""
        ...

    @property
    def identity(self) -> str:
        """Text that differs between jobs of one design."""
        ...

    def compute(self, start: int, stop: int) -> Columns:
        """Compute the results of points start to stop - 1."""
        ...


def run(
    job: Job,
    path: Path,
    group: str,
    origin: Provenance,
    write: Write,
    *,
    workers: int | None = 1,
    scheduler: str | None = None,
    chunk: int = 512,
    resume: bool = False,
    progress: Progress = lambda _done, _all, _rate: None,
) -> None:
    """Compute all points of a job, and write them into a group of the results file `path`.

    `workers` is a number of processes; None starts one per core when the points left take long. A
    Dask `scheduler` may compute instead.
    """
    with contextlib.ExitStack() as stack:
        client = None
        if scheduler is not None:
            client = stack.enter_context(cluster.connected(scheduler))
        points = stack.enter_context(_opened(path, job, origin, resume))
        ranges = points.missing(chunk)
        done, began, fresh = job.count - sum(b - a for a, b in ranges), time.monotonic(), 0
        progress(done, job.count, 0.0)
        here = client is None
        results = _here(job, ranges, workers) if here else _on_cluster(job, ranges, client)
        with contextlib.closing(results):
            for start, values in results:
                fresh += points.put(start, values)
                rate = fresh / max(time.monotonic() - began, 1e-9)
                progress(done + fresh, job.count, rate)
        points.write_results(group, origin, write)
    part_of(path).unlink()


def part_of(path: Path) -> Path:
    """Path of the unfinished file."""
    return path.with_name(path.name + ".part")


@dataclass
class _Points:
    """Finished points of a job in an unfinished file.

    `path` is that of the results file. The type of records, and where they begin in the stream,
    are known from the first chunk on.
    """

    path: Path
    count: int
    stream: BinaryIO
    record: np.dtype | None = None
    place: int = 0

    def read_header(self, key: bytes) -> None:
        """Find the records; raises `InputError` if the file is another one, or was cut off."""
        name, anew = part_of(self.path).name, "start anew without --resume"
        if self.stream.readline(len(key)) != key:
            remedy = f"take the same design and options, or {anew}"
            problem = f"{name} belongs to another design or sweep"
            raise InputError.of("--resume", problem, remedy)
        size = os.fstat(self.stream.fileno()).st_size
        if size == len(key):
            return
        with contextlib.suppress(ValueError):
            np.lib.format.read_magic(self.stream)
            _, _, self.record = np.lib.format.read_array_header_1_0(self.stream)
            self.place = self.stream.tell()
        if self.record is None or size != self.place + self.count * self.record.itemsize:
            raise InputError.of("--resume", f"{name} was cut off", anew)

    def _mapped(self, kind: Any, *width: int) -> np.ndarray:
        self.stream.flush()
        return np.memmap(self.stream, kind, "r", self.place, (self.count, *width))

    def missing(self, chunk: int) -> list[Range]:
        """Chunks that lack a point; those of a run that was never interrupted."""
        starts = range(0, self.count, chunk)
        ranges = [(start, min(start + chunk, self.count)) for start in starts]
        if self.record is None:
            return ranges
        raw = self._mapped(np.uint8, self.record.itemsize)
        done = np.array(_checksums(raw)) == self._mapped(self.record)[SUM[0]]
        return [(start, stop) for start, stop in ranges if not done[start:stop].all()]

    def put(self, start: int, values: Columns) -> int:
        """Write the results of points from `start` on; return their number."""
        fields = [(name, one.dtype, one.shape[1:]) for name, one in values.items()]
        count = len(next(iter(values.values())))
        records = np.zeros(count, [SUM, *fields])
        for name, one in values.items():
            records[name] = one
        records[SUM[0]] = _checksums(records.view(np.uint8).reshape(count, -1))
        with writing_to(self.path):
            if self.record is None:
                self._begin(records.dtype)
            _write(self.stream, records.tobytes(), self.place + start * records.itemsize)
        return count

    def _begin(self, record: np.dtype) -> None:
        """Write the header, and make room for all points and for the results file."""
        header = {"descr": record.descr, "fortran_order": False, "shape": (self.count,)}
        np.lib.format.write_array_header_1_0(self.stream, header)
        self.place, size = self.stream.tell(), self.count * record.itemsize
        try:
            _demand_room(self.path, 2 * size + OVERHEAD)
            self.stream.truncate(self.place + size)
        except OSError:
            part_of(self.path).unlink()
            raise
        self.record = record

    def write_results(self, group: str, origin: Provenance, write: Write) -> None:
        """Write the results file under a temporary name, and rename it."""
        temporary = self.path.with_name(f".{self.path.name}.new")
        assert self.record is not None
        records = self._mapped(self.record)
        columns = {name: records[name] for name in self.record.names or () if name != SUM[0]}
        with writing_to(self.path):
            try:  # without room HDF5 hangs or crashes
                _demand_room(self.path, records.nbytes + OVERHEAD)
                with h5py.File(temporary, "w", locking=False) as file:
                    write_root_attributes(file, origin)
                    write(file.create_group(group), columns)
                with temporary.open("r+b") as stream:
                    os.fsync(stream.fileno())
                os.replace(temporary, self.path)
            except BaseException:
                temporary.unlink(missing_ok=True)
                raise


@contextlib.contextmanager
def _opened(path: Path, job: Job, origin: Provenance, resume: bool) -> Iterator[_Points]:
    """Begin or resume the unfinished file of a job, which no other run may write meanwhile."""
    part, known = part_of(path), (__version__, job.count, origin.design, job.identity)
    key = hashlib.sha256(repr(known).encode()).hexdigest().encode() + b"\n"
    with contextlib.ExitStack() as stack:
        with writing_to(path):
            for own in (path, part):
                if not is_regular(own):
                    remedy = "delete it, or name another folder"
                    raise InputError.of("--out", "is not a regular file", remedy, str(own))
            resume = resume and part.exists()
            part.touch()
            stream = stack.enter_context(part.open("r+b"))
            _lock(stream, path)
        points = _Points(path, job.count, stream)
        if resume:
            points.read_header(key)
        else:
            stream.truncate(0)
            _write(stream, key, 0)
        yield points


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


def _checksums(raw: np.ndarray) -> list[int]:
    """Checksums of records, given as rows of bytes."""
    return [zlib.crc32(row[np.dtype(SUM[1]).itemsize :]) for row in raw]


def _demand_room(path: Path, size: int) -> None:
    """Raise `OSError` if there is no room for so many bytes beside a file."""
    if shutil.disk_usage(path.parent).free < size:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _write(stream: BinaryIO, data: bytes, place: int) -> None:
    stream.seek(place)
    stream.write(data)
    stream.flush()


def _here(job: Job, ranges: list[Range], workers: int | None) -> Results:
    """Compute in this process, and on as many as there are cores if the rest takes long.

    The first range does not count, as modules are imported for it.
    """
    if workers is not None and workers > 1 and len(ranges) > 1:
        yield from _on_processes(job, ranges, workers)
        return
    most = (os.cpu_count() or 1) if workers is None else 1
    for n, part in enumerate(ranges, 1):
        began = time.monotonic()
        found = _compute(job, part)
        left = (len(ranges) - n) * (time.monotonic() - began)
        yield found
        if n > 1 and min(most, len(ranges) - n) > 1 and left > STARTUP:
            yield from _on_processes(job, ranges[n:], min(most, len(ranges) - n))
            return


def _share(pool: Executor, job: Job, ranges: list[Range], most: int) -> Results:
    """Submit ranges, `most` at a time, and wait for results as they are ready."""
    from concurrent.futures import FIRST_COMPLETED, wait

    waiting, running = iter(ranges), set[Any]()
    while True:
        with _uninterrupted():
            new = itertools.islice(waiting, most - len(running))
            running |= {pool.submit(_compute, job, part) for part in new}
        if not running:
            return
        finished, running = wait(running, return_when=FIRST_COMPLETED)
        yield from (future.result() for future in finished)


def _compute(job: Job, part: Range) -> tuple[int, Columns]:
    values = job.compute(*part)
    # systems and what is prepared for them refer to each other: without this their matrices stay
    # until the collector counts enough objects, gigabytes later
    gc.collect(0)
    return part[0], values


def _exit_with_parent() -> None:
    """End this worker process when its parent process is killed."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            wait([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _on_processes(job: Job, ranges: list[Range], workers: int) -> Results:
    """Compute on processes, and collect the results in this one."""
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    with ProcessPoolExecutor(workers, get_context("spawn"), _exit_with_parent) as pool:
        try:
            yield from _share(pool, job, ranges, 2 * workers)
        except BrokenProcessPool:
            raise PendsusError(
                "a worker was killed, perhaps out of memory; give fewer --workers or a smaller"
                " --chunk and continue with --resume"
            ) from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C; processes started meanwhile ignore it, as this one ends them.

    Windows has no such delay.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _on_cluster(job: Job, ranges: list[Range], client: cluster.Client) -> Results:
    """Compute on a cluster; raises `PendsusError` if its scheduler or workers are lost."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker  # pyright: ignore[reportMissingImports]
    from distributed.comm import CommClosedError  # pyright: ignore

    most = 4 * max(1, sum(client.nthreads().values()))
    try:
        yield from _share(client.get_executor(pure=False), job, ranges, most)
    except (CancelledError, CommClosedError) as error:
        reason = str(error).partition("\n")[0] or "its work was cancelled"
        raise PendsusError(
            f"the connection to the scheduler was lost ({reason}); restart it and continue with"
            " --resume"
        ) from None
    except KilledWorker:
        raise PendsusError(
            "the cluster's workers were killed, perhaps out of memory; give a smaller --chunk and"
            " continue with --resume"
        ) from None
