"""Compute constraints of centres of circles and spheres and apexes of cones: distances and concentricity.

A centre is a point, so the formulas are those of vertices (``math.md`` sections 4.3 and 12). A distance too short to be
normally distributed is absent; its offset vector is tested instead, with its own degrees of freedom (section 4.8).
"""

from __future__ import annotations

from functools import partial

from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.point import cut_distance, fill_height, fill_line_offsets, fill_offsets
from tanteo.features.constraints.relation import PairGroup, PairRelation, register_relation

CENTRE_PLANE_HEIGHT = ConstraintKind("centre_plane_height", ("m",), "height of a centre over a plane, signed")
CENTRE_EDGE_DISTANCE = ConstraintKind("centre_edge_distance", ("m",), "distance of a centre from an edge")
CENTRE_AXIS_DISTANCE = ConstraintKind("centre_axis_distance", ("m",), "distance of a centre from another axis")
CENTRE_ON_AXIS = ConstraintKind("centre_on_axis", ("m", "m"), "offsets of a centre from an axis through it", null=True)
VERTEX_AXIS_DISTANCE = ConstraintKind("vertex_axis_distance", ("m",), "distance of a vertex from an axis")
CENTRE_VERTEX_DISTANCE = ConstraintKind("centre_vertex_distance", ("m",), "distance of a centre from a vertex")
CENTRE_DISTANCE = ConstraintKind("centre_distance", ("m",), "distance of two centres")
CONCENTRICITY = ConstraintKind("concentricity", ("m", "m", "m"), "offsets of one centre from another at it", null=True)


def _cut_height(group: PairGroup) -> list[ConstraintColumn]:
    return [group.column(CENTRE_PLANE_HEIGHT, group.value, group.S)]


def _cut_apart(
    kind: ConstraintKind, together: ConstraintKind, sigmas: float, group: PairGroup
) -> list[ConstraintColumn]:
    """Return the distance where it is clearly positive, and the test that it is zero."""
    (distance,) = cut_distance(kind, sigmas, group)
    return [distance, group.column(together, group.value, group.S)]


register_relation(PairRelation((CENTRE_PLANE_HEIGHT,), ("plane", "centre"), 1, fill_height, _cut_height))
_EDGE = partial(cut_distance, CENTRE_EDGE_DISTANCE, 3.0)
_VERTEX = partial(cut_distance, VERTEX_AXIS_DISTANCE, 3.0)
register_relation(PairRelation((CENTRE_EDGE_DISTANCE,), ("line", "centre"), 2, fill_line_offsets, _EDGE))
register_relation(PairRelation((VERTEX_AXIS_DISTANCE,), ("axis", "point"), 2, fill_line_offsets, _VERTEX))
register_relation(
    PairRelation(
        (CENTRE_AXIS_DISTANCE, CENTRE_ON_AXIS),
        ("axis", "centre"),
        2,
        fill_line_offsets,
        partial(_cut_apart, CENTRE_AXIS_DISTANCE, CENTRE_ON_AXIS, 3.0),
    )
)
register_relation(
    PairRelation(
        (CENTRE_VERTEX_DISTANCE,),
        ("point", "centre"),
        3,
        fill_offsets,
        partial(cut_distance, CENTRE_VERTEX_DISTANCE, 5.0),
    )
)
register_relation(
    PairRelation(
        (CENTRE_DISTANCE, CONCENTRICITY),
        ("centre", "centre"),
        3,
        fill_offsets,
        partial(_cut_apart, CENTRE_DISTANCE, CONCENTRICITY, 5.0),
    )
)
