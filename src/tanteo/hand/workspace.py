"""Where the hand may be: what a person knows of the cell before anything is sensed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import frozen_array
from tanteo.typing import FloatArray, Vectors


@dataclass(frozen=True, slots=True, eq=False)
class Workspace:
    """A box in the world that the hand's body stays inside; the table's top is usually its floor.

    Attributes:
        low: Corner ``(3,)`` [m]; may be minus infinity.
        high: Corner ``(3,)`` [m]; may be infinity.

    Raises:
        InputError: Corners that are not three numbers in order.
    """

    low: FloatArray
    high: FloatArray

    def __post_init__(self) -> None:
        low, high = frozen_array(self.low), frozen_array(self.high)
        if low.shape != (3,) or high.shape != (3,) or not (low < high).all():
            raise InputError(
                f"workspace: expected a low and a high corner of three numbers, got {low.tolist()} and "
                f"{high.tolist()}. Put the smaller first."
            )
        object.__setattr__(self, "low", low)
        object.__setattr__(self, "high", high)

    @classmethod
    def everywhere(cls) -> Workspace:
        """No bound at all."""
        return cls(np.full(3, -np.inf), np.full(3, np.inf))

    @classmethod
    def above(cls, height: float) -> Workspace:
        """Everything above a horizontal table [m]."""
        return cls(np.array([-np.inf, -np.inf, height]), np.full(3, np.inf))

    def room(self, centres: Vectors, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Room of spheres ``(*batch, k, 3)`` to the low and to the high faces ``(*batch, k, 3)`` [m]."""
        r = radii[:, None]
        return np.asarray(centres - self.low - r), np.asarray(self.high - centres - r)
