"""Usual mistakes in readings files, and how each is undone: conventions of poses, signs, units, a mirror."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Rotations, Transforms
from tanteo.parts import METRES
from tanteo.sensors import Column, Readings
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
"""One mirror stands for all: whichever axes are exchanged or reversed, the rest is a turn, which is searched."""


@dataclass(frozen=True, slots=True)
class Way:
    """Another way to read the numbers.

    Attributes:
        finding: type of the finding.
        words: what would have been meant, after "if".
        advice: what to do.
        undo: the readings as they would have been meant; None where it says nothing of them.
    """

    finding: type[Convention]
    words: str
    advice: str
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
    hands = readings.Ts_world_hand
    ranged = readings.ranges.given[hands.given]
    if not ranged.any():
        return None
    Ts = np.array(hands.values)
    Ts[ranged] = change(Ts[ranged])
    return replace(readings, Ts_world_hand=hands.map(lambda _: Ts))


def _reversed(name: str) -> Callable[[Readings], Readings | None]:
    """Readings with the opposite of a direction; None where none has one."""

    def undo(readings: Readings) -> Readings | None:
        column: Column = getattr(readings, name)
        changed: dict[str, Any] = {name: column.map(np.negative)}
        return replace(readings, **changed) if column.given.any() else None

    return undo


def _mirrored(readings: Readings) -> Readings | None:
    if readings.Ts_world_hand.given.any():
        return None
    names = "points", "directions", "normals"
    vectors: dict[str, Any] = {name: getattr(readings, name).map(lambda v: v * _MIRROR) for name in names}
    return replace(readings, **vectors)


def _longer(unit: str, read: str) -> Callable[[Readings], Readings | None]:
    """Return a function that takes all lengths for those of another unit than the one that was read."""
    factor = METRES[unit] / METRES[read]

    def undo(readings: Readings) -> Readings | None:
        Ts = np.array(readings.Ts_world_hand.values)
        Ts[:, :3, 3] *= factor
        names = "points", "ranges", "max_ranges"
        lengths: dict[str, Any] = {name: getattr(readings, name).map(lambda v: factor * v) for name in names}
        lengths |= {"Ts_world_hand": readings.Ts_world_hand.map(lambda _: Ts), "radii": factor * readings.radii}
        return replace(readings, **lengths)

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


_POSES = "Check the columns of the hand's pose."

HANDS = (
    Way(HandConvention, "the hand's quaternions are in the order x y z w", _POSES, _turned(_order(1))),
    Way(HandConvention, "the hand's quaternions are in the order w x y z", _POSES, _turned(_order(-1))),
    Way(HandConvention, "the hand's poses are inverted (they are meant to take hand to world)", _POSES,
        lambda readings: _with_hands(readings, SE3.inverse)),
    Way(HandConvention, "the hand's rotations are transposed", _POSES, _turned(lambda R: np.swapaxes(R, -1, -2))),
    Way(HandConvention, "the hand's angles are a rotation vector, not roll, pitch and yaw", _POSES,
        _turned(_of_vector)),
    Way(HandConvention, "the hand's angles are roll, pitch and yaw, not a rotation vector", _POSES,
        _turned(_of_angles)),
    Way(HandConvention, "the hand's angles are in radians, not degrees", _POSES, _turned(_of_degrees)),
)  # fmt: skip
"""Usual mistakes in poses of the hand: most of them throw the readings farther apart than a part is."""

OTHERS = (
    Way(DirectionsConvention, "the directions (dx, dy, dz) are reversed",
        "They are meant to point into the material, as the sensor looks or the tip moves.", _reversed("directions")),
    Way(NormalsConvention, "the normals (nx, ny, nz) are reversed",
        "The normals are meant to point out of the material.", _reversed("normals")),
    Way(UnitsConvention, "lengths are in inches, not millimetres", "Name their unit (x_in).", _longer("in", "mm")),
    Way(UnitsConvention, "lengths are in millimetres, not inches", "Name their unit (x_mm).", _longer("mm", "in")),
    Way(UnitsConvention, "lengths are in millimetres, not metres", "Name their unit (x_mm).", _longer("mm", "m")),
    Way(UnitsConvention, "lengths are in metres, not millimetres", "Name their unit (x_m).", _longer("m", "mm")),
    Way(MirrorConvention, "they are seen in a mirror", HANDED, _mirrored),
)  # fmt: skip
"""Other usual mistakes."""
