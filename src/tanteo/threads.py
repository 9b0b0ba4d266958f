"""Work on several parts at a time, on threads that stay.

The compiled core runs without the interpreter's lock, so that Python of one part and the core of another overlap. Items
share no state that they change, so results do not depend on the number of threads.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextvars import copy_context
from typing import TypeVar

from tanteo import _core

Item = TypeVar("Item")
Result = TypeVar("Result")

_POOLS: dict[int, ThreadPoolExecutor] = {}
"""Threads by process: a process that was forked has none of those of its parent."""

_LOCK = threading.Lock()


def _free_lock() -> None:
    """Replace the lock in a process that was forked while another thread held it."""
    global _LOCK
    _LOCK = threading.Lock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_free_lock)


def for_each(work: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return the results of a function for all items, in their order.

    As many threads work as the core uses: the processors, or ``OMP_NUM_THREADS``. The calling thread is one of them, so
    that calls may be nested. If items fail, the first failure in the order of the items is raised.

    Args:
        work: function of one item; it changes nothing that the function of another item reads.
        items: the items.

    Raises:
        BaseException: the failure of an item.
    """
    items = list(items)
    helpers = min(_core.most_threads(), len(items)) - 1
    if helpers < 1:
        return [work(item) for item in items]
    results, failures = dict[int, Result](), dict[int, BaseException]()
    rows = iter(range(len(items)))

    def run() -> None:
        for row in _until_failure(rows, failures):
            try:
                results[row] = work(items[row])
            except BaseException as failure:  # noqa: BLE001  raised again in the calling thread
                failures[row] = failure

    others: Sequence[Future[None]] = [_pool().submit(copy_context().run, run) for _ in range(helpers)]
    run()
    for other in others:
        if not other.cancel():
            other.result()
    if failures:
        raise failures[min(failures)]
    return [results[row] for row in range(len(items))]


def _until_failure(rows: Iterator[int], failures: dict[int, BaseException]) -> Iterator[int]:
    """Yield rows that no other thread has taken, until an item has failed."""
    while not failures:
        with _LOCK:
            row = next(rows, None)
        if row is None:
            return
        yield row


def _pool() -> ThreadPoolExecutor:
    """Return the threads of this process."""
    with _LOCK:
        if os.getpid() not in _POOLS:
            _POOLS[os.getpid()] = ThreadPoolExecutor(_core.most_threads() - 1, thread_name_prefix="tanteo")
        return _POOLS[os.getpid()]
