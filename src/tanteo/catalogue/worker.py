"""Run a process that reads CAD files for another one, within memory limits, and that ends with its parent."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from tanteo.catalogue.archive import part_to_bytes
from tanteo.catalogue.cache import load
from tanteo.catalogue.record import Record, record_of, record_to_bytes
from tanteo.errors import TanteoError
from tanteo.parts import read_part
from tanteo.parts.readers import split_body

Read = TypeVar("Read")

LEAST_MEMORY, MEMORY_PER_BYTE = 1 << 30, 500
"""Memory limit of a file: constant [bytes] (the CAD kernel takes 300 MB), and per byte (the largest STEP files of NIST,
of 2 MB, take 20)."""

_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)


def main() -> None:
    """Serve requests from standard input until it closes, one JSON line each; the first line states the limits."""
    # The kernel prints to standard output: give it standard error and keep the pipe for replies.
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    rules = json.loads(sys.stdin.buffer.readline())
    end_with(rules["parent"])
    for line in sys.stdin.buffer:
        request = json.loads(line)
        memory = min(rules["memory"], memory_of(request["path"])) if rules["by_size"] else rules["memory"]
        limit_memory(memory)
        limit_processor_time(request["seconds"])
        letter, reply = _answered(request, memory)
        pipe.write(letter + len(reply).to_bytes(8, "big") + reply)
        pipe.flush()


def _answered(request: Mapping[str, Any], memory: int) -> tuple[bytes, bytes]:
    """Return letter and bytes of a reply."""
    requested = request["path"], request["unit"], request["name"], memory
    if request["record"]:
        found = attempt(partial(read_record, request["key"]), *requested)
        return (b"E", found.encode()) if isinstance(found, str) else (b"R", record_to_bytes(found))
    result = attempt(read_part, *requested)
    return (b"E", result.encode()) if isinstance(result, str) else (b"P", part_to_bytes(result))


def read_record(key: str | None, path: str, *, unit: str | None, name: str) -> Record:
    """Return the catalogue record of a file's part, from the cache if possible.

    Args:
        key: name of its cache entry; None if it is not cached.
        path: path of the file.
        unit: length unit; None if the file states it.
        name: name for the part.
    """
    found = load(key, name=name, source=path) if key else None
    return record_of(found or read_part(path, unit=unit, name=name))


def attempt(read: Callable[..., Read], path: str, unit: str | None, name: str, memory: int = 0) -> Read | str:
    """Read one file, and return the part or an error message.

    A bad file affects only itself, for any exception of its reader. This function and ``third_party_reader`` are the
    only places that catch every exception (decision 67).

    Args:
        read: function that reads a file.
        path: path of the file.
        unit: length unit; None if the file states it.
        name: name for the part.
        memory: memory limit for the message [bytes]; 0 for none.
    """
    label = Path(path).name
    try:
        return read(path, unit=unit, name=name)
    except (TanteoError, OSError) as error:
        return str(error)
    except MemoryError:
        size = f"{memory / 1e9:.3g} GB of memory" if memory else "the available memory"
        return f"{label}: expected to be read with {size}, needs more. Simplify the part."
    except Exception as error:  # noqa: BLE001 - see above
        what = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        return f"{label}: expected a file that can be read, but its reader fails ({what}). Export it again."


def memory_for(workers: int) -> int:
    """Return the memory limit of each worker [bytes]: together half of the machine's memory.

    Args:
        workers: number of workers.
    """
    try:
        there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on every system
        return 0
    return max(2 * LEAST_MEMORY, int(there) // (2 * max(workers, 1)))


def memory_of(path: str) -> int:
    """Return the memory limit for reading a file [bytes].

    Args:
        path: path of the file.
    """
    with suppress(OSError, ValueError):
        return LEAST_MEMORY + MEMORY_PER_BYTE * split_body(path)[0].stat().st_size
    return LEAST_MEMORY


def limit_memory(size: int) -> None:
    """Limit the memory of this process, where the operating system supports it.

    Args:
        size: limit [bytes]; 0 for none.
    """
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on Windows

        if size:
            resource.setrlimit(resource.RLIMIT_DATA, (size, resource.getrlimit(resource.RLIMIT_DATA)[1]))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def limit_processor_time(seconds: float) -> None:
    """End this process by SIGPROF after some more processor time, where the operating system supports it.

    Unlike a limit of elapsed time, it does not depend on how busy the machine is.

    Args:
        seconds: processor time from now on [s]; 0 for no limit.
    """
    with suppress(AttributeError, ValueError, OSError):
        signal.signal(signal.SIGPROF, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_PROF, seconds)


def end_with(parent: int) -> None:
    """End this process when its parent ends, also while a reader hangs.

    Args:
        parent: process id of the parent.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.name == "posix":
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    """End this process when its parent changes; used on other systems, or if the parent ended earlier."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
