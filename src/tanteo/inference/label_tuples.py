"""Poses from labels: three labelled planes on three faces that stand to each other as they do.

A label says that its points share one face. Three planes that are not parallel to one line fix a pose, so that few
triples of faces are left: the tuples of the interpretation tree (Grimson and Lozano-Perez 1984), here proposals only.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from tanteo.features import label_kind
from tanteo.inference.labels import groups_of
from tanteo.inference.prepared import PreparedPart
from tanteo.lie import SE3, SO3
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_FACES = 64
"""Largest faces of a part that are tried: labels are given to faces that a person discriminates."""

_FLAT = 3.0
"""Points of a label are of a plane if they scatter about theirs by no more than so many standard deviations."""

_TILT, _SDS = 0.02, 3.0
"""Angles agree within so much [rad] and so many standard deviations."""

_KNOWN = 0.1
"""Standard deviation of a sensed normal up to which it is known which faces it may be of [rad]."""

_INDEPENDENT = 0.2
"""Triple product of three normals from which they fix a pose well."""

_MOST = 1500
"""Triples of faces that are tried for each side from which the planes may be seen, the largest faces first."""


@dataclass(frozen=True, slots=True, eq=False)
class Planes:
    """Planes through the points of a label each, or through one point with its normal: ``normals . x = offsets``.

    Attributes:
        normals: of unit length; outward where the sensor's direction is known ``(n, 3)``.
        offsets: of the points, or of the centres of the tip's ball ``(n,)`` [m].
        middles: of the points ``(n, 3)`` [m].
        spans: how far the points reach from there ``(n,)`` [m].
        radii: of the tip ``(n,)`` [m].
        tilts: standard deviations of the normals ``(n,)`` [rad].
        sided: whether the side of the material is known ``(n,)``.
        sds: of the height of each at its middle ``(n,)`` [m].
        rows: of the points of each.
    """

    normals: Vectors
    offsets: FloatArray
    middles: Vectors
    spans: FloatArray
    radii: FloatArray
    tilts: FloatArray
    sided: BoolArray
    sds: FloatArray
    rows: tuple[IntArray, ...]


def labelled_planes(points: ContactPoints) -> Planes:
    """Planes of the labels that have three points or more and fit one, and of points with a sensed normal."""
    groups, found = groups_of(points), []
    for g in range(groups.max(initial=-1) + 1):
        rows = np.flatnonzero(groups == g)
        if len(rows) < 3 or label_kind(points.kinds[rows[0]]).shape != "plane":
            continue
        p, sd = points.points[rows], float(points.sd[rows].max())
        middle = p.mean(axis=0)
        _, sizes, axes = np.linalg.svd(p - middle, full_matrices=False)
        n, width = axes[2], sizes[1] / np.sqrt(len(rows))
        if sizes[2] > _FLAT * sd * np.sqrt(len(rows)) or width < _FLAT * sd:
            continue
        toward = points.inward[rows].sum(axis=0) @ n
        n = -n if toward > 0 else n
        span = np.linalg.norm(p - middle, axis=1).max()
        tilt = sd / (width * np.sqrt(len(rows)))
        found.append(
            (n, n @ middle, middle, span, points.radii[rows].mean(), tilt, toward != 0, sd / np.sqrt(len(rows)), rows)
        )
    for k in np.flatnonzero(points.oriented & ~points.centres & (groups < 0) & (points.normal_sds < _KNOWN)):
        n, p = points.normals[k], points.points[k]
        found.append((n, n @ p, p, 0.0, points.radii[k], points.normal_sds[k], True, points.sd[k], np.array([k])))
    n, offsets, middles, spans, radii, tilts, sided, sds, own = zip(*found, strict=True) if found else [()] * 9
    return Planes(
        np.array(n).reshape(-1, 3), np.array(offsets), np.array(middles).reshape(-1, 3), np.array(spans),
        np.array(radii), np.array(tilts), np.array(sided, dtype=bool), np.array(sds), tuple(own),
    )  # fmt: skip


def from_labels(planes: Planes, prepared: PreparedPart) -> Transforms:
    """Poses that put three labelled planes on three faces that have room for them ``(S, 4, 4)``.

    None where no three planes fix a pose.
    """
    best, faces = _three(planes), prepared.part.planes
    if best is None or len(faces) < 3:
        return np.zeros((0, 4, 4))
    large = np.argsort(-faces.areas, kind="stable")[:_FACES]
    N, centroids, radii = faces.normals[large], faces.centroids[large], _radii(prepared)[large]
    offsets, middles, spans = np.sum(N * centroids, axis=1), planes.middles[best], planes.spans[best]
    room = radii > spans[:, None] / 2
    angles, across = np.arccos((N @ N.T).clip(-1, 1)), np.cross(N[:, None], N)
    out = []
    for signs in product(*((1,) if planes.sided[i] else (1, -1) for i in best)):
        n = np.array(signs)[:, None] * planes.normals[best]
        heights = np.array(signs) * planes.offsets[best] - planes.radii[best]
        triples = _alike(n, N, angles, across, planes.tilts[best], room)
        R = _frames(n[None])[0] @ np.swapaxes(_frames(N[triples]), 1, 2)
        Ts = _placed(R, N[triples], heights - offsets[triples])
        off = SE3.apply(SE3.inverse(Ts)[:, None], middles) - centroids[triples]
        triples = triples[np.all(np.linalg.norm(off, axis=-1) < radii[triples] + spans, axis=1)]
        R = SO3.align(N[triples], np.broadcast_to(n, (len(triples), 3, 3)))
        out.append(_placed(R, N[triples], heights - offsets[triples]))
    return np.concatenate(out)


def _radii(prepared: PreparedPart) -> FloatArray:
    """How far the planar faces of a part reach from their centroids ``(M,)`` [m]."""
    planes = prepared.part.planes
    of = np.repeat(np.arange(len(planes)), np.diff(planes.boundary_start))
    away = np.linalg.norm(planes.boundary - planes.centroids[of], axis=1)
    return np.asarray(np.maximum.reduceat(away, planes.boundary_start[:-1]))


def _three(planes: Planes) -> list[int] | None:
    """Three planes that fix a pose best: independent, of those that are known best."""
    rows = np.argsort(planes.tilts, kind="stable")[:6]
    triples = list(combinations(rows.tolist(), 3))
    if not triples:
        return None
    sizes = [abs(np.linalg.det(planes.normals[list(t)])) for t in triples]
    best = int(np.argmax(sizes))
    return list(triples[best]) if sizes[best] > _INDEPENDENT else None


def _alike(
    n: Vectors, N: Vectors, angles: FloatArray, across: FloatArray, tilts: FloatArray, room: BoolArray
) -> np.ndarray:
    """Triples of faces that have room, with the angles of three normals and their handedness ``(K, 3)``."""

    def fits(i: int, j: int) -> BoolArray:
        within = _TILT + _SDS * float(np.hypot(tilts[i], tilts[j]))
        near = np.abs(angles - np.arccos(np.clip(n[i] @ n[j], -1, 1))) < within
        return np.asarray(near & room[i][:, None] & room[j])

    a, b = np.nonzero(fits(0, 1))
    pair, c = np.nonzero(fits(0, 2)[a] & fits(1, 2)[b])
    triples = np.column_stack([a[pair], b[pair], c])
    volumes = np.einsum("ki,ki->k", across[triples[:, 0], triples[:, 1]], N[triples[:, 2]]) * np.sign(np.linalg.det(n))
    triples = triples[volumes > 0.5 * _INDEPENDENT]  # of the same handedness, and a pose follows
    return triples[np.argsort(triples.sum(axis=1), kind="stable")[:_MOST]]


def _placed(R: FloatArray, N: FloatArray, heights: FloatArray) -> Transforms:
    """Poses of those attitudes that move three faces of normals ``(K, 3, 3)`` of the part by heights ``(K, 3)``."""
    shifts = np.linalg.solve(N @ np.swapaxes(R, 1, 2), heights[..., None])[..., 0]
    return SE3.from_parts(R, np.asarray(shifts, dtype=np.float64))


def _frames(normals: FloatArray) -> FloatArray:
    """Right-handed frames ``(K, 3, 3)``: along the first of three normals, and across it and the second."""
    x = normals[:, 0]
    z = np.cross(x, normals[:, 1])
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)
