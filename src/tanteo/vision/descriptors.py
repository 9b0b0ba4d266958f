"""Shape descriptors of an outline: area, perimeter, centre, axes, Hu's invariants, with covariance.

Moments are integrals along the polygon (Green), exact for straight sides; derivatives by the complex step, exact to
rounding. Every point of the outline errs along its normal by its own deviation, and all of them together by a bias.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.errors import InputError
from tanteo.frames.covariances import frozen_array
from tanteo.typing import Covariances, FloatArray

NAMES = ("area", "perimeter", "x", "y", "long_axis", "short_axis", *(f"hu{k}" for k in range(1, 8)))
"""The order of a vector of descriptors. The axes are standard deviations of the area along its principal directions."""

_NODES, _WEIGHTS = 0.5 + np.sqrt(0.15) * np.array([-1.0, 0.0, 1.0]), np.array([5.0, 8.0, 5.0]) / 18
_POWERS = [(p, q) for p in range(4) for q in range(4 - p)]


@dataclass(frozen=True, slots=True, eq=False)
class Descriptors:
    """Descriptors of one outline, in the units of its points.

    Attributes:
        values: ``(13,)`` in the order of :data:`NAMES`.
        covariance: ``(13, 13)``.
    """

    values: FloatArray
    covariance: Covariances

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen_array(self.values))
        object.__setattr__(self, "covariance", frozen_array(self.covariance))

    def __getitem__(self, name: str) -> float:
        return float(self.values[NAMES.index(name)])

    def sd(self, name: str) -> float:
        """Standard deviation of one of them."""
        k = NAMES.index(name)
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
    after = np.roll(points, -1, axis=-2)
    middle = points.mean(axis=-2, keepdims=True)
    m = _moments(points - middle, after - middle)
    area = m[0, 0]
    if np.any(np.abs(area.real) < 1e-12 * np.ptp(points.real, axis=-2).max() ** 2):
        raise InputError("outline: expected an area, got points on a line. Take more of the outline.")
    sign = np.sign(area.real)
    m = {k: sign * v for k, v in m.items()}
    cx, cy = m[1, 0] / m[0, 0], m[0, 1] / m[0, 0]
    step = after - points
    perimeter = np.sqrt(step[..., 0] ** 2 + step[..., 1] ** 2).sum(axis=-1)
    mu = _moments(
        points - middle - np.stack([cx, cy], -1)[..., None, :], after - middle - np.stack([cx, cy], -1)[..., None, :]
    )
    mu = {k: sign * v for k, v in mu.items()}
    a, b, c = mu[2, 0] / m[0, 0], mu[1, 1] / m[0, 0], mu[0, 2] / m[0, 0]
    root = np.sqrt((0.5 * (a - c)) ** 2 + b * b)
    axes = np.sqrt(0.5 * (a + c) + root), np.sqrt(0.5 * (a + c) - root)
    place = cx + middle[..., 0, 0], cy + middle[..., 0, 1]
    return np.stack([m[0, 0], perimeter, *place, *axes, *_hu(mu)], axis=-1)


def _moments(start: FloatArray, end: FloatArray) -> dict[tuple[int, int], FloatArray]:
    """``m_pq = integral of x^(p + 1) y^q / (p + 1) dy`` along the sides."""
    t = _NODES
    x = start[..., 0, None] * (1 - t) + end[..., 0, None] * t
    y = start[..., 1, None] * (1 - t) + end[..., 1, None] * t
    dy = (end[..., 1] - start[..., 1])[..., None] * _WEIGHTS
    return {(p, q): (x ** (p + 1) * y**q * dy).sum(axis=(-1, -2)) / (p + 1) for p, q in _POWERS}


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
    """Derivatives by every coordinate ``(13, n, 2)``."""
    points = np.asarray(outline, dtype=np.float64)
    n = len(points)
    size = float(np.ptp(points, axis=0).max())
    h = 1e-30 * size
    moved = np.broadcast_to(points.astype(np.complex128), (2 * n, n, 2)).copy()
    k = np.arange(2 * n)
    moved[k, k // 2, k % 2] += 1j * h
    return np.asarray((descriptor_values(moved).imag / h).T.reshape(len(NAMES), n, 2))
