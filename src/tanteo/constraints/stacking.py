"""A set of features as arrays, and which pairs of them have which constraints; what :mod:`relate` works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from tanteo.constraints.relative import AXIS_HATS
from tanteo.features import Feature, Shape, collect_shared
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

MEETINGS: tuple[tuple[Shape, Shape], ...] = (
    ("plane", "plane"),
    ("plane", "line"),
    ("line", "line"),
    ("plane", "point"),
    ("line", "point"),
    ("point", "point"),
)
"""Pairs of shapes, the first one first."""
_ORDER: dict[Shape, int] = {"plane": 0, "line": 1, "point": 2}
_AXIS: dict[Shape, int] = {"plane": 2, "line": 0, "point": 0}
_FREE: dict[Shape, tuple[float, float, float]] = {
    "plane": (1.0, 1.0, 0.0),
    "line": (1.0, 0.0, 0.0),
    "point": (0.0, 0.0, 0.0),
}


@dataclass(frozen=True, slots=True, eq=False)
class PairPlan:
    """Which features meet, sorted by the shapes of both; depends on the kinds only, so it is kept.

    Attributes:
        first: index of the first feature of each pair ``(N,)``; planes come before lines before points.
        second: of the second.
        pairs: both ``(N, 2)``.
        groups: for each pair of shapes, its slice of the pairs.
        axis_hats: ``[e]x`` of the second feature's axis ``(N, 3, 3)``.
        axis: that axis as a unit vector of its own frame ``(N, 3, 1)``.
        free: directions along which the second origin may slide to the middle ``(N, 3)``.
    """

    first: IntArray
    second: IntArray
    pairs: IntArray
    groups: dict[tuple[Shape, Shape], slice]
    axis_hats: FloatArray
    axis: FloatArray
    free: FloatArray


@lru_cache(maxsize=256)
def pair_plan(shapes: tuple[Shape | None, ...]) -> PairPlan:
    """The pairs of features of those shapes; of none with a feature that has no shape."""
    meetings: dict[tuple[Shape, Shape], list[tuple[int, int]]] = {key: [] for key in MEETINGS}
    shaped = [(i, shape) for i, shape in enumerate(shapes) if shape is not None]
    for one, other in combinations(shaped, 2):
        (a, first), (b, second) = (one, other) if _ORDER[one[1]] <= _ORDER[other[1]] else (other, one)
        meetings[first, second].append((a, b))
    groups: dict[tuple[Shape, Shape], slice] = {}
    pairs: list[tuple[int, int]] = []
    keys: list[tuple[Shape, Shape]] = []
    for key, members in meetings.items():
        if members:
            groups[key] = slice(len(pairs), len(pairs) + len(members))
            pairs += members
            keys += [key] * len(members)
    index = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    axes = np.array([_AXIS[b] for _, b in keys], dtype=np.int64)
    free = np.array([_FREE[a] if a == b else (0.0, 0.0, 0.0) for a, b in keys]).reshape(-1, 3)
    return PairPlan(
        np.ascontiguousarray(index[:, 0]),
        np.ascontiguousarray(index[:, 1]),
        index,
        groups,
        AXIS_HATS[axes],
        np.eye(3)[axes][..., None],
        free,
    )


@dataclass(frozen=True, slots=True, eq=False)
class FeatureArrays:
    """Some features, stacked.

    Attributes:
        R: rotations ``(n, 3, 3)``.
        c: origins in the world ``(n, 3)`` [m].
        C: independent body covariances ``(n, 6, 6)``.
        shared_jacobian: ``B' A`` of each feature on all shared errors ``(n, 6, D)``; none if nothing is shared.
        shared: covariance of the shared errors ``(D, D)``.
        extent: for lines, least, mean and greatest abscissa of the sensed points ``(n, 3)`` [m].
    """

    R: FloatArray
    c: Vectors
    C: Covariances
    shared_jacobian: FloatArray | None
    shared: Covariances
    extent: FloatArray


def stack_features(features: Sequence[Feature], shapes: tuple[Shape | None, ...]) -> FeatureArrays:
    """Copy frames, covariances and shared errors of some features into arrays."""
    n = len(features)
    T = np.array([feature.T_world_feature for feature in features]).reshape(n, 4, 4)
    C = np.zeros((n, 6, 6))
    for k, feature in enumerate(features):
        C[k][_block(feature.kind.rows)] = feature.P
    shared_jacobian, shared = None, np.zeros((0, 0))
    if any(feature.shared for feature in features):
        _, shared, rows = collect_shared(features)
        shared_jacobian = np.zeros((n, 6, len(shared)))
        for k, (feature, A) in enumerate(zip(features, rows, strict=True)):
            shared_jacobian[k, feature.kind.rows] = A
    R, c = T[:, :3, :3], T[:, :3, 3]
    return FeatureArrays(R, c, C, shared_jacobian, shared, _extents(features, shapes, R, c))


@lru_cache(maxsize=64)
def _block(rows: tuple[int, ...]) -> tuple[IntArray, IntArray]:
    """Index of the square block of those rows, kept: building it costs as much as using it."""
    index = np.array(rows, dtype=np.int64)
    return index[:, None], index


def _extents(features: Sequence[Feature], shapes: tuple[Shape | None, ...], R: FloatArray, c: Vectors) -> FloatArray:
    extent = np.zeros((len(features), 3))
    lines = [k for k, shape in enumerate(shapes) if shape == "line" and len(features[k].support)]
    if not lines:
        return extent  # origins are the centroids, as fitting leaves them
    supports = [features[k].support for k in lines]
    counts = np.array([len(s) for s in supports])
    starts = np.cumsum(counts) - counts
    owner = np.repeat(lines, counts)
    t = np.einsum("ij,ij->i", np.concatenate(supports) - c[owner], R[owner, :, 0])
    extent[lines, 0] = np.minimum.reduceat(t, starts)
    extent[lines, 1] = np.add.reduceat(t, starts) / counts
    extent[lines, 2] = np.maximum.reduceat(t, starts)
    return extent


def propagate_pairs(arrays: FeatureArrays, plan: PairPlan, g1: FloatArray, g2: FloatArray) -> Covariances:
    """Covariance ``(N, m, m)`` of the values of each pair.

    The gains of shared errors are added before squaring, so that what is common cancels to the last digit.
    """
    S = g1 @ arrays.C[plan.first] @ g1.swapaxes(1, 2)
    S += g2 @ arrays.C[plan.second] @ g2.swapaxes(1, 2)
    if arrays.shared_jacobian is not None:
        W = g1 @ arrays.shared_jacobian[plan.first] + g2 @ arrays.shared_jacobian[plan.second]
        S += W @ arrays.shared @ W.swapaxes(1, 2)
    return S
