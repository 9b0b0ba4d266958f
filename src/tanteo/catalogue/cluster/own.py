"""Worker processes on this computer that serve one client and end with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from distributed import Client, SubprocessCluster

from tanteo.catalogue.cluster.end import EndWithClient
from tanteo.errors import InputError

BEGIN = 300.0
"""Idle time after which a scheduler ends if no client ever connected [s]; the starting process was killed."""

LEFT = 20.0
"""Time after which the processes end when their client was killed [s]; otherwise the client ends them itself."""

_SILENT = 50
"""Lowest logging level that Dask may print: ``logging.CRITICAL``."""

_HTTP = "127.0.0.1:0"
"""Address of the scheduler's HTTP server, which Dask starts also without a dashboard, otherwise at all addresses."""


@contextmanager
def own_processes(count: int) -> Iterator[Client]:
    """Start worker processes on this computer and yield a client connected to them.

    The processes end with the context, or :data:`LEFT` seconds after this process was killed.

    Args:
        count: number of worker processes, with one thread each.

    Raises:
        InputError: The processes could not be started.
    """
    with ExitStack() as stack:
        try:
            own = SubprocessCluster(
                n_workers=count,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=_SILENT,
                scheduler_kwargs={"idle_timeout": f"{BEGIN:g}s", "dashboard_address": _HTTP},
            )
            client = stack.enter_context(Client(stack.enter_context(own)))
            client.register_plugin(EndWithClient(LEFT))
        except (OSError, RuntimeError) as error:
            why = str(error).splitlines()[0] if str(error) else "no answer"
            raise InputError(
                f"scheduler: expected {count} processes of this computer, got: {why}. Use fewer, or leave the "
                "scheduler out."
            ) from None
        yield client
