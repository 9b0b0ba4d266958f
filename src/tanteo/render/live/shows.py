"""Sessions for the live page, which an ideal probe or a hand carries out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, cast

import numpy as np

from tanteo.geometry.typing import Tangents
from tanteo.hand import Hand, HandReading, Robot, Workspace
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Solid
from tanteo.hand.simulator.arm import ArmMotion
from tanteo.parts import Surface
from tanteo.planning import Action, Done, Furniture, Probe, Sensing, Session, sense_part
from tanteo.sensors import Readings
from tanteo.sensors.presets import NoiseLaw, RobotPreset


class Watch(Protocol):
    """Observer of a run, which may delay the run, or end it by an exception."""

    def place(self, note: str) -> None:
        """Handle the end of an action.

        Args:
            note: remarks for the user.
        """
        ...

    def moved(self, sensed: HandReading) -> None:
        """Handle a motion of the hand.

        Args:
            sensed: readings and pose of the hand.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Show:
    """Session that is ready to run.

    Attributes:
        session: session to run.
        run: function that carries out the session.
        truth: real parts, world frame, which are shown at the end.
        furniture: known furniture.
        hand: hand and its first reading; None for a probe without a hand.
        arm: arm that carries the hand; None without one.
    """

    session: Session
    run: Callable[[Watch], Done]
    truth: tuple[Solid, ...]
    furniture: tuple[Solid, ...] = ()
    hand: tuple[Hand, HandReading] | None = None
    arm: ArmMotion | None = None


def probe_show(
    session: Session, read: Callable[[Action], Readings], truth: tuple[Solid, ...], furniture: tuple[Solid, ...] = ()
) -> Show:
    """Return a show with a probe that needs no motion.

    Args:
        session: the session.
        read: function that makes a reading.
        truth: real parts.
        furniture: known furniture to draw.
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
    arm: ArmMotion | None = None,
) -> Show:
    """Return a show with a hand, see :func:`tanteo.planning.sense_part`.

    Args:
        session: the session.
        robot: robot that carries the hand.
        rules: limits of its motions.
        truth: real parts.
        furniture: known furniture to draw.
        known: known furniture for the evaluation of readings.
        errors: error model of the robot's poses.
        arm: arm that carries the hand; None without one.
    """

    def run(watch: Watch) -> Done:
        seen = cast("Robot", _Observed(robot, watch.moved))
        done = sense_part(
            session,
            seen,
            rules,
            furniture=known,
            errors=errors,
            reach=arm,
            watch=lambda visit: watch.place(visit.note),
        )
        return done.end

    return Show(session, run, truth, furniture, (robot.hand, robot.sensed), arm)


class _Observed:
    """Robot that reports its motions to an observer."""

    def __init__(self, robot: Robot, see: Callable[[HandReading], None]) -> None:
        self._robot, self._see = robot, see

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def step(self, twist: Tangents) -> HandReading:
        sensed = self._robot.step(twist)
        self._see(sensed)
        return sensed


NOISE = 3e-4
"""Standard deviation of a reading [m]."""

_STANDOFF, _REACH, _CONE = 0.10, 0.30, float(np.radians(80.0))
_SHORT = 5e-3
"""Distance before furniture at which a free-space ray ends [m]."""


def laser(workspace: Workspace) -> tuple[Probe, Sensing]:
    """Return probe and noise model of a laser from above: standard deviation 0.3 mm, stand-off 100 mm.

    Args:
        workspace: bounds of the laser's positions.
    """
    probe = Probe(
        "laser", NoiseLaw.of(NOISE), max_range=_REACH, standoff=_STANDOFF, clearance=0.01,
        approach=np.array([0.0, 0.0, -1.0]), cone=_CONE, workspace=workspace,
    )  # fmt: skip
    return probe, Sensing(sd=NOISE)


def simulated(truth: Surface, furniture: Surface | None, seed: int) -> Callable[[Action], Readings]:
    """Return a function that simulates readings of the laser on the part, or free-space rays up to furniture.

    The k-th reading has the k-th sample of the noise, whether the user or the policy chose it.

    Args:
        truth: surface of the real parts, world frame.
        furniture: surface of known furniture; None without any.
        seed: seed of the noise.
    """
    rng = np.random.default_rng((1991, seed))

    def read(action: Action) -> Readings:
        noise = NOISE * rng.normal()
        start, along = action.origin[None], action.direction[None]
        distance = float(truth.cast(start, along).distances[0])
        ends = np.inf if furniture is None else float(furniture.cast(start, along).distances[0])
        if distance <= min(ends, action.max_range):
            return action.read(max(distance + noise, 1e-6))
        free = max(min(ends - _SHORT, action.max_range), 1e-3)
        return Readings.from_columns(
            start, ids=[f"a{action.number}"], directions=along, is_free=np.array([True]), max_ranges=np.array([free])
        )

    return read
