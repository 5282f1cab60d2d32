"""Run a job: chunks of points, on processes or a Dask cluster, whose results are kept on disk.

A job computes any range of its points independently, so number of workers and engine do not matter.
Finished chunks are files with checksums in the folder ``NAME.h5.part``, see `chunks`. A run that is
killed, also by a power cut, continues from there with ``resume``. When all points are done, the
results may show that another job (in a more complete model) is to be computed instead: it keeps its
chunks in a folder inside that of the first, and what the first had shown follows from its chunks
again after an interruption. At last the results file is written.
"""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import os
import shutil
import signal
import socket
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TextIO

import h5py
import numpy as np

from suspension_cli.conventions import BUILDS_AT_ONCE
from suspension_cli.errors import InputError, PendsusError, format_value, one_line
from suspension_cli.files import hdf5
from suspension_cli.files.hdf5 import Provenance
from suspension_cli.files.mapped_arrays import new_array, release
from suspension_cli.files.whole_files import is_regular, lock, remove_leftovers, writing_to
from suspension_cli.studies import chunks
from suspension_cli.studies.chunks import Columns
from suspension_cli.studies.interpolated import InterpolatedMap
from suspension_cli.version import __version__

SIGNALS_APART = 1.0
"""Longest time, s, between the signals by which a batch system ends workers and this process."""
STARTUP = 5.0
"""Time, s, that a run must still take for further processes to start: they import the program."""
PATIENCE = 5.0
"""Seconds in which a scheduler must answer and have a worker, and may have lost all of them."""
EVERY = 1.0
"""Time, s, after which a cluster without results is asked for its workers."""
KEY = "job"
"""File in the folder of an unfinished run that identifies its job."""

Client = Any
"""A `distributed.Client`, of an optional dependency."""
Pipe = Any
"""Reading end of a pipe of `multiprocessing`, whose type differs between systems."""
Range = tuple[int, int]
"""First point, and one after the last."""
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


class Verdict(NamedTuple):
    """What follows from the results of all points of a job.

    If it is not to be computed in another way (`instead`), they are written, with their origin.
    That job may have further points beside those of this one, which are kept (`keeps_points`).
    """

    origin: Provenance
    write: Write
    instead: Job | None = None
    keeps_points: bool = False


Review = Callable[[Columns], Verdict]
"""Judges the results of all points of the last job."""


def run(
    job: Job,
    path: Path,
    group: str,
    origin: Provenance,
    write: Write,
    *,
    review: Review | None = None,
    workers: int | None = 1,
    scheduler: str | None = None,
    chunk: int = BUILDS_AT_ONCE,
    resume: bool = False,
    progress: Progress = lambda _done, _all, _rate: None,
) -> None:
    """Compute all points of a job, and write them into a group of the results file `path`.

    A `review` may replace origin and `write`, or have another job computed instead. `workers` is a
    number of processes; None starts one per core when the points left take long. A Dask `scheduler`
    may compute instead.
    """
    with contextlib.ExitStack() as stack:
        client = None
        if scheduler is not None:
            client = stack.enter_context(connected(scheduler))
        points = stack.enter_context(_opened(path, job, origin, resume))
        how = {"workers": workers, "client": client, "chunk": chunk, "progress": progress}
        _compute_all(job, points, **how)
        verdict = Verdict(origin, write)
        while review is not None and (verdict := review(points.columns)).instead is not None:
            job = verdict.instead
            points = points.extended(job) if verdict.keeps_points else points.of_another(job)
            _compute_all(job, points, **how)
        columns = points.columns
        write = verdict.write
        hdf5.write_large(
            path, verdict.origin, lambda file: write(file.create_group(group), columns)
        )
    shutil.rmtree(part_of(path))


def _compute_all(
    job: Job,
    points: _Points,
    *,
    workers: int | None,
    client: Client | None,
    chunk: int,
    progress: Progress,
) -> None:
    """Compute the points of a job that are not done."""
    starts = range(0, job.count, chunk)
    ranges = [(start, min(start + chunk, job.count)) for start in starts]
    ranges = [(start, stop) for start, stop in ranges if not points.done[start:stop].all()]
    done = int(points.done.sum())
    began = time.monotonic()
    progress(done, job.count, 0.0)
    here = client is None
    results = _here(job, ranges, workers) if here else _on_cluster(job, ranges, client)
    with contextlib.closing(results):
        for start, values in results:
            points.save(start, values)
            now = int(points.done.sum())
            progress(now, job.count, (now - done) / max(time.monotonic() - began, 1e-9))


def part_of(path: Path) -> Path:
    """Folder of the unfinished run."""
    return path.with_name(path.name + ".part")


class _Points:
    """Results of the points of a job that are done, as arrays and as chunks in a folder."""

    def __init__(self, path: Path, count: int, key: str, folder: Path | None = None) -> None:
        self.path = path
        self.key = key
        self.folder = folder or part_of(path)
        self.done = np.zeros(count, dtype=bool)
        self.columns: Columns = {}

    def of_another(self, job: Job) -> _Points:
        """Points of a job that follows from the results of this one, with those already done."""
        key = hashlib.sha256(f"{self.key} {job.identity}".encode()).hexdigest()
        result = _Points(self.path, job.count, key, self.folder / key[:16])
        with writing_to(self.path):
            result.folder.mkdir(exist_ok=True)
        result.read()
        return result

    def extended(self, job: Job) -> _Points:
        """Points of a job that has these and further ones, with those already done."""
        result = _Points(self.path, job.count, self.key, self.folder)
        result.read()
        return result

    def save(self, start: int, values: Columns) -> None:
        """Keep the results of points from `start` on."""
        file = chunks.path_of(self.folder, start)
        with writing_to(self.path):
            chunks.write(file.with_suffix(".new"), self.key, start, values)
            os.replace(file.with_suffix(".new"), file)
        self.add(start, values)

    def add(self, start: int, values: Columns) -> None:
        """Take over the results of points from `start` on."""
        for name, one in values.items():
            if name not in self.columns:
                shape = (len(self.done), *one.shape[1:])
                with writing_to(self.path):
                    self.columns[name] = new_array(self.folder, shape, one.dtype)
            column = self.columns[name]
            column[start : start + len(one)] = one
            release(column)
            self.done[start : start + len(one)] = True

    def read(self) -> None:
        """Read the chunks in the folder; those that are not as written are computed again."""
        for file in self.folder.glob(f"*{chunks.ENDING}"):
            start = chunks.start_of(file)
            found = chunks.read(file, self.key, len(self.done))
            if start is not None and found is not None:
                self.add(start, found)


@contextlib.contextmanager
def _opened(path: Path, job: Job, origin: Provenance, resume: bool) -> Iterator[_Points]:
    """Begin or resume the folder of a job, which no other run may write meanwhile."""
    folder = part_of(path)
    if not is_regular(path, follow=True):
        problem = "is not a regular file"
        remedy = "delete it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(path))
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        problem = "is no folder of an unfinished run"
        remedy = "delete it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(folder))
    known = (__version__, job.count, origin.design, job.identity)
    key = hashlib.sha256(repr(known).encode()).hexdigest()
    points = _Points(path, job.count, key)
    with contextlib.ExitStack() as stack:
        with writing_to(path):
            folder.mkdir(exist_ok=True)
            stream = stack.enter_context((folder / KEY).open("a+"))
            _lock(stream, path)
            remove_leftovers(path)
            stream.seek(0)
            given = stream.read()
            if not (resume and given):
                for file in folder.glob(f"*{chunks.ENDING}"):
                    file.unlink()
                for inner in filter(Path.is_dir, folder.iterdir()):
                    shutil.rmtree(inner)
                stream.truncate(0)
                stream.write(key)
                stream.flush()
        if resume and given == key:
            points.read()
        elif resume and given:
            problem = f"{folder.name} belongs to another design or sweep"
            remedy = "take the same design and options, or start anew without --resume"
            raise InputError.of("--resume", problem, remedy)
        try:
            yield points
        finally:
            if not points.done.any():
                shutil.rmtree(folder, ignore_errors=True)


def _lock(stream: TextIO, path: Path) -> None:
    """Raise `InputError` if another run has the file; where locks are unknown it is not noticed."""
    if lock(stream.fileno()) is False:
        problem = "another run is writing this file"
        remedy = "wait for it, or name another folder"
        raise InputError.of("--out", problem, remedy, str(path))


def _here(job: Job, ranges: list[Range], workers: int | None) -> Results:
    """Compute in this process, and on as many as there are cores if the rest takes long.

    The first range does not count, as modules are imported for it. An interpolated map is evaluated
    in less time than other processes take to start.
    """
    if isinstance(job, InterpolatedMap):
        workers = 1
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


def _share(
    pool: Executor,
    job: Job,
    ranges: list[Range],
    most: int,
    compute: Callable[[Job, Range], Any],
    check: Callable[[], None] = lambda: None,
) -> Generator[Any, None, None]:
    """Submit calls of `compute`, `most` at a time, and wait for results as they are ready.

    `check` is called at least every second; it may raise an error.
    """
    from concurrent.futures import FIRST_COMPLETED, wait

    waiting = iter(ranges)
    running = set[Any]()
    while True:
        with _uninterrupted():
            new = itertools.islice(waiting, most - len(running))
            running |= {pool.submit(compute, job, part) for part in new}
        if not running:
            return
        finished, running = wait(running, EVERY, return_when=FIRST_COMPLETED)
        check()
        yield from (future.result() for future in finished)


def _compute(job: Job, part: Range) -> tuple[int, Columns]:
    return part[0], job.compute(*part)


def _compute_or_error(job: Job, part: Range) -> tuple[int, Columns] | Exception:
    """Return an error instead of raising it: what is raised then is from the cluster."""
    try:
        return _compute(job, part)
    except Exception as error:
        return error


def _start_worker(stopped: Pipe) -> None:
    """Let this worker process end when `stopped` is closed, or its parent process is killed."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            wait([parent.sentinel, stopped])
            os._exit(1)

    if hasattr(signal, "pthread_sigmask"):  # by which the pool ends what is left of a broken one
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    threading.Thread(target=watch, daemon=True).start()


def _on_processes(job: Job, ranges: list[Range], workers: int) -> Results:
    """Compute on processes, and collect the results in this one."""
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    context = get_context("spawn")
    stopped, stop = context.Pipe(duplex=False)
    with _uninterrupted():
        _start_semaphore_tracker()
        pool = ProcessPoolExecutor(workers, context, _start_worker, (stopped,))
    with stopped, stop, pool:
        try:
            yield from _share(pool, job, ranges, 2 * workers, _compute)
        except BrokenProcessPool:
            # batch systems end one process after another: the signal to this one may still come
            time.sleep(SIGNALS_APART)
            raise PendsusError(
                "a worker was killed, perhaps out of memory; give fewer --workers or a smaller"
                " --chunk and continue with --resume"
            ) from None
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            stop.close()  # what workers compute now is not needed
            raise


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Delay the signals that end a run; processes started meanwhile ignore them.

    This process ends them. Windows has no such delay.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _ending_signals())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _ending_signals() -> set[signal.Signals]:
    return {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}


def _start_semaphore_tracker() -> None:
    """Start the process that removes the semaphores of this one, if it runs not yet.

    While signals are delayed, so that it is not ended by SIGHUP. As it stops the delay of some,
    this begins again.
    """
    if not hasattr(signal, "pthread_sigmask"):
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()
    signal.pthread_sigmask(signal.SIG_BLOCK, _ending_signals())


def _on_cluster(job: Job, ranges: list[Range], client: Client) -> Results:
    """Compute on a cluster; raises `PendsusError` if its scheduler or workers are lost."""
    from concurrent.futures import CancelledError

    from distributed import KilledWorker  # pyright: ignore[reportMissingImports]
    from distributed.comm import CommClosedError  # pyright: ignore

    most = 4 * max(1, sum(client.nthreads().values()))
    pool = client.get_executor(pure=False)
    results = _share(pool, job, ranges, most, _compute_or_error, _watch(client))
    failure: Exception | None = None
    try:
        for found in results:
            if isinstance(found, Exception):
                failure = found
                break
            yield found
    except PendsusError:
        raise
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
    except Exception as error:  # a worker that ends while its results are fetched, for example
        reason = one_line(error)
        raise PendsusError(
            f"the cluster lost results ({reason}); see to its workers and continue with --resume"
        ) from None
    if failure is not None:
        raise failure


def _watch(client: Client) -> Callable[[], None]:
    """Make a function that raises `PendsusError` once a cluster has long had no workers.

    Its scheduler waits for new ones for ever.
    """
    asked = time.monotonic()
    lost: float | None = None

    def check() -> None:
        nonlocal asked, lost
        now = time.monotonic()
        if now - asked < EVERY:
            return
        asked = now
        with contextlib.suppress(OSError):  # without a scheduler, what was submitted fails
            if client.nthreads():
                lost = None
            elif lost is None:
                lost = now
        if lost is not None and now - lost > PATIENCE:
            raise PendsusError(
                "all workers of the cluster were lost; start `dask worker` again and continue with"
                " --resume"
            )

    return check


def is_encrypted(scheduler: str) -> bool:
    """Whether an address is one at which only holders of a certificate are answered."""
    return scheduler.startswith(("tls://", "wss://"))


def describe_exposure(scheduler: str) -> str:
    """Warning of a scheduler without TLS at an address that other machines reach; else ""."""
    host = scheduler.rpartition("://")[2].rpartition(":")[0].strip("[]")
    own = "", "localhost", "127.0.0.1", "::1", socket.gethostname()
    if is_encrypted(scheduler) or host in own:
        return ""
    return (
        f"--scheduler {scheduler} has no TLS: whoever reaches it can run programs on its machines"
        " and on this one, and read and change what is sent; docs/examples/cluster.md shows how to"
        " set it up"
    )


@contextlib.contextmanager
def connected(scheduler: str) -> Iterator[Client]:
    """Connect to a Dask scheduler that answers and has workers, such as ``tls://host:8786``.

    Certificates are those of Dask's configuration.

    Raises `InputError` if Dask is missing, the scheduler does not answer, or it has no workers.
    """
    try:
        from distributed import Client, Security, comm  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError.of(
            "--scheduler", "needs Dask", "pip install 'pendsus[cluster]'", format_value(scheduler)
        ) from None
    import asyncio
    import logging

    for name in ("distributed", "distributed.client"):  # errors are raised anyway
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def probe() -> None:
        keys = Security().get_connection_args("client")
        (await comm.connect(scheduler, timeout=PATIENCE, **keys)).abort()  # pyright: ignore

    remedy = "start `dask scheduler` and `dask worker`, and give its address"
    if is_encrypted(scheduler):
        remedy = "set the certificate and key of the cluster as docs/examples/cluster.md says"
    try:
        asyncio.run(probe())  # without a scheduler, Client takes long to give up
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, ImportError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.of(
            "--scheduler", f"does not answer ({reason})", remedy, format_value(scheduler)
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            remedy = "start `dask worker` with its address"
            raise InputError.of(
                "--scheduler", "has no workers", remedy, format_value(scheduler)
            ) from None
        yield client
