"""Implement the client of the linuxcncrsh protocol: requests, answers by name, and polled values.

Sources: ``src/emc/usr_intf/emcrsh.cc`` and ``docs/src/man/man1/linuxcncrsh.1.adoc`` (LinuxCNC/linuxcnc), versions 2.9
and master. A request is a line. An answer is a name and a value, ended by carriage return and line feed, or by line
feed and carriage return after ``SET`` in 2.9. A ``SET`` is acknowledged if ``VERBOSE`` is on. Answers arrive in the
order of the requests, one for each.
"""

from __future__ import annotations

import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence

from tanteo.machines.latch import Latch
from tanteo.machines.link import Link
from tanteo.machines.row_reader import RowReader

_UNCOUNTED = "SET ECHO", "SET ENABLE", "SET VERBOSE"
"""Answers that a version sends or does not send, before the others are counted."""
_PERIOD = 0.1
"""Time between two requests of the polled values [s]."""


class RshClient:
    """Connection to linuxcncrsh.

    Attributes:
        polling: whether the reader thread requests the polled values regularly, calls ``heard`` for each answer, and
            refuses answers that were not requested. ``heard`` raises ValueError with the expected
            and the received answer.
    """

    def __init__(self, link: Link, latch: Latch, polled: Sequence[str], heard: Callable[[str, str], None]) -> None:
        self.polling = False
        self._link, self._latch, self._polled, self._heard = link, latch, tuple(polled), heard
        self._answers: dict[str, tuple[str, float]] = {}
        self._open, self._counting = Counter[str](), threading.Lock()
        self._busy, self._polled_at = threading.Lock(), 0.0
        self._reader = RowReader(link, latch, self._hear, self._poll)

    def value(self, name: str, default: str = "") -> str:
        """Return the last answer with a name.

        Args:
            name: name of the answer, in capital letters.
            default: value before the first answer.
        """
        return self._answers.get(name, (default, 0.0))[0]

    def age(self, name: str) -> float:
        """Return the age of the last answer with a name [s]; infinite before the first one.

        Args:
            name: name of the answer, in capital letters.
        """
        return time.monotonic() - self._answers[name][1] if name in self._answers else float("inf")

    def send(self, text: str) -> None:
        """Send requests without waiting for answers; never raises.

        Args:
            text: requests, one in a line.
        """
        names = [name for name in map(_answer_to, text.splitlines()) if name]
        with self._counting:
            self._open.update(names)
        self._latch.send(self._link, text.encode("ascii") + b"\r\n")

    def request(self, line: str, name: str, deadline: float) -> str:
        """Send a request, and return its answer.

        Args:
            line: request to send.
            name: name of the answer, in capital letters.
            deadline: deadline, by the monotonic clock [s].

        Raises:
            LateError: no answer arrives in time.
            StoppedError: the machine has stopped, or the connection is lost.
        """
        with self._busy:
            begun = time.monotonic()
            self._latch.check()
            self.send(line)
            while True:
                self._latch.check()
                answer, at = self._answers.get(name, ("", -1.0))
                if at > begun:
                    return answer
                self._latch.late(deadline, f"an answer to '{line}'")
                time.sleep(0.001)

    def fresh(self, deadline: float) -> None:
        """Request all polled values, and wait for the answers.

        Args:
            deadline: deadline, by the monotonic clock [s].
        """
        self.send("\r\n".join(f"get {name.lower()}" for name in self._polled[:-1]))
        self.request(f"get {self._polled[-1].lower()}", self._polled[-1], deadline)

    def set(self, what: str, deadline: float) -> bool:
        """Send a ``SET`` request, and return whether it was acknowledged.

        Args:
            what: name and value to set.
            deadline: deadline, by the monotonic clock [s].
        """
        return self.request(f"set {what}", "SET " + what.partition(" ")[0].upper(), deadline) == "ACK"

    def close(self) -> None:
        """Send ``quit`` and end the reader thread, without closing the connection; never raises."""
        self._reader.close()
        self.send("quit")

    def _poll(self) -> None:
        if self.polling and time.monotonic() - self._polled_at > _PERIOD:
            self._polled_at = time.monotonic()
            self.send("\r\n".join(f"get {name.lower()}" for name in self._polled))

    def _hear(self, row: str) -> None:
        name, _, answer = row.partition(" ")
        if name.upper() == "SET":
            of, _, answer = answer.partition(" ")
            name = f"SET {of}"
        if name:
            self._take(name.upper(), answer.strip())

    def _take(self, name: str, answer: str) -> None:
        with self._counting:
            requested = self._open[name] > 0
            self._open[name] -= requested
        if self.polling:
            if not requested and name not in _UNCOUNTED:
                raise ValueError("one answer for each request", f"{name} {answer}")
            self._heard(name, answer)
        self._answers[name] = (answer, time.monotonic())


def _answer_to(request: str) -> str:
    """Return the name of the answer to a request; empty if it has none, or only in some versions."""
    word, _, rest = request.upper().partition(" ")
    name = f"SET {rest.split(' ')[0]}" if word == "SET" else rest if word == "GET" else word
    return "" if name in (*_UNCOUNTED, "QUIT") else name
