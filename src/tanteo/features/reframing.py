"""Move a feature's frame along its own symmetry, which changes the numbers but not the feature."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.errors import InputError
from tanteo.features.feature import Feature, SharedTerm
from tanteo.features.kinds import EDGE, FeatureKind
from tanteo.geometry import SE3
from tanteo.geometry.typing import Covariances, FloatArray, Transforms, Vectors


def reframe_shared_jacobian(kind: FeatureKind, S: Transforms) -> FloatArray:
    """Return ``A = B Ad(S^-1) B'`` ``(*batch, size, size)`` with ``p' = A p``, exact for ``S`` in the symmetry group.

    Args:
        kind: kind of the feature.
        S: motions in the feature frame ``(*batch, 4, 4)``.
    """
    rows = list(kind.rows)
    Ad = SE3.adjoint_inverse(np.asarray(S, dtype=np.float64))
    return Ad[..., rows, :][..., :, rows]


def reframe(kind: FeatureKind, T: Transforms, P: Covariances, S: Transforms) -> tuple[Transforms, Covariances]:
    """Return the frame ``T S`` and its covariance, for ``S`` in the symmetry group of the kind (``math.md`` section 2).

    Args:
        kind: kind of the feature.
        T: frames ``(*batch, 4, 4)`` [m].
        P: covariances over the kind's rows ``(*batch, size, size)``.
        S: motions in the feature frame along its free directions, or one of its discrete symmetries ``(*batch, 4, 4)``.

    Raises:
        InputError: ``S`` moves the feature itself.
    """
    S = np.asarray(S, dtype=np.float64)
    if not any(_leaves(kind, F @ S) for F in kind.symmetries):
        raise InputError(f"S: expected a motion that maps a {kind.name} onto itself, got one that moves it.")
    A = reframe_shared_jacobian(kind, S)
    return T @ S, A @ P @ np.swapaxes(A, -1, -2)


def _leaves(kind: FeatureKind, S: Transforms) -> bool:
    """Return whether ``S`` is in the continuous symmetry group, which maps free directions onto themselves."""
    p = SE3.translation(S)
    R = SE3.rotation(S)
    fixed = [i for i in kind.rows if i < 3]
    off_origin = np.abs(p[..., fixed]).max(initial=0.0) > 1e-9 * (1 + np.abs(p).max(initial=0.0))
    turns = [i - 3 for i in kind.free if i >= 3]
    if len(turns) == 3:
        return not off_origin
    axis = np.eye(3)[turns[0]] if turns else None
    wanted = R[..., :, turns[0]] - axis if axis is not None else R - np.eye(3)
    return not off_origin and float(np.abs(wanted).max(initial=0.0)) < 1e-9


def flip_edge(T: Transforms) -> Transforms:
    """Return the frame of an undirected edge after a half turn about its z axis.

    Args:
        T: frames ``(*batch, 4, 4)``.
    """
    return T @ EDGE.symmetries[1]


def reframe_feature(feature: Feature, S: Transforms) -> Feature:
    """Return the same feature with its frame moved by ``S`` along its symmetry, including its shared terms.

    Args:
        feature: sensed feature.
        S: motion in the feature frame ``(4, 4)``.

    Raises:
        InputError: ``S`` moves the feature itself.
    """
    T, P = reframe(feature.kind, feature.T_world_feature, feature.P, S)
    A = reframe_shared_jacobian(feature.kind, S)
    shared = tuple(SharedTerm(term.error, A @ term.jacobian) for term in feature.shared)
    size = feature.size
    if size is not None and len(size.covariance):  # the size does not change, only its covariance with the frame
        size = replace(size, covariance=A @ size.covariance)
    return replace(feature, T_world_feature=T, P=P, shared=shared, size=size)


def reframe_near(feature: Feature, point: Vectors) -> Feature:
    """Return the same line or plane with its origin at the foot of a point; other features are returned unchanged.

    Use this before pairwise constraints, because second-order terms grow with the distance between origins.

    Args:
        feature: sensed feature.
        point: point in the world ``(3,)`` [m].
    """
    free = [i for i in feature.kind.free if i < 3]
    if not free:
        return feature
    local = SE3.apply(SE3.inverse(feature.T_world_feature), np.asarray(point, dtype=np.float64))
    slide = np.eye(4)
    slide[free, 3] = local[free]
    return reframe_feature(feature, slide)
