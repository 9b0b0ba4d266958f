"""The flat patch that fits an idea best among what was seen from afar, and where on it the hand has room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from tanteo.features import Feature
from tanteo.geometry import SO3
from tanteo.geometry.typing import BoolArray, FloatArray, Vectors
from tanteo.hand.acquisition.guesses import FaceGuess
from tanteo.hand.acquisition.seen import Cloud

_SEEDS = 48
_NEIGHBOURS = 0.015
"""A patch is first looked for within this distance of a seed [m]."""

_FEW = 8
"""Points that make a patch."""

_GATE = 3.0
"""Points of a patch are within so many standard deviations of it ..."""

_FORM = 3e-4
"""... with this much for the form of the surface [m]."""

_ELSE = 0.03
"""A point that is not of the patch may be anywhere within this [m]."""

_BLURRED = 0.003, math.radians(6.0)
"""What is seen from afar is no better known than this, whatever the idea [m, rad]."""

_FARTHEST = 8 / 3, 2.5
"""A face that is farther off the idea, or turned more, in standard deviations of both, is not the one that is meant."""

_WIDEST = 0.015
"""More room than this to the border of a patch is no better [m]."""

_PATCHES = 3
"""Patches that are proposed at most."""

_ONE_FACE = math.radians(12.0), 0.005
"""Patches that are no more askew [rad] and apart [m] may be of one face."""

_SHARED = 0.5
"""Planes that share more of their points are one patch."""

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

    def turned(self, normal: FloatArray) -> float:
        """Angle between its normal and another [rad]."""
        return math.acos(min(1.0, max(-1.0, float(self.normal @ normal))))

    def is_of(self, other: Patch) -> bool:
        """Whether both may be of one face."""
        return self._is_near(other.point, other.normal)

    def is_on(self, plane: Feature) -> bool:
        """Whether it may be of a face that was sensed."""
        return self._is_near(plane.T_world_feature[:3, 3], plane.T_world_feature[:3, 2])

    def _is_near(self, point: FloatArray, normal: FloatArray) -> bool:
        off = float((self.point - point) @ normal)
        return self.turned(normal) < _ONE_FACE[0] and abs(off) < _ONE_FACE[1]


def find_patches(cloud: Cloud, guess: FaceGuess) -> list[Patch]:
    """Patches that explain the points, the best first, those near the idea preferred; none if there are none.

    Every seed's neighbourhood proposes a plane; planes are judged by all points and refined by those that agree. Of
    planes that share most of their points the best is taken.
    """
    points, met = cloud.points, cloud.met & cloud.ahead
    candidates, found = np.flatnonzero(met), list[tuple[float, FloatArray, FloatArray, BoolArray]]()
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
        score = _gain(points[agree], sds[agree], point, normal) * _near(guess, point, normal)
        if agree.sum() >= _FEW and score > 0:
            found.append((score, point, normal, agree))
    kept: list[tuple[float, FloatArray, FloatArray, BoolArray]] = []
    for one in sorted(found, key=lambda f: -f[0]):
        if len(kept) < _PATCHES and all((one[3] & k[3]).sum() < _SHARED * one[3].sum() for k in kept):
            kept.append(one)
    return [Patch(p, n, points[agree], _seen_through(cloud, p, n, agree)) for _, p, n, agree in kept]


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


def _gain(points: Vectors, sds: FloatArray, point: FloatArray, normal: FloatArray) -> float:
    """How much better than chance a plane explains points that are near it (log of the ratio of likelihoods).

    Counted points would prefer a tilted plane through two faces: it meets many, but none of them well.
    """
    off = ((points - point) @ normal) / sds
    return float(np.sum(np.log(_ELSE / (math.sqrt(2 * math.pi) * sds)) - 0.5 * off**2))


def _near(guess: FaceGuess, point: FloatArray, normal: FloatArray) -> float:
    off, along = float((guess.point - point) @ normal), float(normal @ guess.normal)
    sd, turn_sd = max(guess.sd, _BLURRED[0]), max(guess.turn_sd, _BLURRED[1])
    if abs(off) > _FARTHEST[0] * sd or along < math.cos(min(_FARTHEST[1] * turn_sd, math.pi)):
        return 0.0
    return math.exp(-0.5 * (off / sd) ** 2) * (along + 0.2)


def _seen_through(cloud: Cloud, point: FloatArray, normal: FloatArray, agree: BoolArray) -> Vectors:
    """Where frontal beams that are not of a patch went through its plane, or ended before it."""
    height, closing = (cloud.starts - point) @ normal, -(cloud.beams @ normal)
    steep = closing > 0.1
    to_plane = height / np.where(steep, closing, 1.0)
    known = cloud.ahead & steep & (to_plane > 0) & (cloud.met | (cloud.ranges > to_plane)) & ~agree
    ends = (cloud.starts + np.minimum(cloud.ranges, to_plane)[:, None] * cloud.beams)[known]
    return np.asarray(ends - ((ends - point) @ normal)[:, None] * normal)


def stands(patch: Patch, baseline: float, wanted: FloatArray) -> list[tuple[float, FloatArray, FloatArray]]:
    """Where the hand may stand over a patch, both its frontal sensors on it, best first, rather near the wanted place.

    Returns:
        Room to the border around both sensors [m], the point under the hand's front ``(3,)`` [m], and the direction
        from the first sensor to the second ``(3,)``.
    """
    plane = SO3.frame_from_axis(patch.normal, 2)[:, :2]
    inside, border = ((points - patch.point) @ plane for points in (patch.inside, patch.border))
    centres = inside[:: max(1, len(inside) // 60)]
    turns = np.arange(12) * math.pi / 12
    pair = 0.5 * baseline * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    spots = centres[:, None, None] + np.stack([-pair, pair], axis=1)
    # each stand needs support under both sensors and room around them
    support = cKDTree(inside).query(spots)[0].max(axis=-1)
    width = np.full(support.shape, _WIDEST)
    if len(border):
        width = np.minimum(cKDTree(border).query(spots)[0].min(axis=-1), _WIDEST)
    off = np.linalg.norm(centres - (wanted - patch.point) @ plane, axis=-1)[:, None]
    score = np.where(support < _SUPPORT, width - 0.1 * off, -np.inf)
    out: list[tuple[float, FloatArray, FloatArray]] = []
    for k in np.argsort(-score, axis=None):
        i, j = np.unravel_index(k, score.shape)
        if not np.isfinite(score[i, j]) or len(out) >= _STANDS:
            break
        along = plane @ [math.cos(turns[j]), math.sin(turns[j])]
        out.append((float(width[i, j]), patch.point + plane @ centres[i], along))
    return out
