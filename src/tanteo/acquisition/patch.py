"""The flat patch that fits an idea best among what was seen from afar, and where on it the hand has room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tanteo.acquisition.cloud import Cloud
from tanteo.acquisition.ideas import FaceIdea
from tanteo.typing import BoolArray, FloatArray, Vectors

_SEEDS = 48
_NEIGHBOURS = 0.015
"""A patch is first looked for within this distance of a seed [m]."""

_FEW = 8
"""Points that make a patch."""

_GATE = 3.0
"""Points of a patch are within so many standard deviations of it ..."""

_FORM = 3e-4
"""... with this much for the form of the surface [m]."""

_TRUST = 0.015
"""Standard deviation of the idea's distance from the face that is preferred [m]."""

_WIDEST = 0.015
"""More room than this to the border of a patch is no better [m]."""

_STANDS = 150
"""Places that are proposed at most."""

_SUPPORT = 0.008
"""Where a finger shall sense, a point of the patch is this near [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """A flat piece of surface.

    Attributes:
        point: The centroid of its points ``(3,)`` [m].
        normal: Outward ``(3,)``.
        inside: Its points ``(k, 3)`` [m].
        border: Where the plane of the patch is known to be empty or covered ``(m, 3)`` [m].
    """

    point: FloatArray
    normal: FloatArray
    inside: Vectors
    border: Vectors


def find_patch(cloud: Cloud, idea: FaceIdea) -> Patch | None:
    """The patch with most points, those near the idea preferred; None if there is none.

    Every seed's neighbourhood proposes a plane; planes are judged by all points and refined by those that agree.
    """
    points, met = cloud.points, cloud.met & cloud.ahead
    candidates = np.flatnonzero(met)
    if len(candidates) < _FEW:
        return None
    best, best_score = None, 0.0
    for seed in candidates[:: max(1, len(candidates) // _SEEDS)]:
        near = met & (np.sum((points - points[seed]) ** 2, axis=1) < _NEIGHBOURS**2)
        if near.sum() < _FEW:
            continue
        point, normal = _plane(points[near], cloud.beams[near], np.ones(int(near.sum())))
        for _ in range(3):
            agree, sds = _agreeing(cloud, met, point, normal)
            if agree.sum() < _FEW:
                break
            point, normal = _plane(points[agree], cloud.beams[agree], 1 / sds[agree] ** 2)
        score = _score(int(agree.sum()), point, normal, idea)
        if agree.sum() >= _FEW and score > best_score:
            best, best_score = (point, normal, agree), score
    if best is None:
        return None
    return Patch(best[0], best[1], points[best[2]], _border(cloud, *best))


def _plane(points: Vectors, beams: Vectors, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    w = weights / weights.sum()
    centre = w @ points
    away = points - centre
    normal = np.linalg.eigh(away.T @ (w[:, None] * away))[1][:, 0]
    return centre, -normal if normal @ beams.mean(axis=0) > 0 else normal


def _agreeing(cloud: Cloud, met: BoolArray, point: FloatArray, normal: FloatArray) -> tuple[BoolArray, FloatArray]:
    cosines = -(cloud.beams @ normal)
    sds = np.sqrt(cloud.deviations(cosines) ** 2 + _FORM**2)
    off = np.abs((cloud.points - point) @ normal)
    return met & (off < _GATE * sds) & (cosines > 0.1), sds


def _score(count: int, point: FloatArray, normal: FloatArray, idea: FaceIdea) -> float:
    off = float((idea.point - point) @ normal)
    along = float(normal @ idea.normal)
    return count * math.exp(-0.5 * (off / _TRUST) ** 2) * max(along + 0.2, 0.0)


def _border(cloud: Cloud, point: FloatArray, normal: FloatArray, agree: BoolArray) -> Vectors:
    """Where frontal beams went through the plane of the patch, or ended before it."""
    places, known = _places(cloud, point, normal)
    return np.asarray(places[known & ~agree])


def _places(cloud: Cloud, point: FloatArray, normal: FloatArray) -> tuple[Vectors, BoolArray]:
    """Where in a plane each beam went through it or ended before it, and which of the frontal ones did either."""
    height = (cloud.starts - point) @ normal
    closing = -(cloud.beams @ normal)
    steep = closing > 0.1
    to_plane = height / np.where(steep, closing, 1.0)
    known = cloud.ahead & steep & (to_plane > 0) & (cloud.met | (cloud.ranges > to_plane))
    ends = cloud.starts + np.minimum(cloud.ranges, to_plane)[:, None] * cloud.beams
    return ends - ((ends - point) @ normal)[:, None] * normal, known


def stands(patch: Patch, baseline: float, wanted: FloatArray) -> list[tuple[float, FloatArray, FloatArray]]:
    """Where the hand may stand over a patch, with both its frontal sensors on it, best first.

    Args:
        patch: The patch.
        baseline: Of the two frontal sensors [m].
        wanted: Where it should rather be ``(3,)`` [m].

    Returns:
        Room to the border around both sensors [m], the point under the hand's front ``(3,)`` [m], and the direction
        from the first sensor to the second ``(3,)``.
    """
    e = _across(patch.normal)
    f = np.cross(patch.normal, e)
    inside = (patch.inside - patch.point) @ np.stack([e, f], axis=1)
    border = (patch.border - patch.point) @ np.stack([e, f], axis=1)
    centres = inside[:: max(1, len(inside) // 60)]
    turns = np.arange(12) * math.pi / 12
    pair = 0.5 * baseline * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    spots = centres[:, None, None] + np.stack([-pair, pair], axis=1)
    # each stand needs support under both sensors and room around them
    support = _nearest(spots, inside).max(axis=-1)
    width = (
        np.minimum(_nearest(spots, border).min(axis=-1), _WIDEST) if len(border) else np.full(support.shape, _WIDEST)
    )
    off = np.linalg.norm(centres - (wanted - patch.point) @ np.stack([e, f], axis=1), axis=-1)[:, None]
    score = np.where(support < _SUPPORT, width - 0.1 * off, -np.inf)
    out: list[tuple[float, FloatArray, FloatArray]] = []
    for k in np.argsort(-score, axis=None):
        i, j = np.unravel_index(k, score.shape)
        if not np.isfinite(score[i, j]) or len(out) >= _STANDS:
            break
        place = patch.point + centres[i, 0] * e + centres[i, 1] * f
        out.append((float(width[i, j]), place, math.cos(turns[j]) * e + math.sin(turns[j]) * f))
    return out


def _nearest(spots: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of every spot ``(*batch, 2)`` to the nearest point ``(m, 2)``."""
    flat = spots.reshape(-1, 2)
    squared = np.sum(flat**2, axis=1)[:, None] + np.sum(points**2, axis=1) - 2 * flat @ points.T
    return np.sqrt(np.maximum(squared.min(axis=1), 0.0)).reshape(spots.shape[:-1])


def _across(normal: FloatArray) -> FloatArray:
    helper = np.eye(3)[int(np.argmin(np.abs(normal)))]
    e = np.cross(normal, helper)
    return np.asarray(e / np.linalg.norm(e))
