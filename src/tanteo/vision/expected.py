"""Expected information of a view: which edges of the possible parts it would show, and their information.

The information about the pose is that of the edges that are visible and in the image, with the errors of edges, of the
lens and of the camera's pose. The information about the part is bounded by the divergences between possible images
(Kolchinsky and Tracey 2017, Estimating mixture entropy with pairwise distances, Entropy 19), by edges of one hypothesis
that another lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tanteo.geometry import SE3
from tanteo.geometry.special import log_sum
from tanteo.geometry.typing import Covariances, FloatArray, IntArray, Transforms
from tanteo.vision.camera import Camera, project_linearized
from tanteo.vision.image_edges import Weights, standing
from tanteo.vision.models import VisionModel
from tanteo.vision.settings import EDGES, EVIDENCE
from tanteo.vision.wireframe import in_camera, see_edges

_NEAREST = 4
"""Numerical: number of samples of another hypothesis that are compared with a sample."""


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """Edges of one hypothesis in a view.

    Attributes:
        pixels: samples ``(n, 2)`` [px].
        spans: length of edge that each represents ``(n,)`` [px].
        chances: probability that it is found ``(n,)``.
        groups: number of its edge ``(n,)``.
        rows: derivative of its offset across the edge by the pose of the part ``(n, 6)``.
        normals: unit vectors across the edge ``(n, 2)``.
    """

    pixels: FloatArray
    spans: FloatArray
    chances: FloatArray
    groups: IntArray
    rows: FloatArray
    normals: FloatArray


def expected_information(
    hypotheses: Sequence[tuple[VisionModel, Transforms, Covariances]], weights: FloatArray, camera: Camera
) -> tuple[float, float]:
    """Return the expected information of a view about part and pose [nats], and the share of edges that it shows.

    Args:
        hypotheses: parts with poses ``T_world_part`` and covariances in the part's frame.
        weights: probability of each ``(k,)``.
        camera: camera with the pose of the view, its errors, and those of its mounting.
    """
    p = np.asarray(weights) / np.sum(weights)
    shown = [_shown(model, camera, T) for model, T, _ in hypotheses]
    pose = [_pose_information(one, camera, T, C) for one, (_, T, C) in zip(shown, hypotheses, strict=True)]
    D = np.array([[_divergence(one, other) for other in shown] for one in shown])
    identity = -float(np.sum(p * [log_sum(np.log(p) - row) for row in D]))
    lengths = [_all_lengths(model, camera, T) for model, T, _ in hypotheses]
    share = [one.spans.sum() / max(length, 1e-9) for one, length in zip(shown, lengths, strict=True)]
    return float(p @ np.array(pose)) + max(identity, 0.0), float(p @ np.array(share))


def _shown(model: VisionModel, camera: Camera, T_world_part: Transforms) -> _Shown:
    """Return the edges of a part that a view shows."""
    frame, T = model.frame, SE3.inverse(standing(camera)) @ T_world_part
    seen = see_edges(frame, T)
    points = in_camera(T[None], frame.points)[0]
    pixels, D = project_linearized(camera, points)
    DR = D @ T[:3, :3]
    along = np.einsum("nij,nj->ni", DR, frame.tangents)
    size = np.linalg.norm(along, axis=1)
    inside = np.all((pixels >= 0) & (pixels <= np.array(camera.size) - 1.0), axis=1)
    keep = np.asarray(seen.shown, dtype=bool) & inside & (size > 0)
    normals = np.stack([-along[keep, 1], along[keep, 0]], axis=1) / size[keep, None]
    by_shift = np.einsum("ni,nij->nj", normals, DR[keep])
    rows = np.concatenate([by_shift, np.cross(frame.points[keep], by_shift)], axis=1)
    chances = np.where(np.asarray(seen.rims, dtype=bool)[keep], EVIDENCE.rim_shows, EVIDENCE.crease_shows)
    return _Shown(pixels[keep], frame.lengths[keep] * size[keep], chances, frame.groups[keep], rows, normals)


def _all_lengths(model: VisionModel, camera: Camera, T_world_part: Transforms) -> float:
    """Return the length of all sharp edges of a part at its distance from a camera [px]."""
    depth = SE3.apply(SE3.inverse(standing(camera)) @ T_world_part, model.part.centroid)[2]
    frame = model.frame
    return float(frame.lengths[frame.sharp].sum() * camera.focal.mean() / max(depth, 1e-3))


def _pose_information(shown: _Shown, camera: Camera, T_world_part: Transforms, C: Covariances) -> float:
    """Return the expected reduction of the entropy of a pose [nats]."""
    w = shown.chances * np.minimum(shown.spans / EDGES.correlation, 1.0) / EDGES.bias**2
    H = np.einsum("ni,n,nj->ij", shown.rows, w, shown.rows)
    for group in np.unique(shown.groups):  # the error common to an edge, by Woodbury's formula
        own = shown.groups == group
        common = camera.edge_sd * (w[own] @ shown.rows[own])
        H -= np.outer(common, common) / (1 + camera.edge_sd**2 * w[own].sum())
    covariance = camera.pose_covariance
    if covariance is not None:
        A = SE3.adjoint(SE3.inverse(T_world_part) @ standing(camera))
        of_camera = np.linalg.pinv(A @ covariance @ A.T, hermitian=True)
        H = H - H @ np.linalg.pinv(H + of_camera, hermitian=True) @ H
    L = np.linalg.cholesky(C + 1e-18 * np.eye(6))
    return 0.5 * float(np.linalg.slogdet(np.eye(6) + L.T @ H @ L)[1])


def _divergence(one: _Shown, other: _Shown) -> float:
    """Return how much less probable an image of one hypothesis is under another [nats]."""
    weights = Weights()
    only, lacking = _unmatched(one, other), _unmatched(other, one)
    found = one.chances * np.log(one.chances * 2 * EVIDENCE.reach / EVIDENCE.rare)
    missed = -np.log1p(-other.chances)
    return weights.hits * _weighed(one, found * only) + weights.misses * _weighed(other, missed * lacking)


def _weighed(shown: _Shown, values: FloatArray) -> float:
    """Return the sum of values in stretches, in which more of the same edge adds little."""
    total = 0.0
    for group in np.unique(shown.groups):
        own = shown.groups == group
        total += float(values[own] @ shown.spans[own]) / (1 + shown.spans[own].sum() / EVIDENCE.whole)
    return total / EVIDENCE.stretch


def _unmatched(one: _Shown, other: _Shown) -> FloatArray:
    """Return 1 for the samples of one hypothesis that are beyond reach of all edges of another ``(n,)``."""
    if not len(one.pixels) or not len(other.pixels):
        return np.ones(len(one.pixels))
    _, near = cKDTree(other.pixels).query(one.pixels, k=min(_NEAREST, len(other.pixels)))
    near = near.reshape(len(one.pixels), -1)
    gaps, normals = one.pixels[:, None] - other.pixels[near], other.normals[near]
    across = np.abs(np.sum(gaps * normals, axis=2))
    along = np.sqrt(np.maximum(np.sum(gaps**2, axis=2) - across**2, 0.0))
    same = np.abs(np.sum(one.normals[:, None] * normals, axis=2)) > EVIDENCE.same_direction
    matched = same & (across < EVIDENCE.reach) & (along < other.spans[near])
    return 1.0 - matched.any(axis=1)
