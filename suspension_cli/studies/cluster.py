"""Sweeps on a Dask cluster (the extra ``pendsus[cluster]``)."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Generator, Iterator
from typing import Any

from suspension_cli.errors import InputError, PendsusError, format_value
from suspension_cli.studies.builds import ColumnValues
from suspension_cli.studies.sweep_file import Job

Client = Any
"""A `distributed.Client`, of an optional dependency."""

PATIENCE = 5.0
"""Seconds in which a scheduler must answer and have a worker."""


@contextlib.contextmanager
def connected(scheduler: str) -> Iterator[Client]:
    """Connect to a Dask scheduler that answers and has workers, such as ``tcp://host:8786``.

    Raises `InputError` if Dask is missing, the scheduler does not answer, or it has no workers.
    """
    try:
        from distributed import Client, comm  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError.of(
            "--scheduler", "needs Dask", "pip install 'pendsus[cluster]'", format_value(scheduler)
        ) from None
    import asyncio
    import logging

    for name in ("distributed", "distributed.client"):  # errors are raised anyway
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def probe() -> None:
        (await comm.connect(scheduler, timeout=PATIENCE)).abort()  # pyright: ignore

    remedy = "start `dask scheduler` and `dask worker`, and give its address"
    try:
        asyncio.run(probe())  # without a scheduler, Client takes long to give up
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise InputError.of(
            "--scheduler", f"does not answer ({reason})", remedy, format_value(scheduler)
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise InputError.of(
                "--scheduler",
                "has no workers",
                "start `dask worker` with its address",
                format_value(scheduler),
            ) from None
        yield client


def on_cluster(
    job: Job, ranges: list[tuple[int, int]], client: Client
) -> Generator[tuple[tuple[int, int], ColumnValues], None, None]:
    """Compute ranges (start, stop) of a job on a cluster; yield results as they are ready.

    The job is sent to the workers once.

    Raises `PendsusError` if the connection to the scheduler is lost, or workers are killed
    repeatedly.
    """
    from concurrent.futures import CancelledError

    from distributed import KilledWorker  # pyright: ignore[reportMissingImports]
    from distributed.comm import CommClosedError  # pyright: ignore

    try:
        yield from _compute_ranges(job, ranges, client)
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


def _compute_ranges(
    job: Job, ranges: list[tuple[int, int]], client: Client
) -> Iterator[tuple[tuple[int, int], ColumnValues]]:
    from distributed import as_completed  # pyright: ignore[reportMissingImports]

    sent = client.scatter(job, broadcast=True, hash=False)
    waiting = iter(ranges)
    most = 4 * max(1, sum(client.nthreads().values()))
    first = [
        client.submit(_compute, sent, part, pure=False) for part in itertools.islice(waiting, most)
    ]
    running = as_completed(first, loop=client.loop)
    for future in running:
        yield future.result()
        for part in itertools.islice(waiting, 1):
            running.add(client.submit(_compute, sent, part, pure=False))


def _compute(job: Job, part: tuple[int, int]) -> tuple[tuple[int, int], ColumnValues]:
    return part, job.compute(*part)
