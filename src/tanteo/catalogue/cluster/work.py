"""Submission of tasks to Dask workers and handling of their results and failures."""

from __future__ import annotations

import importlib
import importlib.util
import os
import queue
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from tanteo.errors import InputError, install_command

if TYPE_CHECKING:
    from distributed import Client, Future

Task = TypeVar("Task")
Result = TypeVar("Result")

CONNECT = 10.0
"""Time limit for the first answer of a scheduler [s]."""

LONGEST_WAIT = 30.0
"""Time without any worker after which the work is given up [s]; Dask restarts a dead worker within about 3 s."""

_POLL = 1.0
"""Interval at which the number of workers is checked while no task finishes [s]."""

_AHEAD = 64
"""Number of tasks that are queued at the scheduler, so that no worker is idle between two tasks."""


def check_scheduler(address: str) -> str:
    """Check the address of a scheduler and return it unchanged.

    Args:
        address: ``tcp://HOST:PORT`` (or ``tls://``, ``ucx://``), ``local`` or ``local:N``.

    Raises:
        InputError: The address has another form.
    """
    kind, colon, count = address.partition(":")
    local = kind == "local" and (not colon or (count.isdecimal() and 0 < int(count) <= 1024))
    if local or (address.startswith(("tcp://", "tls://", "ucx://")) and address.rpartition(":")[2].isdecimal()):
        return address
    raise InputError(
        f"scheduler: expected tcp://HOST:PORT, or local:N for N processes of this computer, got '{address}'. "
        "'dask scheduler' prints its address."
    )


def run_tasks(
    scheduler: str,
    work: Callable[[Task], Result],
    tasks: Mapping[int, Task],
    on_result: Callable[[int, Result | str], None],
    *,
    modules: str | None = None,
) -> None:
    """Run tasks on the workers of a scheduler, in any order.

    Args:
        scheduler: address of the scheduler, or ``local:N``.
        work: function of an importable module that computes the result of one task.
        tasks: tasks by number. A task must contain everything that its result depends on (such as random seeds), so
            that every worker computes the same.
        on_result: function called in the calling thread with the number of a task and its result. If the workers failed
            (four died of the task), the result is a sentence with the reason.
        modules: folder that is added to the workers' import path, for a ``work`` outside of tanteo.

    Raises:
        InputError: No scheduler answers, the workers have another version of tanteo or none, or all workers are gone.
        Exception: ``work`` raised it.

    Example:
        >>> from tanteo.catalogue.cluster.work import run_tasks
        >>> squares = {}
        >>> run_tasks("local:2", abs, {0: -3, 1: 5}, squares.__setitem__)
        >>> sorted(squares.items())
        [(0, 3), (1, 5)]
    """
    with _client(scheduler) as client:
        _Spread(client, scheduler, (_version(), modules, work.__module__, work.__qualname__), on_result).run(tasks)


class _Spread:
    """State of a running distribution: the tasks at the scheduler and those that have finished."""

    def __init__(self, client: Client, scheduler: str, work: tuple[Any, ...], on_result: Callable[..., None]) -> None:
        self._client, self._scheduler, self._work, self._on_result = client, scheduler, work, on_result
        self._done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._out: dict[str, tuple[int, Future]] = {}

    def run(self, tasks: Mapping[int, Any]) -> None:
        waiting = iter(tasks.items())
        self._hand_out(waiting)
        while self._out:
            future = self._next()
            number, _ = self._out.pop(future.key)
            self._on_result(number, self._result(future))
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
        """Wait for the next finished task; raise if there has been no worker for :data:`LONGEST_WAIT` seconds."""
        alone = 0.0
        while True:
            try:
                return self._done.get(timeout=_POLL)
            except queue.Empty:
                alone = 0.0 if self._workers() else alone + _POLL
            if alone > LONGEST_WAIT:
                raise InputError(
                    f"scheduler: expected a worker at {self._scheduler}, got none for {LONGEST_WAIT:.0f} s. "
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
            return "expected to be done by a worker, but every worker that tried it died. Check its memory."
        except CancelledError:
            raise _gone(self._scheduler) from None
        except ModuleNotFoundError as error:
            raise InputError(
                f"scheduler: expected workers that have all modules, got: {error}. Install tanteo {_version()} there."
            ) from None


def at_work(version: str, modules: str | None, module: str, name: str, task: Any) -> Any:
    """Import the work by name and run it on one task (called on the worker).

    Args:
        version: version of tanteo of the client.
        modules: folder to add to the import path, or None.
        module: name of the module of the work.
        name: name of the function in the module.
        task: argument of the function.

    Returns:
        The result of the function.

    Raises:
        InputError: The worker has another version of tanteo.
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
    """Connect to a scheduler; a ``local`` one is started here and ends with the context."""
    check_scheduler(scheduler)
    if importlib.util.find_spec("distributed") is None:
        raise InputError(f"scheduler: expected Dask, which is not installed. Run {install_command('cluster')}.")
    from distributed import Client

    if not scheduler.startswith("local"):
        try:
            client = Client(scheduler, timeout=CONNECT)
        except (OSError, TimeoutError, ValueError) as error:
            raise _no_scheduler(scheduler, error) from None
        with client:
            yield client
        return
    from tanteo.catalogue.cluster.own import own_processes

    with own_processes(int(scheduler.partition(":")[2] or os.cpu_count() or 1)) as client:
        yield client


def _again(scheduler: str) -> str:
    if scheduler.startswith("local"):
        return "Its processes died: check the memory, and use fewer."
    return f"Start one with 'dask worker {scheduler}' and repeat the command."


def _version() -> str:
    return str(importlib.import_module("tanteo").__version__)


def _no_scheduler(scheduler: str, error: Exception) -> InputError:
    why = str(error).splitlines()[0] if str(error) else "no answer"
    return InputError(
        f"scheduler: expected a scheduler at {scheduler}, got: {why}. 'dask scheduler' starts one and prints its "
        "address."
    )


def _gone(scheduler: str) -> InputError:
    return InputError(
        f"scheduler: expected {scheduler} to stay connected, but the connection was lost. Restart it and repeat the "
        "command."
    )
