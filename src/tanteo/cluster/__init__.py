"""Work spread over processes of this machine or of many, by Dask: what a worker that dies had begun is begun again.

A *scheduler* is the address of one that runs (``tcp://HOST:PORT``; ``dask scheduler`` and ``dask worker`` start such),
or ``local``, ``local:8``: processes of this computer, which end with the work. Every worker needs the same tanteo, and
sees files under the same paths. Whoever can reach a scheduler can run programs on its workers: keep it in a network
that you trust.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.cluster.work import at_work, check_scheduler, spread
from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.cluster.own import own_processes

__all__ = ["at_work", "check_scheduler", "own_processes", "spread"]

__getattr__: Callable[[str], Any]
__getattr__, _ = lazy(__name__, {"own": "own_processes"})
