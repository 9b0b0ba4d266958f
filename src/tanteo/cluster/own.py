"""Processes of this computer that are workers for one client, and end with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from distributed import Client, SubprocessCluster

from tanteo.cluster.end import EndWithClient
from tanteo.errors import InputError

BEGIN = 300.0
"""Time after which processes of this computer end that nobody has spoken to [s]: what began them was killed."""

LEFT = 20.0
"""Time after which they end when the one they worked for is gone [s]; one that ends as it should ends them itself."""

_SILENT = 50
"""Level of logging from which Dask may write: critical."""


@contextmanager
def own_processes(count: int) -> Iterator[Client]:
    """Processes of this computer: they stay as long as this one is connected, however busy or idle they are."""
    with ExitStack() as stack:
        try:
            own = SubprocessCluster(
                n_workers=count,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=_SILENT,
                scheduler_kwargs={"idle_timeout": f"{BEGIN:g}s"},
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
