"""Near variants: objects that are like a part, but differ anywhere, or by one face that is farther out or in.

A near variant of a part looks like the part with more outliers than the sensor makes. These may be anywhere (decision
35). Or they agree: another variant has a higher step, a wider bore, a thicker wall, and what was sensed of it is all
off that one face by the same (decision 49). Outliers of a sensor do not do that.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tanteo.geometry.special import legendre_nodes, log_sum
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts import Part
from tanteo.posterior.details import Details
from tanteo.posterior.outliers import LEAST_RATE, log_by_rate

_ONE_FACE = 0.5
"""Share of what is a near variant that differs from it by one face (decision 49)."""

_OFFSET = 0.1
"""Standard deviation of how far a face may be out or in, in diagonals of the part."""

_LEAST = 1
"""A face is elsewhere if so many readings agree on where; one alone may be an outlier as well, and is weighed so."""

_AT_ONCE = 2_000_000
"""Numerical: pairs of readings that are compared at a time, which bounds the memory."""

_NODES = 12
"""Numerical: least number of nodes of the Gauss-Legendre quadrature over the displaced fraction of a surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Shifted:
    """Faces that may be elsewhere, as readings say that agree on where.

    Attributes:
        poses: at which pose ``(K,)``.
        faces: which face ``(K,)``.
        offsets: how far outside of its place ``(K,)`` [m].
        counts: readings that are off the face and agree ``(K,)``.
        log_odds: of the face there over the face where the part has it, before the prior of the face ``(K,)``.
    """

    poses: IntArray
    faces: IntArray
    offsets: FloatArray
    counts: IntArray
    log_odds: FloatArray


def log_density_of_near_variant(at: Details, part: Part, mean: float) -> FloatArray:
    """Log density of all readings if the object is a near variant of the part ``(S,)``: anywhere else, or by one face.

    A face counts with "anywhere" unless the readings say more clearly that it alone is elsewhere.

    Args:
        at: the readings at the poses.
        part: the part.
        mean: rate of outliers that is stated.
    """
    anywhere = log_density_by_surfaces(at, mean)
    found, share = shifted(at, part, mean), _ONE_FACE / len(part.faces)
    log = np.logaddexp(*_at_rate(at, mean)).sum(axis=1)[found.poses] + found.log_odds
    clear = log > anywhere[found.poses]
    left = np.log1p(-share * np.bincount(found.poses[clear], minlength=len(anywhere)))
    one_face = np.full(len(anywhere), -np.inf)
    np.logaddexp.at(one_face, found.poses[clear], log[clear] + np.log(share))
    return np.asarray(np.logaddexp(left + anywhere, one_face))


def log_density_by_surfaces(at: Details, mean: float) -> FloatArray:
    """The same if any share of the surface is anywhere else ``(S,)``: what one label names, or one beam meets, as one.

    Args:
        at: the readings at the poses.
        mean: rate of outliers that is stated.
    """
    alone = at.groups < 0
    places = None if at.places is None else at.places[alone]
    on, off = by_place(at.log_hit[:, alone], at.log_outlier[:, alone], mean, places)
    labelled = np.broadcast_to(at.log_elsewhere, at.log_groups.shape)
    return log_density_elsewhere(np.concatenate([on, at.log_groups], axis=1), np.concatenate([off, labelled], axis=1))


def log_density_elsewhere(log_on: FloatArray, log_off: FloatArray) -> FloatArray:
    """Log density of all readings if any share of the surface, all shares alike, is anywhere else ``(S,)``.

    Args:
        log_on: log density of what was sensed at each place if the surface is that of the part ``(S, P)``.
        log_off: if it is elsewhere ``(S, P)``.
    """
    nodes = max(_NODES, int(np.ceil(2 * np.sqrt(log_on.shape[1]))))
    return log_sum(log_by_rate(log_on, log_off, *_shares(nodes)), axis=0)


def shifted(at: Details, part: Part, mean: float) -> Shifted:
    """The faces that are better elsewhere: those of which readings that look off agree on another place.

    A face may be off by a normal density; readings of it that do not agree stay outliers, at the rate that is stated.
    The integral over where it is is Laplace's. Of several places of one face at one pose the best one counts. Where
    what agrees with the outliers are the readings on the face as it is, it is not elsewhere.

    Args:
        at: the readings at the poses.
        part: the part.
        mean: rate of outliers that is stated.
    """
    off = np.greater(*_at_rate(at, mean)[::-1])
    pose, reading = _proposed(at, off & (off.sum(axis=1) >= _LEAST)[:, None])
    step = max(1, _AT_ONCE // max(off.shape[1], 1))
    blocks = [slice(k, k + step) for k in range(0, len(pose), step)]
    found = [_about(at, part, mean, off, pose[block], reading[block]) for block in blocks]
    offsets, counts, odds = (np.concatenate([f[k] for f in found]) if found else np.zeros(0) for k in range(3))
    faces = at.faces[pose, reading]
    order = np.lexsort((-odds, faces, pose))
    order = order[(counts[order] >= _LEAST) & (odds[order] > 0)]
    pose, faces = pose[order], faces[order]
    best = order[:0] if not len(order) else np.flatnonzero(np.r_[True, (np.diff(pose) != 0) | (np.diff(faces) != 0)])
    kept = order[best]
    return Shifted(pose[best], faces[best], offsets[kept], counts[kept].astype(np.int64), odds[kept])


def _at_rate(at: Details, mean: float) -> tuple[FloatArray, FloatArray]:
    """Log densities of each reading and that it is on the surface, or off, at the rate that is stated ``(S, n)``."""
    return np.log1p(-mean) + at.log_hit, np.log(max(mean, LEAST_RATE)) + at.log_outlier


def _proposed(at: Details, off: BoolArray) -> tuple[IntArray, IntArray]:
    """Poses and readings ``(P,)`` that say where a face may be: of those that are as far off it, within an sd, one."""
    far, (pose, reading) = 1 / np.finfo(float).eps, np.nonzero(off)  # farther, whole numbers are not exact
    off = np.rint((at.distances * at.per_sd)[pose, reading].clip(-far, far)).astype(np.int64)
    _, one = np.unique(np.stack([pose, at.faces[pose, reading], off]), axis=1, return_index=True)
    return pose[one], reading[one]


def _about(
    at: Details, part: Part, mean: float, off: BoolArray, pose: IntArray, reading: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far out a face is, how many agree, and the log odds ``(P,)``, if a reading at a pose is on the face there."""
    on, outlier = (of[pose] for of in _at_rate(at, mean))
    there, d, weight = np.log1p(-mean) + at.log_there[pose], at.distances[pose], at.per_sd[pose] ** 2
    same = at.faces[pose] == at.faces[pose, reading][:, None]

    def on_it(offset: FloatArray) -> FloatArray:
        return np.asarray(there - 0.5 * weight * (d - offset[:, None]) ** 2)

    spread = (_OFFSET * part.diagonal) ** 2
    agree: BoolArray = same & (on_it(at.distances[pose, reading]) > outlier)
    known = np.sum(weight * agree, axis=1)
    offset = np.sum(weight * d * agree, axis=1) / (known + 1 / spread)
    hit = on_it(offset)
    odds = np.sum(np.where(same, np.logaddexp(hit, outlier) - np.logaddexp(on, outlier), 0.0), axis=1)
    odds += -0.5 * offset**2 / spread - 0.5 * np.log1p(spread * known)
    return offset, np.sum(same & off[pose] & (hit > outlier), axis=1).astype(np.float64), np.asarray(odds)


def by_place(
    log_hit: FloatArray, log_outlier: FloatArray, mean: float, places: IntArray | None
) -> tuple[FloatArray, FloatArray]:
    """Log densities of all readings of each place, if the surface is there, and if it is not ``(S, P)``.

    At one place the surface is there or elsewhere for all readings: where one of them is on the part, the others
    are outliers of the sensor, whatever the object is.

    Args:
        log_hit: log density of each reading if it is on the part ``(S, n)``.
        log_outlier: if it is elsewhere ``(S, n)``.
        mean: rate of outliers that is stated.
        places: number of the place of each reading ``(n,)``; each has its own if not given.
    """
    if places is None or len(np.unique(places)) == len(places):
        return log_hit, log_outlier
    order = np.argsort(places, kind="stable")
    first, count = np.unique(places[order], return_index=True, return_counts=True)[1:]
    several = np.repeat(count > 1, count)
    hit, outlier = log_hit[:, order], log_outlier[:, order]
    rate = np.log(max(mean, LEAST_RATE))
    hit = np.where(several, np.logaddexp(np.log1p(-mean) + hit, rate + outlier), hit)
    return np.add.reduceat(hit, first, axis=1), np.add.reduceat(outlier, first, axis=1)


@cache
def _shares(nodes: int) -> tuple[FloatArray, FloatArray]:
    x, w = legendre_nodes(nodes)
    return (1 + x) / 2, w
