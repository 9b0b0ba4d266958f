"""Which faces a reading near an edge may have met, and how likely each is beforehand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tanteo.shapes import SHARP, Junctions
from tanteo.surface_search.sensed_face import AWAY, GRAZING
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import FloatArray, IntArray, Vectors


def with_others(
    touches: Touches, target: Target, faces: Junctions, at: Vectors, outward: Vectors, n: IntArray, nearest: IntArray
) -> tuple[Junctions, FloatArray]:
    """The faces at the edge, the nearest one and the one that the beam or normal tells, if these are others; each once.

    Where noise is as large as walls are thick, the nearest edge need not be one of the face that was met.

    Returns:
        The faces ``(k, F)``, and half the squared distance past the border of the others, in deviations ``(k, F)``.
    """
    sd = touches.sd[n]
    triangles = nearest[:, None]
    if outward.any():
        triangles = np.stack([nearest, target.surface.closest(at + 2 * sd[:, None] * outward).triangles], axis=1)
    normals = target.surface.normals[triangles]
    offsets = np.sum(normals * target.surface.vertices[target.surface.triangles[triangles, 0]], axis=-1)
    gaps = np.sum(normals * at[:, None], axis=-1) - offsets
    known = np.sum(faces.normals * at[:, None], axis=-1) - faces.offsets
    alike = (normals @ np.swapaxes(faces.normals, 1, 2) > np.cos(SHARP)) & faces.valid[:, None]
    alike &= np.abs(gaps[..., None] - known[:, None]) < sd[:, None, None]
    new = ~alike.any(axis=2)
    if new.shape[1] > 1:
        same = (np.sum(normals[:, 0] * normals[:, 1], axis=-1) > np.cos(SHARP)) & (np.abs(np.diff(gaps)[:, 0]) < sd)
        new[:, 1] &= ~same
    past = np.zeros(new.shape)
    k, j = np.nonzero(new)
    if not len(k):
        return faces, np.zeros(faces.valid.shape)
    foot = at[k] - gaps[k, j, None] * normals[k, j]
    past[k, j] = 0.5 * (target.surface.closest(foot).distances / sd[k]) ** 2
    lines = np.zeros((*new.shape, 2))
    others = Junctions(normals, offsets, np.zeros((*lines.shape, 3)), lines, lines, np.zeros_like(new), new, triangles)
    return others.beside(faces), np.concatenate([past, np.zeros(faces.valid.shape)], axis=1)


def weights(touches: Touches, target: Target, faces: Junctions, along: Vectors, n: IntArray) -> FloatArray:
    """Log of ``w`` for each face ``(k, 6)``."""
    cosine = -(faces.normals @ along[:, :, None])[..., 0]
    aimed = np.where(cosine > 0, np.log(np.maximum(cosine, GRAZING)), AWAY)
    log = np.where(touches.directed[n, None], aimed, -np.log(target.part.area))
    return np.asarray(np.where(faces.valid, log, -np.inf))


def exact_planes(target: Target, at: Vectors, faces: Junctions) -> Junctions:
    """The same with the planes that touch curved faces near the points, not those of their facets."""
    if target.curved is None:
        return faces
    at = np.broadcast_to(at[:, None], faces.normals.shape)
    normals, d = np.array(faces.normals), np.sum(faces.normals * at, axis=-1) - faces.offsets
    target.curved.replace(at, faces.triangles, d, normals)
    return replace(faces, normals=normals, offsets=np.sum(normals * at, axis=-1) - d)
