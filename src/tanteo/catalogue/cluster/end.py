"""Scheduler plug-in that ends processes started for one client (a separate module because importing it loads Dask)."""

from __future__ import annotations

from distributed import Scheduler, SchedulerPlugin


class EndWithClient(SchedulerPlugin):  # type: ignore[misc]
    """End an idle scheduler some time after its last client has disconnected, even if that client was killed.

    While a client is connected, the scheduler waits without limit.

    Args:
        after: time between the last disconnection and the end of the scheduler [s].
    """

    name = "tanteo-end-with-client"

    def __init__(self, after: float) -> None:
        self.after = after

    async def start(self, scheduler: Scheduler) -> None:
        """Disable Dask's own idle timeout (called by Dask on the scheduler)."""
        scheduler.idle_timeout = None

    def remove_client(self, scheduler: Scheduler, client: str) -> None:
        """Start the idle timeout once the last client has disconnected (called by Dask on the scheduler)."""
        if set(scheduler.clients) <= {"fire-and-forget"}:  # a client that Dask itself always registers
            scheduler.idle_since, scheduler.idle_timeout = None, self.after
