"""Query a triangle mesh: closest points, inside or outside, rays, borders of faces, and exact surfaces.

The package wraps libigl (double precision) and Embree (single precision, hits refined in double). All data is in the
mesh frame in metres; points have leading batch axes.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
