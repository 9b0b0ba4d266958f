"""Straight segments and corners of an image, with covariance.

OpenCV's detector (von Gioi and others 2010) proposes segments. A line is fitted to the sub-pixel edge points along
each, in pixels without distortion, where straight edges are straight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry import freeze
from tanteo.geometry.typing import BoolArray, Covariances, FloatArray, IntArray
from tanteo.vision.camera import Camera, opencv, without_distortion
from tanteo.vision.edges import EdgeMap, cell_of, channel_of
from tanteo.vision.settings import EDGES, EVIDENCE, SEARCH


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """Straight segments, in pixels without distortion.

    Attributes:
        ends: feet of the first and the last edge point on the line ``(n, 2, 2)`` [px].
        middles: means of the edge points ``(n, 2)`` [px].
        directions: unit vectors from the first end to the second ``(n, 2)``.
        covariances: covariances of offset at the middle and direction ``(n, 2, 2)`` [px, rad].
        counts: numbers of edge points of the fits ``(n,)``.
    """

    ends: FloatArray
    middles: FloatArray
    directions: FloatArray
    covariances: Covariances
    counts: IntArray

    def __post_init__(self) -> None:
        freeze(self, "ends", "middles", "directions", "covariances")

    def __len__(self) -> int:
        return len(self.ends)

    @property
    def lengths(self) -> FloatArray:
        """Lengths of the segments ``(n,)`` [px]."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class Corners:
    """Corners, at which two segments end.

    Attributes:
        pixels: intersections of the lines of the segments ``(m, 2)``, without distortion [px].
        covariances: covariances of the pixels ``(m, 2, 2)`` [px^2].
        segments: numbers of the two segments ``(m, 2)``.
        ends: end of each segment at the corner ``(m, 2)``, 0 or 1.
    """

    pixels: FloatArray
    covariances: Covariances
    segments: IntArray
    ends: IntArray

    def __len__(self) -> int:
        return len(self.pixels)


def find_segments(image: FloatArray, camera: Camera, edges: EdgeMap) -> Segments:
    """Find the straight segments of an image.

    Args:
        image: grey levels ``(rows, columns)``.
        camera: camera of the image, for its distortion.
        edges: edges of the image.
    """
    cv2 = opencv()
    picture = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    # rounding to whole levels changes a difference of two pixels by one level at most
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD, quant=1.0).detect(picture)[0]
    lines = np.zeros((0, 2, 2)) if found is None else np.asarray(found, dtype=np.float64).reshape(-1, 2, 2)
    lines = lines[np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1) >= EVIDENCE.stretch]
    # the detector counts from pixel corners
    fitted = [_fitted(camera, edges, line - 0.5) for line in lines]
    return _joined([row for row in fitted if row is not None])


_Row = tuple[FloatArray, FloatArray, FloatArray, FloatArray, int]


def _fitted(camera: Camera, edges: EdgeMap, line: FloatArray) -> _Row | None:
    """Return the line through the edge points along a proposed segment; None if they are few."""
    way = line[1] - line[0]
    length = float(np.linalg.norm(way))
    way = way / length
    normal = np.array([-way[1], way[0]])
    places = line[0] + np.arange(0.0, length + 1.0)[:, None] * way
    row, column, inside = cell_of(edges.points.shape, places)
    which = edges.nearest[channel_of(normal), row, column]
    which = np.unique(which[inside & (which >= 0)])
    off = (edges.points.pixels[which] - line[0]) @ normal
    which = which[np.abs(off) < EVIDENCE.reach]
    if len(which) < EVIDENCE.shortest:
        return None
    return fit_line(without_distortion(camera, edges.points.pixels[which]), edges.points.sds[which], way)


def fit_line(points: FloatArray, sds: FloatArray, way: FloatArray) -> _Row:
    """Fit a straight line to edge points of an image.

    Neighbouring points share noise over a correlation length, and all points share a bias (``EdgeSettings.bias``).

    Args:
        points: points ``(n, 2)`` without distortion [px].
        sds: standard deviations of the points across the line ``(n,)`` [px].
        way: approximate direction of the line, a unit vector ``(2,)``; the fitted direction has its sign.

    Returns:
        End points ``(2, 2)`` [px], weighted middle ``(2,)`` [px], direction ``(2,)``, covariance of offset and angle
        ``(2, 2)`` [px, rad], and number of points.
    """
    w = 1 / (sds**2 + 0.05**2)
    w = w * np.clip(1 - ((points - np.median(points, axis=0)) @ np.array([-way[1], way[0]]) / 6.0) ** 2, 0.05, 1.0)
    middle = (w @ points) / w.sum()
    centred = points - middle
    _, vectors = np.linalg.eigh((centred.T * w) @ centred)
    direction = vectors[:, 1] * np.sign(vectors[:, 1] @ way)
    along = centred @ direction
    spacing = max(float(np.ptp(along)) / len(points), 0.3)
    share = min(spacing / EDGES.correlation, 1.0)
    off = centred @ np.array([-direction[1], direction[0]])
    inflate = max(1.0, float(np.mean(w * off**2)))
    covariance = np.diag(
        [inflate / (w.sum() * share) + EDGES.bias**2, inflate / max(float(w @ along**2) * share, 1e-12)]
    )
    ends = middle + np.array([[along.min()], [along.max()]]) * direction
    return ends, middle, direction, covariance, len(points)


def _joined(rows: list[_Row]) -> Segments:
    """Return the segments, and the unions of two segments on one line."""
    out = list(rows)
    for i in range(len(rows)):
        for j in range(i + 1, len(rows)):
            joint = _join(rows[i], rows[j])
            out += [] if joint is None else [joint]
    columns = [np.array(column) for column in zip(*out, strict=True)]
    return Segments(*(columns or [np.zeros((0, *s)) for s in ((2, 2), (2,), (2,), (2, 2))] + [np.zeros(0, np.int64)]))


def _join(a: _Row, b: _Row) -> _Row | None:
    if abs(a[2] @ b[2]) < np.cos(SEARCH.sharp):
        return None
    ends = np.concatenate([a[0], b[0]])
    apart = np.linalg.norm(a[0][:, None] - b[0][None], axis=2)
    i, j = np.unravel_index(int(np.argmin(apart)), (2, 2))
    whole = b[0][1 - j] - a[0][1 - i]
    length = float(np.linalg.norm(whole))
    lengths = np.linalg.norm(a[0][1] - a[0][0]) + np.linalg.norm(b[0][1] - b[0][0])
    if apart[i, j] > min(2 * EVIDENCE.stretch, 0.5 * lengths) or length < 0.9 * lengths:
        return None
    way = whole / max(length, 1e-9)
    off = (ends - a[0][1 - i]) @ np.array([-way[1], way[0]])
    if np.abs(off).max() > EVIDENCE.reach:
        return None
    # both pieces as points on the common line
    sds = np.sqrt(np.repeat([a[3][0, 0], b[3][0, 0]], 2))
    joint = fit_line(ends, sds, way)
    return joint[0], joint[1], joint[2], joint[3], a[4] + b[4]


def find_corners(segments: Segments, reach: float = EVIDENCE.shortest, least: float = SEARCH.sharp) -> Corners:
    """Find the corners of an image: pairs of segments that end near the intersection of their lines.

    Args:
        segments: segments of the image.
        reach: largest distance of an end from the intersection [px].
        least: smallest angle between the two segments [rad].
    """
    n = len(segments)
    i, j = (index.ravel() for index in np.triu_indices(n, 1))
    d, m = segments.directions, segments.middles
    sine = d[i, 0] * d[j, 1] - d[i, 1] * d[j, 0]
    ok = np.abs(sine) > np.sin(least)
    i, j, sine = i[ok], j[ok], sine[ok]
    gap = m[j] - m[i]
    along = (gap[:, 0] * d[j, 1] - gap[:, 1] * d[j, 0]) / sine
    where = m[i] + along[:, None] * d[i]
    first, near_i = _nearest_end(segments, i, where)
    second, near_j = _nearest_end(segments, j, where)
    keep: BoolArray = (near_i < reach) & (near_j < reach)
    i, j, where = i[keep], j[keep], where[keep]
    covariances = _meeting_covariance(segments, i, j, where)
    return Corners(where, covariances, np.stack([i, j], axis=1), np.stack([first[keep], second[keep]], axis=1))


def _nearest_end(segments: Segments, index: IntArray, where: FloatArray) -> tuple[IntArray, FloatArray]:
    far = np.linalg.norm(segments.ends[index] - where[:, None], axis=2)
    return np.argmin(far, axis=1), far.min(axis=1)


def _meeting_covariance(segments: Segments, i: IntArray, j: IntArray, where: FloatArray) -> Covariances:
    """Return the covariances of intersections of lines ``(m, 2, 2)`` from those of offset and direction [px^2]."""
    rows, variances = [], []
    for k in (i, j):
        d = segments.directions[k]
        rows.append(np.stack([-d[:, 1], d[:, 0]], axis=1))
        along = np.sum((where - segments.middles[k]) * d, axis=1)
        C = segments.covariances[k]
        variances.append(C[:, 0, 0] + 2 * along * C[:, 0, 1] + along**2 * C[:, 1, 1])
    A = np.linalg.inv(np.stack(rows, axis=1)) if len(i) else np.zeros((0, 2, 2))
    return np.asarray(A * np.stack(variances, axis=1)[:, None, :] @ np.swapaxes(A, 1, 2))
