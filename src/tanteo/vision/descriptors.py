"""Shape descriptors of an outline: area, perimeter, centre, axes, Hu's invariants, with covariance.

Moments are integrals along the polygon (Green), exact for straight sides; derivatives by the complex step, exact to
rounding. Every point of the outline errs along its normal by its own deviation, and all of them together by a bias.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING, Any

import numpy as np

from tanteo.errors import InputError
from tanteo.frames import freeze
from tanteo.lie import SE3
from tanteo.shapes import Surface
from tanteo.typing import Covariances, FloatArray
from tanteo.vision.camera import opencv

if TYPE_CHECKING:
    from tanteo.vision.models import Rest, VisionModel


DESCRIPTOR_NAMES = ("area", "perimeter", "x", "y", "long_axis", "short_axis", *(f"hu{k}" for k in range(1, 8)))
"""The order of a vector of descriptors. The axes are standard deviations of the area along its principal directions."""

_NODES, _WEIGHTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 18
_POWERS = [(p, q) for p in range(4) for q in range(4 - p)]

_TINY = 1e-30
"""The complex step: nothing is subtracted, so none is too small."""


@dataclass(frozen=True, slots=True, eq=False)
class Descriptors:
    """Descriptors of one outline, in the units of its points.

    Attributes:
        values: ``(13,)`` in the order of :data:`DESCRIPTOR_NAMES`.
        covariance: ``(13, 13)``.
    """

    values: FloatArray
    covariance: Covariances

    def __post_init__(self) -> None:
        freeze(self, "values", "covariance")

    def __getitem__(self, name: str) -> float:
        return float(self.values[DESCRIPTOR_NAMES.index(name)])

    def sd(self, name: str) -> float:
        """Standard deviation of one of them."""
        k = DESCRIPTOR_NAMES.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))


def describe(outline: FloatArray, normals: FloatArray, sds: FloatArray, bias: float = 0.0) -> Descriptors:
    """Descriptors of a closed outline.

    Args:
        outline: corners in order ``(n, 2)``, either sense.
        normals: unit, outward ``(n, 2)``.
        sds: of each corner along its normal ``(n,)``, independent.
        bias: standard deviation of an error along the normal that all corners share.

    Raises:
        InputError: fewer than three corners, or no area.
    """
    values = descriptor_values(outline)
    J = _gradient(outline)
    along = np.einsum("knc,nc->kn", J, normals)
    covariance = (along * np.asarray(sds) ** 2) @ along.T + bias**2 * np.outer(along.sum(axis=1), along.sum(axis=1))
    return Descriptors(values, covariance)


def descriptor_values(outline: Any) -> Any:
    """The descriptors of outlines ``(*batch, n, 2)`` as ``(*batch, 13)``; may be complex.

    Raises:
        InputError: fewer than three corners, or no area.
    """
    points = np.asarray(outline)
    if points.shape[-2] < 3 or points.shape[-1] != 2:
        raise InputError(f"outline: expected three or more corners (n, 2), got shape {points.shape}.")
    middle = points.mean(axis=-2, keepdims=True)
    start = points - middle
    sums = _of_sides(start, np.roll(start, -1, axis=-2)).sum(axis=-2)
    if np.any(np.abs(sums[..., 0].real) < 1e-12 * np.ptp(points.real, axis=-2).max() ** 2):
        raise InputError("outline: expected an area, got points on a line. Take more of the outline.")
    out = _of_sums(sums)
    out[..., 2:4] += middle[..., 0, :]
    return out


def _of_sides(start: FloatArray, end: FloatArray) -> FloatArray:
    """What each side ``(*batch, 2)`` adds to the moments (:data:`_POWERS`) and to the perimeter ``(*batch, 11)``.

    ``m_pq = integral of x^(p + 1) y^q / (p + 1) dy`` along the sides.
    """
    x, y = (start[..., k, None] * (1 - _NODES) + end[..., k, None] * _NODES for k in (0, 1))
    step = end - start
    dy = step[..., 1, None] * _WEIGHTS
    xs, ys = [x, x * x, x * x * x, x * x * x * x], [1.0, y, y * y, y * y * y]
    moments = [(xs[p] * ys[q] * dy).sum(axis=-1) / (p + 1) for p, q in _POWERS]
    return np.stack([*moments, np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2)], axis=-1)


def _of_sums(sums: FloatArray) -> FloatArray:
    """The descriptors ``(*batch, 13)`` of moments and perimeter ``(*batch, 11)``, either sense."""
    sign = np.sign(sums[..., 0].real)
    m = {power: sign * sums[..., k] for k, power in enumerate(_POWERS)}
    cx, cy = m[1, 0] / m[0, 0], m[0, 1] / m[0, 0]
    mu = {power: _about(m, *power, cx, cy) for power in _POWERS}
    a, b, c = mu[2, 0] / m[0, 0], mu[1, 1] / m[0, 0], mu[0, 2] / m[0, 0]
    root = np.sqrt((0.5 * (a - c)) ** 2 + b * b)
    axes = np.sqrt(0.5 * (a + c) + root), np.sqrt(0.5 * (a + c) - root)
    return np.stack([m[0, 0], sums[..., -1], cx, cy, *axes, *_hu(mu)], axis=-1)


def _about(m: dict[tuple[int, int], FloatArray], p: int, q: int, x: FloatArray, y: FloatArray) -> FloatArray:
    """A moment about another point, from those about the origin."""
    out = np.zeros_like(x)
    for i in range(p + 1):
        for j in range(q + 1):
            out += comb(p, i) * comb(q, j) * (-x) ** (p - i) * (-y) ** (q - j) * m[i, j]
    return out


def _hu(mu: dict[tuple[int, int], FloatArray]) -> list[FloatArray]:
    """Hu's seven invariants under turning, shift and scale (Hu 1962); the last changes sign in a mirror."""
    n = {(p, q): v / mu[0, 0] ** (1 + 0.5 * (p + q)) for (p, q), v in mu.items() if p + q >= 2}
    a, b = n[3, 0] + n[1, 2], n[2, 1] + n[0, 3]
    c, d = n[3, 0] - 3 * n[1, 2], 3 * n[2, 1] - n[0, 3]
    e, f = n[2, 0] - n[0, 2], n[1, 1]
    return [
        n[2, 0] + n[0, 2],
        e * e + 4 * f * f,
        c * c + d * d,
        a * a + b * b,
        c * a * (a * a - 3 * b * b) + d * b * (3 * a * a - b * b),
        e * (a * a - b * b) + 4 * f * a * b,
        d * a * (a * a - 3 * b * b) - c * b * (3 * a * a - b * b),
    ]


def _gradient(outline: FloatArray) -> FloatArray:
    """Derivatives by every coordinate ``(13, n, 2)``: of the sums by the two sides that it moves, then of the rest."""
    points = np.asarray(outline, dtype=np.float64)
    start = points - points.mean(axis=0)
    before, after = np.roll(start, 1, axis=0), np.roll(start, -1, axis=0)
    moved = start + 1j * _TINY * np.eye(2)[:, None]
    by_corner = (_of_sides(before, moved) + _of_sides(moved, after)).imag / _TINY
    sums = _of_sides(start, after).sum(axis=0)
    by_sum = _of_sums(sums + 1j * _TINY * np.eye(len(sums))).imag / _TINY
    return np.asarray(np.einsum("sk,cns->knc", by_sum, by_corner))


_ACROSS = 600
"""Pixels of the drawing across the part."""

_COMPARED = ("area", "perimeter", "long_axis", "short_axis")

SLACK = 0.1
"""Relative error of lengths that perspective and shadows make."""


def outline_from_above(surface: Surface, rest: Rest) -> Descriptors:
    """Descriptors [m] of the silhouette of a part at rest, seen from straight above; holes are filled."""
    cv2 = opencv()
    flat = SE3.apply(rest.T_table_part, surface.vertices)[:, :2]
    low = flat.min(axis=0)
    step = float(np.ptp(flat, axis=0).max()) / _ACROSS
    up = SE3.apply(rest.T_table_part[:3, :3], surface.normals)[:, 2] > 0
    scaled = (flat - low) / step + 2.0
    mask = np.zeros((_ACROSS + 5, _ACROSS + 5), dtype=np.uint8)
    for polygon in np.rint(scaled[surface.triangles[up]] * 16).astype(np.int32):
        cv2.fillConvexPoly(mask, polygon, 1, lineType=cv2.LINE_8, shift=4)
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_TC89_KCOS)
    points = max(found, key=cv2.contourArea)[:, 0].astype(np.float64)
    tangents = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
    return describe((points - 2.0) * step + low, normals, np.full(len(points), 0.5 * step))


def like_outline(
    outline: Descriptors, models: Sequence[VisionModel], slack: float = SLACK
) -> list[tuple[VisionModel, int, float]]:
    """Parts and stable poses by how like their outlines are to one on the table, the likest first.

    Area, perimeter and axes are compared as logarithms, with the covariance of the outline and a relative slack.

    Args:
        outline: of a region, on the table [m].
        models: the parts.
        slack: relative standard deviation of lengths.

    Returns:
        Part, number of its stable pose, squared distance in standard deviations (four degrees of freedom).
    """
    rows = [DESCRIPTOR_NAMES.index(name) for name in _COMPARED]
    powers = np.array([2.0, 1.0, 1.0, 1.0])
    relative = outline.covariance[np.ix_(rows, rows)] / np.outer(outline.values[rows], outline.values[rows])
    # one error of scale, which all share, and one of each
    S = relative + slack**2 * (0.5 * np.outer(powers, powers) + 0.5 * np.diag(powers**2))
    out = []
    for model in models:
        for k, known in enumerate(model.outlines):
            gap = np.log(outline.values[rows] / known.values[rows])
            out.append((model, k, float(gap @ np.linalg.solve(S, gap))))
    return sorted(out, key=lambda row: row[2])
