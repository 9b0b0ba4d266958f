"""Define approximate poses of features, from which an acquisition starts; world frame, metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from tanteo.errors import InputError
from tanteo.geometry import frozen_array
from tanteo.geometry.typing import FloatArray


def _point(name: str, value: npt.ArrayLike) -> FloatArray:
    array = frozen_array(np.asarray(value, dtype=np.float64))
    if array.shape != (3,) or not np.isfinite(array).all():
        raise InputError(f"{name}: expected three finite numbers, got {np.asarray(value).tolist()}. Give x, y, z.")
    return array


def _unit(name: str, value: npt.ArrayLike) -> FloatArray:
    array = _point(name, value)
    length = float(np.linalg.norm(array))
    if length < 1e-9:
        raise InputError(f"{name}: expected a direction that is not zero, got {array.tolist()}. Correct it.")
    return frozen_array(array / length)


SD, TURN_SD = 0.015, np.radians(30.0)
"""Default standard deviations of a guess: position [m] and orientation [rad]."""


RADIUS_SHARE = 0.2
"""Default standard deviation of a guessed radius, as a fraction of it."""


def _check_fields(guess: FaceGuess | EdgeGuess | VertexGuess | RoundGuess, *directions: str) -> None:
    """Check the fields of a guess, and store its point and directions as read-only arrays."""
    for name, unit in (("sd", "m"), ("turn_sd", "rad")):
        value = getattr(guess, name)
        if not 0 < value < np.inf:
            raise InputError(f"{name}: expected a positive standard deviation [{unit}], got {value}. Correct it.")
    object.__setattr__(guess, "point", _point("point", guess.point))
    for name in directions:
        object.__setattr__(guess, name, _unit(name, getattr(guess, name)))


@dataclass(frozen=True, slots=True, eq=False)
class FaceGuess:
    """Approximate pose of a flat face.

    Attributes:
        point: approximate point on the face ``(3,)`` [m].
        normal: approximate outward normal ``(3,)``; normalized.
        sd: standard deviation of the point along the normal [m]; a face more than five of them away is another one.
        turn_sd: standard deviation of the normal [rad].
    """

    point: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _check_fields(self, "normal")


@dataclass(frozen=True, slots=True, eq=False)
class EdgeGuess:
    """Approximate pose of a straight edge and of the face from which it is sensed.

    Attributes:
        point: approximate point on the edge ``(3,)`` [m].
        direction: approximate direction of the edge, with the face on its left in a view from outside ``(3,)``;
            normalized.
        normal: approximate outward normal of the face ``(3,)``; normalized.
        sd: standard deviation of the point along the normal [m].
        turn_sd: standard deviation of the normal [rad].
    """

    point: FloatArray
    direction: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _check_fields(self, "direction", "normal")
        if np.linalg.norm(np.cross(self.direction, self.normal)) < 0.1:
            raise InputError("direction: expected one across the normal, got one along it. An edge lies in its face.")

    def face(self, inset: float) -> FaceGuess:
        """Return the guess of the face at a distance inside of the edge.

        Args:
            inset: distance from the edge [m].
        """
        inwards = np.cross(self.normal, self.direction)
        return FaceGuess(self.point + inset * inwards / np.linalg.norm(inwards), self.normal, self.sd, self.turn_sd)


@dataclass(frozen=True, slots=True, eq=False)
class VertexGuess:
    """Approximate pose of a corner, at which two edges of one face intersect.

    Attributes:
        point: approximate position of the corner ``(3,)`` [m].
        arriving: direction of the edge that ends at the corner, with the face on its left ``(3,)``; normalized.
        leaving: direction of the edge that begins at the corner, with the face on its left ``(3,)``; normalized.
        normal: approximate outward normal of the face ``(3,)``; normalized.
        sd: standard deviation of the point along the normal [m].
        turn_sd: standard deviation of the normal [rad].
    """

    point: FloatArray
    arriving: FloatArray
    leaving: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _check_fields(self, "arriving", "leaving", "normal")
        if np.linalg.norm(np.cross(self.arriving, self.leaving)) < 0.1:
            raise InputError("leaving: expected an edge that meets the other, got parallel ones. A corner has two.")

    def edges(self, along: float) -> tuple[EdgeGuess, EdgeGuess]:
        """Return the guesses of both edges at a distance from the corner.

        Args:
            along: distance from the corner [m].
        """
        spread = self.sd, self.turn_sd
        return (
            EdgeGuess(self.point - along * self.arriving, self.arriving, self.normal, *spread),
            EdgeGuess(self.point + along * self.leaving, self.leaving, self.normal, *spread),
        )


@dataclass(frozen=True, slots=True, eq=False)
class RoundGuess:
    """Approximate pose and radius of a bore or a boss that ends in a flat face.

    Attributes:
        point: approximate centre of the rim ``(3,)`` [m].
        axis: approximate axis out of the material, which is the outward normal of the face ``(3,)``; normalized.
        radius: approximate radius [m].
        convex: whether it is a boss, with the face inside the rim; otherwise a bore, with the face around it.
        sd: standard deviation of the centre [m].
        turn_sd: standard deviation of the axis [rad].
        radius_share: standard deviation of the radius, as a fraction of it.

    Example:
        >>> tanteo.hand.acquisition.RoundGuess([0, 0, 0.02], [0, 0, 2], 0.015).axis.tolist()
        [0.0, 0.0, 1.0]
    """

    point: FloatArray
    axis: FloatArray
    radius: float
    convex: bool = False
    sd: float = SD
    turn_sd: float = TURN_SD
    radius_share: float = RADIUS_SHARE

    def __post_init__(self) -> None:
        _check_fields(self, "axis")
        if not 0 < self.radius < np.inf:
            raise InputError(f"radius: expected a positive length [m], got {self.radius}. Correct it.")
        if not 0 < self.radius_share < 1:
            raise InputError(f"radius_share: expected a fraction from 0 to 1, got {self.radius_share}. Correct it.")

    def face(self) -> FaceGuess:
        """Return the guess of the face in which the bore or boss ends."""
        return FaceGuess(self.point, self.axis, self.sd, self.turn_sd)
