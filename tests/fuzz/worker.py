"""The process that reads spoiled files, so that nothing else ends with it."""

from __future__ import annotations

import os
import sys
import time
import traceback

from fuzz.targets import READERS
from tanteo.errors import TanteoError


def peak():
    """Memory that this process and its children have needed at most [bytes]."""
    import resource

    each = (resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return max(each) * (1 if sys.platform == "darwin" else 1024)


def outcome(reader, path):
    """Return what a reader makes of a file: a word, and the trace of an unexpected exception."""
    try:
        reader(path)
    except TanteoError as error:
        text = str(error)
        word = "refused" if text.strip() and len(text) < 2000 else "mute or endless message"
        return word, text[:300]
    except BaseException:  # noqa: BLE001 - the caller needs the exception
        return "traceback", traceback.format_exc()
    return "read", ""


def serve(pipe, folder):
    """Serve as a worker: take kind, name and content, return the outcome and the largest memory so far."""
    os.environ["TANTEO_CACHE"] = str(folder / f"cache-{os.getpid()}")
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)  # libraries complain there
    for kind, name, content in iter(pipe.recv, None):
        path = folder / f"{os.getpid()}" / name
        path.parent.mkdir(exist_ok=True)
        if not (path.parent / "seeds").exists():
            (path.parent / "seeds").symlink_to(folder)
        path.write_bytes(content)
        start = time.monotonic()
        ended = outcome(READERS[kind], path)
        pipe.send((*ended, peak(), time.monotonic() - start))
