"""Rough ideas of where a feature is: what acquisition starts from. World frame, metres."""

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
"""Of a guess: place [m] and attitude [rad]."""


RADIUS_SHARE = 0.2
"""Of a guess of a radius, one standard deviation as a share of it."""


def _settle(guess: FaceGuess | EdgeGuess | VertexGuess | RoundGuess, *directions: str) -> None:
    """Its point and these directions as arrays, which are checked like its spread."""
    for name, unit in (("sd", "m"), ("turn_sd", "rad")):
        value = getattr(guess, name)
        if not 0 < value < np.inf:
            raise InputError(f"{name}: expected a positive standard deviation [{unit}], got {value}. Correct it.")
    object.__setattr__(guess, "point", _point("point", guess.point))
    for name in directions:
        object.__setattr__(guess, name, _unit(name, getattr(guess, name)))


@dataclass(frozen=True, slots=True, eq=False)
class FaceGuess:
    """Somewhere on a flat face.

    Attributes:
        point: About there ``(3,)`` [m].
        normal: About its outward normal ``(3,)``; made unit.
        sd: How well the place is known, one standard deviation along the normal [m]. What is found farther off than
            five of them is another face.
        turn_sd: How well the normal is known [rad].
    """

    point: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _settle(self, "normal")


@dataclass(frozen=True, slots=True, eq=False)
class EdgeGuess:
    """Somewhere on a straight edge, and the face from which it is to be sensed.

    Attributes:
        point: About there ``(3,)`` [m].
        direction: About along the edge, with the face on its left as seen from outside ``(3,)``; made unit.
        normal: About the outward normal of that face ``(3,)``; made unit.
        sd: As of a :class:`FaceGuess` [m].
        turn_sd: The same [rad].
    """

    point: FloatArray
    direction: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _settle(self, "direction", "normal")
        if np.linalg.norm(np.cross(self.direction, self.normal)) < 0.1:
            raise InputError("direction: expected one across the normal, got one along it. An edge lies in its face.")

    def face(self, inset: float) -> FaceGuess:
        """The idea of the face, this far inside of the edge [m]."""
        inwards = np.cross(self.normal, self.direction)
        return FaceGuess(self.point + inset * inwards / np.linalg.norm(inwards), self.normal, self.sd, self.turn_sd)


@dataclass(frozen=True, slots=True, eq=False)
class VertexGuess:
    """About where two edges of one face meet.

    Attributes:
        point: About the corner ``(3,)`` [m].
        arriving: Direction of the edge that ends in it, with the face on its left ``(3,)``; made unit.
        leaving: Direction of the edge that begins in it, with the face on its left ``(3,)``; made unit.
        normal: About the outward normal of the face ``(3,)``; made unit.
        sd: As of a :class:`FaceGuess` [m].
        turn_sd: The same [rad].
    """

    point: FloatArray
    arriving: FloatArray
    leaving: FloatArray
    normal: FloatArray
    sd: float = SD
    turn_sd: float = TURN_SD

    def __post_init__(self) -> None:
        _settle(self, "arriving", "leaving", "normal")
        if np.linalg.norm(np.cross(self.arriving, self.leaving)) < 0.1:
            raise InputError("leaving: expected an edge that meets the other, got parallel ones. A corner has two.")

    def edges(self, along: float) -> tuple[EdgeGuess, EdgeGuess]:
        """Both edges, this far from the corner [m]."""
        spread = self.sd, self.turn_sd
        return (
            EdgeGuess(self.point - along * self.arriving, self.arriving, self.normal, *spread),
            EdgeGuess(self.point + along * self.leaving, self.leaving, self.normal, *spread),
        )


@dataclass(frozen=True, slots=True, eq=False)
class RoundGuess:
    """About a bore or a boss that ends in a flat face.

    Attributes:
        point: About the centre of its rim ``(3,)`` [m].
        axis: About its axis, out of the material: the outward normal of the face ``(3,)``; made unit.
        radius: About that [m].
        convex: A boss, with the face inside the rim; otherwise a bore, with the face around it.
        sd: How well the centre is known [m].
        turn_sd: How well the axis is known [rad].
        radius_share: How well the radius is known, as a share of it.

    Example:
        >>> tanteo.hand.RoundGuess([0, 0, 0.02], [0, 0, 2], 0.015).axis.tolist()
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
        _settle(self, "axis")
        if not 0 < self.radius < np.inf:
            raise InputError(f"radius: expected a positive length [m], got {self.radius}. Correct it.")
        if not 0 < self.radius_share < 1:
            raise InputError(f"radius_share: expected a share from 0 to 1, got {self.radius_share}. Correct it.")

    def face(self) -> FaceGuess:
        """The idea of the face in which it ends."""
        return FaceGuess(self.point, self.axis, self.sd, self.turn_sd)
