"""The protocol of linuxcncrsh from the client's end: requests, answers by name, and what is polled.

Read for it: ``src/emc/usr_intf/emcrsh.cc`` and ``docs/src/man/man1/linuxcncrsh.1.adoc`` (LinuxCNC/linuxcnc), of 2.9 and
of its master: a request is a line; an answer is its name and what is said, ended by carriage return and line feed, in
2.9 the other way round after ``SET``; a ``SET`` is acknowledged where ``VERBOSE`` is on. Answers come in the order of
the requests.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.row_reader import RowReader

_PERIOD = 0.1
"""Between two questions for what is polled [s]."""


class RshClient:
    """One connection.

    Attributes:
        polling: whether what is polled is asked for now and then, and somebody is to hear of each answer.
    """

    def __init__(self, link: Link, latch: Latch, polled: Sequence[str], heard: Callable[[str], None]) -> None:
        self.polling = False
        self._link, self._latch, self._polled, self._heard = link, latch, tuple(polled), heard
        self._said: dict[str, tuple[str, float]] = {}
        self._busy, self._asked = threading.Lock(), 0.0
        self._reader = RowReader(link, latch, self._hear, self._poll)

    def said(self, name: str, default: str = "") -> str:
        """What was answered last under a name."""
        return self._said.get(name, (default, 0.0))[0]

    def age(self, name: str) -> float:
        """Since when [s]; infinite for never."""
        return time.monotonic() - self._said[name][1] if name in self._said else float("inf")

    def send(self, text: str) -> None:
        """Requests whose answers nobody waits for; never raises."""
        self._latch.send(self._link, text.encode("ascii") + b"\r\n")

    def ask(self, request: str, name: str, deadline: float) -> str:
        """A request, and the answer to it.

        Raises:
            LateError: there is none in time.
            StoppedError: it has stopped, or the connection is gone.
        """
        with self._busy:
            begun = time.monotonic()
            self._latch.check()
            self.send(request)
            while True:
                self._latch.check()
                said, at = self._said.get(name, ("", -1.0))
                if at > begun:
                    return said
                self._latch.late(deadline, f"an answer to '{request}'")
                time.sleep(0.001)

    def fresh(self, deadline: float) -> None:
        """All that is polled, asked for from now on."""
        self.send("\r\n".join(f"get {name.lower()}" for name in self._polled[:-1]))
        self.ask(f"get {self._polled[-1].lower()}", self._polled[-1], deadline)

    def set(self, what: str, deadline: float) -> bool:
        """``SET``: whether it was acknowledged."""
        return self.ask(f"set {what}", "SET " + what.partition(" ")[0].upper(), deadline) == "ACK"

    def close(self) -> None:
        """Take leave; never raises, and leaves the connection open."""
        self._reader.close()
        self.send("quit")

    def _poll(self) -> None:
        if self.polling and time.monotonic() - self._asked > _PERIOD:
            self._asked = time.monotonic()
            self.send("\r\n".join(f"get {name.lower()}" for name in self._polled))

    def _hear(self, row: str) -> None:
        name, _, said = row.partition(" ")
        if name.upper() == "SET":
            of, _, said = said.partition(" ")
            name = f"SET {of}"
        if name:
            self._said[name.upper()] = (said.strip(), time.monotonic())
            if self.polling:
                self._heard(name.upper())
