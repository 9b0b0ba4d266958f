"""Define the options that a user states for a readings file, for what the file does not contain."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from tanteo.errors import InputError, check_kind
from tanteo.geometry.limits import LARGEST_TILT_SD, LEAST_TILT_SD, check_length
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.io.poses.pose_syntax import parse_pose
from tanteo.io.poses.transforms import Track
from tanteo.io.readings.brands import brand as known_brand
from tanteo.io.readings.units import length_unit, parse_lengths

if TYPE_CHECKING:
    from tanteo.io.readings.analog import OutputRange
    from tanteo.io.readings.range_codes import Special
    from tanteo.sensors import Rig

_WORDS = {"down": (0, 0, -1), "up": (0, 0, 1)} | {
    f"{sign}{axis}": tuple((-1 if sign == "-" else 1) * (k == i) for k in range(3))
    for i, axis in enumerate("xyz")
    for sign in ("", "+", "-")
}
_HOW = "down, -z, 0,0,-1, ijk, -ijk, tool or from:0,0,500mm"
LARGEST_RADIUS = 1.0


@dataclass(frozen=True, slots=True)
class Direction:
    """Approach or viewing direction of all rows.

    Attributes:
        kind: rule: one fixed vector; away from a viewpoint; the z axis of the tip; the vectors I, J, K of the file, or
            opposite to them.
        vector: unit vector in the world, or the viewpoint [m].
    """

    kind: Literal["fixed", "from", "tool", "ijk", "-ijk"]
    vector: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """Options that the user states; None where nothing is stated.

    Attributes:
        units: length unit of numbers without one.
        radius: radius of the tip's ball [m]; the points are its centres.
        direction: direction of all rows.
        normal_sd: standard deviation of normals for each tilt component [rad].
        brand: robot brand whose convention the hand's pose columns follow.
        tool: ``T_hand_tip`` ``(4, 4)`` [m].
        hand: ``T_world_hand`` ``(4, 4)`` [m] of rows without one, or the hand's poses over time.
        rig: range sensors on the hand.
        device: name of the rig's device that measured a frame of zones, where the rig has several.
        sensor: name of the preset of ranges without a sensor in the rig.
        analog: range of an analog output.
        special: values that are no distances, see :mod:`tanteo.io.readings.range_codes`.
        max_points: largest number of readings to keep, drawn at random.
    """

    units: str | None = None
    radius: float | None = None
    direction: Direction | None = None
    normal_sd: float | None = None
    brand: str | None = None
    tool: Transforms | None = None
    hand: Transforms | Track | None = None
    rig: Rig | None = None
    device: str | None = None
    sensor: str | None = None
    analog: OutputRange | None = None
    special: tuple[Special, ...] = ()
    max_points: int | None = None

    def __post_init__(self) -> None:
        if self.units is not None:
            length_unit(self.units, "units")
        if self.radius is not None and self.radius != 0:
            check_length("radius", self.radius, 0.0)
            if self.radius > LARGEST_RADIUS:
                raise InputError(f"radius: expected {LARGEST_RADIUS:g} m or less, got {self.radius:g}. Check its unit.")
        if self.normal_sd is not None and not LEAST_TILT_SD <= self.normal_sd <= LARGEST_TILT_SD * (1 + 1e-9):
            least, most, got = np.degrees([LEAST_TILT_SD, LARGEST_TILT_SD, self.normal_sd])
            raise InputError(
                f"normal_sd: expected from {least:.2g} to {most:.0f} degrees, got {got:.3g}. Check its unit."
            )
        if self.max_points is not None and self.max_points < 1:
            raise InputError(f"max_points: expected 1 or more, got {self.max_points}. Use 1000.")


def parse_direction(text: str, name: str = "direction") -> Direction:
    """Return the direction of a text such as ``down``, ``-z``, ``0,0,-1``, ``tool`` or ``from:0,0,500mm``.

    ``ijk`` means that the file's vectors I, J, K point into the material, ``-ijk`` that they point out of it.

    Args:
        text: typed direction.
        name: name of the input, for messages.

    Raises:
        InputError: the text is something else.
    """
    word = text.strip().lower()
    if word in ("tool", "ijk", "-ijk"):
        return Direction(word)  # type: ignore[arg-type]
    if word in _WORDS:
        return Direction("fixed", _WORDS[word])  # type: ignore[arg-type]
    if word.startswith("from:"):
        place = parse_lengths(word[5:], name)
        if len(place) == 3:
            return Direction("from", (place[0], place[1], place[2]))
    numbers = re.split(r"[\s,]+", word)
    try:
        vector = np.array([float(number) for number in numbers])
    except ValueError:
        vector = np.zeros(0)
    return _fixed(vector, name, text)


def _fixed(vector: FloatArray, name: str, text: str) -> Direction:
    if vector.shape != (3,) or not np.isfinite(vector).all() or not 1e-9 < np.linalg.norm(vector) < 1e9:
        raise InputError(f"{name}: expected {_HOW}, got '{text}'. It points into the material.")
    x, y, z = (vector / np.linalg.norm(vector)).tolist()
    return Direction("fixed", (x, y, z))


def as_direction(value: str | Vectors | Direction | None) -> Direction | None:
    """Return a direction from an argument: a text, a vector ``(3,)``, or a direction.

    Args:
        value: argument as passed; None for no direction.
    """
    if value is None or isinstance(value, Direction):
        return value
    if isinstance(value, str):
        return parse_direction(value)
    return _fixed(np.asarray(value, dtype=np.float64), "direction", str(value))


def as_pose(name: str, value: str | Transforms | Vectors | None) -> Transforms | None:
    """Return a pose ``(4, 4)`` [m] from an argument: a text, a matrix, or the offset of a tool.

    Args:
        name: name of the argument, for messages.
        value: text, matrix ``(4, 4)`` [m], or offset ``(3,)`` [m]; None for no pose.

    Raises:
        InputError: the text or the array is not a pose.
    """
    if value is None or isinstance(value, str):
        return None if value is None else parse_pose(value, name, attitude=name != "tool")
    array = np.asarray(value, dtype=np.float64)
    if array.shape == (3,):
        T = np.eye(4)
        T[:3, 3] = array
        array = T
    if array.shape != (4, 4) or not np.isfinite(array).all():
        raise InputError(f"{name}: expected a pose (4, 4) or an offset (3,) in metres, got shape {array.shape}.")
    return array


def as_brand(value: str | None) -> str | None:
    """Return the canonical name of a brand.

    Args:
        value: name or alias of a brand; None for no brand.
    """
    if value is None:
        return None
    check_kind("brand", value, str, "Name one of tanteo.io.BRANDS.")
    return known_brand(value).name
