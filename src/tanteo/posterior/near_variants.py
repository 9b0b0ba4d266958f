"""Near variants of a part: objects that differ from it anywhere, or by one displaced face.

The readings of a near variant fit the part with more outliers than the sensor makes. They may be off anywhere (decision
35). Or they agree: a variant has a higher step, a wider bore or a thicker wall, and all readings of that face are off
by the same distance (decision 49). Outliers of a sensor do not agree.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from tanteo.geometry.special import legendre_nodes, log_sum
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts import Part
from tanteo.posterior.details import Details
from tanteo.posterior.outliers import LEAST_RATE, log_all_outliers, log_by_rate

_ONE_FACE = 0.5
"""Fraction of near variants that differ by one face (decision 49)."""

_OFFSET = 0.1
"""Standard deviation of the displacement of a face over the diagonal of the part."""

_LEAST = 1
"""Number of agreeing readings from which a face may be displaced; a single one may be an outlier as well."""

_AT_ONCE = 2_000_000
"""Numerical: pairs of readings that are compared at a time, which bounds the memory."""

_NODES = 12
"""Numerical: least number of nodes of the Gauss-Legendre quadrature over the displaced fraction of a surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Shifted:
    """Faces that may be displaced, because several readings agree on another place.

    Attributes:
        poses: index of the pose ``(K,)``.
        faces: index of the face ``(K,)``.
        offsets: displacement of the face, outward ``(K,)`` [m].
        counts: number of readings that are off the face and agree ``(K,)``.
        log_odds: log odds of the displaced face against the nominal one, before the prior of the face ``(K,)``.
    """

    poses: IntArray
    faces: IntArray
    offsets: FloatArray
    counts: IntArray
    log_odds: FloatArray


def log_density_of_near_variant(at: Details, part: Part, mean: float) -> FloatArray:
    """Return the log density of all readings on a near variant of the part ``(S,)``.

    It differs anywhere or by one face. A face counts as "anywhere" unless the readings support more strongly that it
    alone is displaced.

    Args:
        at: the readings at the poses.
        part: the part.
        mean: stated rate of outliers.
    """
    logs = [log + log_density_of_design(at.of_design(k), part, mean) for k, log in enumerate(at.log_designs)]
    return log_sum(np.stack(logs), axis=0)


def log_density_of_design(at: Details, part: Part, mean: float) -> FloatArray:
    """Return the log density of all readings on a near variant, given how their places were chosen ``(S,)``.

    Args:
        at: the readings at the poses, with the densities of one design of the places.
        part: the part.
        mean: stated rate of outliers.
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
    """Return the log density if any fraction of the surface is displaced; a label or a beam is one unit ``(S,)``.

    Distant readings are outliers, or the variant is larger than all parts.

    Args:
        at: the readings at the poses.
        mean: stated rate of outliers.
    """
    alone = at.groups < 0
    near, distant = alone & ~at.distant.rows, alone & at.distant.rows
    log = _log_displaced(at, near, mean)
    if not distant.any():
        return log
    log += at.log_outlier[:, distant].sum(axis=1) + log_all_outliers(int(distant.sum()), mean)
    return at.distant.mean(log, _log_displaced(at, alone, mean))


def _log_displaced(at: Details, alone: BoolArray, mean: float) -> FloatArray:
    """Return the log density of all labels and some unlabelled readings, any fraction of the surface displaced."""
    places = None if at.places is None else at.places[alone]
    on, off = by_place(at.log_hit[:, alone], at.log_outlier[:, alone], mean, places)
    labelled = np.broadcast_to(at.log_elsewhere, at.log_groups.shape)
    return log_density_elsewhere(np.concatenate([on, at.log_groups], axis=1), np.concatenate([off, labelled], axis=1))


def log_density_elsewhere(log_on: FloatArray, log_off: FloatArray) -> FloatArray:
    """Return the log density if a fraction of the surface, uniform from 0 to 1, is displaced ``(S,)``.

    Args:
        log_on: log density at each place if its surface is that of the part ``(S, P)``.
        log_off: log density at each place if its surface is displaced ``(S, P)``.
    """
    nodes = max(_NODES, int(np.ceil(2 * np.sqrt(log_on.shape[1]))))
    return log_sum(log_by_rate(log_on, log_off, *_shares(nodes)), axis=0)


def shifted(at: Details, part: Part, mean: float) -> Shifted:
    """Return the faces that explain the readings better if displaced.

    The displacement of a face has a normal prior. Readings that do not agree on it stay outliers at the stated rate.
    The integral over the displacement is Laplace's approximation. The best displacement of each face at each pose
    counts. A face is not displaced if only readings on the nominal face agree with the outliers.

    Args:
        at: the readings at the poses.
        part: the part.
        mean: stated rate of outliers.
    """
    on_face = at.faces >= 0  # centres, edges and corners have negative numbers
    off = np.greater(*_at_rate(at, mean)[::-1]) & on_face & ~at.distant.rows
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
    """Return log densities of each reading times the probability to be on the surface, or off ``(S, n)``."""
    return np.log1p(-mean) + at.log_hit, np.log(max(mean, LEAST_RATE)) + at.log_outlier


def _proposed(at: Details, off: BoolArray) -> tuple[IntArray, IntArray]:
    """Return poses and readings ``(P,)`` that propose a displacement; of equal ones within an sd, one."""
    far, (pose, reading) = 1 / np.finfo(float).eps, np.nonzero(off)  # farther, whole numbers are not exact
    off = np.rint((at.distances * at.per_sd)[pose, reading].clip(-far, far)).astype(np.int64)
    _, one = np.unique(np.stack([pose, at.faces[pose, reading], off]), axis=1, return_index=True)
    return pose[one], reading[one]


def _about(
    at: Details, part: Part, mean: float, off: BoolArray, pose: IntArray, reading: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return displacement, number of agreeing readings and log odds ``(P,)`` of a face through a reading."""
    nominal, outlier = (of[pose] for of in _at_rate(at, mean))
    scale, log_weight = _with_face(at, part, pose, reading)
    on = nominal + scale
    there, d, weight = np.log1p(-mean) + at.log_there[pose] + scale, at.distances[pose], at.per_sd[pose] ** 2
    same = at.faces[pose] == at.faces[pose, reading][:, None]

    def on_it(offset: FloatArray) -> FloatArray:
        return np.asarray(there - 0.5 * weight * (d - offset[:, None]) ** 2)

    spread = (_OFFSET * part.diagonal) ** 2
    agree: BoolArray = same & (on_it(at.distances[pose, reading]) > outlier)
    known = np.sum(weight * agree, axis=1)
    offset = np.sum(weight * d * agree, axis=1) / (known + 1 / spread)
    hit = on_it(offset)
    displaced = np.logaddexp(np.where(same, hit, on), outlier) - np.logaddexp(nominal, outlier)
    odds = log_weight + np.sum(displaced, axis=1)
    odds += -0.5 * offset**2 / spread - 0.5 * np.log1p(spread * known)
    return offset, np.sum(same & off[pose] & (hit > outlier), axis=1).astype(np.float64), np.asarray(odds)


def _with_face(at: Details, part: Part, pose: IntArray, reading: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return the change of the densities if the face of a reading is touched, too, with places even over touched faces.

    The displaced face is then one of the faces over which the places are even, so that each place has a lower density.
    Without this change a displaced face would be touched at no cost, and would explain any other plane of touches.

    Args:
        at: the readings at the poses, with the densities of one design.
        part: the part.
        pose: index of the pose ``(P,)``.
        reading: index of the reading whose face is touched ``(P,)``.

    Returns:
        Change of the log density of each reading ``(P, n)``, and of the log weight of the design ``(P,)``.
    """
    zero = np.zeros((len(pose), at.faces.shape[1])), np.zeros(len(pose))
    if at.over_touched is None or not len(pose):
        return zero
    areas = np.array([face.area for face in part.faces])
    areas = areas / areas.sum()
    log_scale = at.over_touched[pose, reading]  # zero for readings whose places have no density, and if all is touched
    similar = at.over_touched[pose] == log_scale[:, None]
    touched = np.zeros((len(pose), len(areas)), dtype=np.bool_)
    rows, columns = np.nonzero(similar & (at.inlier_probability[pose] > 0.5) & (at.faces[pose] >= 0))
    touched[rows, at.faces[pose][rows, columns]] = True
    own, face = touched @ areas, at.faces[pose, reading]
    new = (log_scale > 0) & ~touched[np.arange(len(pose)), face] & (own > 0) & (own < 1)
    own = np.where(new, own, 0.5)
    grown = np.log1p(areas[face] / own) / -np.log(own)
    change = np.where(new[:, None] & similar, -(log_scale * grown)[:, None], 0.0)
    return change, np.where(new, np.log(areas[face] * (touched.sum(axis=1) + 1) / 2), 0.0)


def by_place(
    log_hit: FloatArray, log_outlier: FloatArray, mean: float, places: IntArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return the log density of the readings of each place, if the surface is nominal and if displaced ``(S, P)``.

    At one place the surface is nominal for all readings, or displaced for all. If one reading is on the part, others at
    the same place are outliers of the sensor.

    Args:
        log_hit: log density of each reading if it is on the part ``(S, n)``.
        log_outlier: log density of each reading if it is off the part ``(S, n)``.
        mean: stated rate of outliers.
        places: number of the place of each reading ``(n,)``; None if each has its own.
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
