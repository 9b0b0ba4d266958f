"""Shape descriptors of an outline: area, perimeter, centre, axes, Hu's invariants, with covariance.

Moments are integrals along the polygon (Green), exact for straight sides. The complex step gives derivatives that are
exact to rounding. Every point of the outline has an own error along its normal, and all points share a bias.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.geometry import freeze
from tanteo.geometry.typing import Covariances, FloatArray

DESCRIPTOR_NAMES = ("area", "perimeter", "x", "y", "long_axis", "short_axis", *(f"hu{k}" for k in range(1, 8)))
"""Definition: order of the descriptors. The axes are standard deviations of the area along its principal directions."""

_NODES, _WEIGHTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 18
"""Numerical: Gauss-Legendre nodes on a side, exact for the polynomials of fifth degree that occur."""

_POWERS = [(p, q) for p in range(4) for q in range(4 - p)]
"""Definition: powers of x and y of the moments up to third order."""

_TINY = 1e-30
"""Numerical: complex step. Nothing is subtracted, so no step is too small."""


@dataclass(frozen=True, slots=True, eq=False)
class Descriptors:
    """Descriptors of one outline, in the units of its points.

    Attributes:
        values: ``(13,)`` in the order of :data:`DESCRIPTOR_NAMES`.
        covariance: covariance of the values ``(13, 13)``.
    """

    values: FloatArray
    covariance: Covariances

    def __post_init__(self) -> None:
        freeze(self, "values", "covariance")

    def __getitem__(self, name: str) -> float:
        return float(self.values[DESCRIPTOR_NAMES.index(name)])

    def sd(self, name: str) -> float:
        """Return the standard deviation of a descriptor."""
        k = DESCRIPTOR_NAMES.index(name)
        return float(np.sqrt(max(self.covariance[k, k], 0.0)))


def describe(outline: FloatArray, normals: FloatArray, sds: FloatArray, bias: float = 0.0) -> Descriptors:
    """Return the descriptors of a closed outline.

    Args:
        outline: corners in order ``(n, 2)``, either sense.
        normals: outward unit normals ``(n, 2)``.
        sds: independent standard deviations of the corners along their normals ``(n,)``.
        bias: standard deviation of an error along the normal that all corners share.

    Raises:
        InputError: fewer than three corners, or no area.
    """
    values = descriptor_values(outline)
    J = gradient(outline)
    along = np.einsum("knc,nc->kn", J, normals)
    covariance = (along * np.asarray(sds) ** 2) @ along.T + bias**2 * np.outer(along.sum(axis=1), along.sum(axis=1))
    return Descriptors(values, covariance)


def descriptor_values(outline: Any) -> Any:
    """Return the descriptors ``(*batch, 13)`` of outlines ``(*batch, n, 2)``, which may be complex.

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
        raise InputError("outline: expected an area, got points on a line. Give more of the outline.")
    out = _of_sums(sums)
    out[..., 2:4] += middle[..., 0, :]
    return out


def _of_sides(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return the terms of sides ``(*batch, 2)`` of the moments (:data:`_POWERS`) and the perimeter ``(*batch, 11)``.

    ``m_pq = integral of x^(p + 1) y^q / (p + 1) dy`` along the sides.
    """
    x, y = (start[..., k, None] * (1 - _NODES) + end[..., k, None] * _NODES for k in (0, 1))
    step = end - start
    dy = step[..., 1, None] * _WEIGHTS
    xs, ys = [x, x * x, x * x * x, x * x * x * x], [1.0, y, y * y, y * y * y]
    moments = [(xs[p] * ys[q] * dy).sum(axis=-1) / (p + 1) for p, q in _POWERS]
    return np.stack([*moments, np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2)], axis=-1)


def _of_sums(sums: FloatArray) -> FloatArray:
    """Return the descriptors ``(*batch, 13)`` of moments and perimeter ``(*batch, 11)``, either sense."""
    sign = np.sign(sums[..., 0].real)
    m = {power: sign * sums[..., k] for k, power in enumerate(_POWERS)}
    cx, cy = m[1, 0] / m[0, 0], m[0, 1] / m[0, 0]
    mu = {power: _about(m, *power, cx, cy) for power in _POWERS}
    a, b, c = mu[2, 0] / m[0, 0], mu[1, 1] / m[0, 0], mu[0, 2] / m[0, 0]
    root = np.sqrt((0.5 * (a - c)) ** 2 + b * b)
    axes = np.sqrt(0.5 * (a + c) + root), np.sqrt(0.5 * (a + c) - root)
    return np.stack([m[0, 0], sums[..., -1], cx, cy, *axes, *_hu(mu)], axis=-1)


def _about(m: dict[tuple[int, int], FloatArray], p: int, q: int, x: FloatArray, y: FloatArray) -> FloatArray:
    """Return a moment about another point, from moments about the origin."""
    out = np.zeros_like(x)
    for i in range(p + 1):
        for j in range(q + 1):
            out += comb(p, i) * comb(q, j) * (-x) ** (p - i) * (-y) ** (q - j) * m[i, j]
    return out


def _hu(mu: dict[tuple[int, int], FloatArray]) -> list[FloatArray]:
    """Return the seven invariants under rotation, shift and scale (Hu 1962); the last one changes sign in a mirror."""
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


def gradient(outline: FloatArray) -> FloatArray:
    """Return the derivatives by every coordinate ``(13, n, 2)``, by the chain rule over the sums of sides."""
    points = np.asarray(outline, dtype=np.float64)
    start = points - points.mean(axis=0)
    before, after = np.roll(start, 1, axis=0), np.roll(start, -1, axis=0)
    moved = start + 1j * _TINY * np.eye(2)[:, None]
    by_corner = (_of_sides(before, moved) + _of_sides(moved, after)).imag / _TINY
    sums = _of_sides(start, after).sum(axis=0)
    by_sum = _of_sums(sums + 1j * _TINY * np.eye(len(sums))).imag / _TINY
    return np.asarray(np.einsum("sk,cns->knc", by_sum, by_corner))
