"""A process that reads CAD files for another one: requests on standard input, parts on standard output.

It is a process and not a thread because CAD kernels crash and hang. A request is one line of JSON; a reply is a
letter (``P`` part, ``E`` error), eight bytes of length, and that many bytes.
"""

from __future__ import annotations

import json
import os
import sys

from tanteo.catalogue.archive import part_to_bytes
from tanteo.errors import TanteoError
from tanteo.parts import read_part


def main() -> None:
    """Serve requests until standard input closes."""
    # The kernel prints to standard output: give it standard error and keep the pipe for replies.
    pipe = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for line in sys.stdin.buffer:
        request = json.loads(line)
        try:
            part = read_part(request["path"], unit=request["unit"], name=request["name"])
            letter, reply = b"P", part_to_bytes(part)
        except (TanteoError, RuntimeError, OSError, MemoryError) as error:
            letter, reply = b"E", str(error).encode()
        pipe.write(letter + len(reply).to_bytes(8, "big") + reply)
        pipe.flush()
