"""Usual mistakes of convention in readings files, and functions that undo them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Rotations, Transforms
from tanteo.parts import METRES
from tanteo.sensors import Readings
from tanteo.words import HANDED
from tanteo.words.findings import (  # fmt: skip
    Convention,
    DirectionsConvention,
    HandConvention,
    MirrorConvention,
    NormalsConvention,
    UnitsConvention,
)

_MIRROR = np.array([1.0, 1.0, -1.0])
"""Representative of all mirrors: whichever axes are exchanged or reversed, the rest is a rotation."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """Usual mistake of convention in readings.

    Attributes:
        finding: type of the finding.
        words: what the author meant, after "if".
        advice: what the user should do.
        undo: function that returns the readings without the mistake; None where it does not apply.
    """

    finding: type[Convention]
    words: str
    advice: str
    undo: Callable[[Readings], Readings | None]


def _turned(change: Callable[[Rotations], Rotations]) -> Callable[[Readings], Readings | None]:
    """Return a function that changes the attitude of the hand."""

    def undo(readings: Readings) -> Readings | None:
        def turned(Ts: Transforms) -> Transforms:
            out = np.array(Ts)
            out[:, :3, :3] = change(Ts[:, :3, :3])
            return out

        return _with_hands(readings, turned)

    return undo


def _with_hands(readings: Readings, change: Callable[[Transforms], Transforms]) -> Readings | None:
    """Return readings with other poses of the hand; None if no range depends on them."""
    known = np.isfinite(readings.Ts_world_hand).all(axis=(1, 2)) & np.isfinite(readings.ranges)
    if not known.any():
        return None
    Ts = np.array(readings.Ts_world_hand)
    Ts[known] = change(Ts[known])
    return replace(readings, Ts_world_hand=Ts)


def _reversed(name: str) -> Callable[[Readings], Readings | None]:
    """Return a function that reverses a direction; it returns None where no reading has one."""

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
    """Return rotations by vectors that were read as roll, pitch, yaw; of two solutions the one below a full turn."""
    pitch = np.arcsin(np.clip(-R[:, 2, 0], -1, 1))
    roll, yaw = np.arctan2(R[:, 2, 1], R[:, 2, 2]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    one = np.stack([roll, pitch, yaw], axis=-1)
    half = np.pi * np.array([1.0, 1.0, 1.0])
    other = np.stack([roll, -pitch, yaw], axis=-1) + half
    other = (other + np.pi) % (2 * np.pi) - np.pi
    long = np.linalg.norm(one, axis=1) > np.pi
    return SO3.exp(np.where((long & (np.linalg.norm(other, axis=1) <= np.pi))[:, None], other, one))


def _of_angles(R: Rotations) -> Rotations:
    """Return rotations by roll, pitch and yaw that were read as a rotation vector."""
    roll, pitch, yaw = np.moveaxis(SO3.log(R), -1, 0)
    return SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)


_POSES = "Check the columns of the hand's pose."

HANDS = (
    Mistake(HandConvention, "the hand's quaternions are in the order x y z w", _POSES, _turned(_order(1))),
    Mistake(HandConvention, "the hand's quaternions are in the order w x y z", _POSES, _turned(_order(-1))),
    Mistake(HandConvention, "the hand's poses are inverted (they are meant to take hand to world)", _POSES,
        lambda readings: _with_hands(readings, SE3.inverse)),
    Mistake(HandConvention, "the hand's rotations are transposed", _POSES, _turned(lambda R: np.swapaxes(R, -1, -2))),
    Mistake(HandConvention, "the hand's angles are a rotation vector, not roll, pitch and yaw", _POSES,
        _turned(_of_vector)),
    Mistake(HandConvention, "the hand's angles are roll, pitch and yaw, not a rotation vector", _POSES,
        _turned(_of_angles)),
    Mistake(HandConvention, "the hand's angles are in radians, not degrees", _POSES,
        _turned(lambda R: SO3.exp(np.degrees(SO3.log(R))))),
)  # fmt: skip
"""Usual mistakes in poses of the hand. Most of them spread the readings wider than a part."""

OTHERS = (
    Mistake(DirectionsConvention, "the directions (dx, dy, dz) are reversed",
        "They are meant to point into the material, as the sensor looks or the tip moves.", _reversed("directions")),
    Mistake(NormalsConvention, "the normals (nx, ny, nz) are reversed",
        "The normals are meant to point out of the material.", _reversed("normals")),
    Mistake(UnitsConvention, "lengths are in inches, not millimetres", "Name their unit (x_in).", _longer("in", "mm")),
    Mistake(UnitsConvention, "lengths are in millimetres, not inches", "Name their unit (x_mm).", _longer("mm", "in")),
    Mistake(UnitsConvention, "lengths are in millimetres, not metres", "Name their unit (x_mm).", _longer("mm", "m")),
    Mistake(UnitsConvention, "lengths are in metres, not millimetres", "Name their unit (x_m).", _longer("m", "mm")),
    Mistake(MirrorConvention, "they are seen in a mirror", HANDED, _mirrored),
)  # fmt: skip
"""Other usual mistakes."""
