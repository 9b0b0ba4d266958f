"""What was sensed, as the likelihood reads it: one file a kind, arrays in the world frame, metres and radians."""

from tanteo.measurements.features import TO_POINTS, FeaturePoints, ToPoints, as_labelled_points
from tanteo.measurements.points import ContactPoints, as_contact_points, directions_met, is_round
from tanteo.measurements.pose_factor import PoseFactor
from tanteo.measurements.rays import FreeRays, as_free_rays
from tanteo.measurements.stable_poses import OnTable

__all__ = [
    "TO_POINTS",
    "ContactPoints",
    "FeaturePoints",
    "FreeRays",
    "OnTable",
    "PoseFactor",
    "ToPoints",
    "as_contact_points",
    "as_free_rays",
    "as_labelled_points",
    "directions_met",
    "is_round",
]
