"""Planes that labels and normals show: through the points of a label each, or through one point with its normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.features import label_kind
from tanteo.inference.labels import groups_of
from tanteo.inference.settings import SearchSettings
from tanteo.measurements import ContactPoints
from tanteo.typing import BoolArray, FloatArray, IntArray, Vectors


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


def labelled_planes(points: ContactPoints, settings: SearchSettings) -> Planes:
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
        if sizes[2] > settings.gate * sd * np.sqrt(len(rows)) or width < settings.gate * sd:
            continue
        toward = points.inward[rows].sum(axis=0) @ n
        n = -n if toward > 0 else n
        span = np.linalg.norm(p - middle, axis=1).max()
        tilt = sd / (width * np.sqrt(len(rows)))
        found.append(
            (n, n @ middle, middle, span, points.radii[rows].mean(), tilt, toward != 0, sd / np.sqrt(len(rows)), rows)
        )
    for k in np.flatnonzero(
        points.oriented & ~points.centres & (groups < 0) & (points.normal_sds < settings.plane_normal_sd)
    ):
        n, p = points.normals[k], points.points[k]
        found.append((n, n @ p, p, 0.0, points.radii[k], points.normal_sds[k], True, points.sd[k], np.array([k])))
    n, offsets, middles, spans, radii, tilts, sided, sds, own = zip(*found, strict=True) if found else [()] * 9
    return Planes(
        np.array(n).reshape(-1, 3), np.array(offsets), np.array(middles).reshape(-1, 3), np.array(spans),
        np.array(radii), np.array(tilts), np.array(sided, dtype=bool), np.array(sds), tuple(own),
    )  # fmt: skip
