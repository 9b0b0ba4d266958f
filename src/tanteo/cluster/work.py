"""Tasks that are handed out to workers, and what becomes of them."""

from __future__ import annotations

import importlib
import importlib.util
import os
import queue
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from tanteo.errors import InputError

if TYPE_CHECKING:
    from distributed import Client, Future

Task = TypeVar("Task")
Result = TypeVar("Result")

CONNECT = 10.0
"""Time in which a scheduler answers [s]."""

NOBODY = 30.0
"""Time for which work waits where there is no worker at all [s]: a worker that was ended begins again in three."""

_ASK = 1.0
_AHEAD = 64
"""Tasks that wait at the scheduler, so that no worker waits for the next one."""


def check_scheduler(address: str) -> str:
    """The address of a scheduler, as it was given.

    Raises:
        InputError: it is none.
    """
    kind, colon, count = address.partition(":")
    local = kind == "local" and (not colon or (count.isdecimal() and 0 < int(count) <= 1024))
    if local or (address.startswith(("tcp://", "tls://", "ucx://")) and address.rpartition(":")[2].isdecimal()):
        return address
    raise InputError(
        f"scheduler: expected tcp://HOST:PORT, or local:N for N processes of this computer, got '{address}'. "
        "'dask scheduler' prints the address of one."
    )


def spread(
    scheduler: str,
    work: Callable[[Task], Result],
    tasks: Mapping[int, Task],
    settle: Callable[[int, Result | str], None],
    *,
    modules: str | None = None,
) -> None:
    """Do tasks on the workers of a scheduler, in any order.

    Args:
        scheduler: its address, or ``local:N``.
        work: a function of a module, which workers import.
        tasks: by any number; what decides a result is in its task, so that it is the same on any worker.
        settle: called in this thread with the number of a task and what the work returned, or a sentence that says why
            the workers could not do it (each of four died at it).
        modules: a folder of modules that the workers see, too, and where the work is found if tanteo has it not.

    Raises:
        InputError: no scheduler answers there, its workers have another tanteo or none, or all are gone.
        Exception: whatever the work raised.

    Example:
        >>> from tanteo.cluster import spread
        >>> squares = {}
        >>> spread("local:2", abs, {0: -3, 1: 5}, squares.__setitem__)
        >>> sorted(squares.items())
        [(0, 3), (1, 5)]
    """
    with _client(scheduler) as client:
        _Spread(client, scheduler, (_version(), modules, work.__module__, work.__qualname__), settle).run(tasks)


class _Spread:
    """Tasks of which a few wait at the scheduler."""

    def __init__(self, client: Client, scheduler: str, work: tuple[Any, ...], settle: Callable[..., None]) -> None:
        self._client, self._scheduler, self._work, self._settle = client, scheduler, work, settle
        self._done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._out: dict[str, tuple[int, Future]] = {}

    def run(self, tasks: Mapping[int, Any]) -> None:
        waiting = iter(tasks.items())
        self._hand_out(waiting)
        while self._out:
            future = self._next()
            number, _ = self._out.pop(future.key)
            self._settle(number, self._result(future))
            future.release()
            self._hand_out(waiting)

    def _hand_out(self, waiting: Iterator[tuple[int, Any]]) -> None:
        while len(self._out) < _AHEAD:
            number, task = next(waiting, (None, None))
            if number is None:
                return
            future = self._client.submit(at_work, *self._work, task, pure=False)
            self._out[future.key] = number, future
            future.add_done_callback(self._done.put)

    def _next(self) -> Future:
        """A task that is done; an error where nobody is left who could do one."""
        alone = 0.0
        while True:
            try:
                return self._done.get(timeout=_ASK)
            except queue.Empty:
                alone = 0.0 if self._workers() else alone + _ASK
            if alone > NOBODY:
                raise InputError(
                    f"scheduler: expected a worker at {self._scheduler}, got none for {NOBODY:.0f} s. "
                    f"{_again(self._scheduler)}"
                )

    def _workers(self) -> int:
        if self._client.status != "running":
            raise _gone(self._scheduler)
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def _result(self, future: Future) -> Any:
        from distributed import CancelledError, KilledWorker

        try:
            return future.result()
        except KilledWorker:
            return "expected to be done by a worker, but every one that tried it was ended. Look at its memory."
        except CancelledError:
            raise _gone(self._scheduler) from None
        except ModuleNotFoundError as error:
            raise InputError(
                f"scheduler: expected workers that have all modules, got: {error}. Install tanteo {_version()} there."
            ) from None


def at_work(version: str, modules: str | None, module: str, name: str, task: Any) -> Any:
    """What a worker does with a task: the work is told by name.

    Raises:
        InputError: it has another version.
    """
    if version != _version():
        raise InputError(
            f"scheduler: expected workers with tanteo {version}, got one with {_version()}. Install the same there."
        )
    if modules is not None and modules not in sys.path:
        sys.path.insert(0, modules)
    return getattr(importlib.import_module(module), name)(task)


@contextmanager
def _client(scheduler: str) -> Iterator[Client]:
    """A connection; a cluster of one's own ends with it."""
    check_scheduler(scheduler)
    if importlib.util.find_spec("distributed") is None:
        raise InputError("scheduler: expected Dask, which is not installed. pip install 'tanteo[cluster]'.")
    from distributed import Client

    if not scheduler.startswith("local"):
        try:
            client = Client(scheduler, timeout=CONNECT)
        except (OSError, TimeoutError, ValueError) as error:
            raise _nobody(scheduler, error) from None
        with client:
            yield client
        return
    from tanteo.cluster.own import own_processes

    with own_processes(int(scheduler.partition(":")[2] or os.cpu_count() or 1)) as client:
        yield client


def _again(scheduler: str) -> str:
    if scheduler.startswith("local"):
        return "Its processes were ended: look at the memory, and use fewer."
    return f"Start one, 'dask worker {scheduler}', and give the command again."


def _version() -> str:
    return str(importlib.import_module("tanteo").__version__)


def _nobody(scheduler: str, error: Exception) -> InputError:
    why = str(error).splitlines()[0] if str(error) else "no answer"
    return InputError(
        f"scheduler: expected one that answers at {scheduler}, got: {why}. 'dask scheduler' starts one and prints its "
        "address."
    )


def _gone(scheduler: str) -> InputError:
    return InputError(
        f"scheduler: expected {scheduler} to stay, but the connection was lost. Start it anew, and give the command "
        "again."
    )
