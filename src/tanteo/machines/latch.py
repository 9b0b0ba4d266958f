"""Latch the first reason for which a machine must not move, and build the errors of failed motions."""

from __future__ import annotations

import time
from collections.abc import Callable

from tanteo.geometry.typing import Vectors
from tanteo.machines.link import Link
from tanteo.machines.protocol import ContactError, LateError, LinkLostError, MachineState, StoppedError, in_mm, quoted


class Latch:
    """First reason to stop, shared by all threads of a driver and never cleared.

    Attributes:
        name: name of the machine, for messages.
        advice: instruction for the operator after a stop.
        stopped: reason of the stop; empty while the machine may move.
        lost: error that ended the connection; None while it is open.
    """

    def __init__(self, name: str, advice: str, abort: Callable[[], None]) -> None:
        self.name, self.advice = name, advice
        self.stopped = ""
        self.lost: LinkLostError | None = None
        self._abort = abort

    def stop(self, why: str) -> None:
        """Forbid further motions; the first reason is kept.

        Args:
            why: reason of the stop.
        """
        self.stopped = self.stopped or why

    def lose(self, error: LinkLostError) -> None:
        """Record that the connection is lost.

        Args:
            error: error that ended the connection.
        """
        self.lost = self.lost or error

    def check(self) -> None:
        """Raise the latched error, if there is one.

        Raises:
            LinkLostError: the connection is lost.
            StoppedError: the machine has stopped.
        """
        if self.lost is not None:
            raise self.lost
        if self.stopped:
            raise StoppedError(
                f"{self.name}: expected a machine that can move, got a stopped one: {self.stopped}. "
                f"{self.advice}, and start again."
            )

    def state(self, of_controller: MachineState) -> MachineState:
        """Return ``lost`` or ``stopped`` if that is latched, else the state of the controller.

        Args:
            of_controller: state that the controller reports.
        """
        return "lost" if self.lost is not None else "stopped" if self.stopped else of_controller

    def late(self, deadline: float, what: str) -> None:
        """Stop the machine and raise an error if a deadline has passed.

        Args:
            deadline: deadline, by the monotonic clock [s].
            what: expected event, for the message.

        Raises:
            LateError: the deadline has passed.
        """
        if not time.monotonic() <= deadline:  # also if the deadline is not a number
            self._abort()
            raise LateError(
                f"{self.name}: expected {what} in time, got none. A stop was sent: check the machine before you go on."
            )

    def failed(self, got: str) -> StoppedError:
        """Stop the machine, and return the error of a command that failed.

        Args:
            got: reaction of the controller, for the message.
        """
        self._abort()
        return StoppedError(f"{self.name}: expected its command to be carried out, got {got}. A stop was sent.")

    def bent(self, reply: str, expected: str) -> StoppedError:
        """Stop the machine, and return the error of a reply that cannot be read.

        Args:
            reply: reply as received.
            expected: expected reply, for the message.
        """
        self.stop(f"it replied {quoted(reply)} where {expected} was expected")
        self._abort()
        return StoppedError(
            f"{self.name}: expected {expected}, got {quoted(reply)}. A stop was sent: check the controller and its "
            "cable."
        )

    def changed(self, what: str) -> StoppedError:
        """Forbid further motions, and return the error of a change that another sender has made.

        Args:
            what: change, for the message.
        """
        self.stop(f"another sender changed its state: {what}")
        return StoppedError(
            f"{self.name}: expected the state that this program has set, got {what}. No motion was sent: find the "
            "other sender, and start again."
        )

    def send(self, link: Link, data: bytes) -> None:
        """Send bytes; a failure is latched as a lost connection and not raised.

        Args:
            link: connection.
            data: bytes to send.
        """
        try:
            link.write(data)
        except LinkLostError as error:
            self.lose(error)

    def contact_error(self, place: Vectors) -> ContactError:
        """Return the error of a contact on a path that should be free.

        Args:
            place: position of the contact ``(3,)`` [m].
        """
        return ContactError(
            f"{self.name}: expected a clear path, got a contact at {in_mm(place)}. Give the part more clearance."
        )

    def in_contact(self) -> ContactError:
        """Return the error of a probe that is in contact before a guarded motion."""
        return ContactError(
            f"{self.name}: expected a probe without contact, got one in contact before its motion. Check the stylus "
            "and its cable."
        )
