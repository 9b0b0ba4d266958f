"""Query a triangle mesh: closest points, inside or outside, rays, borders of faces, and exact surfaces.

The package wraps libigl (double precision) and Embree (single precision, hits refined in double). All data is in the
mesh frame in metres; points have leading batch axes.
"""

from tanteo.shapes.borders import Borders, borders
from tanteo.shapes.field import DistanceField, as_signed, ball_contact, distance_field, signed_distance
from tanteo.shapes.junctions import SHARP, Junctions
from tanteo.shapes.near_planes import NearPlanes, near_planes, nearest
from tanteo.shapes.revolved import Profiles, Revolved, revolved
from tanteo.shapes.surface import ClosestPoints, RayHits, Surface

__all__ = [
    "SHARP",
    "Borders",
    "ClosestPoints",
    "DistanceField",
    "Junctions",
    "NearPlanes",
    "Profiles",
    "RayHits",
    "Revolved",
    "Surface",
    "as_signed",
    "ball_contact",
    "borders",
    "distance_field",
    "near_planes",
    "nearest",
    "revolved",
    "signed_distance",
]
