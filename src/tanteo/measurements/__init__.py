"""What was sensed, as the likelihood reads it: factors with labels and shared errors, and free-space rays."""

from tanteo.measurements.features import as_labelled_points
from tanteo.measurements.points import ContactPoints, as_contact_points, surface_points
from tanteo.measurements.pose_factor import PoseFactor
from tanteo.measurements.python_factor import PoseFunction, PythonFactor
from tanteo.measurements.rays import FreeRays, as_free_rays
from tanteo.measurements.sight_lines import SightLines
from tanteo.measurements.stable_poses import OnTable

__all__ = [
    "ContactPoints",
    "FreeRays",
    "OnTable",
    "PoseFactor",
    "PoseFunction",
    "PythonFactor",
    "SightLines",
    "as_contact_points",
    "as_free_rays",
    "as_labelled_points",
    "surface_points",
]
