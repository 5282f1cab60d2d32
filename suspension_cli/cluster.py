"""Sweeps on a Dask cluster (the extra ``pendsus[cluster]``)."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Generator, Iterator
from typing import Any

from suspension_cli.errors import Fault, InputError, PendsusError, shown

PATIENCE = 5.0
"""Seconds in which a scheduler must answer and have a worker."""


@contextlib.contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of a Dask scheduler that answers and has workers.

    Parameters
    ----------
    scheduler : str
        Address: ``tcp://host:8786``.

    Raises
    ------
    InputError
        If Dask is missing, nobody answers or there are no workers.
    """
    try:
        from distributed import Client, comm  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError([Fault("--scheduler", "needs Dask", "pip install 'pendsus[cluster]'", shown(scheduler))]) from None
    import asyncio
    import logging

    for name in ("distributed", "distributed.client"):  # what matters is raised
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def knock() -> None:
        (await comm.connect(scheduler, timeout=PATIENCE)).abort()  # pyright: ignore

    remedy = "start `dask scheduler` and `dask worker`, and give its address"
    try:
        asyncio.run(knock())  # a client that finds nobody takes long to give up
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError([Fault("--scheduler", f"does not answer ({reason})", remedy, shown(scheduler))]) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise InputError([Fault("--scheduler", "has no workers", "start `dask worker` with its address", shown(scheduler))]) from None
        yield client


def on_cluster(job: Any, ranges: list[tuple[int, int]], client: Any) -> Generator[tuple[tuple[int, int], dict[str, Any]], None, None]:
    """Results of ranges of a job from the workers of a cluster, as they come.

    Parameters
    ----------
    job : batch.Job
        Sent to the workers once.
    ranges : list of (start, stop)
    client : distributed.Client

    Raises
    ------
    PendsusError
        If the scheduler is lost, or chunk after chunk kills its worker.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker  # pyright: ignore[reportMissingImports]
    from distributed.comm import CommClosedError  # pyright: ignore

    try:
        yield from _computed(job, ranges, client)
    except (CancelledError, CommClosedError) as error:
        raise PendsusError(f"the scheduler was lost ({str(error).splitlines()[0]}); start it again and go on with --resume") from None
    except KilledWorker:
        raise PendsusError("the cluster's workers die, out of memory perhaps; give a smaller --chunk and go on with --resume") from None


def _computed(job: Any, ranges: list[tuple[int, int]], client: Any) -> Iterator[tuple[tuple[int, int], dict[str, Any]]]:
    from distributed import as_completed  # pyright: ignore[reportMissingImports]

    sent = client.scatter(job, broadcast=True, hash=False)
    waiting = iter(ranges)
    most = 4 * max(1, sum(client.nthreads().values()))
    first = [client.submit(_compute, sent, part, pure=False) for part in itertools.islice(waiting, most)]
    running = as_completed(first, loop=client.loop)
    for future in running:
        yield future.result()
        for part in itertools.islice(waiting, 1):
            running.add(client.submit(_compute, sent, part, pure=False))


def _compute(job: Any, part: tuple[int, int]) -> tuple[tuple[int, int], dict[str, Any]]:
    return part, job.compute(*part)
