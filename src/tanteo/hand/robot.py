"""The hand as sensors on a body of spheres, and what a motion needs of a robot that carries it, simulated or real."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.sensors import Rig
from tanteo.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms, Vectors

FRONTAL_COSINE = 0.9
"""A sensor whose beam is within 26 degrees of the hand's +z is a frontal one."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Spheres that cover the hand.

    Attributes:
        centres: ``(k, 3)`` in the hand's frame [m].
        radii: ``(k,)`` [m].
        blind: Spheres that no beam of the hand goes before or beside ``(k,)``; none if left out. Only the workspace
            keeps them from what no beam has met.

    Raises:
        InputError: Shapes that do not fit, or a radius that is not positive.
    """

    centres: Vectors
    radii: FloatArray
    blind: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        centres, radii = frozen_array(self.centres), frozen_array(self.radii)
        if centres.ndim != 2 or centres.shape[1:] != (3,) or radii.shape != centres.shape[:1] or not len(radii):
            raise InputError(
                f"body: expected centres (k, 3) and radii (k,), got {centres.shape} and {radii.shape}. Pass one row "
                "a sphere."
            )
        if not (np.isfinite(centres).all() and (radii > 0).all() and np.isfinite(radii).all()):
            raise InputError("body: expected finite centres and positive radii [m], got others. Correct them.")
        blind = np.zeros(len(radii), dtype=bool) if not len(self.blind) else np.array(self.blind, dtype=bool)
        if blind.shape != radii.shape or blind.all():
            raise InputError("body: expected one truth a sphere, and one sphere that is not blind. Correct blind.")
        blind.setflags(write=False)
        object.__setattr__(self, "blind", blind)
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "radii", radii)

    def placed(self, T_world_hand: Transforms) -> Vectors:
        """Centres in the world ``(*batch, k, 3)`` with the hand at ``(*batch, 4, 4)``."""
        R = T_world_hand[..., None, :3, :3]
        return np.asarray((R @ self.centres[..., None])[..., 0] + T_world_hand[..., None, :3, 3])


_FINGER, _PALM = (0.008, 0.060), (0.030, 0.100)
"""Radius and length of a finger, from its front to the palm, and of the palm, rounded ends included [m]."""


def gripper_body(rig: Rig) -> Body:
    """A gripper: one round finger behind every frontal sensor, whose front the sensor is, and a round palm behind.

    The palm's axis runs midway between the frontal sensors, along the hand's z.

    Raises:
        InputError: The rig has no frontal sensor.
    """
    (finger_radius, finger_length), (palm_radius, palm_length) = _FINGER, _PALM
    fronts = np.array([s.T_hand_sensor[:3, 3] for s in rig.sensors if s.T_hand_sensor[2, 2] > FRONTAL_COSINE])
    if not len(fronts):
        raise InputError(f"{rig.source}: expected a sensor that looks along the hand's +z, got none. Add one.")
    behind = np.linspace(finger_radius, finger_length, 1 + int(np.ceil(finger_length / finger_radius)))
    fingers = fronts[:, None] - behind[:, None] * np.array([0.0, 0.0, 1.0])
    back = fronts[:, 2].min() - finger_length
    depth = np.linspace(palm_radius, max(palm_length - palm_radius, palm_radius), 3)
    palm = np.array([*fronts.mean(axis=0)[:2], back]) - depth[:, None] * np.array([0.0, 0.0, 1.0])
    fingers = fingers.reshape(-1, 3)
    radii = np.concatenate([np.full(len(fingers), finger_radius), np.full(len(palm), palm_radius)])
    blind = np.repeat([False, True], [len(fingers), len(palm)])
    return Body(np.concatenate([fingers, palm]), radii, blind)


MET, FREE, NEAR, LOST = 0, 1, 2, 3
"""States of a reading: a range; nothing within range; too near for a range; something there, but no range."""


@dataclass(frozen=True, slots=True, eq=False)
class HandReading:
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
    def sensed(self) -> HandReading:
        """What was sensed last."""
        ...

    def step(self, twist: Tangents) -> HandReading:
        """Command a velocity ``[v, w]`` of the hand in its own frame [m/s, rad/s] for one period, and sense."""
        ...
