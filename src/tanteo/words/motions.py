"""Motions of a part as values and as text."""

from __future__ import annotations

import math
from dataclasses import dataclass

_TILTED = 0.35
"""Least component of the unit tilt along an axis for its name to appear."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A motion of a part that is free, or that is known to some extent.

    Attributes:
        turns: whether it is a rotation; otherwise a translation.
        axis: name of the axis that it follows, such as ``world x`` or ``part z``; empty if it follows none.
        direction: unit direction in the world.
        point: point of the rotation axis in the world [m]; empty for a translation.
        pitch: translation along the axis per angle [m/rad].
    """

    turns: bool
    axis: str
    direction: tuple[float, float, float]
    point: tuple[float, ...] = ()
    pitch: float = 0.0

    def __str__(self) -> str:
        """Return the motion with every number: ``rotation about world z through (1.0, 2.0, 3.0) mm``."""
        along = self.axis or f"the world direction ({', '.join(f'{c:.2f}' for c in self.direction)})"
        if not self.turns:
            return f"sliding along {along}"
        words = f"rotation about {along} through ({', '.join(f'{1e3 * c:.1f}' for c in self.point)}) mm"
        return words if self.pitch == 0 else f"{words} while sliding {1e3 * self.pitch:.1f} mm a radian"

    @property
    def brief(self) -> str:
        """Return the motion without its place and by its nearest axis: ``sliding along world y, 26° towards z``."""
        return f"{'rotation about' if self.turns else 'sliding along'} {self.axis or _tilted(self.direction)}"


def _tilted(direction: tuple[float, float, float]) -> str:
    """Return the nearest axis of the world, the angle to it [deg], and the axes towards which the direction leans."""
    k = max(range(3), key=lambda i: abs(direction[i]))
    sign = math.copysign(1.0, direction[k])
    lean = [(name, sign * v) for i, (name, v) in enumerate(zip("xyz", direction, strict=True)) if i != k]
    length = math.hypot(*(v for _, v in lean))
    tilt = math.degrees(math.atan2(length, abs(direction[k])))
    to = [("−" if v < 0 else "") + name for name, v in lean if abs(v) >= _TILTED * length]
    return f"world {'xyz'[k]}, {tilt:.0f}° towards {' and '.join(to)}"
