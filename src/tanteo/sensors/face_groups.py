"""Divide readings into groups that are probably on one face each, without knowing the part."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import BoolArray, FloatArray, IntArray, Vectors

_MOST_FACES = 64
"""Numerical: largest number of faces with their own state; further readings count alone."""

_SAME_FACE = math.radians(20)
"""Numerical: largest angle between approaches to one face; people and programs approach a face along its normal."""

_LEAST_ON_PLANE = 4
"""Numerical: fewest readings of a plane, one more than determine it."""

_FEW, _TRIPLES = 16, 600
"""Numerical: number of readings up to which all triples are tried as a plane, and number of random triples of more."""

_SDS = 3.0
"""Numerical: distance from the plane of a face up to which a reading belongs to it [standard deviations]."""


def faces_of(
    points: Vectors, aims: Vectors, on_surface: BoolArray, sds: FloatArray, labels: tuple[str, ...]
) -> tuple[IntArray, Vectors]:
    """Return the number of the face of each reading, -1 for none, and an approach to each face ``(f, 3)``.

    Readings with one label belong to one face. Of the others, those whose approaches are within 20 degrees of each
    other belong to one face if four or more lie on a plane; the plane with most readings comes first. The rest joins
    the face whose plane, by regression with a prior on its tilt, predicts a reading best, or begins a new one.

    Args:
        points: sensed points ``(n, 3)`` [m].
        aims: directions of beam or approach, zero for none ``(n, 3)``.
        on_surface: mask of the readings that are points of one face ``(n,)``.
        sds: standard deviations of the readings about the plane of their face ``(n,)`` [m].
        labels: label of each reading; empty for none.
    """
    numbers, faces = np.full(len(points), -1), list[_Face]()
    labelled = np.array([bool(label) for label in labels], dtype=np.bool_)
    left = aims.any(axis=1) & on_surface & ~labelled
    while len(faces) < _MOST_FACES and len(members := _on_one_plane(points, aims, sds, np.flatnonzero(left))):
        numbers[members], left[members] = len(faces), False
        faces.append(_Face("", aims[members[0]], points[members[0]], complete=True))
    for k in np.flatnonzero((aims.any(axis=1) & on_surface & labelled) | left):
        gaps = [one.gap(labels[k], aims[k], points[k]) for one in faces]
        best = int(np.argmin(gaps)) if gaps else -1
        if not gaps or gaps[best] > _SDS:
            if len(faces) == _MOST_FACES:
                continue
            best = len(faces)
            faces.append(_Face(labels[k], aims[k], points[k]))
        faces[best].add(points[k], sds[k] ** 2)
        numbers[k] = best
    return numbers, np.array([one.aim for one in faces]).reshape(-1, 3)


def divided(
    numbers: IntArray, aims: Vectors, faces: tuple[int, ...], labels: tuple[str, ...]
) -> tuple[IntArray, Vectors]:
    """Return groups of readings without a label divided by the face of the part, and an approach to each group.

    Args:
        numbers: number of the group of each reading, -1 for none ``(n,)``.
        aims: an approach to each group ``(g, 3)``.
        faces: index of the face of each reading in an assumed pose; empty for no pose.
        labels: label of each reading; empty for none.
    """
    if not faces:
        return numbers, aims
    keys = [(int(k), -1 if label else face) for k, face, label in zip(numbers, faces, labels, strict=True)]
    groups = {key: n for n, key in enumerate(dict.fromkeys(key for key in keys if key[0] >= 0))}
    return np.array([groups.get(key, -1) for key in keys], dtype=np.int64), aims[[k for k, _ in groups]]


def _on_one_plane(points: Vectors, aims: Vectors, own: FloatArray, rows: IntArray) -> IntArray:
    """Return the rows of the plane through most readings with similar approaches; none if fewer than four lie on it."""
    if len(rows) < _LEAST_ON_PLANE:
        return rows[:0]
    p, a = points[rows], aims[rows] / np.linalg.norm(aims[rows], axis=1, keepdims=True)
    triples = np.array(list(combinations(range(len(rows)), 3))) if len(rows) <= _FEW else None
    if triples is None:
        triples = np.random.default_rng(0).integers(len(rows), size=(_TRIPLES, 3))
    along = np.cross(p[triples[:, 1]] - p[triples[:, 0]], p[triples[:, 2]] - p[triples[:, 0]])
    size = np.linalg.norm(along, axis=1)
    along, triples = along[size > 0] / size[size > 0, None], triples[size > 0]
    along *= np.sign(np.sum(along * a[triples[:, 0]], axis=1, keepdims=True))
    near = along @ a.T > math.cos(_SAME_FACE)
    heights = np.abs(along @ p.T - np.sum(along * p[triples[:, 0]], axis=1)[:, None])
    on = near & (heights < _SDS * own[rows]) & near[np.arange(len(triples))[:, None], triples].all(axis=1)[:, None]
    if not len(triples) or on.sum(axis=1).max() < _LEAST_ON_PLANE:
        return rows[:0]
    return rows[on[np.argmax(on.sum(axis=1))]]


class _Face:
    """Plane through readings of one face: linear regression of their heights along the first approach."""

    def __init__(self, label: str, aim: Vectors, point: Vectors, *, complete: bool = False) -> None:
        self.label, self.aim, self._origin, self._complete = label, aim, point, complete
        self._axes = SO3.frame_from_axis(aim, 2)
        self._information = np.diag([0.0, *np.full(2, np.tan(_SAME_FACE / _SDS) ** -2)])
        self._vector = np.zeros(3)
        self._variance = 0.0
        self._covariance = np.zeros((3, 3))

    def gap(self, label: str, aim: Vectors, point: Vectors) -> float:
        """Return the distance of a reading from the plane [standard deviations]; infinite for another face."""
        if label or self.label:
            return 0.0 if label == self.label else np.inf
        if self._complete or aim @ self.aim < np.cos(_SAME_FACE):
            return np.inf
        row, height = self._row(point)
        predicted = row @ self._covariance
        return float(abs(height - predicted @ self._vector) / np.sqrt(predicted @ row + self._variance))

    def add(self, point: Vectors, variance: float) -> None:
        """Add a reading with the variance of its height about the plane [m^2]."""
        row, height = self._row(point)
        self._information += np.outer(row, row) / variance
        self._vector += row * height / variance
        self._covariance = np.linalg.inv(self._information)
        self._variance = variance

    def _row(self, point: Vectors) -> tuple[Vectors, float]:
        x, y, z = self._axes.T @ (point - self._origin)
        return np.array([1.0, x, y]), float(z)
