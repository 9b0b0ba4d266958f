"""The compiled core: shapes, the likelihood of measurements, and what climbs, proposes and samples on it.

Arrays in, arrays out, all float64 or int32, C-contiguous, metres and radians. ``inference`` calls it, and
``active`` for what readings are expected to tell.
"""

from tanteo._core.native import (
    Problem,
    Shape,
    climb,
    closest_points,
    details,
    distinct,
    first_hits,
    group_information,
    log_densities,
    make_problem,
    make_shape,
    marginals,
    mixture,
    offsets,
    open_shape,
    place,
    propose,
    scores,
    settle,
    slopes,
    version,
)

__all__ = [
    "Problem",
    "Shape",
    "climb",
    "closest_points",
    "details",
    "distinct",
    "first_hits",
    "group_information",
    "log_densities",
    "make_problem",
    "make_shape",
    "marginals",
    "mixture",
    "offsets",
    "open_shape",
    "place",
    "propose",
    "scores",
    "settle",
    "slopes",
    "version",
]
