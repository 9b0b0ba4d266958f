"""Test a pattern of centres against a model pattern at any pose: the joint test of points (``math.md`` section 4.8).

The distances between n points have a singular covariance for five or more points (four in a plane), and accept mirror
images. The residual of the coordinates after the best rigid motion is the Mahalanobis distance of a complete set of
constraints that do not depend on the pose (section 9), chi-square with ``3 n - 6`` degrees of freedom.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tanteo.errors import InputError
from tanteo.features.constraints.joint import JointTest, joint_test
from tanteo.features.feature import Feature, collect_shared
from tanteo.geometry import SE3, SO3, maximize
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors

_PASSES = 20


def relate_pattern(features: Sequence[Feature], model: Vectors) -> JointTest:
    """Test whether centres (or vertices) match those of a model, in the given order, up to one rigid motion.

    A mirror image is a different pattern, except in a plane: a planar pattern equals its mirror image turned over, and
    only the axes of its holes separate the two.

    Args:
        features: two or more circles, spheres, cones or vertices; shared errors are treated exactly.
        model: the same points of the model ``(n, 3)`` [m], in any frame.

    Returns:
        Joint test. ``dof`` is ``3 n - 6``, or ``3 n - 5`` for collinear points; ``xi`` is the remaining left motion
        ``(v, w)`` of the model about the mean of the sensed points, which is zero.

    Raises:
        InputError: there are fewer than two features, a feature has no centre, or the number of points differs.

    Example:
        >>> holes = [
        ...     tanteo.fitting.given_round(tanteo.features.kinds.CIRCLE, c, 1e-5, label="h")
        ...     for c in ([0, 0, 0], [0.04, 0, 0], [0, 0.03, 0])
        ... ]
        >>> test = tanteo.features.relate_pattern(holes, [[0, 0, 0.1], [0, 0.04, 0.1], [-0.03, 0, 0.1]])
        >>> test.dof, test.p_value > 0.99
        (3, True)
    """
    points = np.asarray(model, dtype=np.float64)
    if len(features) < 2 or points.shape != (len(features), 3) or not np.isfinite(points).all():
        raise InputError(
            f"pattern: expected two or more features and as many finite points of the model, got {len(features)} and "
            f"an array of shape {points.shape}."
        )
    for feature in features:
        if not {0, 1, 2} <= set(feature.kind.rows):
            raise InputError(
                f"pattern: expected features with a centre, got a {feature.kind.name} ({feature.label!r})."
            )
    sensed = np.stack([feature.T_world_feature[:3, 3] for feature in features])
    S = _covariance(features)
    middle = sensed.mean(axis=0)
    whiten = np.linalg.inv(np.linalg.cholesky(S))

    def linearize(T: Transforms) -> tuple[FloatArray, FloatArray]:
        placed = SE3.apply(T, points)
        G = whiten @ _by_motion(placed - middle)
        return G.T @ G, -G.T @ (whiten @ (sensed - placed).ravel())

    def moved(T: Transforms, step: FloatArray) -> Transforms:
        return SE3.exp(np.r_[step[:3] + np.cross(middle, step[3:]), step[3:]]) @ T

    placed = SE3.apply(maximize(_first(sensed, points), linearize, moved, _PASSES)[0], points)
    return joint_test((sensed - placed).ravel(), _by_motion(placed - middle), S)


def _by_motion(arms: Vectors) -> FloatArray:
    """Return the derivative of ``sensed - placed`` by a motion of the model about the mean ``(3 n, 6)``."""
    return -np.concatenate([np.broadcast_to(np.eye(3), (len(arms), 3, 3)), -SO3.hat(arms)], axis=-1).reshape(-1, 6)


def _covariance(features: Sequence[Feature]) -> Covariances:
    """Return the covariance of all centres in the world ``(3 n, 3 n)``, with shared errors."""
    n = len(features)
    _, C, gains = collect_shared(features)
    S = np.zeros((n, 3, n, 3))
    A = np.zeros((n, 3, C.shape[0]))
    for k, (feature, gain) in enumerate(zip(features, gains, strict=True)):
        rows = [feature.kind.rows.index(i) for i in range(3)]
        R = feature.T_world_feature[:3, :3]
        S[k, :, k] = R @ feature.P[np.ix_(rows, rows)] @ R.T
        A[k] = R @ gain[rows]
    flat = A.reshape(3 * n, -1)
    return S.reshape(3 * n, 3 * n) + flat @ C @ flat.T


def _first(sensed: Vectors, model: Vectors) -> FloatArray:
    """Return the least-squares rigid motion (Procrustes problem by SVD, Umeyama 1991)."""
    a = model - model.mean(axis=0)
    b = sensed - sensed.mean(axis=0)
    U, _, Vt = np.linalg.svd(b.T @ a)
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return SE3.from_parts(R, sensed.mean(axis=0) - R @ model.mean(axis=0))
