"""Run a sweep: points in chunks, on processes or a Dask cluster, with results straight to disk.

A job computes any range of its points independently, with the same bits, so chunk size, number of
workers and engine do not matter. The HDF5 datasets are allocated in full when the file is made, and
chunks are written in place. A killed run leaves a valid file (``NAME.h5.part``) and a journal of
the finished points (``NAME.h5.journal``), from which ``resume`` continues. When all points are done
the file gets its name and the journal is deleted. The journal is locked during a run, so that two
runs never write one file.
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
from typing import TYPE_CHECKING

import h5py

from suspension_cli.errors import PendsusError
from suspension_cli.files.hdf5 import Provenance
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.sweep_file import UNIT, After, Job, opened

if TYPE_CHECKING:
    from suspension_cli.studies.cluster import Client


STARTUP = 5.0
"""Time in which processes start, s: they import the program and load the compiled loops."""


@dataclass(frozen=True)
class Plan:
    """Options of a run.

    Attributes
    ----------
    workers
        Number of processes; 1 computes in this one. None starts one per core when the points left
        take longer here than with these.
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
    fill: Callable[[h5py.Group], None],
    after: After | None = None,
) -> None:
    """Compute all points of a job into one HDF5 file.

    The finished file is `path`; its group has the columns. When the file is made, `fill` writes the
    rest of the group (axes, names). Given the path of the unfinished file, `after` fills the
    columns that need all points.
    """
    chunk = max(UNIT, plan.chunk // UNIT * UNIT)
    with _connected(plan) as client, opened(job, path, group, origin, plan.resume, fill) as store:
        ranges = store.missing(chunk)
        done, began, fresh = job.count - sum(b - a for a, b in ranges), time.monotonic(), 0
        plan.progress(done, job.count, 0.0)
        with contextlib.closing(_results(job, ranges, plan.workers, client)) as results:
            for (start, stop), values in results:
                store.put(start, stop, values)
                done, fresh = done + stop - start, fresh + stop - start
                plan.progress(done, job.count, fresh / max(time.monotonic() - began, 1e-9))
        store.finish(after)


Results = Generator[tuple[tuple[int, int], ColumnValues], None, None]


def _connected(plan: Plan) -> contextlib.AbstractContextManager[Client | None]:
    """Connect to the plan's scheduler, if it has one."""
    if plan.scheduler is None:
        return contextlib.nullcontext()
    from suspension_cli.studies.cluster import connected

    return connected(plan.scheduler)


def _results(
    job: Job, ranges: list[tuple[int, int]], workers: int | None, client: Client
) -> Results:
    if client is not None:
        from suspension_cli.studies.cluster import on_cluster

        return on_cluster(job, ranges, client)
    if workers is not None and workers > 1 and len(ranges) > 1:
        return _on_processes(job, ranges, workers)
    return _in_turn(job, ranges, (os.cpu_count() or 1) if workers is None else 1)


def _in_turn(job: Job, ranges: list[tuple[int, int]], most: int) -> Results:
    """Compute in this process, and on up to `most` ones once these finish the rest sooner.

    The first range does not count, as loops may be compiled for it.
    """
    for n, part in enumerate(ranges, 1):
        began = time.monotonic()
        values = job.compute(*part)
        left = (len(ranges) - n) * (time.monotonic() - began)
        yield part, values
        workers = min(most, len(ranges) - n)
        if n > 1 and workers > 1 and left > STARTUP + left / workers:
            yield from _on_processes(job, ranges[n:], workers)
            return


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


def _work(part: tuple[int, int]) -> tuple[tuple[int, int], ColumnValues]:
    assert _job is not None
    return part, _job.compute(*part)


def _on_processes(job: Job, ranges: list[tuple[int, int]], workers: int) -> Results:
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    waiting = iter(ranges)
    with ProcessPoolExecutor(
        workers, mp_context=get_context("spawn"), initializer=_initialise, initargs=(job,)
    ) as pool:
        try:
            with _uninterrupted():
                running = {
                    pool.submit(_work, part) for part in itertools.islice(waiting, 2 * workers)
                }
            while running:
                finished, running = wait(running, return_when=FIRST_COMPLETED)
                for future in finished:
                    yield future.result()
                    with _uninterrupted():
                        running |= {
                            pool.submit(_work, part) for part in itertools.islice(waiting, 1)
                        }
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
    """Delay Ctrl-C; processes started meanwhile ignore it, as this one ends them."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
