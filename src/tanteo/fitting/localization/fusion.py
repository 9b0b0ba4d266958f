"""Fusion of two estimates of one feature (``math.md`` section 6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tanteo.errors import InputError
from tanteo.features.kinds import FeatureKind
from tanteo.fitting.localization.relations import relation_between
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms


class Fused(NamedTuple):
    """Fused estimate of a feature.

    Attributes:
        T: frames ``(*batch, 4, 4)``.
        P: covariances over the kind's rows, and the size if there is one.
        chi2: test statistic of the fusion, chi-square with as many degrees of freedom as ``P`` has rows if both are the
            same feature.
        size: radius [m] or half angle [rad] ``(*batch,)``; None without sizes.
    """

    T: Transforms
    P: Covariances
    chi2: FloatArray
    size: FloatArray | None


def fuse_features(
    kind: FeatureKind,
    T1: Transforms,
    P1: Covariances,
    T2: Transforms,
    P2: Covariances,
    sizes: tuple[FloatArray, FloatArray] | None = None,
) -> Fused:
    """Update estimate 1 by estimate 2 of the same feature in one linearized step, then re-centre it.

    Args:
        kind: vertex, edge, plane, circle, cylinder, cone or sphere. Edges must point the same way.
        T1: frames ``(*batch, 4, 4)`` in one common frame.
        P1: covariances over the kind's rows, independent of ``P2``; with the size as the last row, if there are sizes,
            as :attr:`Feature.full_covariance` has it.
        T2: frames of the other estimate.
        P2: covariances of the other estimate.
        sizes: radii [m] or half angles [rad] of both ``(*batch,)``.

    Raises:
        InputError: for covariances of another size.

    Example:
        >>> one, other = (5.01e-3, np.diag([1, 1, 1, 1.0]) * 1e-10), (5.03e-3, np.diag([1, 1, 1, 3.0]) * 1e-10)
        >>> ball = tanteo.fitting.localization.fuse_features(
        ...     tanteo.features.kinds.SPHERE, np.eye(4), one[1], np.eye(4), other[1], (one[0], other[0])
        ... )
        >>> round(1e3 * float(ball.size), 6)
        5.015
    """
    rows, more = list(kind.rows), sizes is not None
    for name, P in (("P1", P1), ("P2", P2)):
        if np.shape(P)[-2:] != (kind.size + more,) * 2:
            what = f"{kind.size} rows" + (f" and one of the {kind.size_name}" if more else "")
            raise InputError(f"{name}: expected a covariance of {what} of a {kind.name}, got shape {np.shape(P)}.")
    T12 = SE3.inverse(T1) @ T2
    f, D = relation_between(kind, kind).linearize(T12, np.zeros(T12.shape[:-2]))
    G1, G2 = -(D @ SE3.adjoint_inverse(T12))[..., rows], D[..., rows]
    if sizes is not None:
        f = np.concatenate([f, np.broadcast_to(np.subtract(sizes[1], sizes[0]), f.shape[:-1])[..., None]], axis=-1)
        G1, G2 = _with_one(G1, -1.0), _with_one(G2, 1.0)
    G1t = np.swapaxes(G1, -1, -2)
    S = G1 @ P1 @ G1t + G2 @ P2 @ np.swapaxes(G2, -1, -2)
    K = np.swapaxes(np.linalg.solve(S, G1 @ P1), -1, -2)
    step = -(K @ f[..., None])[..., 0]
    xi = np.zeros((*T12.shape[:-2], 6))
    xi[..., rows] = step[..., : kind.size]
    P = P1 - K @ S @ np.swapaxes(K, -1, -2)
    chi2 = np.einsum("...i,...i->...", f, np.linalg.solve(S, f[..., None])[..., 0])
    size = None if sizes is None else np.asarray(sizes[0] + step[..., -1])
    return Fused(T1 @ SE3.exp(xi), 0.5 * (P + np.swapaxes(P, -1, -2)), chi2, size)


def _with_one(G: FloatArray, derivative: float) -> FloatArray:
    """Return derivatives with one further row and column for the size."""
    out = np.zeros((*G.shape[:-2], G.shape[-2] + 1, G.shape[-1] + 1))
    out[..., :-1, :-1], out[..., -1, -1] = G, derivative
    return out
