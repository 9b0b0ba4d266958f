"""Points sensed on a straight edge of the part, and sensed edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.factors.factor import FeaturePart, register_factor
from tanteo.factors.line_points import line_points
from tanteo.factors.on_surface import OnSurface
from tanteo.features import Feature
from tanteo.features.kinds import EDGE
from tanteo.geometry.typing import FloatArray


@register_factor("edge")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class EdgePoint(OnSurface):
    """Point on a straight edge: normal density about the edge, uniform along it."""

    core: ClassVar[str] = "edge_point"
    codimension: ClassVar[int] = 2
    feature_kinds: ClassVar[tuple[str, ...]] = (EDGE.name,)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return two points of the edge with the information of the edge, about the place of least variance."""
        points, cov, jacobians = line_points(view[0], view[0].T_world_feature, jacobian)
        return [(cls(at=point, cov=cov), own) for point, own in zip(points, jacobians, strict=True)]
