"""Values with partial derivatives for pairs of each shape, and the columns of constraints cut from them.

``FILL`` writes values and partials into the rows of one group of pairs before the common propagation; ``CUT`` reads
values and covariances after it, and decides which constraints each pair has.
"""

from __future__ import annotations

from functools import partial

import numpy as np

from tanteo.constraints import constraint as kinds
from tanteo.constraints.angle import angle_partials, edge_plane_partials
from tanteo.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.constraints.group import (
    PARALLEL_ALPHA,
    RESOLUTION,
    Group,
    angle_bias_of,
    bent_pairs,
    length_of,
    parallel_pairs,
)
from tanteo.constraints.intersection import gap_partials
from tanteo.constraints.parallel import condition_on_parallel, sign_of
from tanteo.typing import BoolArray, FloatArray

_NEARLY_PARALLEL = "the directions are parallel within 5 sigma, where the angle has no valid variance: see parallelism."
_NOT_PARALLEL = f"the pair is not parallel (rejected at {PARALLEL_ALPHA:g}), so it has no one distance."
_NO_CORNER = "the lines are parallel within 10 sigma, so they have no common perpendicular of their own."


def _fill_planes(p: FloatArray, a: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Rows: angle, two tilts, offset."""
    value[:, 0], _, r[:, 0] = angle_partials(a, 2)
    sign = sign_of(a[:, 2])
    value[:, 1:3] = a[:, :2] * sign[:, None]
    value[:, 3] = p[:, 2]
    r[:, 1, 0] = r[:, 2, 1] = sign
    q[:, 3, 2] = 1.0


def _cut_planes(group: Group) -> list[ConstraintColumn]:
    value, S = group.value, group.S
    bent, parallel = bent_pairs(group, 0), parallel_pairs(group, 1)
    offset, variance = condition_on_parallel(value[:, 1:3], value[:, 3:4], S[:, 1:4, 1:4])
    return [
        group.column(
            kinds.PLANE_ANGLE, value[:, :1], S[:, :1, :1], bent, _NEARLY_PARALLEL, bias=partial(angle_bias_of, group, 2)
        ),
        group.column(kinds.PLANE_PARALLELISM, value[:, 1:3], S[:, 1:3, 1:3]),
        group.column(kinds.PLANE_OFFSET, offset, variance, parallel, _NOT_PARALLEL),
    ]


def _fill_plane_line(p: FloatArray, n: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Rows: height, rise, angle."""
    value[:, 0], value[:, 1] = p[:, 2], n[:, 2]
    q[:, 0, 2] = r[:, 1, 2] = 1.0
    value[:, 2], _, r[:, 2] = edge_plane_partials(n)


def _cut_plane_line(group: Group) -> list[ConstraintColumn]:
    value, S = group.value, group.S
    angle, variance = np.abs(value[:, 2:3]), S[:, 2:3, 2:3]
    sd = np.sqrt(variance[:, 0, 0])
    upright = np.cos(angle[:, 0]) > 5 * sd + RESOLUTION
    folded = angle[:, 0] < 2 * sd
    return [
        group.column(kinds.EDGE_PLANE_COPLANARITY, value[:, :2], S[:, :2, :2]),
        group.column(
            kinds.EDGE_PLANE_ANGLE,
            angle,
            variance,
            upright,
            "the edge is normal to the plane within 5 sigma, where the angle has no valid variance.",
            (folded, "the angle is within 2 sigma of zero, where its sign is lost: test coplanarity instead."),
        ),
    ]


def _fill_lines(p: FloatArray, n: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Rows: angle, two tilts, two offsets, gap."""
    value[:, 0], _, r[:, 0] = angle_partials(n, 0)
    sign = sign_of(n[:, 0])
    value[:, 1:3] = n[:, 1:] * sign[:, None]
    r[:, 1, 1] = r[:, 2, 2] = sign
    value[:, 3:5] = p[:, 1:]
    q[:, 3, 1] = q[:, 4, 2] = 1.0
    value[:, 5], q[:, 5], r[:, 5] = gap_partials(p, n)


def _cut_lines(group: Group) -> list[ConstraintColumn]:
    value, S = group.value, group.S
    sd = np.sqrt(S[:, 0, 0])
    sine = np.sqrt(value[:, 1] ** 2 + value[:, 2] ** 2)
    corner = sine > 10 * sd + RESOLUTION
    parallel = parallel_pairs(group, 1)
    offset, offset_S = condition_on_parallel(value[:, 1:3], value[:, 3:5], S[:, 1:5, 1:5])
    distance, variance, across = length_of(offset, offset_S)
    apart = distance > 3 * np.sqrt(across)
    angle, unsure = _away(group, np.sqrt(S[:, 5, 5]) + 1e-12, np.where(sine > 0, sine, 1.0))
    return [
        group.column(
            kinds.EDGE_ANGLE,
            angle,
            S[:, :1, :1],
            sine > 5 * sd + RESOLUTION,
            _NEARLY_PARALLEL,
            (unsure, "the corner lies among the sensed points of an edge: the angle may be its supplement."),
            bias=lambda: np.where(angle != value[:, :1], -1.0, 1.0) * angle_bias_of(group, 0),
        ),
        group.column(kinds.EDGE_GAP, value[:, 5:6], S[:, 5:6, 5:6], corner, _NO_CORNER),
        group.column(kinds.EDGE_PARALLELISM, value[:, 1:3], S[:, 1:3, 1:3]),
        group.column(
            kinds.EDGE_DISTANCE,
            distance[:, None],
            variance[:, None, None],
            parallel & apart,
            "the edges are not parallel, or nearer than 3 sigma, where the distance is not normal: see collinearity.",
            bias=(across / (2 * np.where(apart, distance, 1.0)))[:, None],
        ),
        group.column(
            kinds.EDGE_COLLINEARITY,
            value[:, 1:5],
            S[:, 1:5, 1:5],
            parallel & ~apart,
            "the edges are not parallel, or clearly apart.",
        ),
    ]


def _away(group: Group, sd: FloatArray, sine: FloatArray) -> tuple[FloatArray, BoolArray]:
    """The angle with both directions pointing away from the corner, and where a direction cannot be told."""
    plan, part = group.plan, group.part
    p, n, slide = group.pair.p[part], group.b[part], group.pair.slide[part, 0]
    s2 = -(p[:, 1] * n[:, 1] + p[:, 2] * n[:, 2]) / (sine * sine)  # abscissae of the feet, as in intersection.py
    s = np.empty((group.n, 2))
    s[:, 0], s[:, 1] = p[:, 0] + s2 * n[:, 0], s2 + slide
    extent = group.arrays.extent[plan.pairs[part]]
    margin = (3 * sd / sine)[:, None]
    inside = (s >= extent[..., 0] - margin) & (s <= extent[..., 2] + margin)
    turned = (s > extent[..., 1]).sum(axis=1) == 1
    angle = group.value[:, 0]
    return np.where(turned, np.pi - angle, angle)[:, None], np.asarray(inside.any(axis=1))


def _fill_plane_point(p: FloatArray, n: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Row: height."""
    value[:, 0], q[:, 0, 2] = p[:, 2], 1.0


def _cut_plane_point(group: Group) -> list[ConstraintColumn]:
    return [group.column(kinds.POINT_PLANE_HEIGHT, group.value[:, :1], group.S[:, :1, :1])]


def _fill_line_point(p: FloatArray, n: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Rows: two offsets."""
    value[:, :2] = p[:, 1:]
    q[:, 0, 1] = q[:, 1, 2] = 1.0


def _fill_points(p: FloatArray, n: FloatArray, value: FloatArray, q: FloatArray, r: FloatArray) -> None:
    """Rows: the three offsets."""
    value[:, :3] = p
    q[:, 0, 0] = q[:, 1, 1] = q[:, 2, 2] = 1.0


def _cut_offsets(kind: ConstraintKind, rows: int, sigmas: float, group: Group) -> list[ConstraintColumn]:
    value, variance, across = length_of(group.value[:, :rows], group.S[:, :rows, :rows])
    clear = value > sigmas * np.sqrt(across / (rows - 1))
    reason = f"the distance is below {sigmas:g} sigma, where it is not normal: the features touch, as far as is known."
    bias = across / (2 * np.where(clear, value, 1.0))
    return [group.column(kind, value[:, None], variance[:, None, None], clear, reason, bias=bias[:, None])]


def _cut_line_point(group: Group) -> list[ConstraintColumn]:
    return _cut_offsets(kinds.POINT_EDGE_DISTANCE, 2, 3.0, group)


def _cut_points(group: Group) -> list[ConstraintColumn]:
    return _cut_offsets(kinds.POINT_DISTANCE, 3, 5.0, group)


FILL = {
    (0, 0): _fill_planes,
    (0, 1): _fill_plane_line,
    (1, 1): _fill_lines,
    (0, 2): _fill_plane_point,
    (1, 2): _fill_line_point,
    (2, 2): _fill_points,
}
CUT = {
    (0, 0): _cut_planes,
    (0, 1): _cut_plane_line,
    (1, 1): _cut_lines,
    (0, 2): _cut_plane_point,
    (1, 2): _cut_line_point,
    (2, 2): _cut_points,
}
