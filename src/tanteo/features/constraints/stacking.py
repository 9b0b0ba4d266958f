"""Stack features in arrays, and list which pairs have which constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import TypeAlias

import numpy as np

from tanteo.features.constraints.relative import AXIS_HATS
from tanteo.features.feature import Feature, collect_shared
from tanteo.features.kinds import Shape
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Vectors

MEETINGS: tuple[tuple[Shape, Shape], ...] = (
    ("plane", "plane"),
    ("plane", "line"),
    ("line", "line"),
    ("plane", "point"),
    ("line", "point"),
    ("point", "point"),
    ("plane", "axis"),
    ("line", "axis"),
    ("axis", "axis"),
    ("axis", "point"),
    ("plane", "centre"),
    ("line", "centre"),
    ("axis", "centre"),
    ("point", "centre"),
    ("centre", "centre"),
)
"""Pairs of shapes that have constraints, the first one first."""
_ORDER: dict[Shape, int] = {"plane": 0, "line": 1, "axis": 2, "point": 3, "centre": 4}
_AXIS: dict[Shape, int] = {"plane": 2, "line": 0, "axis": 0, "point": 0, "centre": 0}
_FREE: dict[Shape, tuple[float, float, float]] = {
    "plane": (1.0, 1.0, 0.0),
    "line": (1.0, 0.0, 0.0),
    "axis": (1.0, 0.0, 0.0),
    "point": (0.0, 0.0, 0.0),
    "centre": (0.0, 0.0, 0.0),
}
_OF_LINES = {("line", "axis")}
"""Pairs of different shapes that may still be re-framed along their common direction."""

Aspect: TypeAlias = tuple[int, Shape]
"""Index of a feature, and one of its roles in constraints."""


@dataclass(frozen=True, slots=True, eq=False)
class PairPlan:
    """Pairs of feature aspects, sorted by both shapes; cached, because it depends only on the kinds.

    Attributes:
        first: index of the first aspect of each pair ``(N,)``; planes precede lines, axes and points in this order.
        second: index of the second aspect of each pair ``(N,)``.
        pairs: both indices ``(N, 2)``.
        groups: slice of the pairs for each pair of shapes.
        axis_hats: ``[e]x`` of the second feature's axis ``(N, 3, 3)``.
        axis: axis of the second feature as a unit vector in its own frame ``(N, 3, 1)``.
        free: mask of the directions along which the second origin may move to the middle ``(N, 3)``.
    """

    first: IntArray
    second: IntArray
    pairs: IntArray
    groups: dict[tuple[Shape, Shape], slice]
    axis_hats: FloatArray
    axis: FloatArray
    free: FloatArray


@lru_cache(maxsize=256)
def pair_plan(aspects: tuple[Aspect, ...]) -> PairPlan:
    """Return the pairs of aspects of different features.

    Args:
        aspects: aspects of the features.
    """
    meetings: dict[tuple[Shape, Shape], list[tuple[int, int]]] = {key: [] for key in MEETINGS}
    for (i, (one, of)), (j, (other, shape)) in combinations(enumerate(aspects), 2):
        if one == other:
            continue
        a, b, first, second = (i, j, of, shape) if _ORDER[of] <= _ORDER[shape] else (j, i, shape, of)
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
    slides = [a == b or (a, b) in _OF_LINES for a, b in keys]
    free = np.array([_FREE[b] if ok else (0.0, 0.0, 0.0) for ok, (_, b) in zip(slides, keys, strict=True)])
    return PairPlan(
        np.ascontiguousarray(index[:, 0]),
        np.ascontiguousarray(index[:, 1]),
        index,
        groups,
        AXIS_HATS[axes],
        np.eye(3)[axes][..., None],
        free.reshape(-1, 3),
    )


@dataclass(frozen=True, slots=True, eq=False)
class FeatureArrays:
    """Aspects of some features in arrays; the frame of an axis is rotated so that x is along it, like that of a line.

    Attributes:
        owner: index of the feature ``(n,)``.
        R: rotations ``(n, 3, 3)``.
        c: origins in the world ``(n, 3)`` [m].
        C: independent body covariances ``(n, 6, 6)``.
        shared_jacobian: ``B' A`` of each feature on all shared errors ``(n, 6, D)``; None if nothing is shared.
        shared: covariance of the shared errors ``(D, D)``.
        extent: smallest, mean and largest abscissa of the sensed points on lines ``(n, 3)`` [m].
    """

    owner: IntArray
    R: FloatArray
    c: Vectors
    C: Covariances
    shared_jacobian: FloatArray | None
    shared: Covariances
    extent: FloatArray


_TO_X = np.eye(3)[:, [2, 0, 1]]
"""Rotation of a frame that puts its x axis along the former z axis."""
_ROW_OF_AXIS = {0: 1, 1: 2, 3: 4, 4: 5}
"""New tangent rows of a round feature when its z axis becomes x; rows along and about the axis are dropped."""


def stack_features(features: Sequence[Feature], aspects: tuple[Aspect, ...]) -> FeatureArrays:
    """Return frames, covariances and shared errors of feature aspects as arrays.

    Args:
        features: sensed or model features.
        aspects: aspects of the features.
    """
    n = len(aspects)
    T = np.array([features[k].T_world_feature for k, _ in aspects]).reshape(n, 4, 4)
    R = T[:, :3, :3]
    c = T[:, :3, 3]
    C = np.zeros((n, 6, 6))
    shared_jacobian = None
    shared = np.zeros((0, 0))
    gains = None
    if any(feature.shared for feature in features):
        _, shared, gains = collect_shared(features)
        shared_jacobian = np.zeros((n, 6, len(shared)))
    for i, (k, shape) in enumerate(aspects):
        rows, of = _rows(features[k].kind.rows, shape)
        C[i][_block(rows)] = features[k].P if len(of) == features[k].kind.size else features[k].P[_block(of)]
        if shared_jacobian is not None and gains is not None:
            shared_jacobian[i, rows] = gains[k][list(of)]
        if shape == "axis":
            R[i] = R[i] @ _TO_X
    owner = np.array([k for k, _ in aspects], dtype=np.int64)
    return FeatureArrays(owner, R, c, C, shared_jacobian, shared, _extents(features, aspects, R, c))


@lru_cache(maxsize=64)
def _rows(rows: tuple[int, ...], shape: Shape) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the tangent rows of an aspect, and the positions of the feature's own rows that they come from."""
    if shape == "axis":
        of = tuple(k for k, row in enumerate(rows) if row in _ROW_OF_AXIS)
        return tuple(_ROW_OF_AXIS[rows[k]] for k in of), of
    of = tuple(k for k, row in enumerate(rows) if shape != "centre" or row < 3)
    return tuple(rows[k] for k in of), of


@lru_cache(maxsize=64)
def _block(rows: tuple[int, ...]) -> tuple[IntArray, IntArray]:
    """Return the index of a square block of rows, cached because building it costs as much as using it."""
    index = np.array(rows, dtype=np.int64)
    return index[:, None], index


def _extents(features: Sequence[Feature], aspects: tuple[Aspect, ...], R: FloatArray, c: Vectors) -> FloatArray:
    extent = np.zeros((len(aspects), 3))
    lines = [i for i, (k, shape) in enumerate(aspects) if shape == "line" and len(features[k].support)]
    if not lines:
        return extent  # fitting puts the origins at the centroids
    supports = [features[aspects[i][0]].support for i in lines]
    counts = np.array([len(s) for s in supports])
    starts = np.cumsum(counts) - counts
    owner = np.repeat(lines, counts)
    t = np.einsum("ij,ij->i", np.concatenate(supports) - c[owner], R[owner, :, 0])
    extent[lines, 0] = np.minimum.reduceat(t, starts)
    extent[lines, 1] = np.add.reduceat(t, starts) / counts
    extent[lines, 2] = np.maximum.reduceat(t, starts)
    return extent


def propagate_pairs(arrays: FeatureArrays, plan: PairPlan, g1: FloatArray, g2: FloatArray) -> Covariances:
    """Return the covariance ``(N, m, m)`` of the values of each pair.

    The gains of shared errors are added before squaring, so that common errors cancel to the last digit.

    Args:
        arrays: stacked aspects.
        plan: pairs of the aspects.
        g1: gradients over the first body error ``(N, m, 6)``.
        g2: gradients over the second body error ``(N, m, 6)``.
    """
    S = g1 @ arrays.C[plan.first] @ g1.swapaxes(1, 2)
    S += g2 @ arrays.C[plan.second] @ g2.swapaxes(1, 2)
    if arrays.shared_jacobian is not None:
        W = g1 @ arrays.shared_jacobian[plan.first] + g2 @ arrays.shared_jacobian[plan.second]
        S += W @ arrays.shared @ W.swapaxes(1, 2)
    return S
