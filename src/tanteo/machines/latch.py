"""Why a machine may not move any more, kept once and never cleared; what drivers say when a motion goes wrong."""

from __future__ import annotations

import time
from collections.abc import Callable

from tanteo.geometry.typing import Vectors
from tanteo.machines.link import Link
from tanteo.machines.protocol import ContactError, LateError, LinkLostError, MachineState, StoppedError, in_mm


class Latch:
    """The first reason to stop, of a driver whose threads all ask it.

    Attributes:
        name: of the machine, for messages.
        advice: what a person does about a stop.
        stopped: why; empty while it may move.
        lost: the connection's end; None while it stands.
    """

    def __init__(self, name: str, advice: str, abort: Callable[[], None]) -> None:
        self.name, self.advice = name, advice
        self.stopped = ""
        self.lost: LinkLostError | None = None
        self._abort = abort

    def stop(self, why: str) -> None:
        """No motion from here on; the first reason stays."""
        self.stopped = self.stopped or why

    def lose(self, error: LinkLostError) -> None:
        """The connection is gone."""
        self.lost = self.lost or error

    def check(self) -> None:
        """Raise what there is to be raised."""
        if self.lost is not None:
            raise self.lost
        if self.stopped:
            raise StoppedError(
                f"{self.name}: expected a machine that may move, got one that has stopped: {self.stopped}. "
                f"{self.advice}, and start again."
            )

    def state(self, of_controller: MachineState) -> MachineState:
        """The controller's own, unless something is latched."""
        return "lost" if self.lost is not None else "stopped" if self.stopped else of_controller

    def late(self, deadline: float, what: str) -> None:
        """After the deadline: stop it, and say what did not come."""
        if time.monotonic() > deadline:
            self._abort()
            raise LateError(f"{self.name}: expected {what} in time, got none. It was told to stop: look at it.")

    def failed(self, got: str) -> StoppedError:
        """Stop it; the error says what it did instead of its command."""
        self._abort()
        return StoppedError(f"{self.name}: expected its command to be done, got {got}. It was told to stop.")

    def send(self, link: Link, data: bytes) -> None:
        """What cannot be sent is a lost connection; never raises."""
        try:
            link.write(data)
        except LinkLostError as error:
            self.lose(error)

    def met(self, place: Vectors) -> ContactError:
        """A contact on a way that should be free."""
        return ContactError(
            f"{self.name}: expected a free way, met something at {in_mm(place)}. Give the part more clearance."
        )

    def in_contact(self) -> ContactError:
        """A probe that is in contact before a guarded motion."""
        return ContactError(
            f"{self.name}: expected a probe that is free, got one in contact before it moved. Look at the stylus and "
            "its cable."
        )
