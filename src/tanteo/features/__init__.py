"""Represent sensed features: vertices, edges, planes and round features, without their symmetry directions.

A feature is a frame, a kind, and a covariance of the perturbations that matter for the kind (``math.md`` section 2).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.features.feature import (
        Feature,
        Round,
        SharedError,
        SharedTerm,
        Sides,
        collect_shared,
        cross_covariance,
        feature_covariance,
        shared_root,
        stacked_covariance,
    )
    from tanteo.features.kinds import (
        CIRCLE,
        CONE,
        CYLINDER,
        EDGE,
        HALF_EDGE,
        KINDS,
        PLANE,
        SPHERE,
        VERTEX,
        FeatureKind,
        Shape,
        binding,
        feature_kind,
        register_kind,
    )
    from tanteo.features.outlines import OUTLINES, outline, outlines_off
    from tanteo.features.reframing import flip_edge, reframe, reframe_feature, reframe_near

__all__ = [
    "CIRCLE",
    "CONE",
    "CYLINDER",
    "EDGE",
    "HALF_EDGE",
    "KINDS",
    "OUTLINES",
    "PLANE",
    "SPHERE",
    "VERTEX",
    "Feature",
    "FeatureKind",
    "Round",
    "Shape",
    "SharedError",
    "SharedTerm",
    "Sides",
    "binding",
    "collect_shared",
    "cross_covariance",
    "feature_covariance",
    "feature_kind",
    "flip_edge",
    "outline",
    "outlines_off",
    "reframe",
    "reframe_feature",
    "reframe_near",
    "register_kind",
    "shared_root",
    "stacked_covariance",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "feature": (
            "Feature Round SharedError SharedTerm Sides collect_shared cross_covariance feature_covariance "
            "shared_root stacked_covariance"
        ),
        "kinds": (
            "CIRCLE CONE CYLINDER EDGE HALF_EDGE KINDS PLANE SPHERE VERTEX FeatureKind Shape binding feature_kind "
            "register_kind"
        ),
        "outlines": "OUTLINES outline outlines_off",
        "reframing": "flip_edge reframe reframe_feature reframe_near",
    },
)
