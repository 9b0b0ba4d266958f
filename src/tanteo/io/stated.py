"""What is stated of a file of readings by hand: its format, and what it does not say itself."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from tanteo.errors import InputError, check_kind
from tanteo.io.brands import brand as known_brand
from tanteo.io.pose_syntax import parse_pose
from tanteo.io.units import length_unit, parse_lengths
from tanteo.limits import LARGEST_TILT_SD, LEAST_TILT_SD, check_length
from tanteo.typing import FloatArray, Transforms, Vectors

_WORDS = {"down": (0, 0, -1), "up": (0, 0, 1)} | {
    f"{sign}{axis}": tuple((-1 if sign == "-" else 1) * (k == i) for k in range(3))
    for i, axis in enumerate("xyz")
    for sign in ("", "+", "-")
}
_HOW = "down, -z, 0,0,-1, ijk, -ijk, tool or from:0,0,500mm"
LARGEST_RADIUS = 1.0


@dataclass(frozen=True, slots=True)
class Direction:
    """Where the tip moved or the device looked, of all rows.

    Attributes:
        kind: One vector; away from a viewpoint; the z axis of the tip; the vectors I J K of the file, or against them.
        vector: The unit vector, or the viewpoint [m].
    """

    kind: Literal["fixed", "from", "tool", "ijk", "-ijk"]
    vector: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """What is stated by hand; None where nothing is.

    Attributes:
        units: Length unit of numbers that have none.
        radius: Of the tip's ball [m]; the points are its centres.
        direction: Of all rows.
        normal_sd: Standard deviation of normals about each tilt [rad].
        brand: Whose pose the hand's columns are.
        tool: ``T_hand_tip``.
        hand: ``T_world_hand`` of rows without one.
        device: Name of the device in the rig that a frame of zones is of.
        max_points: Readings that are kept, drawn at random.
    """

    units: str | None = None
    radius: float | None = None
    direction: Direction | None = None
    normal_sd: float | None = None
    brand: str | None = None
    tool: Transforms | None = None
    hand: Transforms | None = None
    device: str | None = None
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
    """``down``, ``-z``, ``0,0,-1``, ``ijk`` (I J K point into the material), ``-ijk``, ``tool``, ``from:0,0,500mm``.

    Raises:
        InputError: It is something else.
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
    """A direction as an argument gives it: words, or a vector."""
    if value is None or isinstance(value, Direction):
        return value
    if isinstance(value, str):
        return parse_direction(value)
    return _fixed(np.asarray(value, dtype=np.float64), "direction", str(value))


def as_pose(name: str, value: str | Transforms | Vectors | None) -> Transforms | None:
    """A pose as an argument gives it: words, a matrix ``(4, 4)`` [m], or of a tool its offset ``(3,)`` [m]."""
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
    """The name of a brand as the table of brands has it."""
    if value is None:
        return None
    check_kind("brand", value, str, "Name one of tanteo.io.BRANDS.")
    return known_brand(value).name
