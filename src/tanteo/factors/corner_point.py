"""Points sensed on a corner of the part, and sensed vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tanteo.factors.factor import FeaturePart, register_factor
from tanteo.factors.on_surface import OnSurface
from tanteo.features import Feature
from tanteo.features.kinds import VERTEX
from tanteo.geometry.typing import FloatArray


@register_factor("vertex")
@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CornerPoint(OnSurface):
    """Point on a corner: normal density about it; all corners are equally probable."""

    core: ClassVar[str] = "corner_point"
    codimension: ClassVar[int] = 3
    feature_kinds: ClassVar[tuple[str, ...]] = (VERTEX.name,)

    @classmethod
    def from_feature(cls, view: tuple[Feature, ...], name: str, jacobian: FloatArray) -> FeaturePart:
        """Return one factor: the vertex with its covariance."""
        T, R = view[0].T_world_feature, view[0].T_world_feature[:3, :3]
        return [(cls(at=T[:3, 3], cov=R @ view[0].P @ R.T), R @ jacobian)]
