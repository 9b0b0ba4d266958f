"""Poses from corners: a corner of the image and the far ends of its two segments, matched with a corner of the part.

Three points give two poses under weak perspective (Alter 1994). Newton's method refines them under perspective.
"""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SE3, SO3, maximize
from tanteo.geometry.typing import FloatArray, Transforms, Vectors
from tanteo.parts import Part
from tanteo.parts.readers import near_groups
from tanteo.vision.camera import Camera
from tanteo.vision.segments import Corners, Segments
from tanteo.vision.settings import EVIDENCE, NEWTON_STEPS, SEARCH

_SAME_END = 1e-6
"""Numerical: distance within which two ends are one, as a share of the diagonal. CAD files have more digits."""


def model_paths(part: Part) -> Vectors:
    """Return corners of the part with the far ends of two edges at each ``(P, 3, 3)``: corner, end, end [m].

    The result has both orders of the two ends, and one of the paths that the symmetry of the part maps onto each other.
    """
    ends = part.edges.ends
    slack = _SAME_END * part.diagonal
    flat = ends.reshape(-1, 3)
    label = near_groups(flat, max(slack, 1e-9)).reshape(-1, 2)
    paths = []
    for corner in np.unique(label):
        at = [(int(e), int(s)) for e, s in np.argwhere(label == corner)]
        paths += [[ends[e, s], ends[e, 1 - s], ends[f, 1 - t]] for e, s in at for f, t in at if e != f]
    if not paths:
        return np.zeros((0, 3, 3))
    out = np.array(paths)
    flatness = np.linalg.norm(np.cross(out[:, 1] - out[:, 0], out[:, 2] - out[:, 0]), axis=1)
    out = out[flatness > 1e-3 * part.diagonal**2 * 1e-2]
    return _without_images(part, out)


def _without_images(part: Part, paths: Vectors) -> Vectors:
    """Return one path of every orbit of the symmetry group."""
    kept: list[FloatArray] = []
    for path in paths:
        images = SE3.apply(part.symmetry.Ts[:, None], path)
        if not any(np.any(np.abs(images - other).max(axis=(1, 2)) < 1e-3 * part.diagonal) for other in kept):
            kept.append(path)
    return np.array(kept)


def image_paths(segments: Segments, corners: Corners) -> FloatArray:
    """Return corners of the image with possible ends of their two segments ``(L, 3, 2)``, without distortion [px].

    An edge may be interrupted. So the ends and corners farther along its line are possible ends, too: the nearest
    ``SearchSettings.far_ends`` of them.
    """
    places = np.concatenate([segments.ends.reshape(-1, 2), corners.pixels])
    out = []
    for m in range(len(corners)):
        sides = [
            _far_ends(segments, places, corners.pixels[m], int(corners.segments[m, k]), int(corners.ends[m, k]))
            for k in (0, 1)
        ]
        out += [[corners.pixels[m], first, second] for first in sides[0] for second in sides[1]]
    return np.array(out).reshape(-1, 3, 2)


def _far_ends(segments: Segments, places: FloatArray, corner: FloatArray, s: int, near: int) -> FloatArray:
    """Return places ``(k, 2)`` along a segment from a corner at its end ``near``, the far end of the segment first."""
    end = segments.ends[s, 1 - near]
    way = end - corner
    length = float(np.linalg.norm(way))
    way = way / max(length, 1e-9)
    local = places - corner
    along, off = local @ way, np.abs(local[:, 0] * way[1] - local[:, 1] * way[0])
    good = np.flatnonzero((off < EVIDENCE.reach) & (along > 0.6 * length))
    kept = [end]
    for k in good[np.argsort(along[good], kind="stable")]:
        if len(kept) == SEARCH.far_ends:
            break
        if all(np.linalg.norm(places[k] - other) > EVIDENCE.reach for other in kept):
            kept.append(places[k])
    return np.array(kept)


def poses_from_paths(camera: Camera, images: FloatArray, models: Vectors) -> Transforms:
    """Return poses ``T_camera_part`` that put a model path on an image path, up to two for each pair.

    Args:
        camera: camera of the image.
        images: paths of the image ``(L, 3, 2)``, without distortion [px].
        models: paths of the part ``(P, 3, 3)``, part frame [m].

    Returns:
        Poses ``(k, 4, 4)`` with the three points in front of the camera.
    """
    rays = np.concatenate([(images - camera.centre) / camera.focal, np.ones((*images.shape[:-1], 1))], axis=-1)
    L, P = len(rays), len(models)
    if not L or not P:
        return np.zeros((0, 4, 4))
    # a camera that points at the corner: weak perspective is best there
    axis = rays[:, 0] / np.linalg.norm(rays[:, 0], axis=1, keepdims=True)
    R_view = SO3.inverse(SO3.frame_from_axis(axis, 2))
    local = np.einsum("lij,lkj->lki", R_view, rays)
    flat = local[..., :2] / local[..., 2:]
    a, b = flat[:, None, 1] - flat[:, None, 0], flat[:, None, 2] - flat[:, None, 0]
    A, B = models[None, :, 1] - models[None, :, 0], models[None, :, 2] - models[None, :, 0]
    scale, h1, h2 = _alter(a, b, A, B)
    Ts = []
    for sign in (1.0, -1.0):
        first = np.concatenate([np.broadcast_to(a, (L, P, 2)), sign * h1[..., None]], axis=-1)
        second = np.concatenate([np.broadcast_to(b, (L, P, 2)), sign * h2[..., None]], axis=-1)
        R = _frame(first, second) @ SO3.inverse(
            _frame(np.broadcast_to(A, first.shape), np.broadcast_to(B, first.shape))
        )
        R = SO3.inverse(R_view)[:, None] @ R
        corner = axis[:, None] / np.maximum(scale, 1e-9)[..., None]
        T = SE3.from_parts(R, corner - SE3.apply(R, np.broadcast_to(models[None, :, 0], corner.shape)))
        Ts.append(_newton(T, rays, models))
    both = np.concatenate([T.reshape(-1, 4, 4) for T in Ts])
    points = SE3.apply(both[:, None], np.tile(np.broadcast_to(models, (L, P, 3, 3)).reshape(-1, 3, 3), (2, 1, 1)))
    wanted = np.tile(np.broadcast_to(rays[:, None], (L, P, 3, 3)).reshape(-1, 3, 3), (2, 1, 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(points[..., :2] / points[..., 2:] - wanted[..., :2]).max(axis=(1, 2)) * camera.focal.max()
    good = np.all(points[..., 2] > 0, axis=1) & (off < 2.0)
    return np.asarray(both[good])


def _alter(a: FloatArray, b: FloatArray, A: Vectors, B: Vectors) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return weak-perspective scale and heights of both far ends over the corner, for one of two mirrored poses."""
    d01, d02, d12 = (np.sum(x * x, axis=-1) for x in (a, b, b - a))
    R01, R02, R12 = (np.sum(x * x, axis=-1) for x in (A, B, B - A))
    qa = 2 * (R01 * R02 + R02 * R12 + R12 * R01) - R01**2 - R02**2 - R12**2
    qb = d01 * (-R01 + R02 + R12) + d02 * (R01 - R02 + R12) + d12 * (R01 + R02 - R12)
    qc = 2 * (d01 * d02 + d02 * d12 + d12 * d01) - d01**2 - d02**2 - d12**2
    s2 = (qb + np.sqrt(np.maximum(qb * qb - qa * qc, 0.0))) / qa
    h1 = np.sqrt(np.maximum(s2 * R01 - d01, 0.0))
    h2 = np.sqrt(np.maximum(s2 * R02 - d02, 0.0))
    same = d01 + d02 - d12 <= s2 * (R01 + R02 - R12)
    return np.sqrt(np.maximum(s2, 1e-18)), h1, np.where(same, h2, -h2)


def _frame(first: Vectors, second: Vectors) -> FloatArray:
    x = first / np.maximum(np.linalg.norm(first, axis=-1, keepdims=True), 1e-12)
    z = np.cross(first, second)
    z = z / np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-12)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _newton(T: Transforms, rays: Vectors, models: Vectors) -> Transforms:
    """Return the poses that put the three points on their rays: six equations for six unknowns."""
    wanted, middle = rays[:, None, :, :2], models.mean(axis=1)
    T_part_middle = SE3.from_parts(np.eye(3), middle)  # the origin of the part may be far from it
    T, models = T @ T_part_middle, models - middle[:, None]
    size = float(np.linalg.norm(models[:, 1] - models[:, 0], axis=-1).mean())
    scale = np.r_[np.full(3, size), np.ones(3)]

    def linearize(T: Transforms) -> tuple[FloatArray, FloatArray]:
        local = SE3.apply(T[..., None, :, :], models)
        z = np.where(np.abs(local[..., 2]) > 1e-9, local[..., 2], 1e-9)
        x, y = local[..., 0] / z, local[..., 1] / z
        zero = np.zeros_like(z)
        D = np.stack([np.stack([1 / z, zero, -x / z], -1), np.stack([zero, 1 / z, -y / z], -1)], -2)
        JR = D @ T[..., None, :3, :3]
        J = np.concatenate([JR, np.cross(models[..., None, :], JR)], axis=-1).reshape(*T.shape[:-2], 6, 6) * scale
        off = (wanted - np.stack([x, y], -1)).reshape(*T.shape[:-2], 6)
        Jt = np.swapaxes(J, -1, -2)
        A = Jt @ J
        A = A + 1e-9 * np.trace(A, axis1=-2, axis2=-1)[..., None, None] * np.eye(6) + 1e-15 * np.eye(6)
        return A, (Jt @ off[..., None])[..., 0]

    def moved(T: Transforms, step: FloatArray) -> Transforms:
        step = step * np.minimum(1.0, 0.5 / np.maximum(np.linalg.norm(step, axis=-1), 1e-12))[..., None]
        return np.asarray(T @ SE3.exp(step * scale))

    return np.asarray(maximize(T, linearize, moved, NEWTON_STEPS)[0] @ SE3.inverse(T_part_middle))
