"""Convert poses between tanteo's matrices in metres and the conventions of robot brands and ROS."""

from __future__ import annotations

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3, check_transforms
from tanteo.geometry.typing import FloatArray, Rotations, Transforms
from tanteo.io.readings.brands import Brand, brand

_UNIT = 1e-3
"""Largest deviation of a quaternion's length from one that rounding explains."""


def pose_from_brand(name: str, values: FloatArray) -> Transforms:
    """Return the pose ``(*batch, 4, 4)`` [m] of fields in a brand's convention.

    Args:
        name: key of :data:`BRANDS`.
        values: fields ``(*batch, k)`` in the brand's order and units.

    Raises:
        InputError: the brand is unknown, the number of fields is wrong, a number is not finite, or a quaternion is not
            unit.
    """
    b = brand(name)
    values = np.asarray(values, dtype=np.float64)
    if values.ndim < 1 or values.shape[-1] != len(b.fields) or not np.isfinite(values).all():
        raise InputError(
            f"pose of {name}: expected {len(b.fields)} finite numbers ({' '.join(b.fields)}), got shape {values.shape} "
            "or a number that is not finite. Give all the fields."
        )
    _check_turns(b, values[..., 3:])
    return SE3.from_parts(_rotation(b, values[..., 3:]), values[..., :3] * b.metre)


def pose_of(b: Brand, places: FloatArray, turns: FloatArray) -> Transforms:
    """Return poses ``(*batch, 4, 4)`` of positions and a brand's rotation fields.

    Args:
        b: pose convention.
        places: positions ``(*batch, 3)`` [m].
        turns: rotation fields ``(*batch, 3 or 4)``, angles in radians or quaternions.
    """
    return SE3.from_parts(_rotation(b, turns / b.radian), places)


FULL_TURN = 2.02 * np.pi
"""Largest plausible angle in a field of radians: a full turn with a margin of 1 percent [rad]."""

MANY_TURNS = 200.5 * np.pi
"""Largest plausible angle in a field of degrees, where joints may have wound up [rad]."""

_QUARTER, _CLOSE = np.pi / 2, 2e-3


def in_radians(degrees: FloatArray) -> bool:
    """Return whether angles written as degrees are probably radians: none exceeds pi, and one is a multiple of pi/2.

    Args:
        degrees: angles as written ``(*batch,)``; NaN are ignored.
    """
    sizes = np.abs(degrees[np.isfinite(degrees)])
    quarters = (sizes > 1) & (np.abs(sizes - _QUARTER * np.round(sizes / _QUARTER)) < _CLOSE)
    return bool(len(sizes) and sizes.max() < np.pi + _CLOSE and quarters.any())


def _check_turns(b: Brand, turns: FloatArray) -> None:
    """Refuse degrees in place of radians and radians in place of degrees; the message states the probable mistake."""
    if b.rule not in ("euler", "rotation vector"):
        return
    if b.radian == 1 and (np.abs(turns) > FULL_TURN).any():
        worst = float(turns.flat[int(np.argmax(np.abs(turns)))])
        raise InputError(
            f"pose of {b.name}: expected angles in radians, got {worst:g}, more than a full turn: are these degrees? "
            "Write them in radians."
        )
    if b.rule == "rotation vector" and (np.linalg.norm(turns, axis=-1) > FULL_TURN).any():
        raise InputError(
            f"pose of {b.name}: expected a rotation vector of at most a full turn, got one of "
            f"{np.linalg.norm(turns, axis=-1).max():.3g} rad: are these roll, pitch and yaw, or degrees? Convert them."
        )
    if (np.abs(turns) * b.radian > MANY_TURNS).any():
        raise InputError(f"pose of {b.name}: expected angles of up to 36000 degrees, got more. Correct them.")
    if b.radian != 1 and in_radians(turns):
        listed = ", ".join(f"{angle:g}" for angle in np.ravel(turns)[:3])
        raise InputError(
            f"pose of {b.name}: expected angles in degrees, got {listed}: are these radians? Write them in degrees, "
            "or with other digits if they are."
        )


def pose_as_brand(name: str, T: Transforms) -> FloatArray:
    """Return the fields ``(*batch, k)`` of a pose in a brand's convention.

    If two Euler rotations share one axis (gimbal lock), the first angle of the product is set to zero. Quaternions have
    ``w >= 0``.

    Args:
        name: key of :data:`BRANDS`.
        T: poses ``(*batch, 4, 4)`` [m].

    Raises:
        InputError: the brand is unknown, or ``T`` is not a rigid motion.
    """
    b = brand(name)
    T = check_transforms(f"pose for {name}", T)
    return np.concatenate([T[..., :3, 3] / b.metre, _fields(b, T[..., :3, :3])], axis=-1)


def _rotation(b: Brand, values: FloatArray) -> Rotations:
    if b.rule == "euler":
        angles = values * b.radian
        first, second, third = (
            SO3.axis_rotation("xyz".index(axis), angles[..., k]) for axis, k in zip(b.axes, b.order, strict=True)
        )
        return first @ second @ third
    if b.rule == "rotation vector":
        return SO3.exp(values)
    lengths = np.linalg.norm(values, axis=-1)
    if np.any(np.abs(lengths - 1) > _UNIT):
        worst = values.reshape(-1, 4)[int(np.argmax(np.abs(lengths - 1)))]
        raise InputError(
            f"quaternion: expected a length of 1, got {', '.join(f'{x:g}' for x in worst)}, of length "
            f"{np.linalg.norm(worst):.4g}. Correct it; are these angles?"
        )
    return SO3.from_quaternion(values if b.rule == "wxyz" else np.roll(values, 1, axis=-1))


def _fields(b: Brand, R: Rotations) -> FloatArray:
    if b.rule == "rotation vector":
        return SO3.log(R)
    if b.rule != "euler":
        q = SO3.as_quaternion(R)
        return q if b.rule == "wxyz" else np.roll(q, -1, axis=-1)
    i, j, k = ("xyz".index(axis) for axis in b.axes)
    angles = _two_axes(R, i, j) if i == k else _three_axes(R, i, j, k)
    out = np.empty(angles.shape)
    out[..., list(b.order)] = angles / b.radian
    return out


def _three_axes(R: Rotations, i: int, j: int, k: int) -> FloatArray:
    """Return the angles of ``Ri(a) Rj(b) Rk(c)`` with three different axes and ``b`` in [-pi/2, pi/2]."""
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    level = np.hypot(R[..., i, i], R[..., i, j])
    b = np.arctan2(sign * R[..., i, k], level)
    locked = level < 1e-9
    a = np.where(locked, 0.0, np.arctan2(-sign * R[..., j, k], R[..., k, k]))
    free = np.arctan2(-sign * R[..., i, j], R[..., i, i])
    # with the first angle zero the last one is read from the middle row
    return np.stack([a, b, np.where(locked, np.arctan2(sign * R[..., j, i], R[..., j, j]), free)], axis=-1)


def _two_axes(R: Rotations, i: int, j: int) -> FloatArray:
    """Return the angles of ``Ri(a) Rj(b) Ri(c)`` with ``b`` in [0, pi]."""
    k = 3 - i - j
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    tilt = np.hypot(R[..., i, j], R[..., i, k])
    b = np.arctan2(tilt, R[..., i, i])
    locked = tilt < 1e-9
    a = np.where(locked, 0.0, np.arctan2(R[..., j, i], -sign * R[..., k, i]))
    free = np.arctan2(R[..., i, j], sign * R[..., i, k])
    return np.stack([a, b, np.where(locked, np.arctan2(-sign * R[..., j, k], R[..., j, j]), free)], axis=-1)
