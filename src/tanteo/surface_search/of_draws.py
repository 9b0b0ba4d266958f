"""Modes of weighted draws: their moments, which maxima are one, whether the density is that of the curvature."""

from __future__ import annotations

import numpy as np

from tanteo.lie import SE3
from tanteo.surface_search.moments import Moments
from tanteo.typing import Covariances, FloatArray, Tangents, Transforms

ONE = 9.0
"""Squared Mahalanobis distance within which a maximum belongs to a larger mode."""

_NORMAL, _OFF = 0.25, 2.0
"""Root mean square by which a log density that is believed to be normal may differ; most that one draw counts."""

_USED = 1e-3
"""Draws that weigh less than this beside the heaviest say nothing of that."""


def second_moments(x: Tangents, w: FloatArray) -> Covariances:
    """Mean squares and products ``(6, 6)`` of perturbations ``(S, 6)`` with weights ``(S,)``, about no perturbation."""
    return np.asarray(np.einsum("s,si,sk->ik", w / w.sum(), x, x))


def moments_of(x: Tangents, w: FloatArray, z: FloatArray, spreads: FloatArray, root: FloatArray) -> Moments:
    """Moments about a maximum; given the shared errors, what they explain of the pose is taken off.

    As if there were one draw more with the covariance of the curvature there: a few draws span no space of six.

    Args:
        x: draws as perturbations of the maximum ``(S, 6)``.
        w: their weights ``(S,)``.
        z: whitened shared errors that are expected there, less those at the maximum ``(S, D)``.
        spreads: covariances about them ``(S, D, D)``.
        root: of the covariance by the curvature ``(6, 6)``.
    """
    share, C = w / w.sum(), second_moments(x, w)
    given = C
    if z.shape[1]:
        cross = np.einsum("s,si,sk->ik", share, x, z)
        spread = np.einsum("s,si,sk->ik", share, z, z) + np.einsum("s,sik->ik", share, spreads)
        given = C - cross @ np.linalg.solve(spread, cross.T)
    one = float(np.sum(share**2) / (1 + np.sum(share**2)))  # of it and all draws
    curvature = one * root @ root.T
    return Moments((1 - one) * share @ x, (1 - one) * C + curvature, (1 - one) * given + curvature, 0.0)


def gaps(T: Transforms, others: Transforms, C: Covariances) -> FloatArray:
    """Squared Mahalanobis distances of other poses ``(S, 4, 4)`` from one with these second moments ``(6, 6)``."""
    x = SE3.log(SE3.inverse(T) @ others)
    s = np.sqrt(np.maximum(np.diag(C), 1e-300))
    x = x / s
    return np.asarray(np.sum(x * np.linalg.lstsq(C / np.outer(s, s), x.T, rcond=1e-9)[0].T, axis=1))


def is_normal(off: FloatArray, w: FloatArray) -> bool:
    """Whether a log density is normal at draws with weights ``w``, off whose curvature it is by ``off``, both ``(S,)``.

    A draw that differs by more than two counts as one that differs by this: a stray's tail is no other shape.
    """
    used = w > _USED * w.max()
    return bool(np.sqrt(np.average(np.clip(off[used], -_OFF, _OFF) ** 2, weights=w[used])) < _NORMAL)
