"""Poses as robot brands and ROS write them. Inside tanteo a pose is a matrix in metres; these are the border.

Each convention is a row of :data:`BRANDS`. ``verified`` says whether the brand's own or an integrator's
documentation was read; the others are from memory and must be confirmed on the controller before use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from tanteo.errors import InputError, did_you_mean
from tanteo.frames import check_transforms
from tanteo.io.schema import show
from tanteo.lie import SE3, SO3
from tanteo.typing import FloatArray, Rotations, Transforms

Rule = Literal["euler", "rotation vector", "wxyz", "xyzw"]


@dataclass(frozen=True, slots=True)
class Brand:
    """How a brand writes a pose.

    Attributes:
        name: Name for look-up.
        fields: The fields in their order, position first.
        metre: Metres per unit of position.
        rule: What the fields after the position are.
        axes: For Euler angles: the axes of the product, left to right, so ``"zyx"`` is ``Rz Ry Rx``.
        order: For Euler angles: which angle field belongs to each of the axes.
        radian: Radians per unit of angle.
        verified: The convention was read in documentation.
        source: Where.
        syntax: How the controller's language writes the pose, with a place for each field.
    """

    name: str
    fields: tuple[str, ...]
    metre: float
    rule: Rule
    axes: str
    order: tuple[int, int, int]
    radian: float
    verified: bool
    source: str
    syntax: str


_DEG = np.pi / 180
_UNIT = 1e-3
"""How far the length of a quaternion may be off one, by rounding."""

_RC = "docs.baslerweb.com rc_cube, pose_format_"
_RDK = "RoboDK-API, robomath.py, "
_MEMORY = "from memory: confirm"


def _euler(
    name: str, fields: str, axes: str, order: tuple[int, int, int], source: str, syntax: str, verified: bool = True
) -> Brand:
    return Brand(name, tuple(fields.split()), 1e-3, "euler", axes, order, _DEG, verified, source, syntax)


_BACK, _FORTH = (2, 1, 0), (0, 1, 2)
_LIST, _ROUND = "{}, {}, {}, {}, {}, {}", "({}, {}, {}, {}, {}, {})"
_ROWS = (
    Brand("paper", ("px", "py", "pz", "psi", "theta", "phi"), 1.0, "euler", "zyx", _BACK, 1.0, True,
          "Montano and Sagues 1991, appendix 1", _LIST),
    _euler("fanuc", "X Y Z W P R", "zyx", _BACK, _RC + "fanuc",
           "X = {} mm, Y = {} mm, Z = {} mm, W = {} deg, P = {} deg, R = {} deg"),
    _euler("kuka", "X Y Z A B C", "zyx", _FORTH, _RC + "kuka", "{{X {}, Y {}, Z {}, A {}, B {}, C {}}}"),
    _euler("yaskawa", "X Y Z Rx Ry Rz", "zyx", _BACK, _RC + "yaskawa", "{},{},{},{},{},{}"),
    _euler("mitsubishi", "X Y Z A B C", "zyx", _BACK, _RC + "mitsubishi", _ROUND),
    _euler("kawasaki", "X Y Z O A T", "zyz", _FORTH, _RC + "kawasaki", "TRANS" + _ROUND),
    _euler("staubli", "X Y Z Rx Ry Rz", "xyz", _FORTH, _RDK + "Pose_2_Staubli", "{{" + _LIST + "}}"),
    _euler("comau", "X Y Z A E R", "zyz", _FORTH, _RDK + "Pose_2_Comau", "POS({}, {}, {}, {}, {}, {}, '')"),
    _euler("doosan", "X Y Z A B C", "zyz", _FORTH, "visose/Robots, SystemDoosan.EulerZYZ", "posx" + _ROUND),
    _euler("omron", "X Y Z yaw pitch roll", "zyz", _FORTH, "V+ Language User's Guide 17.0, page 168", "TRANS" + _ROUND),
    _euler("techman", "X Y Z Rx Ry Rz", "zyx", _BACK, _RDK + "Pose_2_Techman", "{{" + _LIST + "}}"),
    _euler("ufactory", "X Y Z Roll Pitch Yaw", "zyx", _BACK, "UFACTORY Lite 6 manual, page 95", "[" + _LIST + "]"),
    Brand("abb", ("X", "Y", "Z", "Q1", "Q2", "Q3", "Q4"), 1e-3, "wxyz", "", _FORTH, 1.0, True, _RC + "abb",
          "[[{}, {}, {}], [{}, {}, {}, {}]]"),
    Brand("ur", ("x", "y", "z", "rx", "ry", "rz"), 1.0, "rotation vector", "", _FORTH, 1.0, True,
          _RC + "ur (metres as in URScript and RTDE; PolyScope shows mm)", "p[" + _LIST + "]"),
    Brand("ros", ("x", "y", "z", "qx", "qy", "qz", "qw"), 1.0, "xyzw", "", _FORTH, 1.0, True,
          "geometry_msgs; REP-103", _LIST + ", {}"),
    _euler("denso", "X Y Z RX RY RZ", "zyx", _BACK,
           "the RC8 manual (ID 1939) has the order RZ, RY, RX, not whether axes turn along: confirm", "P" + _ROUND,
           verified=False),
    _euler("epson", "X Y Z U V W", "zyx", _FORTH, _MEMORY, "XY" + _ROUND, verified=False),
    _euler("mecademic", "X Y Z alpha beta gamma", "xyz", _FORTH, _MEMORY, _ROUND, verified=False),
)  # fmt: skip

BRANDS: Mapping[str, Brand] = MappingProxyType({b.name: b for b in _ROWS})
"""All conventions by name."""


_ALIASES = {"staeubli": "staubli", "stäubli": "staubli", "motoman": "yaskawa", "universal": "ur"}


def brand(name: str) -> Brand:
    """The convention of this name.

    Raises:
        InputError: No such brand; the message lists the nearest.
    """
    name = _ALIASES.get(name.lower(), name.lower())
    if name not in BRANDS:
        hint = did_you_mean(name, BRANDS)
        raise InputError(f"brand: expected one of {', '.join(BRANDS)}, got '{show(name)}'.{hint}")
    return BRANDS[name]


def pose_from_brand(name: str, values: FloatArray) -> Transforms:
    """The pose ``(*batch, 4, 4)`` [m] of the fields ``(*batch, k)`` as the brand writes them.

    Args:
        name: A key of :data:`BRANDS`.
        values: The fields in the brand's order and units.

    Raises:
        InputError: Unknown brand, a wrong number of fields, numbers that are not finite, a quaternion that is
            no rotation.
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
    """Poses ``(*batch, 4, 4)`` of places ``(*batch, 3)`` [m] and the brand's angles [rad] or quaternions."""
    return SE3.from_parts(_rotation(b, turns / b.radian), places)


FULL_TURN = 2.02 * np.pi
"""No angle in radians is larger: a full turn, and a little beyond it."""

MANY_TURNS = 200.5 * np.pi
"""Angles in degrees may have wound up, but not more than this [rad]."""

_QUARTER, _CLOSE = np.pi / 2, 2e-3


def in_radians(degrees: FloatArray) -> bool:
    """Whether angles that are written as degrees are probably radians: none beyond half a turn, and quarters of it."""
    sizes = np.abs(degrees[np.isfinite(degrees)])
    quarters = (sizes > 1) & (np.abs(sizes - _QUARTER * np.round(sizes / _QUARTER)) < _CLOSE)
    return bool(len(sizes) and sizes.max() < np.pi + _CLOSE and quarters.any())


def _check_turns(b: Brand, turns: FloatArray) -> None:
    """Refuse degrees for radians and the other way round, with what is probably meant."""
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
    """The fields ``(*batch, k)`` that the brand writes for the pose ``(*batch, 4, 4)`` [m].

    Where two Euler angles turn about one axis the first of the product is set to zero. Quaternions have ``w >= 0``.

    Raises:
        InputError: Unknown brand, or what is no rigid motion.
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
    """Angles of ``Ri(a) Rj(b) Rk(c)`` with three different axes; ``b`` within a quarter turn."""
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    level = np.hypot(R[..., i, i], R[..., i, j])
    b = np.arctan2(sign * R[..., i, k], level)
    locked = level < 1e-9
    a = np.where(locked, 0.0, np.arctan2(-sign * R[..., j, k], R[..., k, k]))
    free = np.arctan2(-sign * R[..., i, j], R[..., i, i])
    # with the first angle zero the last one is read from the middle row
    return np.stack([a, b, np.where(locked, np.arctan2(sign * R[..., j, i], R[..., j, j]), free)], axis=-1)


def _two_axes(R: Rotations, i: int, j: int) -> FloatArray:
    """Angles of ``Ri(a) Rj(b) Ri(c)``; ``b`` from 0 to pi."""
    k = 3 - i - j
    sign = 1.0 if (i, j, k) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else -1.0
    tilt = np.hypot(R[..., i, j], R[..., i, k])
    b = np.arctan2(tilt, R[..., i, i])
    locked = tilt < 1e-9
    a = np.where(locked, 0.0, np.arctan2(R[..., j, i], -sign * R[..., k, i]))
    free = np.arctan2(R[..., i, j], sign * R[..., i, k])
    return np.stack([a, b, np.where(locked, np.arctan2(-sign * R[..., j, k], R[..., j, j]), free)], axis=-1)
