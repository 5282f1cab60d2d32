"""Sweeps on a Dask cluster (the extra ``pendsus[cluster]``)."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

from suspension_cli.errors import Fault, InputError, shown


def on_cluster(job: Any, ranges: list[tuple[int, int]], scheduler: str) -> Iterator[tuple[tuple[int, int], dict[str, Any]]]:
    """Results of ranges of a job from the workers of a Dask scheduler, as they come.

    Parameters
    ----------
    job : batch.Job
        Sent to the workers once.
    ranges : list of (start, stop)
    scheduler : str
        Address: ``tcp://host:8786``.

    Raises
    ------
    InputError
        If Dask is missing or nobody answers.
    """
    try:
        from distributed import Client, as_completed  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise InputError([Fault("--scheduler", "needs Dask", "pip install 'pendsus[cluster]'", shown(scheduler))]) from None
    try:
        client = Client(scheduler, timeout=20, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            [Fault("--scheduler", f"does not answer ({error})", "start `dask scheduler` and `dask worker`, and give its address", shown(scheduler))]
        ) from None
    with client:
        sent = client.scatter(job, broadcast=True, hash=False)
        waiting = iter(ranges)
        most = 4 * max(1, sum(client.nthreads().values()))
        first = [client.submit(_compute, sent, part, pure=False) for part in itertools.islice(waiting, most)]
        running = as_completed(first)
        for future in running:
            yield future.result()
            following = next(waiting, None)
            if following is not None:
                running.add(client.submit(_compute, sent, following, pure=False))


def _compute(job: Any, part: tuple[int, int]) -> tuple[tuple[int, int], dict[str, Any]]:
    return part, job.compute(*part)
