"""What labels say of an object that is not the part: points of one label share a plane, a line or a point of it.

Points that are anywhere hardly ever lie in one plane. So a label whose points do is no proof of whichever part has such
a face; and most objects that people make have faces along three perpendicular axes, catalogue or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.lie import SO3
from tanteo.measurements import ContactPoints
from tanteo.special import log_sum
from tanteo.typing import Covariances, FloatArray, IntArray, Vectors

_FLAT = 0.5
"""Share of labelled surfaces that are flat: nothing is known of it, and it matters by a factor of two at most."""

_LEAST = {"vertex": 2}
"""Points from which they may miss each other; of planes and lines three, which two always share."""

_FREE = 8 * np.pi**2 / 24
"""Attitudes of three perpendicular axes: those of a body, of which 24 have the same axes."""

_TRIED, _STEPS = 32, 4
"""Pairs of directions that axes are proposed from, those nearest to perpendicular, and steps to the peak."""

_SAME = 0.02
"""Attitudes closer than this are one [rad]: far less than what the axes of two objects are apart."""


@dataclass(frozen=True, slots=True, eq=False)
class Elsewhere:
    """Labelled points off the part, beside as many outliers that know nothing of each other.

    Attributes:
        log_odds: of each group, log density of its points on a surface of their own, over that of outliers ``(G,)``.
        normals: directions that the measurements show, of labelled planes and of sensed normals ``(K, 3)``.
        covariances: of them ``(K, 3, 3)``.
    """

    log_odds: FloatArray
    normals: Vectors
    covariances: Covariances


def groups_of(points: ContactPoints) -> IntArray:
    """Number of the label of each point ``(n,)``; -1 where it has none, or is alone with it and says no more."""
    counts: dict[tuple[str, str], int] = {}
    keys = list(zip(points.labels, points.kinds, strict=True))
    for key in keys:
        counts[key] = counts.get(key, 0) + 1
    several = [key for key, count in counts.items() if key[0] and count > 1]
    number = {key: k for k, key in enumerate(several)}
    return np.array([number.get(key, -1) for key in keys], dtype=np.int32)


def elsewhere(points: ContactPoints, groups: IntArray, radius: float) -> Elsewhere:
    """What the labels say of an object of which nothing else is known.

    Args:
        points: the measurements.
        groups: of :func:`groups_of`.
        radius: of the ball in which the object is [m].
    """
    alone = points.oriented & (groups < 0)
    normals, covariances = list(points.normals[alone]), list(points.normal_sds[alone, None, None] ** 2 * np.eye(3))
    log_odds = np.zeros(groups.max(initial=-1) + 1)
    for g in range(len(log_odds)):
        rows = np.flatnonzero(groups == g)
        kind = points.kinds[rows[0]]
        if len(rows) < _LEAST.get(kind, 3):
            continue
        log, normal, covariance = _shared(points.take(rows), kind, radius)
        log_odds[g] = np.logaddexp(np.log(_FLAT) + log, np.log1p(-_FLAT))
        if kind not in ("edge", "vertex") and log > 0:
            normals.append(normal)
            covariances.append(covariance)
    return Elsewhere(log_odds, np.array(normals).reshape(-1, 3), np.array(covariances).reshape(-1, 3, 3))


def _shared(points: ContactPoints, kind: str, radius: float) -> tuple[float, Vectors, Covariances]:
    """Log density of points on one plane, line or point that is anywhere, over that of outliers; its axis.

    The integral over the plane, line or point is Laplace's, about their least squares fit.
    """
    middle = points.points.mean(axis=0)
    _, _, axes = np.linalg.svd(points.points - middle)
    free = {"vertex": 0, "edge": 1}.get(kind, 2)  # directions along what they share come first
    across, along = axes[free:], axes[:free]
    off = (points.points - middle) @ across.T
    if free == 2:
        off = off - _outward(points, across[0]) * points.radii[:, None]
    m, ball = len(across), 4 / 3 * np.pi * radius**3
    room = {1: 2 * radius, 2: np.pi * radius**2, 3: ball}[m]
    turns = {1: 4 * np.pi if points.directed.any() else 2 * np.pi, 2: 2 * np.pi, 3: 1.0}[m]
    lever = (points.points - middle) @ along.T
    levers = [lever[:, k, None, None] * np.eye(m) for k in range(free)]
    J = np.concatenate([np.broadcast_to(np.eye(m), (len(points), m, m)), *levers, -across @ points.gains], axis=2)
    states = m * (1 + free)  # of the plane, line or point, before the shared errors
    S = across @ points.covs @ across.T
    W = np.linalg.inv(S)
    H = np.einsum("nai,nab,nbj->ij", J, W, J)
    H += np.diag(np.r_[np.full(m, radius**-2), np.ones(len(H) - m)])
    pull = np.einsum("nai,nab,nb->i", J, W, off)
    best = np.linalg.solve(H, pull)
    chi2 = float(np.einsum("na,nab,nb->", off, W, off) - pull @ best)
    log = -np.log(room * turns) + 0.5 * states * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - 0.5 * chi2
    log += len(points) * (np.log(room) - 0.5 * m * np.log(2 * np.pi)) - 0.5 * np.linalg.slogdet(S)[1].sum()
    if free != 2:
        return float(log), np.zeros(3), np.zeros((3, 3))
    normal = across[0] - best[1:3] @ along
    normal /= np.linalg.norm(normal)
    if points.directed.any():
        log += float(np.log(np.maximum(np.abs(points.directions[points.directed] @ normal), 1e-3)).sum())
    return float(log), normal, along.T @ np.linalg.inv(H)[1:3, 1:3] @ along


def _outward(points: ContactPoints, normal: Vectors) -> float:
    """1 where the normal looks towards the sensor, -1 where away; 1 where nobody knows."""
    return -1.0 if float(np.sum(points.directions @ normal)) > 0 else 1.0


def log_right_angled(normals: Vectors, covariances: Covariances, share: float) -> float:
    """Log density of directions of which a share run along three perpendicular axes, over that if they could be any.

    Args:
        normals: the directions ``(K, 3)``; of either sign.
        covariances: of them ``(K, 3, 3)`` [rad^2].
        share: of faces along the axes.
    """
    k = len(normals)
    if k < 2:
        return 0.0
    none, one = k * np.log1p(-share), np.log(k * share) + (k - 1) * np.log1p(-share)
    tangents = SO3.frame_from_axis(normals, 2)[:, :, :2]
    S = np.swapaxes(tangents, 1, 2) @ covariances @ tangents
    frames = _axes_of_pairs(normals)
    log, frames = _climbed(frames, tangents, S, normals, share)
    order, kept = np.argsort(-log, kind="stable"), list[int]()
    for i in order:
        turns = np.abs(np.swapaxes(frames[kept], 1, 2) @ frames[i])
        if not np.any(turns.max(axis=2).min(axis=1) > np.cos(_SAME)):
            kept.append(int(i))
    return float(log_sum([none, one, *log[kept]]))


def _axes_of_pairs(normals: Vectors) -> FloatArray:
    """Perpendicular axes through pairs of directions ``(F, 3, 3)``, columns; none of parallel ones."""
    a, b = np.triu_indices(len(normals), 1)
    cosines = np.abs(np.sum(normals[a] * normals[b], axis=1))
    some = np.argsort(cosines, kind="stable")[:_TRIED]
    x, z = normals[a[some]], np.cross(normals[a[some]], normals[b[some]])
    sines = np.linalg.norm(z, axis=1)
    x, z = x[sines > 0.5], (z / np.maximum(sines, 1e-12)[:, None])[sines > 0.5]
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _climbed(
    frames: FloatArray, tangents: FloatArray, S: Covariances, normals: Vectors, share: float
) -> tuple[FloatArray, FloatArray]:
    """Axes at their peaks and the log of the integral about each, over the density of any directions."""
    W, log_det = np.linalg.inv(S), np.linalg.slogdet(S)[1]
    log = np.zeros(len(frames))
    for step in range(_STEPS):
        along = np.einsum("fia,ki->fka", frames, normals)
        nearest = np.argmax(np.abs(along), axis=2)
        sign = np.sign(np.take_along_axis(along, nearest[..., None], 2))
        a = np.take_along_axis(np.swapaxes(frames, 1, 2), nearest[..., None], 1) * sign
        r = np.einsum("kib,fki->fkb", tangents, a)
        pulls = np.einsum("kab,fkb->fka", W, r)
        q = np.einsum("fka,fka->fk", r, pulls)
        on = np.log(share * 4 * np.pi / 6) - np.log(2 * np.pi) - 0.5 * log_det - 0.5 * q
        total = np.logaddexp(np.log1p(-share), on)
        weight = np.exp(on - total)
        J = -np.swapaxes(tangents, 1, 2) @ SO3.hat(a)  # the axis moves by phi x a
        H = np.einsum("fk,fkai,kab,fkbj->fij", weight, J, W, J) + 2 * np.pi / _FREE ** (2 / 3) * np.eye(3)
        log = total.sum(axis=1) + 1.5 * np.log(2 * np.pi) - 0.5 * np.linalg.slogdet(H)[1] - np.log(_FREE)
        if step < _STEPS - 1:
            g = np.einsum("fk,fkai,fka->fi", weight, J, pulls)
            frames = SO3.exp(-np.linalg.solve(H, g[..., None])[..., 0]) @ frames
    return log, frames
