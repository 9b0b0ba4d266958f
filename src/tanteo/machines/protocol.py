"""What a session needs of whatever moves its probe: facts, status, three motions, abort.

Places are of the centre of the ball, or of a sensor's origin, in the machine's own frame, in metres.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from tanteo.errors import TanteoError
from tanteo.geometry.typing import Transforms, Vectors

MachineState = Literal["idle", "moving", "held", "stopped", "lost"]
"""At rest and ready; under way; paused; an alarm, an emergency stop or an abort; no connection."""


class MachineError(TanteoError):
    """A machine refused, stopped or could not be reached."""


class RefusedError(MachineError):
    """Nothing was sent: the motion is outside of the limits, or the person said no."""


class ContactError(MachineError):
    """Something was met on a way that should be free; the machine has stopped there and may be moved back."""


class StoppedError(MachineError):
    """An alarm, an emergency stop or an abort: it does not move again before it is opened anew."""


class LinkLostError(StoppedError):
    """The connection is gone; where the machine is is not known."""


class LateError(StoppedError):
    """No answer came in time, so the machine was told to stop."""


@dataclass(frozen=True, slots=True)
class Facts:
    """What does not change while a machine is connected.

    Attributes:
        name: for people, with the controller's own version.
        controller: as ``--wcs`` names it: ``grbl``, ``ur``, ``linuxcnc``; empty where no frame can be written.
        turns: its tool can look along any direction; else it points down.
        contact: it touches; else it measures a range at rest.
        guarded: its ``move`` stops where something is met.
    """

    name: str
    controller: str = ""
    turns: bool = False
    contact: bool = True
    guarded: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class MachineStatus:
    """What is known of a machine at one moment.

    Attributes:
        state: one of :data:`MachineState`.
        place: where the tip is ``(3,)`` [m]; None if the controller never said.
        tripped: the probe says contact; None where that is not known.
        age: of what the controller said, when this was asked for [s]; infinite if it never did.
        words: the controller's own.
    """

    state: MachineState
    place: Vectors | None = None
    tripped: bool | None = None
    age: float = np.inf
    words: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """What one guarded motion, or one range, came to.

    Attributes:
        start: where the tip was ``(3,)`` [m].
        direction: unit ``(3,)``.
        distance: from the start to where the tip met the part, or to what the beam met [m]; infinite for nothing.
        reach: how far was looked [m].
        seconds: that it took.
    """

    start: Vectors
    direction: Vectors
    distance: float
    reach: float
    seconds: float = field(default=0.0)

    @property
    def met(self) -> bool:
        """Whether something was met."""
        return bool(np.isfinite(self.distance))


@runtime_checkable
class Machine(Protocol):
    """A driver. What it never does is on the page of robots (``docs/robots.md``, "What a driver never does").

    Motions block until the machine is at rest, no longer than ``seconds``; they raise :class:`MachineError`. Nothing
    else raises, and nothing else waits.
    """

    @property
    def facts(self) -> Facts:
        """What does not change."""
        ...

    def status(self) -> MachineStatus:
        """What was heard last, with its age; from any thread."""
        ...

    def move(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight to a pose ``(4, 4)`` of the probe, which looks along its z; stop where something is met.

        Raises:
            ContactError: something was met.
            StoppedError: it will not move again.
        """
        ...

    def back(self, T_world_probe: Transforms, speed: float, seconds: float) -> None:
        """Straight back to where it came from; the probe may be in contact at the start."""
        ...

    def sense(self, direction: Vectors, reach: float, speed: float, seconds: float) -> Sensed:
        """From here along a direction ``(3,)`` until something is met, ``reach`` [m] at most; or a range at rest."""
        ...

    def abort(self) -> None:
        """Stop at once, for good; from any thread, never waits, never raises."""
        ...

    def write_frame(self, text: str, seconds: float) -> None:
        """Have the controller run the lines that set a frame (:func:`tanteo.io.write_work_frame`)."""
        ...

    def close(self) -> None:
        """Let go; what moves is stopped first. Never raises."""
        ...


def place_of(machine: Machine) -> Vectors:
    """Where it is now ``(3,)`` [m].

    Raises:
        LinkLostError: it has never said.
    """
    place = machine.status().place
    if place is None:
        raise LinkLostError(f"{machine.facts.name}: expected a position, got none. Check the connection.")
    return place


def in_words(values: Vectors) -> str:
    """``(1.000, 2.000, 3.000)``."""
    return "(" + ", ".join(f"{v:.3f}" for v in values + 0.0) + ")"


def in_mm(place: Vectors) -> str:
    """A place ``(3,)`` [m] in words."""
    return f"{in_words(1e3 * place)} mm"
