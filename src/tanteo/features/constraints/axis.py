"""Compute constraints of axes of cylinders, cones and circles.

Angles, distances, coaxiality, perpendicularity to planes.

An axis is a line, so the formulas are those of edges (``math.md`` sections 4.1 to 4.6), with three differences: an axis
has no direction, so angles are from 0 to pi/2; it has no corner; and it is often normal to a plane (section 4.8).
"""

from __future__ import annotations

from functools import partial

import numpy as np

from tanteo.features.constraints.angle import NEARLY_PARALLEL, angle_bias_of, edge_plane_partials
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.gates import chi2_limit
from tanteo.features.constraints.intersection import fill_crossing
from tanteo.features.constraints.parallel import (
    PARALLEL_ALPHA,
    condition_on_parallel,
    fill_lines,
    parallel_pairs,
    sign_of,
)
from tanteo.features.constraints.point import length_of
from tanteo.features.constraints.relation import RESOLUTION, PairGroup, PairRelation, register_relation
from tanteo.features.constraints.relative import X_AXIS
from tanteo.features.kinds import Shape
from tanteo.geometry.typing import FloatArray, Vectors

_FOLDED = "the value is within 2 sigma of where its sign is lost (a right angle, or zero)."


def _crossing(of: str, meaning: str) -> tuple[ConstraintKind, ConstraintKind]:
    return (
        ConstraintKind(f"{of}_angle", ("rad",), f"angle of {meaning}, undirected, 0 to pi/2"),
        ConstraintKind(f"{of}_gap", ("m",), f"shortest distance of {meaning} that cross"),
    )


def _cut_crossing(kinds: tuple[ConstraintKind, ConstraintKind], group: PairGroup) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    sd = np.sqrt(group.S[:, 0, 0])
    sine = np.sqrt(group.b[:, 1] ** 2 + group.b[:, 2] ** 2)
    obtuse = value[:, :1] > np.pi / 2
    angle = np.where(obtuse, np.pi - value[:, :1], value[:, :1])
    right = np.pi / 2 - angle[:, 0] < 2 * sd
    gap_sd = np.sqrt(S[:, 1, 1])
    return [
        group.column(
            kinds[0],
            angle,
            S[:, :1, :1],
            sine > 5 * sd + RESOLUTION,
            NEARLY_PARALLEL,
            (right, _FOLDED),
            bias=lambda: np.where(obtuse, -1.0, 1.0) * angle_bias_of(group, X_AXIS),
        ),
        group.column(
            kinds[1],
            np.abs(value[:, 1:]),
            S[:, 1:, 1:],
            sine > 10 * sd + RESOLUTION,
            "the axes are parallel within 10 sigma, so they have no common perpendicular of their own.",
            (np.abs(value[:, 1]) < 2 * gap_sd, _FOLDED),
        ),
    ]


def _beside(of: str, together: str, meaning: str) -> tuple[ConstraintKind, ConstraintKind, ConstraintKind]:
    return (
        ConstraintKind(f"{of}_parallelism", ("rad", "rad"), f"tilts between {meaning}", null=True),
        ConstraintKind(f"{of}_distance", ("m",), f"distance of {meaning} that are parallel"),
        ConstraintKind(together, ("rad", "rad", "m", "m"), f"tilts and offsets of {meaning} on one line", null=True),
    )


def _cut_beside(
    kinds: tuple[ConstraintKind, ConstraintKind, ConstraintKind], group: PairGroup
) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    parallel = parallel_pairs(group)
    distance, variance, across = length_of(*condition_on_parallel(value[:, :2], value[:, 2:], S))
    apart = distance > 3 * np.sqrt(across)
    bias = (across / (2 * np.where(apart, distance, 1.0)))[:, None]
    reason = (
        f"the axes are not parallel, or nearer than 3 sigma, where the distance is not normal: see {kinds[2].name}."
    )
    return [
        group.column(kinds[0], value[:, :2], S[:, :2, :2]),
        group.column(kinds[1], distance[:, None], variance[:, None, None], parallel & apart, reason, bias=bias),
        group.column(kinds[2], value, S, parallel, f"the axes are not parallel (rejected at {PARALLEL_ALPHA:g})."),
    ]


def _register(shapes: tuple[Shape, Shape], of: str, together: str, meaning: str) -> None:
    crossing = _crossing(of, meaning)
    beside = _beside(of, together, meaning)
    register_relation(PairRelation(crossing, shapes, 2, fill_crossing, partial(_cut_crossing, crossing)))
    register_relation(PairRelation(beside, shapes, 4, fill_lines, partial(_cut_beside, beside)))


_register(("axis", "axis"), "axis", "coaxiality", "two axes")
_register(("line", "axis"), "edge_axis", "edge_axis_collinearity", "an edge and an axis")

AXIS_PLANE_ANGLE = ConstraintKind("axis_plane_angle", ("rad",), "rise of an axis over a plane, 0 to pi/2")
AXIS_PERPENDICULARITY = ConstraintKind(
    "axis_perpendicularity", ("rad", "rad"), "tilts of an axis against the normal of a plane", null=True
)
AXIS_PLANE_DISTANCE = ConstraintKind("axis_plane_distance", ("m",), "height of an axis over a plane parallel to it")


def _fill_plane_axis(p: Vectors, n: Vectors, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Fill the rows elevation, two tilts against the normal, sine of the elevation, height."""
    value[:, 0], _, r[:, 0] = edge_plane_partials(n)
    sign = sign_of(n[:, 2])
    value[:, 1:3] = n[:, :2] * sign[:, None]
    r[:, 1, 0] = r[:, 2, 1] = sign
    value[:, 3], value[:, 4] = n[:, 2], p[:, 2]
    r[:, 3, 2] = q[:, 4, 2] = 1.0


def _cut_plane_axis(group: PairGroup) -> list[ConstraintColumn]:
    value = group.value
    S = group.S
    rise = np.abs(value[:, :1])
    sd = np.sqrt(S[:, 0, 0])
    upright = np.cos(rise[:, 0]) > 5 * sd + RESOLUTION
    tilt = S[:, 3, 3] + RESOLUTION**2
    along = value[:, 3] ** 2 <= chi2_limit(PARALLEL_ALPHA) * tilt
    height = value[:, 4] - S[:, 4, 3] * value[:, 3] / tilt
    variance = S[:, 4, 4] - S[:, 4, 3] ** 2 / tilt
    return [
        group.column(
            AXIS_PLANE_ANGLE,
            rise,
            S[:, :1, :1],
            upright,
            "the axis is normal to the plane within 5 sigma, where the angle has no valid variance: see "
            f"{AXIS_PERPENDICULARITY.name}.",
            (rise[:, 0] < 2 * sd, _FOLDED),
        ),
        group.column(AXIS_PERPENDICULARITY, value[:, 1:3], S[:, 1:3, 1:3]),
        group.column(
            AXIS_PLANE_DISTANCE,
            height[:, None],
            variance[:, None, None],
            along,
            f"the axis is not parallel to the plane (rejected at {PARALLEL_ALPHA:g}), so it has no one distance.",
        ),
    ]


_OF_PLANES = AXIS_PLANE_ANGLE, AXIS_PERPENDICULARITY, AXIS_PLANE_DISTANCE
register_relation(PairRelation(_OF_PLANES, ("plane", "axis"), 5, _fill_plane_axis, _cut_plane_axis))
