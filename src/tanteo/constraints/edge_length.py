"""Length of an edge between the corners it makes with two others: (13)-(15), ``math.md`` section 4.3.

The paper adds the variances of both end points, although both were computed from the same middle edge; the missing
term makes the printed variance wrong by a factor from 0 to 2. Here the length is the difference of two abscissae on
that edge, with one gradient over the joint error of the three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.constraints.intersection import intersect
from tanteo.typing import Covariances, FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class LengthEstimate:
    """Length of edge ``E`` between edges ``A`` and ``B``.

    Attributes:
        value: ``(*batch,)`` [m].
        variance: ``(*batch,)``.
        gradient: over ``(e_A, e_E, e_B)`` ``(*batch, 18)``.
    """

    value: FloatArray
    variance: FloatArray
    gradient: FloatArray


def edge_length(T_A: Transforms, T_E: Transforms, T_B: Transforms, C: Covariances) -> LengthEstimate:
    """Length of ``E`` between its corners with ``A`` and ``B`` [m], replacing (13)-(15).

    ``A`` and ``B`` must be the *adjacent* edges: with others the end points are virtual.

    Args:
        T_A: ``T_world_edge`` of one neighbour ``(*batch, 4, 4)``.
        T_E: of the measured edge.
        T_B: of the other neighbour.
        C: joint body covariance of ``(e_A, e_E, e_B)`` ``(*batch, 18, 18)``; block diagonal if independent.

    Raises:
        DegenerateError: if a neighbour is parallel to ``E``.
    """
    zero = np.zeros((6, 6))
    start, end = intersect(T_A, zero, T_E, zero), intersect(T_B, zero, T_E, zero)
    difference = end.value - start.value
    sign = np.where(difference < 0, -1.0, 1.0)[..., None]
    gradient = np.concatenate([-start.g1, end.g2 - start.g2, end.g1], axis=-1) * sign
    variance = np.sum(gradient * (C @ gradient[..., None])[..., 0], axis=-1)
    return LengthEstimate(np.abs(difference), variance, gradient)
