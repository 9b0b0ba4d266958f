"""Safety filter between a motion and its robot, and the endings of motions.

:class:`Steering` scales every command down so that the clearance is kept.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry.typing import FloatArray, Tangents
from tanteo.hand.motion.control import Loop
from tanteo.hand.robot import HIT, LOST, NEAR, HandReading, Robot
from tanteo.hand.twists import point_velocities, pose_difference
from tanteo.hand.workspace import Workspace
from tanteo.words.findings import AtLimit, Finding, NearSurface, TimedOut

Ending: TypeAlias = Literal["reached", "lost", "nothing", "limit", "timeout"]
"""Status of an ended motion. ``reached``: the goal is reached. ``lost``: the surface ended under a sensor or gave no
ranges any more. ``nothing``: there was nothing to sense within the reach. ``limit``: an obstacle or a bound of the
workspace blocked the motion. ``timeout``: the time limit passed."""


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Result of one motion; the hand is at rest afterwards.

    Attributes:
        name: name of the motion.
        status: ending of the motion.
        finding: reason for the ending.
        log: readings of every period, in order.
    """

    name: str
    status: Ending
    finding: Finding
    log: tuple[HandReading, ...]

    @property
    def message(self) -> str:
        """Return the reason for the ending as text."""
        return self.finding.message

    @property
    def reached(self) -> bool:
        """Return whether the motion reached its goal."""
        return self.status == "reached"

    @property
    def seconds(self) -> float:
        """Return the duration of the motion [s]."""
        return self.log[-1].time - self.log[0].time if self.log else 0.0


_STUCK = 0.1
"""Fraction of a command's velocity below which the command counts as refused."""

_REMEMBERED = 0.5
"""Time for which a range is remembered after the beam hits nothing [s]; objects at the rim of a cone echo only
sometimes."""


@dataclass(frozen=True, slots=True)
class Rules:
    """Limits that every motion keeps.

    Attributes:
        clearance: smallest distance of sensed surfaces from the body along a beam, and of the body from the bounds and
            forbidden boxes of the workspace [m].
        workspace: bounds and forbidden boxes.
        speed: largest speed of the hand's front [m/s].
        turn: largest angular speed of the hand [rad/s].
        patience: time for which commands may be refused before the motion ends [s].
        timeout: time limit of one motion [s].
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
    """State of one running motion: :meth:`step` sends limited commands, and :meth:`end` closes its log.

    Args:
        name: name of the motion.
        robot: robot that carries the hand.
        rules: limits of the motion.

    Attributes:
        loop: gain for distances and angles, chosen from the robot's latency.
        fraction: part of the last command's velocity that was sent, 0 to 1.
        refused: reason why commands were slowed down recently; None if none were.
        free_range: remembered free range along each beam ``(k,)`` [m]; infinite without a recent range.
    """

    def __init__(self, name: str, robot: Robot, rules: Rules) -> None:
        self.robot, self.rules, self.hand = robot, rules, robot.hand
        self.loop = Loop.of(robot.latency, robot.period)
        self.refused: Finding | None = None
        self.fraction = 1.0
        self.free_range, self._until = np.full(len(self.hand.origins), np.inf), np.zeros(len(self.hand.origins))
        self._name, self._log = name, [robot.sensed]
        self._stuck, self._deadline = 0.0, robot.sensed.time + rules.timeout
        self._limits = rules.workspace.limits

    @property
    def sensed(self) -> HandReading:
        """Return the most recent reading."""
        return self._log[-1]

    def step(self, twist: Tangents) -> Ending | None:
        """Send a velocity command, slowed down to keep the clearance.

        Args:
            twist: velocity ``[v, w]``, hand frame [m/s, rad/s].

        Returns:
            ``limit`` if commands have been refused for too long, ``timeout`` if the time is over, else None.
        """
        self._remember()
        self.fraction, why = self._slowed(twist)
        self._log.append(self.robot.step(twist * self.fraction))
        if self.fraction < _STUCK:
            self.refused, self._stuck = why, self._stuck + self.robot.period
        else:
            self._stuck = 0.0
        if self._stuck > self.rules.patience:
            return "limit"
        return "timeout" if self.sensed.time >= self._deadline else None

    def end(self, status: Ending, finding: Finding | None = None) -> Motion:
        """Stop, wait until the last command has taken effect, and close the log.

        Args:
            status: ending of the motion.
            finding: reason for it; None for what blocked the motion, or for the time limit.
        """
        for _ in range(self.loop.delay + 1):
            self._log.append(self.robot.step(np.zeros(6)))
        if finding is None:
            finding = self.refused if status == "limit" else TimedOut(self.rules.timeout)
            assert finding is not None
        return Motion(self._name, status, finding, tuple(self._log))

    def _remember(self) -> None:
        """Update :attr:`free_range` with the most recent reading."""
        sensed = self.sensed
        if len(self._log) > 1:  # a remembered surface comes nearer by the motion of the sensor along its beam
            moved = pose_difference(self._log[-2].T_world_hand, sensed.T_world_hand)
            way = point_velocities(self.hand.origins, np.concatenate(moved))
            self.free_range = np.maximum(self.free_range - np.sum(way * self.hand.axes, axis=1), 0.0)
        hit = (sensed.states == HIT) | (sensed.states == NEAR)
        self.free_range = np.where(hit, np.where(sensed.states == HIT, sensed.ranges, 0.0), self.free_range)
        self._until[hit] = sensed.time + _REMEMBERED
        self.free_range[sensed.time >= self._until] = np.inf

    def _slowed(self, twist: Tangents) -> tuple[float, Finding | None]:
        """Return the fraction of a command's velocity that keeps the clearance, and the reason for the limit."""
        fraction: float = 1.0
        why: Finding | None = None
        closing = np.einsum("ij,ij->i", point_velocities(self.hand.origins, twist), self.hand.axes)
        free = self.loop.gain * (self.free_range - self.hand.overhangs - self.rules.clearance)
        for i in np.flatnonzero((closing > 0) & (closing > free)):
            allowed = max(float(free[i] / closing[i]), 0.0)
            if allowed < fraction:
                fraction, why = allowed, NearSurface(self.hand.rig.sensors[i].name)
        return self._within(twist, fraction, why)

    def _within(self, twist: Tangents, share: float, why: Finding | None) -> tuple[float, Finding | None]:
        """Reduce the fraction of :meth:`_slowed` further where the body nears a bound or forbidden box."""
        if not self._limits:
            return share, why
        T, body = self.sensed.T_world_hand, self.hand.body
        margins, away = self.rules.workspace.clearances(body.placed(T))
        free = self.loop.gain * np.maximum(margins - body.radii[:, None] - self.rules.clearance, 0.0)
        closing = -np.einsum("kmi,ki->km", away, point_velocities(body.centres, twist) @ T[:3, :3].T)
        ratio = np.where(closing > free, free / np.where(closing > free, closing, 1.0), 1.0).min(axis=0)
        worst = int(np.argmin(ratio))
        return (float(ratio[worst]), AtLimit(self._limits[worst])) if ratio[worst] < share else (share, why)


def frontal(steering: Steering) -> tuple[FloatArray, FloatArray]:
    """Return the ranges of the two frontal sensors [m] and whether each has one.

    A reading that is too near counts as zero, and one without a valid range as infinite.
    """
    sensed, pair = steering.sensed, list(steering.hand.frontal)
    states = sensed.states[pair]
    ranges = np.where(states == HIT, sensed.ranges[pair], np.where(states == NEAR, 0.0, np.inf))
    return ranges, np.isfinite(ranges)


def blind(steering: Steering) -> bool:
    """Return whether neither frontal sensor has a range although at least one has an echo."""
    states = steering.sensed.states[list(steering.hand.frontal)]
    return bool((states != HIT).all() and (states == LOST).any())
