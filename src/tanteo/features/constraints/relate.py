"""Compute all constraints between features, as array operations over their pairs.

One pass computes the relative geometry of all pairs, their values with partial derivatives, and one covariance per
pair; the columns of the table are slices of it. Features are first re-framed halfway to each other (``math.md`` section
13), and shared errors cancel exactly.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.features.constraints.constraint import Constraint, ConstraintColumn, ConstraintTable
from tanteo.features.constraints.relation import PAIR_RELATIONS, PairGroup, PairRelation
from tanteo.features.constraints.relative import Relative, pull_back, slide_to_middle
from tanteo.features.constraints.stacking import FeatureArrays, PairPlan, pair_plan, propagate_pairs, stack_features
from tanteo.features.feature import Feature
from tanteo.geometry.typing import FloatArray


def relate_all(features: Sequence[Feature]) -> ConstraintTable:
    """Return all pairwise constraints of some features, with covariances (section 4 of the paper).

    Args:
        features: sensed or model features. A circle or cone has constraints as an axis and as a centre (apex). Model
            features may have zero ``P``.

    Returns:
        One column of arrays per kind. Pairs without a constraint (an angle of parallel edges, a distance of coincident
        ones) are marked, and :meth:`ConstraintTable.absent` gives the reason.
    """
    aspects = tuple([(k, shape) for k, feature in enumerate(features) for shape in feature.kind.aspects])
    plan = pair_plan(aspects)
    labels = tuple([feature.label or str(k) for k, feature in enumerate(features)])
    if not plan.groups:
        return ConstraintTable(labels, ())
    arrays = stack_features(features, aspects)
    pair, b = _geometry(arrays, plan)
    blocks = _blocks(plan)
    n = len(plan.first)
    rows = max((block.stop for _, _, block in blocks), default=0)
    value = np.zeros((n, rows))
    q = np.zeros((n, rows, 3))
    r = np.zeros((n, rows, 3))
    for part, relation, block in blocks:
        relation.fill(pair.p[part], b[part], value[part, block], q[part, block], r[part, block])
    g1, g2 = pull_back(pair, plan.axis_hats, q, r)
    S = propagate_pairs(arrays, plan, g1, g2)
    columns: list[ConstraintColumn] = []
    for part, relation, block in blocks:
        geometry = Relative(pair.R[part], pair.p[part], pair.slide[part])
        group = PairGroup(plan.pairs[part], geometry, b[part], value[part, block], S[part, block, block], arrays)
        columns += relation.cut(group)
    return ConstraintTable(labels, tuple(columns))


def _blocks(plan: PairPlan) -> list[tuple[slice, PairRelation, slice]]:
    """Return every relation with its slice of the pairs, and its slice of the value rows."""
    blocks = []
    for shapes, part in plan.groups.items():
        start = 0
        for relation in PAIR_RELATIONS[shapes]:
            blocks.append((part, relation, slice(start, start + relation.rows)))
            start += relation.rows
    return blocks


def relate(first: Feature, second: Feature) -> tuple[Constraint, ...]:
    """Return the constraints of two features; a plane precedes an edge, an edge precedes a vertex.

    Args:
        first: one feature.
        second: other feature.
    """
    return tuple(relate_all((first, second)))


def _geometry(arrays: FeatureArrays, plan: PairPlan) -> tuple[Relative, FloatArray]:
    """Return the relative geometry of all pairs, re-framed to the middle, and the second axis in the first frame."""
    R1 = arrays.R[plan.first]
    R2 = arrays.R[plan.second]
    gap = arrays.c[plan.second] - arrays.c[plan.first]
    p = (gap[:, None] @ R1)[:, 0]
    pair = slide_to_middle(Relative(R1.swapaxes(1, 2) @ R2, p, p), plan.free)
    return pair, (pair.R @ plan.axis)[..., 0]
