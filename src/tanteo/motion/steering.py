"""The guard between a motion and its robot, and how a motion ends.

Every command is slowed as far as what is near demands.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.hand import LOST, MET, NEAR, HandReading, Robot, Workspace, about, gap
from tanteo.motion.control import Loop
from tanteo.typing import FloatArray, Tangents

Ending: TypeAlias = Literal["reached", "lost", "nothing", "limit", "timeout"]
"""``reached``: it did what it was for. ``lost``: the surface ended under a sensor, or gave no ranges any more.
``nothing``: within its reach there was nothing to sense. ``limit``: something, or a bound of the workspace, was so near
that it could not go on. ``timeout``: it took too long."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """One motion that has ended; the hand is commanded to rest.

    Attributes:
        name: Of the motion.
        status: How it ended.
        message: The same in one sentence.
        log: What was sensed, one entry a period, in order.
    """

    name: str
    status: Ending
    message: str
    log: tuple[HandReading, ...]

    @property
    def reached(self) -> bool:
        """It did what it was for."""
        return self.status == "reached"

    @property
    def seconds(self) -> float:
        """How long it took."""
        return self.log[-1].time - self.log[0].time if self.log else 0.0


_STUCK = 0.1
"""A command that is slowed below this share counts as refused."""

_REMEMBERED = 0.5
"""What a beam met counts so long after it met nothing: of something beside the beam an echo comes now and then [s]."""


@dataclass(frozen=True, slots=True)
class Rules:
    """What every motion keeps to.

    Attributes:
        clearance: What a sensor sees comes no nearer to the body along its beam, and no sphere of the body nearer to
            the workspace's bounds and forbidden boxes [m].
        workspace: Where the hand may be.
        speed: Of the hand's front [m/s].
        turn: Of the hand [rad/s].
        patience: How long a command may be refused before the motion ends [s].
        timeout: Of one motion [s].
    """

    clearance: float
    workspace: Workspace = field(default_factory=Workspace.everywhere)
    speed: float = 0.06
    turn: float = 1.2
    patience: float = 0.3
    timeout: float = 30.0

    def __post_init__(self) -> None:
        for name in ("clearance", "speed", "turn", "patience", "timeout"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name}: expected a positive number, got {value:g}. Correct the rules.")


class Steering:
    """One motion under way: it commands through :meth:`step`, and :meth:`end` closes its log.

    Attributes:
        loop: Gain for distances and angles, chosen from the robot's latency.
        share: How much of the last command was let through, 0 to 1.
        refused: What slowed commands down lately, in words; empty if nothing did.
        room: Along each beam to what it met last, if that was lately; infinite without [m].
    """

    def __init__(self, name: str, robot: Robot, rules: Rules) -> None:
        self.robot, self.rules, self.hand = robot, rules, robot.hand
        self.loop = Loop.of(robot.latency, robot.period)
        self.share, self.refused = 1.0, ""
        self.room, self._until = np.full(len(self.hand.origins), np.inf), np.zeros(len(self.hand.origins))
        self._name, self._log = name, [robot.sensed]
        self._stuck, self._deadline = 0.0, robot.sensed.time + rules.timeout
        self._limits = rules.workspace.limits

    @property
    def sensed(self) -> HandReading:
        """What was sensed last."""
        return self._log[-1]

    def step(self, twist: Tangents) -> Ending | None:
        """Command a velocity, slowed where need be; says so when the motion has to end.

        Returns:
            ``limit`` when commands have been refused for too long, ``timeout`` when time is over, else None.
        """
        self._remember()
        self.share, why = self._slowed(twist)
        self._log.append(self.robot.step(twist * self.share))
        if self.share < _STUCK:
            self.refused, self._stuck = why, self._stuck + self.robot.period
        else:
            self._stuck = 0.0
        if self._stuck > self.rules.patience:
            return "limit"
        return "timeout" if self.sensed.time >= self._deadline else None

    def end(self, status: Ending, message: str = "") -> Motion:
        """Rest until the last command has had its effect, and close the log."""
        for _ in range(self.loop.delay + 1):
            self._log.append(self.robot.step(np.zeros(6)))
        if not message:
            message = {
                "limit": f"it could not go on: {self.refused}",
                "timeout": f"it took longer than {self.rules.timeout:g} s",
            }.get(status, status)
        return Motion(self._name, status, message, tuple(self._log))

    def _remember(self) -> None:
        """Bring :attr:`room` to what was sensed last."""
        sensed = self.sensed
        if len(self._log) > 1:  # what was met has come nearer by as much as the sensor went along its beam
            moved = gap(self._log[-2].T_world_hand, sensed.T_world_hand)
            way = about(self.hand.origins, np.concatenate(moved))
            self.room = np.maximum(self.room - np.sum(way * self.hand.axes, axis=1), 0.0)
        met = (sensed.states == MET) | (sensed.states == NEAR)
        self.room = np.where(met, np.where(sensed.states == MET, sensed.ranges, 0.0), self.room)
        self._until[met] = sensed.time + _REMEMBERED
        self.room[sensed.time >= self._until] = np.inf

    def _slowed(self, twist: Tangents) -> tuple[float, str]:
        """The share of a command that keeps the clearance, and what limits it."""
        share, why = 1.0, ""
        closing = np.einsum("ij,ij->i", about(self.hand.origins, twist), self.hand.axes)
        free = self.loop.gain * (self.room - self.hand.overhangs - self.rules.clearance)
        for i in np.flatnonzero((closing > 0) & (closing > free)):
            allowed = max(float(free[i] / closing[i]), 0.0)
            if allowed < share:
                share, why = allowed, f"'{self.hand.rig.sensors[i].name}' sees something near"
        return self._within(twist, share, why)

    def _within(self, twist: Tangents, share: float, why: str) -> tuple[float, str]:
        """The same for the bounds of the workspace and its forbidden boxes, with the whole body."""
        if not self._limits:
            return share, why
        T, body = self.sensed.T_world_hand, self.hand.body
        room, away = self.rules.workspace.rooms(body.placed(T))
        free = self.loop.gain * np.maximum(room - body.radii[:, None] - self.rules.clearance, 0.0)
        closing = -np.einsum("kmi,ki->km", away, about(body.centres, twist) @ T[:3, :3].T)
        ratio = np.where(closing > free, free / np.where(closing > free, closing, 1.0), 1.0).min(axis=0)
        worst = int(np.argmin(ratio))
        return (float(ratio[worst]), f"the hand is at {self._limits[worst]}") if ratio[worst] < share else (share, why)


def frontal(steering: Steering) -> tuple[FloatArray, FloatArray]:
    """Ranges of the two frontal sensors [m], infinite where nothing is met, and which of them met something.

    A reading that is too near counts as zero; one without a range where something is, as not met.
    """
    sensed, pair = steering.sensed, list(steering.hand.frontal)
    states = sensed.states[pair]
    ranges = np.where(states == MET, sensed.ranges[pair], np.where(states == NEAR, 0.0, np.inf))
    return ranges, np.isfinite(ranges)


def blind(steering: Steering) -> bool:
    """Neither frontal sensor gives a range, though something is there."""
    states = steering.sensed.states[list(steering.hand.frontal)]
    return bool((states != MET).all() and (states == LOST).any())
