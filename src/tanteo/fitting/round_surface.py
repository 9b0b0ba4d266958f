"""Round surfaces and rims in their own frames: distances of points, their derivatives, their curvature.

Each is ``F(p, s)`` of a point ``p`` in the feature's frame and the size ``s`` (radius, half angle): signed distances,
zero on the feature, positive outside the round body. One row for a surface, two for a rim (``math.md`` section 8).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from tanteo.typing import FloatArray, Vectors

_TINY = 1e-300


class Distances(NamedTuple):
    """Of points ``(*batch, n, 3)`` from a round feature; ``k`` rows a point.

    Attributes:
        F: signed distances ``(*batch, n, k)`` [m].
        G: ``dF / dp`` ``(*batch, n, k, 3)``; the outward normal of a surface.
        by_size: ``dF / ds`` ``(*batch, n, k)``.
        H: second derivatives of the last row ``(*batch, n, 3, 3)`` [1/m]; those of the first row of a rim are zero.
        normal_by_size: ``dG / ds`` of the last row ``(*batch, n, 3)``.
    """

    F: FloatArray
    G: FloatArray
    by_size: FloatArray
    H: FloatArray
    normal_by_size: FloatArray


Distance: TypeAlias = Callable[[Vectors, FloatArray], Distances]
"""``(p (*batch, n, 3), s (*batch, 1)) -> Distances``."""


def _radial(p: Vectors) -> tuple[FloatArray, Vectors, FloatArray]:
    """Distance from the z axis, the unit vector away from it, and the projection across both ``(.., 3, 3)``."""
    rho = np.sqrt(p[..., 0] ** 2 + p[..., 1] ** 2)
    e = p * np.array([1.0, 1.0, 0.0]) / np.maximum(rho, _TINY)[..., None]
    around = np.stack([-e[..., 1], e[..., 0], np.zeros_like(rho)], axis=-1)
    return rho, e, around[..., :, None] * around[..., None, :]


def _of_one(F: FloatArray, N: Vectors, by_size: FloatArray, H: FloatArray, turned: Vectors) -> Distances:
    return Distances(F[..., None], N[..., None, :], by_size[..., None], H, turned)


def cylinder(p: Vectors, s: FloatArray) -> Distances:
    """``rho - r`` about z."""
    rho, e, around = _radial(p)
    H = around / np.maximum(rho, _TINY)[..., None, None]
    return _of_one(rho - s, e, np.full(rho.shape, -1.0), H, np.zeros_like(e))


def sphere(p: Vectors, s: FloatArray) -> Distances:
    """``|p| - r``."""
    d = np.sqrt(np.sum(p * p, axis=-1))
    N = p / np.maximum(d, _TINY)[..., None]
    H = (np.eye(3) - N[..., :, None] * N[..., None, :]) / np.maximum(d, _TINY)[..., None, None]
    return _of_one(d - s, N, np.full(d.shape, -1.0), H, np.zeros_like(N))


def cone(p: Vectors, s: FloatArray) -> Distances:
    """``rho cos(s) - z sin(s)`` of the cone about +z with its apex in the origin and half angle ``s``."""
    rho, e, around = _radial(p)
    c, t = np.cos(s), np.sin(s)
    z, unit = p[..., 2], np.array([0.0, 0.0, 1.0])
    N = e * c[..., None] - unit * t[..., None]
    H = around * (c / np.maximum(rho, _TINY))[..., None, None]
    return _of_one(rho * c - z * t, N, -rho * t - z * c, H, -e * t[..., None] - unit * c[..., None])


def rim(p: Vectors, s: FloatArray) -> Distances:
    """``(z, rho - r)`` of the circle about the origin in the plane z = 0."""
    rho, e, around = _radial(p)
    up = np.broadcast_to(np.array([0.0, 0.0, 1.0]), e.shape)
    F, G = np.stack([p[..., 2], rho - s], axis=-1), np.stack([up, e], axis=-2)
    by_size = np.broadcast_to(np.array([0.0, -1.0]), F.shape)
    return Distances(F, G, by_size, around / np.maximum(rho, _TINY)[..., None, None], np.zeros_like(e))
