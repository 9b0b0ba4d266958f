"""From points to sensed features: vertices, edges, planes and round features with covariance (paper section 3).

``fit_*`` turn labelled points into a :class:`~tanteo.features.Feature` and a :class:`FitReport`; ``*_ml`` are their
array cores over batches. This room has never heard of parts.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from tanteo.lazy import lazy

if TYPE_CHECKING:
    from tanteo.fitting.derived import (
        edge_from_planes,
        edge_from_two_points,
        intersect_planes,
        plane_from_two_directions,
    )
    from tanteo.fitting.edge import edge_ml, fit_edge
    from tanteo.fitting.estimate import Estimate, FitReport, SharedReadings
    from tanteo.fitting.fits import FITS, Fit, LabelledPoints, fitted, register_fit
    from tanteo.fitting.given import given_round, with_known_size
    from tanteo.fitting.labelled import LabelledFeatures, fit_labelled
    from tanteo.fitting.on_plane import circle_on_plane, with_named_errors
    from tanteo.fitting.plane import fit_plane, plane_ml
    from tanteo.fitting.round_estimate import RoundEstimate, round_ml
    from tanteo.fitting.round_fit import fit_round
    from tanteo.fitting.round_refusal import arc_of, observable
    from tanteo.fitting.spread import (
        edge_direction_covariance,
        plane_displacement_covariance,
        plane_normal_covariance,
    )
    from tanteo.fitting.vertex import Corner, fit_vertex, intersect_edges, intersect_lines, vertex_ml

__all__ = [
    "FITS",
    "Corner",
    "Estimate",
    "Fit",
    "FitReport",
    "LabelledFeatures",
    "LabelledPoints",
    "RoundEstimate",
    "SharedReadings",
    "arc_of",
    "circle_on_plane",
    "edge_direction_covariance",
    "edge_from_planes",
    "edge_from_two_points",
    "edge_ml",
    "fit_edge",
    "fit_labelled",
    "fit_plane",
    "fit_round",
    "fit_vertex",
    "fitted",
    "given_round",
    "intersect_edges",
    "intersect_lines",
    "intersect_planes",
    "observable",
    "plane_displacement_covariance",
    "plane_from_two_directions",
    "plane_ml",
    "plane_normal_covariance",
    "register_fit",
    "round_ml",
    "vertex_ml",
    "with_known_size",
    "with_named_errors",
]

__getattr__: Callable[[str], Any]
__dir__: Callable[[], list[str]]
__getattr__, __dir__ = lazy(
    __name__,
    {
        "on_plane": "circle_on_plane with_named_errors",
        "derived": "edge_from_planes edge_from_two_points intersect_planes plane_from_two_directions",
        "edge": "edge_ml fit_edge",
        "estimate": "Estimate FitReport SharedReadings",
        "fits": "FITS Fit LabelledPoints fitted register_fit",
        "given": "given_round with_known_size",
        "labelled": "LabelledFeatures fit_labelled",
        "plane": "fit_plane plane_ml",
        "round_fit": "fit_round",
        "round_estimate": "RoundEstimate round_ml",
        "round_refusal": "arc_of observable",
        "spread": "edge_direction_covariance plane_displacement_covariance plane_normal_covariance",
        "vertex": "Corner fit_vertex intersect_edges intersect_lines vertex_ml",
    },
)
