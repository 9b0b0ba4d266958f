"""Query a triangle mesh: closest points, inside or outside, rays, borders of faces, and exact surfaces.

The package wraps libigl (double precision) and Embree (single precision, hits refined in double). All data is in the
mesh frame in metres; points have leading batch axes.
"""
