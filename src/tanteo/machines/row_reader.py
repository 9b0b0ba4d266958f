"""Read the rows that a controller sends, in a thread."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError

_LONGEST = 4096
"""Largest length of a row [bytes]: size of the output buffer of linuxcncrsh; rows of GRBL are shorter."""


class RowReader:
    """Thread that reads the rows of a connection until it is closed or lost; a loss is latched.

    A row that ``hear`` refuses with ValueError, or that does not end, stops the machine.
    """

    def __init__(self, link: Link, latch: Latch, hear: Callable[[str], None], turn: Callable[[], None]) -> None:
        """Start the thread.

        Args:
            link: connection to read; the caller closes it.
            latch: latch of the driver.
            hear: function that receives each row, stripped of blanks; it raises ValueError with the expected reply and
                the row.
            turn: function that is called about twenty times a second; it must not wait.
        """
        self._link, self._latch, self._hear, self._turn = link, latch, hear, turn
        self._closed = False
        self._thread = threading.Thread(target=self._listen, daemon=True, name=f"reader of {link.name}")
        self._thread.start()

    def close(self) -> None:
        """End the thread; never raises."""
        self._closed = True
        self._thread.join(0.5)  # a read may be under way

    def _listen(self) -> None:
        rest = b""
        while not self._closed and self._latch.lost is None:
            self._turn()
            try:
                rest += self._link.read(0.05)
            except LinkLostError as error:
                self._latch.lose(error)
                return
            *rows, rest = re.split(rb"[\r\n]+", rest)
            for row in rows:
                self._take(row)
            if len(rest) > _LONGEST:
                self._take(rest)
                rest = b""

    def _take(self, data: bytes) -> None:
        row = data[: _LONGEST + 1].decode("ascii", "replace").strip()
        try:
            if len(data) > _LONGEST:
                raise ValueError(f"a row of at most {_LONGEST} bytes", row)
            self._hear(row)
        except ValueError as error:
            if not self._latch.stopped:
                expected, reply = error.args
                self._latch.bent(reply, expected)
