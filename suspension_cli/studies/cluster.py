"""Connection to a Dask cluster (the extra ``pendsus[cluster]``)."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Iterator
from typing import Any

from suspension_cli.errors import InputError, format_value

Client = Any
"""A `distributed.Client`, of an optional dependency."""

PATIENCE = 5.0
"""Seconds in which a scheduler must answer and have a worker."""


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
