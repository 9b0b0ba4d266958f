"""The end of processes that were begun for one client (a module of its own, since Dask is loaded by it)."""

from __future__ import annotations

from distributed import Scheduler, SchedulerPlugin


class EndWithClient(SchedulerPlugin):  # type: ignore[misc]
    """A scheduler ends a time after its last client has left, be it killed; until then, it waits however long.

    Args:
        after: that time [s].
    """

    name = "tanteo-end-with-client"

    def __init__(self, after: float) -> None:
        self.after = after

    async def start(self, scheduler: Scheduler) -> None:
        """Called where the scheduler is, by Dask."""
        scheduler.idle_timeout = None

    def remove_client(self, scheduler: Scheduler, client: str) -> None:
        """Called when a client has left, by Dask."""
        if set(scheduler.clients) <= {"fire-and-forget"}:  # Dask's own
            scheduler.idle_since, scheduler.idle_timeout = None, self.after
