"""What the page can show: a session, and how it is carried out, by a probe or a hand, seen or unseen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from tanteo.geometry.typing import Tangents
from tanteo.hand import Hand, HandReading, Robot, Rules, Solid, Workspace
from tanteo.parts import Surface
from tanteo.planning import Action, Done, Furniture, Probe, Sensing, Session, sense_part
from tanteo.sensors import NoiseLaw, Readings, RobotPreset


class Watch(Protocol):
    """Who is told how it goes, and may wait, or end it by an exception of their own."""

    def place(self, note: str) -> None:
        """A place was sensed, or could not be; ``note`` is what a person should know, empty for nothing."""
        ...

    def moved(self, sensed: HandReading) -> None:
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
        hand: the hand and where it is at first; None for a probe without a hand.
    """

    session: Session
    run: Callable[[Watch], Done]
    truth: tuple[Solid, ...]
    furniture: tuple[Solid, ...] = ()
    hand: tuple[Hand, HandReading] | None = None


def probe_show(
    session: Session, read: Callable[[Action], Readings], truth: tuple[Solid, ...], furniture: tuple[Solid, ...] = ()
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
    """A hand that goes there without touching anything: :func:`tanteo.planning.sense_part`.

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
        seen = cast("Robot", _Seen(robot, watch.moved))
        done = sense_part(
            session, seen, rules, furniture=known, errors=errors, watch=lambda visit: watch.place(visit.note)
        )
        return done.end

    return Show(session, run, truth, furniture, (robot.hand, robot.sensed))


class _Seen:
    """A robot that somebody looks at."""

    def __init__(self, robot: Robot, see: Callable[[HandReading], None]) -> None:
        self._robot, self._see = robot, see

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def step(self, twist: Tangents) -> HandReading:
        sensed = self._robot.step(twist)
        self._see(sensed)
        return sensed


NOISE = 3e-4
"""Of a reading [m]."""

_STANDOFF, _REACH, _CONE = 0.10, 0.30, float(np.radians(80.0))
_SHORT = 5e-3
"""A beam that ends on furniture was free up to so much before it [m]."""


def laser(workspace: Workspace) -> tuple[Probe, Sensing]:
    """A thin beam of 0.3 mm from 100 mm, from above, and how its readings become measurements."""
    probe = Probe(
        "laser", NoiseLaw.of(NOISE), max_range=_REACH, standoff=_STANDOFF, clearance=0.01,
        approach=np.array([0.0, 0.0, -1.0]), cone=_CONE, workspace=workspace,
    )  # fmt: skip
    return probe, Sensing(sd=NOISE)


def simulated(truth: Surface, furniture: Surface | None, seed: int) -> Callable[[Action], Readings]:
    """What the laser reads: of the part, or nothing as far as what is known to stand there.

    The k-th reading has the k-th draw of the noise, whoever chose it.

    Args:
        truth: what lies there, in the world.
        furniture: what is known to stand there.
        seed: of the noise.
    """
    rng = np.random.default_rng((1991, seed))

    def read(action: Action) -> Readings:
        noise = NOISE * rng.normal()
        start, along = action.origin[None], action.direction[None]
        met = float(truth.cast(start, along).distances[0])
        ends = np.inf if furniture is None else float(furniture.cast(start, along).distances[0])
        if met <= min(ends, action.max_range):
            return action.read(max(met + noise, 1e-6))
        free = max(min(ends - _SHORT, action.max_range), 1e-3)
        return Readings.from_columns(
            start, ids=[f"a{action.number}"], directions=along, is_free=np.array([True]), max_ranges=np.array([free])
        )

    return read
