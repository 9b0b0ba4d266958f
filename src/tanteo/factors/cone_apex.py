"""Apex of a cone, or a point of its axis at a known offset; the axis points into the cone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tanteo.factors.factor import FeaturePart, Landmark, register_factor
from tanteo.factors.round_centre import MADE_ANGLE, RoundCentre, centre_of, point_landmarks, size_of
from tanteo.features import Feature
from tanteo.features.kinds import CONE
from tanteo.geometry import SE3
from tanteo.geometry.typing import FloatArray
from tanteo.parts import Part


@register_factor("apex")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ConeApex(RoundCentre):
    """Apex of a cone, or a point of its axis at a known offset; the axis points into the cone."""

    core: ClassVar[str] = "cone_apex"
    codimension: ClassVar[int] = 3
    size_is_angle: ClassVar[bool] = True
    feature_kinds: ClassVar[tuple[str, ...]] = (CONE.name,)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return the point of the axis whose error is independent of the direction's, with its offset from the apex."""
        feature = view[0]
        tilts = feature.P[3:, 3:]
        s = max(
            float((feature.P[1, 3] - feature.P[0, 4]) / np.trace(tilts)), 0.0
        )  # there the place is x + s wy, y - s wx
        J = np.eye(5)
        J[0, 4], J[1, 3] = s, -s
        at = feature.T_world_feature @ SE3.from_parts(np.eye(3), np.array([0, 0, s]))
        there = replace(feature, T_world_feature=at, P=J @ feature.P @ J.T, size=None)
        ((factor, own),) = centre_of(cls, there, J @ jacobian, MADE_ANGLE)
        size, side = size_of(feature, MADE_ANGLE)
        apex = cls(
            at=factor.at, cov=factor.cov, normal=factor.normal, sensed_size=size, material_side=side, axis_offset=s
        )
        return [(apex, own)]

    @classmethod
    def landmarks(cls, part: Part) -> list[Landmark]:
        """Return the apexes of cones, each as probable as any other."""
        return point_landmarks(part, "cone")
