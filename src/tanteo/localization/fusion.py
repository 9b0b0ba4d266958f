"""Two estimates of one feature become one (``math.md`` section 6)."""

from __future__ import annotations

import numpy as np

from tanteo.features import FeatureKind
from tanteo.lie import SE3
from tanteo.localization.relations import relation_between
from tanteo.typing import Covariances, FloatArray, Transforms


def fuse_features(
    kind: FeatureKind, T1: Transforms, P1: Covariances, T2: Transforms, P2: Covariances
) -> tuple[Transforms, Covariances, FloatArray]:
    """One linearized update of estimate 1 by estimate 2 of the same feature, then re-centring.

    Args:
        kind: vertex, edge, plane, circle, cylinder or sphere. Edges must point the same way.
        T1: frames ``(*batch, 4, 4)`` in one common frame.
        P1: covariances over the kind's rows, independent of ``P2``.
        T2: frames of the other estimate.
        P2: its covariances.

    Returns:
        Fused frame, fused covariance, and the merge statistic, chi-square of ``kind.size`` degrees of freedom if both
        are the same feature.
    """
    T12 = SE3.inverse(T1) @ T2
    f, D = relation_between(kind, kind).linearize(T12, np.zeros(T12.shape[:-2]))
    rows = list(kind.rows)
    G1, G2 = -(D @ SE3.adjoint_inverse(T12))[..., rows], D[..., rows]
    G1t = np.swapaxes(G1, -1, -2)
    S = G1 @ P1 @ G1t + G2 @ P2 @ np.swapaxes(G2, -1, -2)
    K = np.swapaxes(np.linalg.solve(S, G1 @ P1), -1, -2)
    xi = np.zeros((*T12.shape[:-2], 6))
    xi[..., rows] = -(K @ f[..., None])[..., 0]
    P = P1 - K @ S @ np.swapaxes(K, -1, -2)
    chi2 = np.einsum("...i,...i->...", f, np.linalg.solve(S, f[..., None])[..., 0])
    return T1 @ SE3.exp(xi), 0.5 * (P + np.swapaxes(P, -1, -2)), chi2
