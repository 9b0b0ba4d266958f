"""Ranges of devices whose beam is so wide that the range along its axis is not what they report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from tanteo.factors.factor import MeasuredRow
from tanteo.factors.on_surface import OnSurface
from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts import Surface
from tanteo.sensors.noise import cone_rays, rectangle_rays

SHARES: dict[str, dict[str, float]] = {
    "ray": {"of_rays": 1.0},
    "nearest": {"of_nearest": 1.0},
    "mean": {"of_mean": 1.0},
    "strongest": {"of_strongest": 1.0},
    "": {"of_rays": 0.5, "of_nearest": 0.5},
}
"""Definition: probability of each response in the density; an unknown one is a random ray or the nearest surface."""

_RAYS = 61
"""Number of rays that fill the cone over furniture; half of those over a part (``_core/factors/cone_range.cpp``)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ConeRange(OnSurface):
    """Range of a wide beam: its density is that of the reported range, over what the device may report of its cone.

    ``at`` is on the axis of the cone, at the range.

    Attributes:
        range: range along the beam [m].
        half_angle: half angle of the cone, or of the cone of equal section for a rectangular beam [rad].
        half_axes: half axes of a rectangular beam at distance one, in the world ``(2, 3)``; None for a circle.
        max_incidence: largest incidence at which the device detects a surface [rad].
        response: what the device reports of its cone, one of :data:`~tanteo.sensors.presets.RESPONSES`; empty if
            unknown.
        background: plane of furniture that most of the cone hits, as unit normal towards the sensor and offset along it
            in the world ``(4,)`` [m]; None without furniture.

    Example:
        >>> from tanteo.factors.cone_range import ConeRange
        >>> down = np.array([0.0, 0.0, -1.0])
        >>> echo = ConeRange(at=np.zeros(3), cov=1e-6 * np.eye(3), approach=down, range=0.2, half_angle=0.3)
        >>> echo.response
        ''
    """

    core: ClassVar[str] = "cone_range"
    codimension: ClassVar[int] = 1
    flat_face: ClassVar[bool] = True
    range: float
    half_angle: float
    half_axes: Vectors | None = None
    max_incidence: float = 1.5707
    response: str = ""
    background: Vectors | None = None

    @property
    def residual_sd(self) -> float:
        """Return the standard deviation of the range [m]."""
        axis = np.asarray(self.approach)
        return float(np.sqrt(axis @ self.cov @ axis))

    @property
    def other_responses(self) -> tuple[str, ...]:
        """Return the responses that predict one range and are not the stated one."""
        return tuple(name for name, share in SHARES.items() if name != self.response and "of_rays" not in share)

    def log_on(self, surface: Surface, sd: float) -> float | None:
        """Return the log density of the range of a cone that hits a surface, from rays that fill the cone.

        Args:
            surface: surface of furniture in the world.
            sd: standard deviation of this surface along its normal [m].
        """
        distances, normals, rays = self._cast(surface)
        cosines = np.abs(np.sum(normals * rays, axis=1))
        hit = np.isfinite(distances)  # it answered, so that its largest incidence excludes nothing
        if not hit.any():
            return -np.inf
        ranges, shares = distances[hit], SHARES[self.response]
        flat = np.unique(np.round(normals[hit], 3), axis=0, return_inverse=True)[1].ravel()
        signals = cosines[hit] / ranges**2
        most = np.argmax(np.bincount(flat, weights=signals))
        means = np.array([ranges.mean(), np.average(ranges, weights=signals)])  # even, or by signal
        predicted = (
            ("of_rays", ranges, 1 / len(ranges)),
            ("of_nearest", ranges.min(keepdims=True), 1.0),
            ("of_mean", means, 0.5),
            ("of_strongest", ranges[flat == most].mean(keepdims=True), 1.0),
        )
        # a turn of half the spacing of the rays moves the range on an oblique surface
        cell = ranges.mean() * np.tan(self.half_angle) * np.tan(np.arccos(cosines[hit])).mean() / np.sqrt(4 * _RAYS)
        variance = self.residual_sd**2 + sd**2 + cell**2
        density = sum(
            shares.get(name, 0.0) * weight * np.exp(-0.5 * (d - self.range) ** 2 / variance).sum()
            for name, d, weight in predicted
        )
        with np.errstate(divide="ignore"):
            return float(np.log(density) - 0.5 * np.log(2 * np.pi * variance))

    def before(self, surfaces: Sequence[Surface]) -> ConeRange:
        """Return the range of a cone that also contains furniture, as the plane that most of its rays hit.

        Rays that miss the part hit furniture, so that a mean is between both, and the larger signal is the stronger.

        Args:
            surfaces: surfaces of furniture in the world.
        """
        if not surfaces:
            return self
        origin = self.at - self.range * np.asarray(self.approach)
        found = [self._cast(surface) for surface in surfaces]
        distances, normals = (np.stack([one[k] for one in found]) for k in (0, 1))
        first = (distances.argmin(axis=0), np.arange(_RAYS))
        hit, rays = np.isfinite(distances[first]), found[0][2]
        if not hit.any():
            return self
        n, rays, d = normals[first][hit], rays[hit], distances[first][hit]
        n = np.where(np.sum(n * rays, axis=1, keepdims=True) > 0, -n, n)
        planes = np.column_stack([n, np.sum(n * (origin + d[:, None] * rays), axis=1)])
        _, where, counts = np.unique(np.round(planes, 4), axis=0, return_index=True, return_counts=True)
        return replace(self, background=planes[where[counts.argmax()]])

    def _cast(self, surface: Surface) -> tuple[FloatArray, Vectors, Vectors]:
        """Return distances, normals of the surface and directions of the rays that fill the cone."""
        axis = np.asarray(self.approach)
        if self.half_axes is None:
            rays = cone_rays(self.half_angle, _RAYS) @ SO3.frame_from_axis(axis, 2).T
        else:
            rays = rectangle_rays(axis, self.half_axes, _RAYS)
        hits = surface.cast(self.at - self.range * axis, rays)
        return hits.distances, surface.normals[np.maximum(hits.triangles, 0)], rays

    def columns(self) -> dict[str, Any]:
        """Return the numbers of the cone, and the probability of each response."""
        background = np.zeros(4) if self.background is None else self.background
        axes = np.zeros((2, 3)) if self.half_axes is None else np.asarray(self.half_axes)
        shares = {name: 0.0 for share in SHARES.values() for name in share} | SHARES[self.response]
        return {
            "directions": self.approach, "round_face": False, "ranges": self.range, "half_angles": self.half_angle,
            "half_widths": axes[0], "half_heights": axes[1], "max_incidences": self.max_incidence,
            "furniture_normals": background[:3], "furniture_offsets": background[3], **shares,
        }  # fmt: skip

    @classmethod
    def from_row(cls, row: MeasuredRow) -> ConeRange:
        """Return a factor from one row with a cone."""
        assert row.cone is not None
        return cls(
            at=row.at, cov=row.cov, approach=row.approach, free_path=row.free_path, range=row.cone.range,
            half_angle=row.cone.half_angle, half_axes=row.cone.half_axes,
            max_incidence=row.cone.max_incidence, response=row.cone.response,
        )  # fmt: skip
