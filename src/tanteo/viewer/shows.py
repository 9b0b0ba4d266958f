"""What the page can show: a session, and how it is carried out. By a bare probe, or by a hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from tanteo.execution import Furniture, sense_part
from tanteo.hand import Hand, Robot, Sensed
from tanteo.motion import Rules
from tanteo.sensors import Readings, RobotPreset
from tanteo.session import Action, Done, Session
from tanteo.simulator import Solid
from tanteo.typing import Tangents


class Watch(Protocol):
    """Who is told how it goes, and may wait, or end it by an exception of their own."""

    def place(self, note: str) -> None:
        """A place was sensed, or could not be; ``note`` is what a person should know, empty for nothing."""
        ...

    def moved(self, sensed: Sensed) -> None:
        """The hand moved."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Show:
    """A session that can begin.

    Attributes:
        session: what is known and asked.
        run: carries it out to its end.
        truth: what truly lies there, in the world; shown at the end.
        furniture: what is known to stand there.
        hand: the hand and where it is at first; None for a bare probe.
    """

    session: Session
    run: Callable[[Watch], Done]
    truth: tuple[Solid, ...]
    furniture: tuple[Solid, ...] = ()
    hand: tuple[Hand, Sensed] | None = None


def bare_show(
    session: Session,
    read: Callable[[Action], Readings],
    truth: tuple[Solid, ...],
    furniture: tuple[Solid, ...] = (),
) -> Show:
    """A probe that is simply where it is wanted.

    Args:
        session: what is known and asked.
        read: makes a reading.
        truth: what lies there.
        furniture: what is known to stand there, to be drawn.
    """

    def run(watch: Watch) -> Done:
        while isinstance(action := session.ask(), Action):
            step = session.tell(read(action), action)
            watch.place(step.note)
        return action

    return Show(session, run, truth, furniture)


def hand_show(
    session: Session,
    robot: Robot,
    rules: Rules,
    truth: tuple[Solid, ...],
    furniture: tuple[Solid, ...] = (),
    known: Furniture | None = None,
    errors: RobotPreset | None = None,
) -> Show:
    """A hand that goes there without touching anything: :func:`tanteo.execution.sense_part`.

    Args:
        session: what is known and asked.
        robot: the hand.
        rules: what its motions keep to.
        truth: what lies there.
        furniture: what is known to stand there, to be drawn.
        known: the same, for the readings.
        errors: of the robot's poses.
    """

    def run(watch: Watch) -> Done:
        seen = _Seen(robot, watch.moved)
        done = sense_part(
            session, seen, rules, furniture=known, errors=errors, watch=lambda visit: watch.place(visit.note)
        )
        return done.end

    return Show(session, run, truth, furniture, (robot.hand, robot.sensed))


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """A robot that somebody looks at."""

    robot: Robot
    see: Callable[[Sensed], None]

    @property
    def hand(self) -> Hand:
        return self.robot.hand

    @property
    def period(self) -> float:
        return self.robot.period

    @property
    def latency(self) -> float:
        return self.robot.latency

    @property
    def sensed(self) -> Sensed:
        return self.robot.sensed

    def step(self, twist: Tangents) -> Sensed:
        sensed = self.robot.step(twist)
        self.see(sensed)
        return sensed
