"""Assign sensed features to model features by the univariate gates (25) of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.features import Feature, feature_covariance, gate
from tanteo.features.constraints import published
from tanteo.features.kinds import EDGE
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Transforms
from tanteo.parts import Part

_PARALLEL = 1e-6
"""Model features whose directions differ by less than this are parallel [rad]."""

_MOST = 40_000
"""Largest number of partial assignments; the answer reports a cut."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Model features of one kind.

    Attributes:
        Ts_part_feature: frames ``(N, 4, 4)``; an edge appears twice, once in each direction.
        directions: normal or direction ``(N, 3)``; zero for vertices.
        names: names for reports, such as ``plane 12``.
    """

    Ts_part_feature: Transforms
    directions: FloatArray
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.names)


def candidates_of(part: Part) -> dict[str, Candidates]:
    """Return the model features of a part by the name of their kind; absent kinds have no entry."""
    planes, edges, corners = part.planes, part.edges, part.corners.points
    both = np.concatenate([edges.Ts_part_feature, edges.Ts_part_feature @ EDGE.symmetries[1]])
    at = np.tile(np.eye(4), (len(corners), 1, 1))
    at[:, :3, 3] = corners
    faces = tuple(part.faces[i].name.replace("face", "plane") for i in planes.faces)
    found = {
        "plane": Candidates(planes.Ts_part_feature, planes.normals, faces),
        "edge": Candidates(both, both[:, :3, 0], tuple(f"edge {i}" for i in range(len(edges))) * 2),
        "vertex": Candidates(at, np.zeros(corners.shape), tuple(f"vertex {i}" for i in range(len(corners)))),
    }
    return {kind: some for kind, some in found.items() if len(some)}


def assignments(
    features: Sequence[Feature], candidates: dict[str, Candidates], significance: float
) -> tuple[IntArray, bool]:
    """Return the assignments whose pairs all pass ``(F, n)``, and whether some were cut.

    Args:
        features: sensed planes, edges and vertices; the paper has no constraint on vertices.
        candidates: model features of the part, by kind.
        significance: rejection percentage of each gate (25).
    """
    n, kinds = len(features), [feature.kind.name for feature in features]
    choices, cut = np.full((1, n), -1), False
    if any(kind not in candidates for kind in kinds):
        return choices[:0], False
    for i in range(n):
        ok = np.ones((len(choices), len(candidates[kinds[i]])), dtype=bool)
        for j in range(i):
            ok &= _pair_gate(features[j], features[i], candidates, significance)[choices[:, j]]
        which, candidate = np.nonzero(ok)
        choices = choices[which]
        choices[:, i] = candidate
        if len(choices) > _MOST:
            choices, cut = choices[:_MOST], True
    return choices, cut


def _pair_gate(first: Feature, second: Feature, candidates: dict[str, Candidates], significance: float) -> BoolArray:
    """Return the gates (25) of one sensed pair against all pairs of the model ``(Ni, Nj)``."""
    pairing = _PAIRINGS.get(first.kind.name)
    A, B = candidates[first.kind.name], candidates[second.kind.name]
    if first.kind is not second.kind or pairing is None:
        return np.ones((len(A), len(B)), dtype=bool)
    T1, T2 = first.T_world_feature, second.T_world_feature
    C1, C2 = feature_covariance(first), feature_covariance(second)
    angle = pairing.least(np.arccos(np.clip(A.directions @ B.directions.T, -1.0, 1.0)))
    parallel = (angle < _PARALLEL) | (angle > np.pi - _PARALLEL)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = pairing.angle(T1, C1, T2, C2)
        ok = _passes(pairing.least(found.value), found.variance, angle, significance)
        cosine, distance = pairing.parallel(T1, C1, T2, C2)
        beside = _passes(np.abs(cosine.value), cosine.variance, np.ones_like(angle), significance)
        beside &= _passes(np.abs(distance.value), distance.variance, pairing.distance(A), significance)
    return np.where(parallel, beside, ok)


def _passes(value: FloatArray, variance: FloatArray, model: FloatArray, significance: float) -> BoolArray:
    """Return gate (25); a variance of 0/0, as (21) has at its extremum, passes only the exact value."""
    safe = np.where(np.isfinite(variance) & (variance > 0), variance, 1e-300)
    return np.asarray(gate(np.nan_to_num(value), safe, model, significance).accept, dtype=np.bool_)


def _gaps(candidates: Candidates) -> tuple[FloatArray, FloatArray]:
    """Return the squared distance of each two frames, and its component along the first's direction ``(N, N)``."""
    gap = candidates.Ts_part_feature[None, :, :3, 3] - candidates.Ts_part_feature[:, None, :3, 3]
    return (gap**2).sum(axis=-1), np.einsum("aj,abj->ab", candidates.directions, gap)


def _between_planes(candidates: Candidates) -> FloatArray:
    """Return the distance ``|p_z|`` of parallel planes, (24)."""
    return np.abs(_gaps(candidates)[1])


def _between_edges(candidates: Candidates) -> FloatArray:
    """Return the distance of parallel edges across them (section 4.4)."""
    square, along = _gaps(candidates)
    return np.sqrt(np.maximum(square - along**2, 0.0))


@dataclass(frozen=True, slots=True)
class _Pairing:
    """Constraints of the paper on pairs of one kind of feature.

    Attributes:
        angle: function for the angle of two sensed features, with variance.
        parallel: function for cosine and distance of two parallel features, with variance.
        distance: function for the distance of parallel model features ``(N, N)`` [m].
        is_undirected: whether an angle and its supplement are equal, (16).
    """

    angle: Callable[..., Any]
    parallel: Callable[..., Any]
    distance: Callable[[Candidates], FloatArray]
    is_undirected: bool

    def least(self, angle: FloatArray) -> FloatArray:
        """Return an angle; for undirected features, the smaller of it and its supplement."""
        return np.minimum(angle, np.pi - angle) if self.is_undirected else angle


_PAIRINGS = {
    "plane": _Pairing(published.angle_planes, published.parallel_planes, _between_planes, False),
    "edge": _Pairing(published.angle_edges, published.parallel_edges, _between_edges, True),
}
"""Constraints by kind; the paper has none on vertices."""
