"""What a motion needs of a robot, whether it is simulated or real."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.hand.body import FRONTAL_COSINE, Body
from tanteo.sensors import Rig
from tanteo.typing import FloatArray, IntArray, Tangents, Transforms, Vectors

MET, FREE, NEAR, LOST = 0, 1, 2, 3
"""States of a reading: a range; nothing within range; too near for a range; something there, but no range."""


@dataclass(frozen=True, slots=True, eq=False)
class Sensed:
    """What a robot knows at one instant.

    Attributes:
        time: Since the start [s].
        T_world_hand: Where the robot says its hand is ``(4, 4)``.
        ranges: Of the rig's sensors in their order ``(k,)`` [m]; NaN where there is none.
        states: :data:`MET`, :data:`FREE`, :data:`NEAR` or :data:`LOST`, ``(k,)``.
    """

    time: float
    T_world_hand: Transforms
    ranges: FloatArray
    states: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """Range sensors on a body. The hand's frame has +z where its frontal sensors look.

    Attributes:
        rig: The sensors.
        body: What may touch nothing.
        frontal: Numbers of the two frontal sensors that control distance and tilt.
        origins: Of all beams in the hand's frame ``(k, 3)`` [m].
        axes: Of all beams ``(k, 3)``, unit.
        pair: Unit vector from the first frontal sensor to the second, across z ``(3,)``.
        baseline: Their distance along ``pair`` [m].
        front: Midpoint of the frontal sensors ``(3,)`` [m].
        overhangs: How far the body stands out beyond each sensor along its beam ``(k,)``, zero or more [m].

    Raises:
        InputError: Not two frontal sensors, or no distance between them.
    """

    rig: Rig
    body: Body
    frontal: tuple[int, int] = field(init=False)
    origins: Vectors = field(init=False)
    axes: Vectors = field(init=False)
    pair: FloatArray = field(init=False)
    baseline: float = field(init=False)
    front: FloatArray = field(init=False)
    overhangs: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        T = np.stack([s.T_hand_sensor for s in self.rig.sensors])
        looking = np.flatnonzero(T[:, 2, 2] > FRONTAL_COSINE)
        if len(looking) != 2:
            raise InputError(
                f"{self.rig.source}: expected two sensors that look along the hand's +z, got {len(looking)}. The "
                "motions steer by two."
            )
        gap = T[looking[1], :3, 3] - T[looking[0], :3, 3]
        gap[2] = 0.0
        baseline = float(np.linalg.norm(gap))
        if baseline < 1e-3:
            raise InputError(
                f"{self.rig.source}: expected frontal sensors apart, got {baseline:g} m across z. Tilt needs a base."
            )
        axes = T[:, :3, 2]
        reach = (axes @ self.body.centres.T + self.body.radii).max(axis=1)
        values = {
            "overhangs": frozen_array(np.maximum(reach - np.sum(axes * T[:, :3, 3], axis=1), 0.0)),
            "frontal": (int(looking[0]), int(looking[1])),
            "origins": frozen_array(T[:, :3, 3]),
            "axes": frozen_array(T[:, :3, 2]),
            "pair": frozen_array(gap / baseline),
            "baseline": baseline,
            "front": frozen_array(T[looking, :3, 3].mean(axis=0)),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)


class Robot(Protocol):
    """A hand that takes one velocity command a period and says what it sensed at the end of it.

    A driver sends the command, waits for the next cycle of its controller, and returns what it reads then.
    """

    @property
    def hand(self) -> Hand:
        """The hand that it carries."""
        ...

    @property
    def period(self) -> float:
        """Between two commands [s]."""
        ...

    @property
    def latency(self) -> float:
        """From a command to the motion that it causes, or more [s]; the motions choose their gains by it."""
        ...

    @property
    def sensed(self) -> Sensed:
        """What was sensed last."""
        ...

    def step(self, twist: Tangents) -> Sensed:
        """Command a velocity ``[v, w]`` of the hand in its own frame [m/s, rad/s] for one period, and sense."""
        ...
