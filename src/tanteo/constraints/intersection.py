"""Where two edges meet, and how far they miss each other: (6)-(12), ``math.md`` sections 4.1 and 4.2.

(8) and (9) each keep one of two redundant equations; (9) is singular exactly when the z axis of the first edge is
normal to the common plane, which the paper's own coplanarity test wants. The foot of the common perpendicular is the
same number when the lines do meet, has a finite variance for every frame, and needs no choice.
"""

from __future__ import annotations

import numpy as np

from tanteo.constraints.relative import X_AXIS, ScalarEstimate, relative, scalar_estimate
from tanteo.errors import DegenerateError
from tanteo.typing import Covariances, FloatArray, Transforms, Vectors


def abscissa_partials(p: Vectors, n: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Abscissa on the second line of the foot of the common perpendicular, with its partials over ``p`` and ``n``.

    ``s = -(n_perp . p_perp) / |n_perp|^2``: (7) with both equations in least squares.
    """
    np_, pp = n * _PERP, p * _PERP
    nn = np.maximum(np.sum(np_ * np_, axis=-1), np.finfo(float).tiny)[..., None]
    s = -np.sum(np_ * pp, axis=-1, keepdims=True) / nn
    return s[..., 0], -np_ / nn, -(pp + 2 * s * np_) / nn


def gap_partials(p: Vectors, n: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Signed length of the common perpendicular along ``u1 x u2``, with its partials."""
    nn = np.maximum((n[..., 1] ** 2 + n[..., 2] ** 2), np.finfo(float).tiny)[..., None]
    sine = np.sqrt(nn)
    w = n[..., _SWAP] * _TURN / sine  # (0, -n_z, n_y) / sine
    h = (w * p).sum(axis=-1, keepdims=True)
    return h[..., 0], w, -p[..., _SWAP] * _TURN / sine - h * n * _PERP / nn


_PERP = np.array([0.0, 1.0, 1.0])
_SWAP = np.array([0, 2, 1])
_TURN = np.array([0.0, -1.0, 1.0])


def _refuse_parallel(n: Vectors, what: str) -> None:
    if np.any((n[..., 1] == 0) & (n[..., 2] == 0)):
        raise DegenerateError(
            f"{what}: expected lines that are not parallel, got a parallel pair. Use the distance of parallel edges."
        )


def intersect(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Abscissa on the second edge, from its origin, of the point nearest to the first edge [m]: replaces (9), (12).

    The abscissa on the first edge is the same call with the features exchanged.

    Raises:
        DegenerateError: for exactly parallel lines. It is trustworthy for ``sin(alpha) > 10 sigma_alpha``.
    """
    pair = relative(T1, T2)
    n = pair.R[..., :, 0]
    _refuse_parallel(n, "edge intersection")
    s, q, r = abscissa_partials(pair.p, n)
    return scalar_estimate(pair, X_AXIS, s, (q, r), (C1, C2, C12))


def gap_edges(
    T1: Transforms, C1: Covariances, T2: Transforms, C2: Covariances, C12: FloatArray | None = None
) -> ScalarEstimate:
    """Signed distance between two skew lines along ``u1 x u2`` [m]: zero if the edges are coplanar.

    Tests coplanarity when no plane was sensed: ``value^2 / variance`` is chi-square with one degree of freedom.

    Raises:
        DegenerateError: for exactly parallel lines, which are always coplanar.
    """
    pair = relative(T1, T2)
    n = pair.R[..., :, 0]
    _refuse_parallel(n, "gap of edges")
    h, q, r = gap_partials(pair.p, n)
    return scalar_estimate(pair, X_AXIS, h, (q, r), (C1, C2, C12))
