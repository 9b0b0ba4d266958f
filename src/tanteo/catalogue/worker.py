"""One process that reads CAD files for another: what it may use of the machine, and that it ends with its parent."""

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

Read = TypeVar("Read")

LEAST_MEMORY = 2 << 30
"""Bytes that a worker may use in any case."""

_SET_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of prctl(2)


def main() -> None:
    """Serve requests until standard input closes: one a line, as JSON; the first line says what holds for all."""
    # The kernel prints to standard output: give it standard error and keep the pipe for replies.
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    rules = json.loads(sys.stdin.buffer.readline())
    end_with(rules["parent"])
    limit_memory(rules["memory"])
    for line in sys.stdin.buffer:
        request = json.loads(line)
        letter, reply = _answered(request, rules["memory"])
        pipe.write(letter + len(reply).to_bytes(8, "big") + reply)
        pipe.flush()


def _answered(request: Mapping[str, Any], memory: int) -> tuple[bytes, bytes]:
    """The letter and the bytes of a reply."""
    asked = request["path"], request["unit"], request["name"], memory
    if request["record"]:
        found = attempt(partial(read_record, request["key"]), *asked)
        return (b"E", found.encode()) if isinstance(found, str) else (b"R", record_to_bytes(found))
    result = attempt(read_part, *asked)
    return (b"E", result.encode()) if isinstance(result, str) else (b"P", part_to_bytes(result))


def read_record(key: str | None, path: str, *, unit: str | None, name: str) -> Record:
    """A part as it goes into a catalogue; one that the cache has is not read again."""
    found = load(key, name=name, source=path) if key else None
    return record_of(found or read_part(path, unit=unit, name=name))


def attempt(read: Callable[..., Read], path: str, unit: str | None, name: str, memory: int = 0) -> Read | str:
    """Read one file: the part, or a sentence why there is none.

    One bad file costs itself only, whatever it makes a reader raise: of many files nobody wants a traceback. This
    and ``reader_of_others`` are the places that take every exception (``docs/decisions/0067``).
    """
    label = Path(path).name
    try:
        return read(path, unit=unit, name=name)
    except (TanteoError, OSError) as error:
        return str(error)
    except MemoryError:
        size = f"{memory / 1e9:.3g} GB of memory" if memory else "the memory that there is"
        return f"{label}: expected to be read with {size}, needs more. Simplify the part."
    except Exception as error:  # noqa: BLE001 - see above
        what = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        return f"{label}: expected a file that can be read, but its reader fails ({what}). Export it again."


def memory_for(workers: int) -> int:
    """Bytes that each of so many workers may use: together half of what the machine has."""
    try:
        there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # not on every system
        return 0
    return max(LEAST_MEMORY, int(there) // (2 * max(workers, 1)))


def limit_memory(size: int) -> None:
    """Let this process use so many bytes of memory at most, where the system can see to that; 0 is no limit."""
    with suppress(ImportError, ValueError, OSError):
        import resource  # not on Windows

        if size:
            resource.setrlimit(resource.RLIMIT_DATA, (size, size))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def end_with(parent: int) -> None:
    """End this process when its parent ends, also while a reader hangs in it."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.name == "posix":
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    """Elsewhere, and where the parent was gone before: as often as the reader lets threads run."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)
