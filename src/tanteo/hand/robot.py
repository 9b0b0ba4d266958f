"""Hand with range sensors on a body of spheres, and the interface of the robot that carries it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import frozen_array
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Tangents, Transforms, Vectors
from tanteo.sensors import Rig

FRONTAL_COSINE = 0.9
"""Smallest cosine between a beam and the hand's +z for a frontal sensor (26 degrees)."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Spheres that enclose the hand, for collision checks.

    Attributes:
        centres: centres of the spheres ``(k, 3)``, hand frame [m].
        radii: radii of the spheres ``(k,)`` [m].
        blind: whether no beam covers the space around a sphere ``(k,)``; all False by default. Only the stated
            workspace protects a blind sphere from obstacles.

    Raises:
        InputError: The shapes differ, a radius is not positive, or every sphere is blind.
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
            raise InputError("body: expected one flag per sphere, and one sphere that is not blind. Correct blind.")
        blind.setflags(write=False)
        object.__setattr__(self, "blind", blind)
        object.__setattr__(self, "centres", centres)
        object.__setattr__(self, "radii", radii)

    def placed(self, T_world_hand: Transforms) -> Vectors:
        """Return the centres in the world frame.

        Args:
            T_world_hand: poses of the hand ``(*batch, 4, 4)``.

        Returns:
            Centres of the spheres ``(*batch, k, 3)`` [m].
        """
        R = T_world_hand[..., None, :3, :3]
        return np.asarray((R @ self.centres[..., None])[..., 0] + T_world_hand[..., None, :3, 3])


_FINGER, _PALM = (0.008, 0.060), (0.030, 0.100)
"""Radius and length of a finger and of the palm, including the rounded ends [m]."""


def gripper_body(rig: Rig) -> Body:
    """Return the body of a gripper: one round finger behind every frontal sensor, and a round palm behind the fingers.

    A frontal sensor sits at the tip of its finger. The palm's axis is parallel to the hand's z, midway between the
    frontal sensors.

    Args:
        rig: range sensors of the hand.

    Raises:
        InputError: The rig has no frontal sensor.
    """
    (finger_radius, finger_length), (palm_radius, palm_length) = _FINGER, _PALM
    fronts = np.array([s.T_hand_sensor[:3, 3] for s in rig.sensors if s.T_hand_sensor[2, 2] > FRONTAL_COSINE])
    if not len(fronts):
        raise InputError(f"{rig.source}: expected a sensor along the hand's +z, got none. Add one.")
    depths = np.linspace(finger_radius, finger_length, 1 + int(np.ceil(finger_length / finger_radius)))
    fingers = fronts[:, None] - depths[:, None] * np.array([0.0, 0.0, 1.0])
    back = fronts[:, 2].min() - finger_length
    depth = np.linspace(palm_radius, max(palm_length - palm_radius, palm_radius), 3)
    palm = np.array([*fronts.mean(axis=0)[:2], back]) - depth[:, None] * np.array([0.0, 0.0, 1.0])
    fingers = fingers.reshape(-1, 3)
    radii = np.concatenate([np.full(len(fingers), finger_radius), np.full(len(palm), palm_radius)])
    blind = np.repeat([False, True], [len(fingers), len(palm)])
    return Body(np.concatenate([fingers, palm]), radii, blind)


HIT, FREE, NEAR, LOST = 0, 1, 2, 3
"""States of a reading: range measured; nothing within range; too near for a range; echo without a valid range."""


@dataclass(frozen=True, slots=True, eq=False)
class HandReading:
    """State and readings that a robot reports at one instant.

    Attributes:
        time: time since the start [s].
        T_world_hand: reported pose of the hand ``(4, 4)``.
        ranges: ranges of the rig's sensors, in the rig's order ``(k,)`` [m]; NaN without a range.
        states: state of every reading ``(k,)``: :data:`HIT`, :data:`FREE`, :data:`NEAR` or :data:`LOST`.
    """

    time: float
    T_world_hand: Transforms
    ranges: FloatArray
    states: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Hand:
    """Range sensors on a body; the hand frame's +z is the viewing direction of its two frontal sensors.

    Attributes:
        rig: range sensors.
        body: spheres that must not touch anything.
        frontal: indices of the two frontal sensors, which control distance and tilt.
        origins: origins of all beams ``(k, 3)``, hand frame [m].
        axes: unit directions of all beams ``(k, 3)``, hand frame.
        pair: unit vector from the first to the second frontal sensor, perpendicular to z ``(3,)``.
        baseline: distance of the frontal sensors along ``pair`` [m].
        front: midpoint of the frontal sensors ``(3,)``, hand frame [m].
        overhangs: distance by which the body extends beyond each sensor along its beam ``(k,)``, at least zero [m].

    Raises:
        InputError: There are not exactly two frontal sensors, or they have no distance from each other.
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
                f"{self.rig.source}: expected two sensors along the hand's +z, got {len(looking)}. The motions "
                "steer by exactly two."
            )
        gap = T[looking[1], :3, 3] - T[looking[0], :3, 3]
        gap[2] = 0.0
        baseline = float(np.linalg.norm(gap))
        if baseline < 1e-3:
            raise InputError(
                f"{self.rig.source}: expected frontal sensors apart, got {baseline:g} m across z. Mount them apart."
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
    """Interface of a robot that carries a hand, takes one velocity command per period and returns a reading.

    A driver sends the command, waits for the next cycle of its controller, and returns what it reads then.
    """

    @property
    def hand(self) -> Hand:
        """Return the hand that the robot carries."""
        ...

    @property
    def period(self) -> float:
        """Return the time between two commands [s]."""
        ...

    @property
    def latency(self) -> float:
        """Return an upper bound on the time from a command to its motion [s]; motions choose their gains by it."""
        ...

    @property
    def sensed(self) -> HandReading:
        """Return the most recent reading."""
        ...

    def step(self, twist: Tangents) -> HandReading:
        """Command a twist for one period and return the reading at its end.

        Args:
            twist: velocity ``[v, w]`` of the hand in its own frame [m/s, rad/s].
        """
        ...
