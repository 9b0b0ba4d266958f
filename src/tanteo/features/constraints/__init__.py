"""Compute constraints between features with their variances (section 4 of the paper) and test them (section 5).

``relate`` and ``relate_all`` compute the constraints of features. The functions named after a constraint are the
underlying array functions, over batches of frames and covariances. ``published`` has the paper's formulas as printed.
"""

# each module registers its relations
from tanteo.features.constraints import angle as angle  # each registers its relations
from tanteo.features.constraints import axis as axis
from tanteo.features.constraints import centre as centre
from tanteo.features.constraints import coplanarity as coplanarity
from tanteo.features.constraints import intersection as intersection
from tanteo.features.constraints import joint as joint
from tanteo.features.constraints import parallel as parallel
from tanteo.features.constraints import point as point
from tanteo.features.constraints import published as published
from tanteo.features.constraints.constraint import ConstraintColumn, ConstraintKind
from tanteo.features.constraints.relation import (
    CONSTRAINT_KINDS,
    PAIR_RELATIONS,
    PairGroup,
    PairRelation,
    register_relation,
)
from tanteo.features.constraints.relative import VectorEstimate

__all__ = [
    "CONSTRAINT_KINDS",
    "PAIR_RELATIONS",
    "ConstraintColumn",
    "ConstraintKind",
    "PairGroup",
    "PairRelation",
    "VectorEstimate",
    "angle",
    "joint",
    "point",
    "published",
    "register_relation",
]
