"""The hand as a collision body: spheres, in the hand's frame."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.sensors import Rig
from tanteo.typing import BoolArray, FloatArray, Transforms, Vectors

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


def gripper_body(
    rig: Rig,
    *,
    finger_radius: float = 0.008,
    finger_length: float = 0.060,
    palm_radius: float = 0.030,
    palm_length: float = 0.100,
) -> Body:
    """A gripper: one round finger behind every frontal sensor, whose front the sensor is, and a round palm behind.

    Args:
        rig: Where the sensors sit; the palm's axis runs midway between the frontal ones, along the hand's z.
        finger_radius: Of the fingers [m].
        finger_length: From the fingers' front to the palm [m].
        palm_radius: Of the palm [m].
        palm_length: Of the palm along its axis [m], rounded ends included.

    Raises:
        InputError: The rig has no frontal sensor.
    """
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
