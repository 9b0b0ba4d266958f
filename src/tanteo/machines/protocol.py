"""Define the protocol of machines that move a probe: constant properties, status, three motions and abort.

Positions are those of the ball's centre, or of a sensor's origin, in the machine's frame, in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry.typing import Rotations, Transforms, Vectors

MachineState = Literal["idle", "moving", "held", "stopped", "lost"]
"""At rest and ready; in motion; paused; in alarm, emergency stop or aborted; without connection."""


class MachineError(TanteoError):
    """A machine refused a command, stopped, or could not be reached."""


class RefusedError(MachineError):
    """Nothing was sent, because the motion violates the limits or the operator declined it."""


class ContactError(MachineError):
    """The probe touched something on a path that should be free; the machine has stopped and can retract."""


class StoppedError(MachineError):
    """The machine is in alarm, emergency stop or aborted, and does not move until it is opened again."""


class LinkLostError(StoppedError):
    """The connection is lost, so the position of the machine is unknown."""


class LateError(StoppedError):
    """No answer arrived in time, so a stop was sent."""


@dataclass(frozen=True, slots=True)
class Facts:
    """Properties of a machine that do not change while it is connected.

    Attributes:
        name: name for messages, with the version of the controller.
        controller: name of the controller in ``--wcs``: ``grbl``, ``ur``, ``linuxcnc``; empty if it takes no frames.
        turns: whether the tool can point along any direction; otherwise it points down.
        contact: whether the machine carries a touch probe; otherwise it measures ranges at rest.
        guarded: whether its ``move`` stops at a contact.
        recorded: whether readings come from a log, so that they need not lie on the commanded line.
        deceleration: smallest deceleration after a contact [m/s^2]; the default is the default of GRBL's ``$120``.
    """

    name: str
    controller: str = ""
    turns: bool = False
    contact: bool = True
    guarded: bool = True
    recorded: bool = False
    deceleration: float = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class MachineStatus:
    """Status of a machine at one instant.

    Attributes:
        state: state of the machine.
        place: position of the tip ``(3,)`` [m]; None before the controller has reported one.
        tripped: whether the probe reports a contact; None if unknown.
        age: age of the controller's last report [s]; infinite before the first report.
        words: state as the controller names it.
        axes: axes of the tool ``(3, 3)``; None if the machine reports none.
    """

    state: MachineState
    place: Vectors | None = None
    tripped: bool | None = None
    age: float = np.inf
    words: str = ""
    axes: Rotations | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """Result of one guarded motion or one range measurement.

    Attributes:
        start: position of the tip at the start ``(3,)`` [m].
        direction: unit direction of motion or beam ``(3,)``.
        distance: distance from the start to the contact or echo [m]; infinite without one.
        reach: largest distance of the motion or beam [m].
        seconds: duration [s].
        reported: position of the contact, or of the end without one, as the controller reports it ``(3,)`` [m]; None
            if it reports none.
    """

    start: Vectors
    direction: Vectors
    distance: float
    reach: float
    seconds: float = field(default=0.0)
    reported: Vectors | None = None

    @property
    def hit(self) -> bool:
        """Whether there was a contact or an echo."""
        return bool(np.isfinite(self.distance))


@runtime_checkable
class Machine(Protocol):
    """Driver of a machine; ``docs/machines_safety.md`` lists what a driver must never do.

    Motions block until the machine is at rest, at most for ``seconds``, and raise :class:`MachineError`. The other
    methods neither raise nor wait.
    """

    @property
    def facts(self) -> Facts:
        """Return the constant properties of the machine."""
        ...

    def status(self) -> MachineStatus:
        """Return the most recent status with its age; callable from any thread."""
        ...

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Move straight to a pose of the probe, and stop at a contact.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m]; the probe points along its z.
            speed: commanded speed [m/s].
            seconds: largest duration [s].

        Raises:
            ContactError: the probe touched something.
            StoppedError: the machine does not move any more.
        """
        ...

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Retract straight to an earlier pose; the probe may be in contact at the start.

        Args:
            T_world_probe: pose at the end ``(4, 4)`` [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        ...

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """Move along a direction until contact, or measure a range at rest.

        Args:
            direction: unit direction ``(3,)``.
            reach: largest distance [m].
            speed: commanded speed [m/s].
            seconds: largest duration [s].
        """
        ...

    def abort(self) -> None:
        """Stop immediately and permanently; callable from any thread, never waits, never raises."""
        ...

    def write_frame(self, text: str, seconds: float) -> None:
        """Send the lines that set a work frame to the controller.

        Args:
            text: lines, as :func:`tanteo.io.poses.write_work_frame` writes them.
            seconds: largest duration [s].
        """
        ...

    def close(self) -> None:
        """Stop a running motion, and disconnect; never raises."""
        ...


def place_of(machine: Machine) -> Vectors:
    """Return the current position of a machine ``(3,)`` [m].

    Args:
        machine: driver.

    Raises:
        LinkLostError: the controller has not reported a position.
        StoppedError: the position is not three finite numbers.
    """
    place = machine.status().place
    if place is None:
        raise LinkLostError(f"{machine.facts.name}: expected a position, got none. Check the connection.")
    if np.shape(place) != (3,) or not np.isfinite(place).all():
        raise StoppedError(
            f"{machine.facts.name}: expected a position of three finite numbers, got {np.asarray(place).tolist()}. "
            "Check the controller."
        )
    return place


def quoted(reply: str) -> str:
    """Return a reply of a controller for a message, without control characters and at most 80 characters long.

    Args:
        reply: reply as received.
    """
    text = "".join(c if c.isprintable() else "?" for c in reply[:81])
    return f"'{text[:80]}...'" if len(text) > 80 else f"'{text}'"


def in_words(values: Vectors) -> str:
    """Return numbers as text, such as ``(1.000, 2.000, 3.000)``.

    Args:
        values: numbers ``(n,)``.
    """
    return "(" + ", ".join(f"{v:.3f}" for v in values + 0.0) + ")"


def in_mm(place: Vectors) -> str:
    """Return a position as text, in millimetres.

    Args:
        place: position ``(3,)`` [m].
    """
    return f"{in_words(1e3 * place)} mm"
