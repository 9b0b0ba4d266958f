"""All that some features say about each other, as array programs over their pairs.

One pass computes the relative geometry of all pairs, their values with partial derivatives, and one covariance per
pair; the columns of the table are cut from it. Features are re-framed halfway to each other first (``math.md``
section 13), and errors that they share cancel exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.constraints.columns import CUT, FILL
from tanteo.constraints.constraint import EDGE_LENGTH, Constraint, ConstraintColumn, ConstraintTable
from tanteo.constraints.edge_length import edge_length
from tanteo.constraints.group import Group
from tanteo.constraints.relative import Relative, pull_back, slide_to_middle
from tanteo.constraints.stacking import FeatureArrays, PairPlan, pair_plan, propagate_pairs, shapes_of, stack_features
from tanteo.errors import InputError
from tanteo.features import Feature, collect_shared
from tanteo.typing import FloatArray


def relate_all(features: Sequence[Feature]) -> ConstraintTable:
    """All pairwise constraints of some features, with covariances (section 4 of the paper).

    Args:
        features: sensed or model features; cones and circles are passed over. Model features may have zero ``P``.

    Returns:
        One column of arrays per kind. Pairs that do not have a constraint (parallel where an angle is asked, coincident
        where a distance is) are marked, and :meth:`ConstraintTable.absent` gives the reason.
    """
    shapes = shapes_of(features)
    plan = pair_plan(shapes)
    labels = tuple([feature.label or str(k) for k, feature in enumerate(features)])
    if not plan.groups:
        return ConstraintTable(labels, ())
    arrays = stack_features(features, shapes)
    pair, b = _geometry(arrays, plan)
    n = len(plan.first)
    value, q, r = np.zeros((n, plan.rows)), np.zeros((n, plan.rows, 3)), np.zeros((n, plan.rows, 3))
    for shape, part in plan.groups.items():
        FILL[shape](pair.p[part], b[part], value[part], q[part], r[part])
    g1, g2 = pull_back(pair, plan.axis_hats, q, r)
    S = propagate_pairs(arrays, plan, g1, g2)
    columns: list[ConstraintColumn] = []
    for shape, part in plan.groups.items():
        columns += CUT[shape](Group(arrays, plan, part, pair, b, value[part], S[part]))
    return ConstraintTable(labels, tuple(columns))


def relate(first: Feature, second: Feature) -> tuple[Constraint, ...]:
    """The constraints of two features; a plane is named before an edge, an edge before a vertex."""
    return tuple(relate_all((first, second)))


def relate_length(edge: Feature, first: Feature, second: Feature) -> Constraint:
    """Length of ``edge`` between its corners with two *adjacent* edges, (13)-(15) corrected.

    Raises:
        InputError: if one of them is no edge.
        DegenerateError: if a neighbour is parallel to the edge.
    """
    features = (first, edge, second)
    for feature in features:
        if feature.kind.name not in ("edge", "half_edge"):
            raise InputError(f"edge length: expected three edges, got a {feature.kind.name} ({feature.label!r}).")
    _, shared, shared_jacobian = collect_shared(features)
    B = np.zeros((sum(f.kind.size for f in features), 18))
    P = np.zeros((len(B), len(B)))
    row = 0
    for k, feature in enumerate(features):
        block = slice(row, row + feature.kind.size)
        B[block, 6 * k : 6 * k + 6], P[block, block] = feature.kind.B, feature.P
        row = block.stop
    T_A, T_E, T_B = (feature.T_world_feature for feature in features)
    length = edge_length(T_A, T_E, T_B, np.zeros((18, 18)))
    g = length.gradient @ B.T
    common = g @ np.concatenate(shared_jacobian)
    variance = np.asarray(g @ P @ g + common @ shared @ common).reshape(1, 1)
    labels = (edge.label, first.label, second.label)
    shallow = [f.label for f in (first, second) if not _meets(edge, f)]
    caution = (
        f"{' and '.join(shallow)}: parallel to the edge within 10 sigma, the corner is not known." if shallow else ""
    )
    return Constraint(EDGE_LENGTH, labels, np.reshape(length.value, 1), variance, np.zeros(1), caution)


def _meets(edge: Feature, other: Feature) -> bool:
    """Whether two edges have a corner to speak of: ``sin(alpha) > 10 sigma`` (``math.md`` section 13, rule 4)."""
    return bool(relate_all((edge, other)).column("edge_gap").present[0])


def _geometry(arrays: FeatureArrays, plan: PairPlan) -> tuple[Relative, FloatArray]:
    """Relative geometry of all pairs, slid to the middle, and the second axis in the first frame."""
    R1, R2 = arrays.R[plan.first], arrays.R[plan.second]
    gap = arrays.c[plan.second] - arrays.c[plan.first]
    p = (gap[:, None] @ R1)[:, 0]
    pair = slide_to_middle(Relative(R1.swapaxes(1, 2) @ R2, p, p), plan.free)
    return pair, (pair.R @ plan.axis)[..., 0]
