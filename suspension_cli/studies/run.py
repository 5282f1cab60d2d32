"""Run a sweep: points in chunks, on processes or a Dask cluster, with results straight to disk.

A job computes any range of its points independently, so number of workers and engine do not matter.
A killed run leaves its finished points in ``NAME.h5.part`` (`sweep_file`), from which ``resume``
continues.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from suspension_cli.errors import PendsusError
from suspension_cli.files.hdf5 import Provenance
from suspension_cli.studies import cluster
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.job import Job
from suspension_cli.studies.sweep_file import UNIT, After, Fill, opened

STARTUP = 5.0
"""Time, s, that a sweep must still take for further processes to start: they import the program."""

Range = tuple[int, int]
"""First point, and one after the last."""
Results = Generator[tuple[Range, ColumnValues], None, None]


@dataclass(frozen=True)
class Plan:
    """Options of a run.

    Attributes
    ----------
    workers
        Number of processes, with this one. None starts one per core when the points left take long.
    scheduler
        Address of a Dask scheduler instead.
    chunk
        Number of points computed at once.
    progress
        Called with (points done, total points, points per second).
    """

    workers: int | None = 1
    scheduler: str | None = None
    chunk: int = 512
    resume: bool = False
    progress: Callable[[int, int, float], None] = field(default=lambda _done, _all, _rate: None)


def run(
    job: Job,
    path: Path,
    group: str,
    origin: Provenance,
    plan: Plan,
    fill: Fill,
    after: After | None = None,
) -> None:
    """Compute all points of a job into one HDF5 file.

    The finished file is `path`; its group has the columns, and what `fill` writes (axes, names).
    Given the path of the unfinished file, `after` fills the columns that need all points.
    """
    chunk = max(UNIT, plan.chunk // UNIT * UNIT)
    with contextlib.ExitStack() as stack:
        client = None
        if plan.scheduler is not None:
            client = stack.enter_context(cluster.connected(plan.scheduler))
        store = stack.enter_context(opened(job, path, group, origin, fill, plan.resume))
        ranges = store.missing(chunk)
        done, began, fresh = store.count - sum(b - a for a, b in ranges), time.monotonic(), 0
        plan.progress(done, store.count, 0.0)
        here = client is None
        results = _here(job, ranges, plan.workers) if here else _on_cluster(job, ranges, client)
        with contextlib.closing(results):
            for (start, stop), values in results:
                store.put(start, stop, values)
                done, fresh = done + stop - start, fresh + stop - start
                plan.progress(done, store.count, fresh / max(time.monotonic() - began, 1e-9))
        store.finish(after)


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
        values = job.compute(*part)
        left = (len(ranges) - n) * (time.monotonic() - began)
        yield part, values
        if n > 1 and min(most, len(ranges) - n) > 1 and left > STARTUP:
            yield from _on_processes(job, ranges[n:], min(most, len(ranges) - n))
            return


def _share(
    submit: Callable[[Range], Any],
    wait: Callable[..., Any],
    ranges: list[Range],
    most: int,
    own: Callable[[int, int], ColumnValues] | None = None,
) -> Results:
    """Submit ranges, `most` at a time, and wait for results as they are ready.

    Meanwhile this process computes ranges too if it has a function for it (`own`). `submit` and
    `wait` are of `concurrent.futures` or of Dask.
    """
    waiting, running = iter(ranges), set[Any]()
    while True:
        with _uninterrupted():
            running |= {submit(part) for part in itertools.islice(waiting, most - len(running))}
        part = next(waiting, None) if own else None
        if own and part:
            yield part, own(*part)
        elif not running:
            return
        finished, running = wait(running, 0 if part else None, "FIRST_COMPLETED")
        yield from (future.result() for future in finished)


_job: Job | None = None


def _initialise(job: Job) -> None:
    global _job  # a worker process serves one job
    _job = job
    threading.Thread(target=_exit_with_parent, daemon=True).start()


def _exit_with_parent() -> None:
    """End this worker process when its parent process is killed."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait

    parent = parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _work(part: Range) -> tuple[Range, ColumnValues]:
    assert _job is not None
    return _compute(_job, part)


def _compute(job: Job, part: Range) -> tuple[Range, ColumnValues]:
    return part, job.compute(*part)


def _on_processes(job: Job, ranges: list[Range], workers: int) -> Results:
    """Compute in this process, which collects the results, and in others."""
    from concurrent.futures import ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    others, spawn = workers - 1, get_context("spawn")
    with ProcessPoolExecutor(others, spawn, initializer=_initialise, initargs=(job,)) as pool:
        try:
            yield from _share(
                lambda part: pool.submit(_work, part), wait, ranges, 2 * others, job.compute
            )
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
    """Compute on a cluster; the job is sent to the workers once.

    Raises `PendsusError` if the connection to the scheduler is lost, or workers are killed
    repeatedly.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker, wait  # pyright: ignore[reportMissingImports]
    from distributed.comm import CommClosedError  # pyright: ignore

    try:
        sent = client.scatter(job, broadcast=True, hash=False)
        with client.as_current():
            yield from _share(
                lambda part: client.submit(_compute, sent, part, pure=False),
                wait,
                ranges,
                4 * max(1, sum(client.nthreads().values())),
            )
    except (CancelledError, CommClosedError) as error:
        raise PendsusError(
            f"the connection to the scheduler was lost ({str(error).splitlines()[0]}); restart it"
            " and continue with --resume"
        ) from None
    except KilledWorker:
        raise PendsusError(
            "the cluster's workers were killed, perhaps out of memory; give a smaller --chunk and"
            " continue with --resume"
        ) from None
