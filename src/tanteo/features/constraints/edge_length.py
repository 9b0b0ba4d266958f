"""Compute the length of an edge between its corners with two others: (13)-(15), ``math.md`` section 4.3.

The paper adds the variances of both end points, although both were computed from the same middle edge. The missing
covariance makes the printed variance wrong by a factor from 0 to 2. Here the length is the difference of two abscissae
on that edge, with one gradient over the joint error of the three edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.errors import InputError
from tanteo.features.constraints.constraint import Constraint, ConstraintKind
from tanteo.features.constraints.intersection import intersect
from tanteo.features.constraints.relate import relate_all
from tanteo.features.constraints.relation import CONSTRAINT_KINDS
from tanteo.features.feature import Feature, collect_shared
from tanteo.geometry.typing import Covariances, FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class LengthEstimate:
    """Length of edge ``E`` between edges ``A`` and ``B``.

    Attributes:
        value: lengths ``(*batch,)`` [m].
        variance: variances ``(*batch,)`` [m^2].
        gradient: gradients over the body errors ``(e_A, e_E, e_B)`` ``(*batch, 18)``.
    """

    value: FloatArray
    variance: FloatArray
    gradient: FloatArray


def edge_length(T_A: Transforms, T_E: Transforms, T_B: Transforms, C: Covariances) -> LengthEstimate:
    """Return the length of ``E`` between its corners with ``A`` and ``B`` [m], replacing (13)-(15).

    ``A`` and ``B`` must be the *adjacent* edges: with others the end points are virtual.

    Args:
        T_A: ``T_world_edge`` of one adjacent edge ``(*batch, 4, 4)`` [m].
        T_E: ``T_world_edge`` of the measured edge.
        T_B: ``T_world_edge`` of the other adjacent edge.
        C: joint body covariance of ``(e_A, e_E, e_B)`` ``(*batch, 18, 18)``; block diagonal if independent.

    Raises:
        DegenerateError: an adjacent edge is parallel to ``E``.
    """
    zero = np.zeros((6, 6))
    start = intersect(T_A, zero, T_E, zero)
    end = intersect(T_B, zero, T_E, zero)
    difference = end.value - start.value
    sign = np.where(difference < 0, -1.0, 1.0)[..., None]
    gradient = np.concatenate([-start.g1, end.g2 - start.g2, end.g1], axis=-1) * sign
    variance = np.sum(gradient * (C @ gradient[..., None])[..., 0], axis=-1)
    return LengthEstimate(np.abs(difference), variance, gradient)


EDGE_LENGTH = ConstraintKind("edge_length", ("m",), "length of an edge between its two corners")
CONSTRAINT_KINDS[EDGE_LENGTH.name] = EDGE_LENGTH


def relate_length(edge: Feature, first: Feature, second: Feature) -> Constraint:
    """Return the length of ``edge`` between its corners with two *adjacent* edges, (13)-(15) corrected.

    Args:
        edge: measured edge.
        first: one adjacent edge.
        second: other adjacent edge.

    Raises:
        InputError: a feature is not an edge.
        DegenerateError: an adjacent edge is parallel to the edge.
    """
    features = (first, edge, second)
    for feature in features:
        if feature.kind.aspects != ("line",):
            raise InputError(f"edge length: expected three edges, got a {feature.kind.name} ({feature.label!r}).")
    _, shared, shared_jacobian = collect_shared(features)
    B = np.zeros((sum(f.kind.size for f in features), 18))
    P = np.zeros((len(B), len(B)))
    row = 0
    for k, feature in enumerate(features):
        block = slice(row, row + feature.kind.size)
        B[block, 6 * k : 6 * k + 6] = feature.kind.B
        P[block, block] = feature.P
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
    """Return whether two edges have a well-defined corner.

    ``sin(alpha) > 10 sigma`` (``math.md`` section 13, rule 4).
    """
    return bool(relate_all((edge, other)).column("edge_gap").present[0])
