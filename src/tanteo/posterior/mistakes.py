"""Usual mistakes in readings files, and how each is undone: conventions of poses, signs, units, a mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Rotations, Transforms
from tanteo.parts import METRES
from tanteo.sensors import Readings
from tanteo.words.findings import (  # fmt: skip
    Convention,
    DirectionsConvention,
    HandConvention,
    MirrorConvention,
    NormalsConvention,
    UnitsConvention,
)

_MIRROR = np.array([1.0, 1.0, -1.0])
"""One mirror stands for all: whichever axes are exchanged or reversed, the rest is a turn, which is searched."""


@dataclass(frozen=True, slots=True)
class Way:
    """Another way to read the numbers.

    Attributes:
        finding: type of the finding.
        mistake: name of the other convention.
        undo: the readings as they would have been meant; None where it says nothing of them.
    """

    finding: type[Convention]
    mistake: str
    undo: Callable[[Readings], Readings | None]


def _turned(change: Callable[[Rotations], Rotations]) -> Callable[[Readings], Readings | None]:
    """Readings whose hands have another attitude."""

    def undo(readings: Readings) -> Readings | None:
        def turned(Ts: Transforms) -> Transforms:
            out = np.array(Ts)
            out[:, :3, :3] = change(Ts[:, :3, :3])
            return out

        return _with_hands(readings, turned)

    return undo


def _with_hands(readings: Readings, change: Callable[[Transforms], Transforms]) -> Readings | None:
    """Readings with other poses of the hand; None where no range depends on them."""
    known = np.isfinite(readings.Ts_world_hand).all(axis=(1, 2)) & np.isfinite(readings.ranges)
    if not known.any():
        return None
    Ts = np.array(readings.Ts_world_hand)
    Ts[known] = change(Ts[known])
    return replace(readings, Ts_world_hand=Ts)


def _reversed(name: str) -> Callable[[Readings], Readings | None]:
    """Readings with the opposite of a direction; None where none has one."""

    def undo(readings: Readings) -> Readings | None:
        values = getattr(readings, name)
        return replace(readings, **{name: -values}) if np.isfinite(values).any() else None

    return undo


def _mirrored(readings: Readings) -> Readings | None:
    if np.isfinite(readings.Ts_world_hand).any():
        return None
    return replace(
        readings, **{name: getattr(readings, name) * _MIRROR for name in ("points", "directions", "normals")}
    )


def _longer(unit: str, read: str) -> Callable[[Readings], Readings | None]:
    """Return a function that takes all lengths for those of another unit than the one that was read."""
    factor = METRES[unit] / METRES[read]

    def undo(readings: Readings) -> Readings | None:
        Ts = np.array(readings.Ts_world_hand)
        Ts[:, :3, 3] *= factor
        names = "points", "ranges", "max_ranges", "radii"
        return replace(readings, Ts_world_hand=Ts, **{name: factor * getattr(readings, name) for name in names})

    return undo


def _order(places: int) -> Callable[[Rotations], Rotations]:
    """Return a function that moves all numbers of quaternions on by some places, the last to the front."""
    return lambda R: SO3.from_quaternion(np.roll(SO3.as_quaternion(R), places, axis=-1))


def _of_vector(R: Rotations) -> Rotations:
    """Rotations by vectors whose numbers were read as roll, pitch and yaw; of both solutions the one below a turn."""
    pitch = np.arcsin(np.clip(-R[:, 2, 0], -1, 1))
    roll, yaw = np.arctan2(R[:, 2, 1], R[:, 2, 2]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    one = np.stack([roll, pitch, yaw], axis=-1)
    half = np.pi * np.array([1.0, 1.0, 1.0])
    other = np.stack([roll, -pitch, yaw], axis=-1) + half
    other = (other + np.pi) % (2 * np.pi) - np.pi
    long = np.linalg.norm(one, axis=1) > np.pi
    return SO3.exp(np.where((long & (np.linalg.norm(other, axis=1) <= np.pi))[:, None], other, one))


def _of_angles(R: Rotations) -> Rotations:
    """Rotations by roll, pitch and yaw whose numbers were read as a rotation vector."""
    roll, pitch, yaw = np.moveaxis(SO3.log(R), -1, 0)
    return SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)


def _of_degrees(R: Rotations) -> Rotations:
    """Rotations by vectors in radians that were read as degrees."""
    return SO3.exp(np.degrees(SO3.log(R)))


HANDS = (
    Way(HandConvention, "quaternion_xyzw", _turned(_order(1))),
    Way(HandConvention, "quaternion_wxyz", _turned(_order(-1))),
    Way(HandConvention, "pose_inverted",
        lambda readings: _with_hands(readings, SE3.inverse)),
    Way(HandConvention, "rotation_transposed", _turned(lambda R: np.swapaxes(R, -1, -2))),
    Way(HandConvention, "rotation_vector",
        _turned(_of_vector)),
    Way(HandConvention, "roll_pitch_yaw",
        _turned(_of_angles)),
    Way(HandConvention, "radians", _turned(_of_degrees)),
)  # fmt: skip
"""Usual mistakes in poses of the hand: most of them throw the readings farther apart than a part is."""

OTHERS = (
    Way(DirectionsConvention, "directions_reversed", _reversed("directions")),
    Way(NormalsConvention, "normals_reversed", _reversed("normals")),
    Way(UnitsConvention, "inches_not_millimetres", _longer("in", "mm")),
    Way(UnitsConvention, "millimetres_not_inches", _longer("mm", "in")),
    Way(UnitsConvention, "millimetres_not_metres", _longer("mm", "m")),
    Way(UnitsConvention, "metres_not_millimetres", _longer("m", "mm")),
    Way(MirrorConvention, "mirrored", _mirrored),
)  # fmt: skip
"""Other usual mistakes."""
