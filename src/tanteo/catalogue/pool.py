"""Read files in worker processes that may crash or hang, as CAD kernels do, without affecting the program.

A thread serves each worker with one file at a time. A worker that dies or exceeds the time limit is replaced, and its
file yields an error message. Workers are plain ``python -c`` processes instead of ``multiprocessing`` ones, so that
calling scripts need no ``if __name__ == "__main__"``. The first line to a worker states its limits; each further line
is a request in JSON. A reply is a letter (``P`` part, ``R`` record, ``E`` error), eight bytes of length, and the data.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tanteo.catalogue.archive import part_from_bytes
from tanteo.catalogue.record import Record, record_from_bytes
from tanteo.catalogue.worker import memory_for, memory_of
from tanteo.errors import InputError
from tanteo.parts import Part
from tanteo.parts.readers import split_body

LEAST_SECONDS, SECONDS_PER_BYTE, MOST_SECONDS = 15.0, 60e-6, 600.0
"""Limit of processor time for a file: constant [s] (a worker starts in 2 s), per byte [s] (40 times the slowest file),
limit [s]."""

PATIENCE = 10.0
"""Limit of elapsed time over that of processor time: a busy machine shares its processors, a worker that waits for a
network drive takes none."""

_SIGPROF = int(getattr(signal, "SIGPROF", 0))

_DO, _AGAIN = "Simplify the part.", "Export the part again."

_COMMAND = "from tanteo.catalogue.worker import main; main()"


@dataclass(frozen=True, slots=True)
class Request:
    """Request to read one file.

    Attributes:
        path: path of the file.
        unit: length unit, see ``read_part``; None if the file states it.
        name: name for the part.
        key: name of its cache entry; None if it is not cached.
        record: whether the part is returned as a catalogue record.
    """

    path: str
    unit: str | None
    name: str
    key: str | None = None
    record: bool = False


def seconds_for(path: str) -> float:
    """Return the limit of processor time for reading a file [s].

    Args:
        path: path of the file.
    """
    with suppress(OSError):
        return min(LEAST_SECONDS + SECONDS_PER_BYTE * split_body(path)[0].stat().st_size, MOST_SECONDS)
    return LEAST_SECONDS


def read_in_processes(
    requests: Mapping[int, Request],
    on_result: Callable[[int, Any], None],
    *,
    workers: int,
    time_limit: float | None = None,
    command: str = _COMMAND,
    memory: int | None = None,
) -> None:
    """Read files in worker processes.

    Args:
        requests: requests by number.
        on_result: function called in this thread with the number and the part, its record if requested, or the error
            message.
        workers: number of processes.
        time_limit: time limit for one file [s]; None for one by file size.
        command: Python code of a worker; tests replace it.
        memory: memory limit of each worker [bytes]; 0 for no limit; None for one by the machine's memory.
    """
    rules = {
        "parent": os.getpid(),
        "memory": memory_for(workers) if memory is None else memory,
        "by_size": memory is None,
    }
    waiting: queue.SimpleQueue[tuple[int, Request]] = queue.SimpleQueue()
    done: queue.SimpleQueue[tuple[int, Part | Record | str]] = queue.SimpleQueue()
    for item in requests.items():
        waiting.put(item)
    stopped = threading.Event()
    running: set[subprocess.Popen[bytes]] = set()
    threads = [
        threading.Thread(target=_serve, args=(waiting, done, stopped, running, time_limit, command, rules), daemon=True)
        for _ in range(workers)
    ]
    for thread in threads:
        thread.start()
    try:
        for _ in range(len(requests)):
            on_result(*done.get())
    finally:
        stopped.set()
        for worker in tuple(running):  # all are idle, except after Ctrl-C: then no file is read to its end
            worker.kill()
        for thread in threads:
            thread.join()


def _serve(
    waiting: queue.SimpleQueue[tuple[int, Request]],
    done: queue.SimpleQueue[tuple[int, Part | Record | str]],
    stopped: threading.Event,
    running: set[subprocess.Popen[bytes]],
    time_limit: float | None,
    command: str,
    rules: Mapping[str, int],
) -> None:
    worker: subprocess.Popen[bytes] | None = None
    while not stopped.is_set():
        try:
            index, request = waiting.get_nowait()
        except queue.Empty:
            break
        if worker is None:
            worker = _started(command, rules)
            running.add(worker)
        if stopped.is_set():  # it may have started after the others were ended
            break
        result, alive = _send(worker, request, time_limit, rules)
        if not alive:
            running.discard(worker)
            _end(worker)
            worker = None
        done.put((index, result))
    if worker is not None:
        _end(worker)


def _started(command: str, rules: Mapping[str, int]) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    worker = subprocess.Popen(
        [sys.executable, "-P", "-c", command],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=environment,
    )
    assert worker.stdin is not None
    with suppress(OSError):  # a worker that died at its start is detected at the first request
        worker.stdin.write(json.dumps(rules).encode() + b"\n")
        worker.stdin.flush()
    return worker


def _end(worker: subprocess.Popen[bytes]) -> None:
    worker.kill()
    worker.wait()
    for pipe in (worker.stdin, worker.stdout):
        if pipe is not None:
            pipe.close()


def _limit(rules: Mapping[str, int], request: Request) -> str:
    memory = min(rules["memory"], memory_of(request.path)) if rules["by_size"] else rules["memory"]
    return f" (it may use {memory / 1e9:.3g} GB of memory)" if rules["memory"] else ""


def _send(
    worker: subprocess.Popen[bytes], request: Request, time_limit: float | None, rules: Mapping[str, int]
) -> tuple[Part | Record | str, bool]:
    """Send one request and return its result, and whether the worker is still usable."""
    label = Path(request.path).name
    assert worker.stdin is not None
    assert worker.stdout is not None
    late = threading.Event()

    def stop() -> None:
        late.set()
        worker.kill()

    allowed = seconds_for(request.path)
    seconds = PATIENCE * allowed if time_limit is None else time_limit
    timer = threading.Timer(seconds, stop)
    timer.start()
    try:
        worker.stdin.write(json.dumps({**asdict(request), "seconds": allowed}).encode() + b"\n")
        worker.stdin.flush()
        head = worker.stdout.read(9)
        size = int.from_bytes(head[1:], "big")
        reply = worker.stdout.read(size) if len(head) == 9 else b""
    except OSError:
        head = b""
        size = 0
        reply = b""
    finally:
        timer.cancel()
    if late.is_set():
        return f"{label}: expected to be read within {seconds:.3g} s, got no end. {_DO}", False
    if len(head) < 9 or len(reply) < size:
        with suppress(subprocess.TimeoutExpired):
            if worker.wait(timeout=PATIENCE) == -_SIGPROF:
                return f"{label}: expected to be read in {allowed:.3g} s of processor time, got no end. {_DO}", False
        return f"{label}: expected a part, got a crash of the CAD reader{_limit(rules, request)}. {_AGAIN}", False
    if head[:1] == b"E":
        return reply.decode(), True
    try:
        if head[:1] == b"R":
            return record_from_bytes(reply), True
        return part_from_bytes(reply, name=request.name, source=request.path), True
    except InputError as error:
        return f"{label}: {error}", True
