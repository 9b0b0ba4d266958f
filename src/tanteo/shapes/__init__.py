"""Queries on a triangle mesh: closest points, inside or outside, rays.

Wraps libigl (double precision) and Embree (single precision, hits refined in double). Everything is in the
frame of the mesh and in metres; points carry leading batch axes.
"""

from tanteo.shapes.field import DistanceField, distance_field, signed_distance
from tanteo.shapes.surface import ClosestPoints, RayHits, Surface

__all__ = ["ClosestPoints", "DistanceField", "RayHits", "Surface", "distance_field", "signed_distance"]
