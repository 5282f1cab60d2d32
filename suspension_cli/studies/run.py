"""Run a sweep: points in chunks, on processes or a Dask cluster, with results straight to disk.

A job computes any range of its points independently, so number of workers and engine do not matter.
A killed run leaves its finished points in ``NAME.h5.part`` (`sweep_file`), from which ``resume``
continues.
"""

from __future__ import annotations

import contextlib
import gc
import itertools
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import Executor
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
Progress = Callable[[int, int, float], None]
Results = Generator[tuple[Range, ColumnValues], None, None]


def run(
    job: Job,
    path: Path,
    group: str,
    origin: Provenance,
    fill: Fill,
    after: After | None = None,
    *,
    workers: int | None = 1,
    scheduler: str | None = None,
    chunk: int = 512,
    resume: bool = False,
    progress: Progress = lambda _done, _all, _rate: None,
) -> None:
    """Compute all points of a job into one HDF5 file.

    The finished file is `path`; its group has the columns, and what `fill` writes (axes, names).
    Given the path of the unfinished file, `after` fills the columns that need all points.

    Parameters
    ----------
    workers
        Number of processes. None starts one per core when the points left take long.
    scheduler
        Address of a Dask scheduler instead.
    chunk
        Number of points computed at once.
    progress
        Called with (points done, total points, points per second).
    """
    chunk = max(UNIT, chunk // UNIT * UNIT)
    with contextlib.ExitStack() as stack:
        client = None
        if scheduler is not None:
            client = stack.enter_context(cluster.connected(scheduler))
        store = stack.enter_context(opened(job, path, group, origin, fill, resume))
        ranges = store.missing(chunk)
        done, began, fresh = store.count - sum(b - a for a, b in ranges), time.monotonic(), 0
        progress(done, store.count, 0.0)
        here = client is None
        results = _here(job, ranges, workers) if here else _on_cluster(job, ranges, client)
        with contextlib.closing(results):
            for (start, stop), values in results:
                store.put(start, stop, values)
                done, fresh = done + stop - start, fresh + stop - start
                progress(done, store.count, fresh / max(time.monotonic() - began, 1e-9))
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


def _compute(job: Job, part: Range) -> tuple[Range, ColumnValues]:
    values = job.compute(*part)
    # systems and what is prepared for them refer to each other: without this their matrices stay
    # until the collector counts enough objects, gigabytes later
    gc.collect(0)
    return part, values


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
    """Compute on a cluster.

    Raises `PendsusError` if the connection to the scheduler is lost, or workers are killed
    repeatedly.
    """
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
