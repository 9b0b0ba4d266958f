"""Points sensed on a face of the part, and sensed planes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tanteo.errors import InputError
from tanteo.factors.cone_range import ConeRange
from tanteo.factors.factor import Factor, FeaturePart, SensedDirection, register_factor
from tanteo.factors.on_surface import OnSurface
from tanteo.factors.plane_points import equivalent_points, typical_residuals
from tanteo.features import Feature
from tanteo.features.kinds import PLANE
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray


@register_factor("point", "plane")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SurfacePoint(OnSurface):
    """Point of a face: its density is the integral of its noise over the faces of the part (decision 16)."""

    core: ClassVar[str] = "surface_point"
    codimension: ClassVar[int] = 1
    flat_face: ClassVar[bool] = True
    feature_kinds: ClassVar[tuple[str, ...]] = (PLANE.name,)
    wide_beam: ClassVar[type[Factor] | None] = ConeRange

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return points that together have the plane's covariance; one point with its normal if no such points exist.

        Raises:
            InputError: a plane of unknown side that was not sensed at points that spread.
        """
        feature, sided = view[0], len(view) == 1
        T, tip = feature.T_world_feature, feature.tip_radius
        local = SE3.apply(SE3.inverse(T), feature.support)[:, :2]
        normal, levers = T[:3, 2], np.column_stack([np.ones(len(local)), local[:, 1], -local[:, 0]])
        rows, variances = equivalent_points(levers, feature.P)
        if len(rows):
            heights = np.sqrt(variances) * typical_residuals(levers[rows] / np.sqrt(variances)[:, None])
            points = SE3.apply(T, np.column_stack([local[rows], heights]))
            radius = tip if sided else 0.0
            return [
                (
                    cls(
                        at=point + radius * normal, cov=variance * np.eye(3), ball_radius=radius,
                        outward=normal if sided else None,
                    ),
                    normal[:, None] * (lever @ jacobian),
                )
                for point, variance, lever in zip(points, variances, levers[rows], strict=True)
            ]  # fmt: skip
        if not sided:
            raise InputError(
                f"plane {name!r}: expected the points where it was sensed (support), spread as far as its tilts are "
                "known well, because its outward side is unknown. Give them, or the side."
            )
        x, y = local.mean(axis=0) if len(local) else np.zeros(2)
        lever = np.array([1.0, y, -x])
        tilt = float(np.sqrt(np.linalg.eigvalsh(feature.P[1:, 1:])[-1]))
        point = SE3.apply(T, np.array([x, y, 0.0])) + tip * normal
        cov = float(lever @ feature.P @ lever) * np.eye(3)
        factor = cls(at=point, cov=cov, ball_radius=tip, normal=SensedDirection(normal, tilt))
        return [(factor, normal[:, None] * (lever @ jacobian))]


@register_factor("circle", "cylinder", "cone", "sphere")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class WallPoint(OnSurface):
    """Point of a face that is not flat: the wall of a hole or boss, a cone or a sphere."""

    core: ClassVar[str] = "surface_point"
    codimension: ClassVar[int] = 1
    round_face: ClassVar[bool] = True
