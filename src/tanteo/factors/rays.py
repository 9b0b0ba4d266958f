"""Free-space rays: straight paths without an echo, world frame, metres."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray, Vectors
from tanteo.sensors import PointMeasurements


@dataclass(frozen=True, slots=True, eq=False)
class FreeRays:
    """Straight paths in the world on which a sensor found no surface.

    Attributes:
        origins: starts of the paths ``(m, 3)`` [m].
        directions: unit directions ``(m, 3)``.
        lengths: free lengths ``(m,)`` [m].
        margin: uncertain length at the end of each ``(m,)`` [m].
        slopes: lateral standard deviation of each path in either direction over the distance along it ``(m,)``; zero by
            default. The echo of a cone may come from any of its rays.
        incidences: largest angle of incidence at which a surface returns an echo ``(m,)`` [rad]; a right angle by
            default. More oblique surfaces do not contradict a path.
        shared_jacobian: derivatives of the origins by the whitened shared errors of the readings, true = origin +
            jacobian z, ``(m, 3, D)``; none by default.
        turns: derivatives of the directions likewise ``(m, 3, D)``.
        moved: whether any path moves; follows from ``shared_jacobian`` and ``turns``.
    """

    origins: Vectors
    directions: Vectors
    lengths: FloatArray
    margin: FloatArray
    slopes: FloatArray = field(default_factory=lambda: np.zeros(0))
    incidences: FloatArray = field(default_factory=lambda: np.zeros(0))
    shared_jacobian: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 0)))
    turns: FloatArray = field(default_factory=lambda: np.zeros((0, 3, 0)))
    moved: bool = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if len(self.slopes) != len(self.lengths):
            object.__setattr__(self, "slopes", np.zeros(len(self.lengths)))
        if len(self.incidences) != len(self.lengths):
            object.__setattr__(self, "incidences", np.full(len(self.lengths), np.pi / 2))
        for name in ("shared_jacobian", "turns"):
            if len(getattr(self, name)) != len(self.lengths):
                object.__setattr__(self, name, np.zeros((len(self.lengths), 3, 0)))
        object.__setattr__(self, "moved", bool(self.shared_jacobian.any() or self.turns.any()))

    def __len__(self) -> int:
        return len(self.lengths)

    def up_to(self, incidence: float) -> FreeRays:
        """Return the rays of a sensor that detects no larger angle of incidence [rad]."""
        return replace(self, incidences=np.minimum(self.incidences, incidence))

    def take(self, rows: IntArray) -> FreeRays:
        """Return the rays in some rows, in the order of the rows."""
        names = "origins", "directions", "lengths", "margin", "slopes", "incidences", "shared_jacobian", "turns"
        return FreeRays(*(getattr(self, name)[rows] for name in names))

    def unmoved(self) -> FreeRays:
        """Return the same rays without shared errors."""
        none = np.zeros((len(self), 3, 0))
        return replace(self, shared_jacobian=none, turns=none)

    def at(self, z: FloatArray) -> tuple[Vectors, Vectors]:
        """Return origins [m] and unit directions for ``S`` draws of the whitened shared errors ``(S, D)``.

        Returns:
            Both ``(S, m, 3)``, or ``(m, 3)`` if no shared error moves the rays.
        """
        if not self.moved:
            return self.origins, self.directions
        shifts, turns = (z @ J.reshape(-1, z.shape[1]).T for J in (self.shared_jacobian, self.turns))
        along = self.directions + turns.reshape(len(z), len(self), 3)
        along /= np.linalg.norm(along, axis=2, keepdims=True)
        return self.origins + shifts.reshape(len(z), len(self), 3), along

    def join(self, other: FreeRays) -> FreeRays:
        """Return the rays of both, which have the same shared errors."""
        if not len(self) or not len(other):
            return self if len(self) else other
        names = "origins", "directions", "lengths", "margin", "slopes", "incidences", "shared_jacobian", "turns"
        return FreeRays(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    @classmethod
    def none(cls) -> FreeRays:
        """Return an empty set of rays."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


def as_free_rays(measured: PointMeasurements, margin: float) -> FreeRays:
    """Return the free-space rays of measurements.

    Args:
        measured: points with their beams.
        margin: uncertain length at the end of each ray [m].
    """
    beams, (_, shared_jacobian, turns, _) = measured.free, measured.whitened()
    slopes = 0.5 * np.tan(beams.half_angles)  # of points even over a disc
    margins = np.full(len(beams), margin)
    lines = beams.origins, beams.directions, beams.lengths
    return FreeRays(*lines, margins, slopes, beams.max_incidences, shared_jacobian, turns)
