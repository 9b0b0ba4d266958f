"""Centres of round features: of circles on the axis of a hole or boss, of spheres, and apexes of cones.

The part has them as landmarks, rows of :func:`tanteo.factors.landmarks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from tanteo.factors.factor import Factor, FeaturePart, Landmark, MeasuredRow, SensedDirection, SensedSize
from tanteo.features import Feature
from tanteo.geometry.typing import FloatArray, Vectors
from tanteo.parts import Part
from tanteo.parts.faces import centred_faces

MADE = 1e-4
"""Standard deviation of a made radius against its CAD [m]: threads are modelled as plain holes (decision 70)."""

MADE_ANGLE = 0.01
"""Standard deviation of a made half angle of a cone against its CAD [rad] (decision 70)."""

_DECADES = 2.0
"""Decades of sizes that round features of an unknown object have."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class RoundCentre(Factor):
    """Point that is the centre of a round feature, or on its axis; ``normal`` is the sensed axis.

    Attributes:
        sensed_size: sensed radius or half angle; None if unknown.
        second_size: a second sensed size, such as the radius of a torus's tube; None if unknown.
        material_side: 1 for a hole, -1 for a boss, 0 if unknown.
        axis_offset: distance along the axis from the landmark to the sensed place [m].
        is_line: whether the feature is an axis, on which a centre may be at any height.
        size_is_angle: whether the size is an angle.
    """

    on_surface: ClassVar[bool] = False
    is_line: ClassVar[bool] = False
    size_is_angle: ClassVar[bool] = False
    sensed_size: SensedSize | None = None
    second_size: SensedSize | None = None
    material_side: int = 0
    axis_offset: float = 0.0

    @property
    def landmark(self) -> Vectors:
        """Return the measured place of the part ``(3,)`` [m]."""
        if self.normal is None or not self.axis_offset:
            return self.at
        return np.asarray(self.at - self.axis_offset * self.normal.direction)

    def log_outlier(self, radius: float) -> float:
        """Return the log density of an outlier: place uniform in the workspace, sizes log-uniform.

        On a line only the two coordinates across it are measured, so the place is uniform in a disc.

        Args:
            radius: radius of the ball of the workspace [m].
        """
        log = super(RoundCentre, self).log_outlier(radius) + (np.log(4 / 3 * radius) if self.is_line else 0.0)
        for size in (self.sensed_size, self.second_size):
            if size is not None:
                log -= np.log(_DECADES * np.log(10) * size.value)
        return float(log)

    def columns(self) -> dict[str, Any]:
        """Return sizes, side of the material and offset along the axis; 0 for what was not sensed."""
        size, other = self.sensed_size, self.second_size
        return {
            "sizes": 0.0 if size is None else size.value,
            "size_sds": 0.0 if size is None else size.sd,
            "others": 0.0 if other is None else other.value,
            "other_sds": 0.0 if other is None else other.sd,
            "material_sides": self.material_side,
            "offsets": self.axis_offset,
        }

    @classmethod
    def from_row(cls, row: MeasuredRow) -> Self:
        """Return a factor from one row of measurements; the approach of the device carries no information."""
        size = None
        if row.size is not None:
            sd = float(np.sqrt(np.linalg.eigvalsh(row.cov)[-1]))
            size = SensedSize(row.size, MADE_ANGLE if cls.size_is_angle else float(np.hypot(sd, MADE)))
        return cls(at=row.at, cov=row.cov, normal=row.normal, sensed_size=size, material_side=row.material_side)


def second_size_of(feature: Feature, made: float) -> SensedSize | None:
    """Return the second sensed size of a round feature, with the tolerance of manufacture; None if it has none."""
    size = feature.second_size
    return None if size is None else SensedSize(size.value, float(np.hypot(np.sqrt(size.variance), made)))


def size_of(feature: Feature, made: float) -> tuple[SensedSize | None, int]:
    """Return the sensed size of a round feature, with the tolerance of manufacture, and the side of its material.

    Args:
        feature: a sensed circle, cylinder, cone, sphere or torus.
        made: standard deviation of the made size [m], or [rad] for a cone.

    Returns:
        The size, None if unknown; and 1 for a hole, -1 for a boss, 0 if unknown.
    """
    size = feature.size
    if size is None:
        return None, 0
    side = 0 if size.convex is None else (-1 if size.convex else 1)
    return SensedSize(size.value, float(np.hypot(np.sqrt(size.variance), made))), side


def centre_of(cls: type[RoundCentre], feature: Feature, jacobian: FloatArray, made: float) -> FeaturePart:
    """Return the factor of a sensed centre, with its axis and size if it has them.

    Args:
        cls: class of the factor.
        feature: a sensed circle, cone, sphere or torus; the first three rows of its perturbation are its place.
        jacobian: derivative of its perturbations by the whitened shared errors ``(size, D)``.
        made: standard deviation of the made size [m], or [rad] for a cone.
    """
    T, P = feature.T_world_feature, feature.P
    R, axis = T[:3, :3], None
    if feature.kind.axis is not None:
        axis = SensedDirection(R[:, feature.kind.axis], float(np.sqrt(np.linalg.eigvalsh(P[3:, 3:])[-1])))
    size, side = size_of(feature, made)
    factor = cls(
        at=T[:3, 3], cov=R @ P[:3, :3] @ R.T, normal=axis, sensed_size=size, material_side=side,
        second_size=second_size_of(feature, made),
    )  # fmt: skip
    return [(factor, R @ jacobian[:3])]


def point_landmarks(part: Part, surface: str) -> list[Landmark]:
    """Return the centres of the faces of a part on one kind of surface, each as probable as any other.

    Args:
        part: the part.
        surface: kind of surface: ``'sphere'``, ``'cone'`` or ``'torus'``.
    """
    faces = [one for one in centred_faces(part) if one.surface == surface]
    return [
        Landmark(
            np.stack([one.centre, one.centre + one.axis]), (one.size, one.size), 1 / len(faces), one.hole, number,
            part.faces[one.face].name,
        )
        for number, one in enumerate(faces)
    ]  # fmt: skip
