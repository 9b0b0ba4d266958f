"""The thread that reads what a controller says, row by row."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable

from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.protocol import LinkLostError


class RowReader:
    """Rows of a connection, as they come, until it is closed or lost; a loss is latched.

    Args:
        link: that is read; its owner closes it.
        latch: of the driver.
        hear: told of each row, without its end and the blanks around it.
        turn: called about twenty times a second, whatever comes; it must not wait.
    """

    def __init__(self, link: Link, latch: Latch, hear: Callable[[str], None], turn: Callable[[], None]) -> None:
        self._link, self._latch, self._hear, self._turn = link, latch, hear, turn
        self._closed = False
        self._thread = threading.Thread(target=self._listen, daemon=True, name=f"reader of {link.name}")
        self._thread.start()

    def close(self) -> None:
        """Read no more; never raises."""
        self._closed = True
        self._thread.join(0.5)  # it may be reading

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
                self._hear(row.decode("ascii", "replace").strip())
