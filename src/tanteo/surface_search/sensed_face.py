"""Which face a reading met, near an edge or in a thin wall, where noise puts its point nearer to another one."""

from __future__ import annotations

import numpy as np

from tanteo.shapes import ClosestPoints
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Vectors

GRAZING = 0.02
"""Least cosine of incidence: a beam along a face does not measure it."""

AWAY = float(np.log(1e-6))
"""Log density of a beam that met a face which looks away from it."""

_OFF = 4.0
"""A reading may be this many standard deviations off its face, and its normal as many off the face's."""


def turn_to_beams(
    touches: Touches, target: Target, R: FloatArray, p: Vectors, phi: FloatArray, g: Vectors, met: IntArray
) -> FloatArray:
    """Take the face that a beam came from where noise put its point nearer to one that looks away; in place.

    Near an edge and in a thin wall the nearest face is often not the one that was met.

    Args:
        touches: the readings.
        target: the part.
        R: its attitudes ``(S, 3, 3)``.
        p: the readings in the part's frame ``(S, n, 3)`` [m].
        phi: their signed distances ``(S, n)`` [m]; changed.
        g: gradients ``(S, n, 3)``; changed.
        met: triangle of each ``(S, n)``; changed.

    Returns:
        Squared distance past the border of that face, in standard deviations ``(S, n)``.
    """
    beside = np.zeros(phi.shape)
    if not touches.directed.any():
        return beside
    d = touches.directions @ R  # of the part at every pose
    doubtful = touches.directed & (np.sum(g * d, axis=-1) > -GRAZING)
    s, n = np.nonzero(doubtful & (np.abs(phi - touches.radii) < -AWAY * touches.sd))
    if not len(s):
        return beside
    at, along, sd, radius = p[s, n], d[s, n], touches.sd[n], touches.radii[n]
    near = target.surface.closest(at - (2 * sd)[:, None] * along)
    distance, normal = _off_face(target, at, near)
    past = (target.surface.closest(at - distance[:, None] * normal).distances / sd) ** 2
    gain = 0.5 * ((phi[s, n] - radius) ** 2 - (distance - radius) ** 2) / sd**2 - 0.5 * past - AWAY + np.log(GRAZING)
    ok = (np.sum(normal * along, axis=-1) < -GRAZING) & (gain > 0)
    s, n = s[ok], n[ok]
    phi[s, n], g[s, n], met[s, n], beside[s, n] = distance[ok], normal[ok], near.triangles[ok], past[ok]
    return beside


def turn_to_normals(
    touches: Touches, target: Target, R: FloatArray, p: Vectors, phi: FloatArray, g: Vectors, met: IntArray
) -> FloatArray:
    """The same for sensed normals: take the face across the edge whose normal was sensed; in place."""
    beside = np.zeros(phi.shape)
    if not touches.oriented.any():
        return beside
    m = touches.normals @ R
    least = np.cos(np.minimum(_OFF * touches.normal_sds, 0.5 * np.pi))
    agreement = np.sum(g * m, axis=-1)
    near_enough = np.abs(phi - touches.radii) < _OFF * touches.sd
    s, n = np.nonzero(touches.oriented & (agreement < least) & near_enough)
    if not len(s):
        return beside
    at, along, sd = p[s, n], m[s, n], touches.sd[n]
    across = g[s, n] - agreement[s, n, None] * along
    across *= (_OFF * sd / np.maximum(np.linalg.norm(across, axis=-1), 1e-12))[:, None]
    near = target.surface.closest(np.stack([at - across, at + across]))  # over a convex edge, over a concave one
    distance, normal = _off_face(target, np.stack([at, at]), near)
    past = (target.surface.closest(at - distance[..., None] * normal).distances / sd) ** 2
    misfit = ((distance - touches.radii[n]) / sd) ** 2 + past
    misfit = np.where(np.sum(normal * along, axis=-1) > least[n], misfit, np.inf)
    side, rows = np.argmin(misfit, axis=0), np.arange(len(s))
    ok = misfit[side, rows] < 2 * _OFF**2
    side, rows, s, n = side[ok], rows[ok], s[ok], n[ok]
    phi[s, n], g[s, n], beside[s, n] = distance[side, rows], normal[side, rows], past[side, rows]
    met[s, n] = near.triangles[side, rows]
    return beside


def _off_face(target: Target, at: Vectors, near: ClosestPoints) -> tuple[FloatArray, Vectors]:
    """Signed distances ``(*batch,)`` from the faces of those closest points, and their normals ``(*batch, 3)``."""
    normal = target.surface.normals[near.triangles]
    distance = np.sum((at - near.points) * normal, axis=-1)
    if target.curved is not None:
        target.curved.replace(at, near.triangles, distance, normal)
    return distance, normal
