"""Find flat patches near a guess in the sensed points, and positions of the hand with clearance over them."""

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
"""Radius around a seed of the points for the first plane [m]."""

_FEW = 8
"""Smallest number of points of a patch."""

_GATE = 3.0
"""Largest distance of a point from its patch, in standard deviations."""

_FORM = 3e-4
"""Standard deviation of the form of the surface, added to that of a point [m]."""

_ELSE = 0.03
"""Width of the uniform density of points outside of the patch [m]."""

_BLURRED = 0.003, math.radians(6.0)
"""Smallest standard deviations for the comparison of distant measurements with a guess [m, rad]."""

_FARTHEST = 8 / 3, 2.5
"""Largest distance and rotation of a face from the guess, in standard deviations."""

_WIDEST = 0.015
"""Clearance to the border of a patch above which more clearance has no value [m]."""

_PATCHES = 3
"""Largest number of proposed patches."""

_ONE_FACE = math.radians(12.0), 0.005
"""Largest angle [rad] and distance [m] of two patches on one face."""

_SHARED = 0.5
"""Fraction of common points above which two planes are one patch."""

_STANDS = 150
"""Largest number of proposed positions."""

_SUPPORT = 0.008
"""Largest distance from a sensor's spot to the nearest point of the patch [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Patch:
    """Flat piece of a surface.

    Attributes:
        point: centroid of its points ``(3,)`` [m].
        normal: outward unit normal ``(3,)``.
        inside: points of the patch ``(k, 3)`` [m].
        border: points of its plane that are known to be empty or covered ``(m, 3)`` [m].
    """

    point: FloatArray
    normal: FloatArray
    inside: Vectors
    border: Vectors

    def turned(self, normal: FloatArray) -> float:
        """Return the angle between the normal and another one [rad].

        Args:
            normal: other unit normal ``(3,)``.
        """
        return math.acos(min(1.0, max(-1.0, float(self.normal @ normal))))

    def is_of(self, other: Patch) -> bool:
        """Return whether two patches may lie on the same face.

        Args:
            other: other patch.
        """
        return self._is_near(other.point, other.normal)

    def is_on(self, plane: Feature) -> bool:
        """Return whether the patch may lie on a sensed face.

        Args:
            plane: sensed face.
        """
        return self._is_near(plane.T_world_feature[:3, 3], plane.T_world_feature[:3, 2])

    def _is_near(self, point: FloatArray, normal: FloatArray) -> bool:
        off = float((self.point - point) @ normal)
        return self.turned(normal) < _ONE_FACE[0] and abs(off) < _ONE_FACE[1]


def find_patches(cloud: Cloud, guess: FaceGuess) -> list[Patch]:
    """Return the patches that explain the points near a guess, best first.

    The neighbourhood of every seed proposes a plane. All points score a plane, and the consistent ones refine it. The
    best of the planes with mostly common points is kept.

    Args:
        cloud: sensed points.
        guess: approximate pose of the face.
    """
    points, hit = cloud.points, cloud.hit & cloud.ahead
    candidates, found = np.flatnonzero(hit), list[tuple[float, FloatArray, FloatArray, BoolArray]]()
    for seed in candidates[:: max(1, len(candidates) // _SEEDS)]:
        near = hit & (np.sum((points - points[seed]) ** 2, axis=1) < _NEIGHBOURS**2)
        if near.sum() < _FEW:
            continue
        point, normal = _plane(points[near], cloud.beams[near], np.ones(int(near.sum())))
        for _ in range(3):
            agree, sds = _agreeing(cloud, hit, point, normal)
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


def _agreeing(cloud: Cloud, hit: BoolArray, point: FloatArray, normal: FloatArray) -> tuple[BoolArray, FloatArray]:
    cosines = -(cloud.beams @ normal)
    sds = np.sqrt(cloud.deviations(cosines) ** 2 + _FORM**2)
    off = np.abs((cloud.points - point) @ normal)
    return hit & (off < _GATE * sds) & (cosines > 0.1), sds


def _gain(points: Vectors, sds: FloatArray, point: FloatArray, normal: FloatArray) -> float:
    """Return the log likelihood ratio of a plane against a uniform density, for points near the plane.

    The number of points would prefer a tilted plane through two faces, which is near many points but fits none well.
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
    """Return the points at which frontal beams outside of a patch pass its plane, or end before it ``(m, 3)`` [m]."""
    height, closing = (cloud.starts - point) @ normal, -(cloud.beams @ normal)
    steep = closing > 0.1
    to_plane = height / np.where(steep, closing, 1.0)
    known = cloud.ahead & steep & (to_plane > 0) & (cloud.hit | (cloud.ranges > to_plane)) & ~agree
    ends = (cloud.starts + np.minimum(cloud.ranges, to_plane)[:, None] * cloud.beams)[known]
    return np.asarray(ends - ((ends - point) @ normal)[:, None] * normal)


def stands(patch: Patch, baseline: float, wanted: FloatArray) -> list[tuple[float, FloatArray, FloatArray]]:
    """Return positions of the hand over a patch with both frontal sensors on it, best first.

    Args:
        patch: patch to scan.
        baseline: distance of the frontal sensors [m].
        wanted: preferred position ``(3,)`` [m].

    Returns:
        For each position: clearance of both sensors to the border [m], point under the hand's front ``(3,)`` [m], and
        unit direction from the first sensor to the second ``(3,)``.
    """
    plane = SO3.frame_from_axis(patch.normal, 2)[:, :2]
    inside, border = ((points - patch.point) @ plane for points in (patch.inside, patch.border))
    centres = inside[:: max(1, len(inside) // 60)]
    turns = np.arange(12) * math.pi / 12
    pair = 0.5 * baseline * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    spots = centres[:, None, None] + np.stack([-pair, pair], axis=1)
    # each position needs points under both sensors and clearance around them
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
