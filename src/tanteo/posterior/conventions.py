"""Usual mistakes of convention in readings files, and functions that undo them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import Rotations, Transforms
from tanteo.parts.readers import METRES
from tanteo.sensors import Column, Readings, Rig
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
        mistake: name of the other convention.
        undo: function that returns the readings in this convention; None if it does not apply to them.
    """

    finding: type[Convention]
    mistake: str
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
    hands = readings.Ts_world_hand
    ranged = readings.ranges.given[hands.given]
    if not ranged.any():
        return None
    Ts = np.array(hands.values)
    Ts[ranged] = change(Ts[ranged])
    return replace(readings, Ts_world_hand=hands.map(lambda _: Ts))


def _reversed(name: str) -> Callable[[Readings], Readings | None]:
    """Return a function that reverses a direction; it returns None where no reading has one."""

    def undo(readings: Readings) -> Readings | None:
        column: Column = getattr(readings, name)
        changed: dict[str, Any] = {name: column.map(np.negative)}
        return replace(readings, **changed) if column.given.any() else None

    return undo


def _without_directions(readings: Readings) -> Readings | None:
    """Return the contacts without directions; None if none has one, or a range depends on them.

    A free-space ray keeps its direction: without it, it states nothing.
    """
    given = readings.directions.given & ~readings.is_free
    if not given.any() or not readings.points.given[given].all():
        return None
    return replace(readings, directions=readings.directions.only(readings.is_free))


def _mirrored(readings: Readings) -> Readings | None:
    if readings.Ts_world_hand.given.any():
        return None
    names = "points", "directions", "normals"
    vectors: dict[str, Any] = {name: getattr(readings, name).map(lambda v: v * _MIRROR) for name in names}
    return replace(readings, **vectors)


def _longer(unit: str, read: str, *, ball: bool = True) -> Callable[[Readings], Readings | None]:
    """Return a function that interprets all lengths in another unit than the one that was read.

    Without the radius of the ball it returns None where the tip is sharp, as the other function has the same result.
    """
    factor = METRES[unit] / METRES[read]

    def undo(readings: Readings) -> Readings | None:
        if not (ball or readings.radii.any()):
            return None
        Ts = np.array(readings.Ts_world_hand.values)
        Ts[:, :3, 3] *= factor
        names = "points", "ranges", "max_ranges", "hole_radii"
        lengths: dict[str, Any] = {name: getattr(readings, name).map(lambda v: factor * v) for name in names}
        lengths |= {"Ts_world_hand": readings.Ts_world_hand.map(lambda _: Ts)}
        lengths |= {"radii": factor * readings.radii} if ball else {}
        return replace(readings, **lengths)

    return undo


def _order(places: int) -> Callable[[Rotations], Rotations]:
    """Return a function that shifts the order of the components of quaternions cyclically."""
    return lambda R: SO3.from_quaternion(np.roll(SO3.as_quaternion(R), places, axis=-1))


def _of_vector(R: Rotations) -> Rotations:
    """Return rotations whose rotation vectors were read as roll, pitch, yaw; of two solutions the shorter vector."""
    pitch = np.arcsin(np.clip(-R[:, 2, 0], -1, 1))
    roll, yaw = np.arctan2(R[:, 2, 1], R[:, 2, 2]), np.arctan2(R[:, 1, 0], R[:, 0, 0])
    one = np.stack([roll, pitch, yaw], axis=-1)
    half = np.pi * np.array([1.0, 1.0, 1.0])
    other = np.stack([roll, -pitch, yaw], axis=-1) + half
    other = (other + np.pi) % (2 * np.pi) - np.pi
    long = np.linalg.norm(one, axis=1) > np.pi
    return SO3.exp(np.where((long & (np.linalg.norm(other, axis=1) <= np.pi))[:, None], other, one))


def _of_angles(R: Rotations) -> Rotations:
    """Return rotations whose roll, pitch and yaw were read as a rotation vector."""
    roll, pitch, yaw = np.moveaxis(SO3.log(R), -1, 0)
    return SO3.axis_rotation(2, yaw) @ SO3.axis_rotation(1, pitch) @ SO3.axis_rotation(0, roll)


HANDS = (
    Mistake(HandConvention, "quaternion_xyzw", _turned(_order(1))),
    Mistake(HandConvention, "quaternion_wxyz", _turned(_order(-1))),
    Mistake(HandConvention, "pose_inverted",
        lambda readings: _with_hands(readings, SE3.inverse)),
    Mistake(HandConvention, "rotation_transposed", _turned(lambda R: np.swapaxes(R, -1, -2))),
    Mistake(HandConvention, "rotation_vector",
        _turned(_of_vector)),
    Mistake(HandConvention, "roll_pitch_yaw",
        _turned(_of_angles)),
    Mistake(HandConvention, "radians", _turned(lambda R: SO3.exp(np.degrees(SO3.log(R))))),
)  # fmt: skip
"""Usual mistakes in poses of the hand. Most of them spread the readings wider than a part."""

_FORWARD = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of an optical frame (z forward) in a frame of a body (x forward), as REP 103 defines them."""


def of_rig(rig: Rig | None) -> tuple[Mistake, ...]:
    """Return usual mistakes in the poses of the sensors on the hand; none without a rig.

    The hand is moved so that each sensor is where it would be by the other convention: ``T_hand' = T_hand M T_s^-1``
    with the other pose ``M`` of a sensor or multi-zone device whose pose in the rig is ``T_s``.

    Args:
        rig: sensors on the hand.
    """
    if rig is None:
        return ()

    def forward(T: Transforms) -> Transforms:
        return T @ SE3.from_parts(_FORWARD, np.zeros(3))

    def ordered(T: Transforms) -> Transforms:
        return SE3.from_parts(_order(1)(T[:3, :3]), T[:3, 3])

    others: dict[str, Callable[[Transforms], Transforms]] = {
        "beam_along_x": forward,
        "mount_inverted": SE3.inverse,
        "mount_inverted_along_x": lambda T: forward(SE3.inverse(T)),
        "mount_quaternion_xyzw": ordered,
    }
    devices = {sensor.name: sensor.T_hand_unit for sensor in rig.sensors}
    return tuple(
        Mistake(HandConvention, name, _remounted({k: other(T) @ SE3.inverse(T) for k, T in devices.items()}))
        for name, other in others.items()
    )


def _remounted(motions: dict[str, Transforms]) -> Callable[[Readings], Readings | None]:
    """Return a function that moves the hand of each reading by the motion of its sensor."""

    def undo(readings: Readings) -> Readings | None:
        hands = readings.Ts_world_hand
        names = [name for name, given in zip(readings.sensors, hands.given.tolist(), strict=True) if given]
        if not any(name in motions for name in names):
            return None
        steps = np.stack([motions.get(name, np.eye(4)) for name in names])
        return replace(readings, Ts_world_hand=hands.map(lambda Ts: Ts @ steps))

    return undo


_UNITS = {
    "inches_not_millimetres": ("in", "mm"),
    "millimetres_not_inches": ("mm", "in"),
    "millimetres_not_metres": ("mm", "m"),
    "metres_not_millimetres": ("m", "mm"),
}
"""Unit that was meant and unit that was read, by the name of the mistake."""

OTHERS = (
    Mistake(DirectionsConvention, "directions_reversed", _reversed("directions")),
    Mistake(NormalsConvention, "normals_reversed", _reversed("normals")),
    *(
        Mistake(UnitsConvention, mistake, _longer(*units, ball=ball))
        for ball in (False, True)  # a radius that an option or its own column states has its own unit
        for mistake, units in _UNITS.items()
    ),
    Mistake(MirrorConvention, "mirrored", _mirrored),
    Mistake(DirectionsConvention, "directions_wrong", _without_directions),
)  # fmt: skip
"""Other usual mistakes."""
