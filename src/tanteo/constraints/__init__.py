"""Compute constraints between features with their variances (section 4 of the paper) and test them (section 5).

``relate`` and ``relate_all`` compute the constraints of features. The functions named after a constraint are the
underlying array functions, over batches of frames and covariances. ``published`` has the paper's formulas as printed.
"""

from tanteo.constraints import published
from tanteo.constraints.angle import (
    angle_bias,
    angle_edge_plane,
    angle_edges,
    angle_planes,
    away_from_corner,
    signed_angle,
)
from tanteo.constraints.axis import AXIS_PERPENDICULARITY, AXIS_PLANE_ANGLE, AXIS_PLANE_DISTANCE
from tanteo.constraints.centre import CENTRE_DISTANCE, CENTRE_ON_AXIS, CONCENTRICITY
from tanteo.constraints.constraint import (
    AbsentConstraint,
    Constraint,
    ConstraintColumn,
    ConstraintKind,
    ConstraintTable,
)
from tanteo.constraints.coplanarity import coplanarity, height_and_pitch
from tanteo.constraints.edge_length import LengthEstimate, edge_length, relate_length
from tanteo.constraints.gates import (
    Gate,
    chi2_limit,
    chi2_p_value,
    chi2_statistic,
    gate,
    joint_gate,
    sidak,
)
from tanteo.constraints.intersection import gap_edges, intersect
from tanteo.constraints.joint import JointTest, joint_test, joint_update, laplace_log_evidence, whitened_test
from tanteo.constraints.parallel import ParallelEstimate, collinearity, parallel_edges, parallel_planes
from tanteo.constraints.pattern import relate_pattern
from tanteo.constraints.point import DistanceEstimate, point_distance, point_edge_distance, point_plane_distance
from tanteo.constraints.relate import relate, relate_all
from tanteo.constraints.relation import CONSTRAINT_KINDS, PAIR_RELATIONS, PairGroup, PairRelation, register_relation
from tanteo.constraints.relative import Relative, ScalarEstimate, VectorEstimate, relative
from tanteo.constraints.size import HALF_ANGLE, RADIUS, relate_size

__all__ = [
    "AXIS_PERPENDICULARITY",
    "AXIS_PLANE_ANGLE",
    "AXIS_PLANE_DISTANCE",
    "CENTRE_DISTANCE",
    "CENTRE_ON_AXIS",
    "CONCENTRICITY",
    "CONSTRAINT_KINDS",
    "HALF_ANGLE",
    "PAIR_RELATIONS",
    "RADIUS",
    "AbsentConstraint",
    "Constraint",
    "ConstraintColumn",
    "ConstraintKind",
    "ConstraintTable",
    "DistanceEstimate",
    "Gate",
    "JointTest",
    "LengthEstimate",
    "PairGroup",
    "PairRelation",
    "ParallelEstimate",
    "Relative",
    "ScalarEstimate",
    "VectorEstimate",
    "angle_bias",
    "angle_edge_plane",
    "angle_edges",
    "angle_planes",
    "away_from_corner",
    "chi2_limit",
    "chi2_p_value",
    "chi2_statistic",
    "collinearity",
    "coplanarity",
    "edge_length",
    "gap_edges",
    "gate",
    "height_and_pitch",
    "intersect",
    "joint_gate",
    "joint_test",
    "joint_update",
    "laplace_log_evidence",
    "parallel_edges",
    "parallel_planes",
    "point_distance",
    "point_edge_distance",
    "point_plane_distance",
    "published",
    "register_relation",
    "relate",
    "relate_all",
    "relate_length",
    "relate_pattern",
    "relate_size",
    "relative",
    "sidak",
    "signed_angle",
    "whitened_test",
]
