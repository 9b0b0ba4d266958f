"""Read CAD files on the workers of a cluster, in batches, each batch in a process that may crash or hang."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from tanteo.catalogue.cache import cache_key
from tanteo.catalogue.cluster.work import run_tasks
from tanteo.catalogue.pool import Request, read_in_processes
from tanteo.catalogue.record import Record
from tanteo.catalogue.worker import memory_for

Requests: TypeAlias = dict[int, Request]

MOST_FILES, SMALL, BATCHES = 128, 300_000, 64
"""Largest number of files per task; smallest size of a task [bytes]; largest number of tasks by size."""


def read_on_cluster(
    requests: Mapping[int, Request], on_result: Callable[[int, Record | str], None], scheduler: str
) -> None:
    """Read files on the workers of a scheduler, which must see them under the same paths.

    Args:
        requests: requests by number.
        on_result: function called in this thread with the number and the part's record, or the error message.
        scheduler: address of the scheduler, see :func:`tanteo.catalogue.cluster.run_tasks`.
    """
    batches = dict(enumerate(_batches(requests)))

    def on_batch(k: int, results: dict[int, Record | str] | str) -> None:
        for index, request in batches[k].items():
            on_result(index, f"{request.path}: {results}" if isinstance(results, str) else results[index])

    run_tasks(scheduler, read_batch, batches, on_batch)


def _batches(requests: Mapping[int, Request]) -> Iterator[Requests]:
    sizes = {index: _bytes(request.path) for index, request in requests.items()}
    enough = max(SMALL, sum(sizes.values()) // BATCHES)
    batch_size = 0
    batch: Requests = {}
    for index, request in requests.items():
        batch[index] = request
        batch_size = batch_size + sizes[index]
        if batch_size >= enough or len(batch) == MOST_FILES:
            yield batch
            batch = {}
            batch_size = 0
    if batch:
        yield batch


def _bytes(path: str) -> int:
    with suppress(OSError):
        return os.stat(path).st_size
    return 0


def read_batch(requests: Requests) -> dict[int, Record | str]:
    """Read a batch of files on a worker; files that differ from those of the caller yield an error message.

    Args:
        requests: requests by number.

    Returns:
        Record or error message by number.
    """
    results: dict[int, Record | str] = {}
    for index, request in requests.items():
        if request.key is not None and cache_key(Path(request.path), request.unit) != request.key:
            results[index] = (
                f"{request.path}: expected the same file on every worker, got none or another one. Use folders that "
                "all of them share."
            )
    todo = {index: request for index, request in requests.items() if index not in results}
    if todo:
        memory = memory_for(os.cpu_count() or 1)
        read_in_processes(todo, results.__setitem__, workers=1, memory=memory)
    return results
