"""First poses for readings without correspondences: three readings on three surface samples the same distances apart.

Every placement of the part puts the three readings near some three samples, so going through all triples of the right
size misses no pose, and needs no guess of where the part is.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tanteo.lie import SE3
from tanteo.matching.target import Target
from tanteo.matching.touches import Touches
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_BASES = 24
"""Readings among which bases are looked for, and half the number of candidates that a base is chosen from."""

_TILT = 0.1
"""Slack for the turn of a sample's normal against the surface between samples [rad]."""

_FACING = 0.1
"""A surface with ``n . d`` above this is not met by a reading that came along ``d``."""


def bases(touches: Touches, count: int, target: Target) -> list[tuple[int, int, int]]:
    """Triples of readings with large triangles, no two alike; later ones avoid the readings of the earlier."""
    n = len(touches)
    pick = np.linspace(0, n - 1, min(n, _BASES)).astype(np.int64)
    triples = np.array(list(combinations(pick, 3)))
    a, b, c = (touches.points[triples[:, k]] for k in range(3))
    sides = np.stack([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))])
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    value = area / sides.max(axis=0)  # height over the longest side: neither small nor thin
    value = np.where(sides.max(axis=0) > target.part.diagonal + 4 * touches.sd.max(), 0.0, value)
    out: list[tuple[int, int, int]] = []
    used = np.zeros(n)
    for _ in range(count):
        k = int(np.argmax(value * 0.3 ** used[triples].sum(axis=1)))
        out.append((int(triples[k, 0]), int(triples[k, 1]), int(triples[k, 2])))
        used[triples[k]] += 1
    return out


def triple_poses(touches: Touches, base: tuple[int, int, int], target: Target, limit: int) -> Transforms:
    """Poses ``(S, 4, 4)``, ``S`` up to about ``limit``, that put three readings on samples up to their spacing."""
    index = list(base)
    places = [_lifted(target, touches.radii[m]) for m in index]
    p, slack = touches.points[index], target.spacing + 2.0 * touches.sd[index].mean()

    def close(a: int, b: int) -> BoolArray:
        gaps = _gaps(places[a], places[b], target, touches.radii[[index[a], index[b]]])
        return np.abs(gaps - np.linalg.norm(p[a] - p[b])) < slack

    first, second = _thinned(np.nonzero(close(0, 1)), limit)
    pair, third = _thinned(np.nonzero(close(0, 2)[first] & close(1, 2)[second]), limit)
    chosen = np.stack([first[pair], second[pair], third], axis=1)
    Ts = _align(np.stack([places[m][chosen[:, m]] for m in range(3)], axis=1), p)
    return Ts[_facing(touches, index, Ts, target.normals[chosen])]


def pair_poses(touches: Touches, base: tuple[int, int], target: Target, limit: int) -> Transforms:
    """The same from two readings with sensed normals, which fix a pose by themselves."""
    index = list(base)
    (p, q), (m, n) = touches.points[index], touches.normals[index]
    gap = float(np.linalg.norm(q - p))
    u = (q - p) / max(gap, 1e-12)
    room = np.cos(np.minimum(_TILT + 3 * touches.normal_sds[index].max(), 1.0))
    wide = np.sqrt(1 - room**2)
    slack = target.spacing + 2.0 * touches.sd[index].mean()
    a, b = (_lifted(target, touches.radii[i]) for i in index)
    step = b - a[:, None]
    far = np.maximum(np.linalg.norm(step, axis=-1), 1e-12)
    lean = np.arcsin(min(slack / max(gap, slack), 1.0))  # a sample off by the slack turns the line between the two
    start, end = (
        np.einsum("abi,ai->ab", step, target.normals) / far,
        np.einsum("abi,bi->ab", step, target.normals) / far,
    )
    ok = (np.abs(far - gap) < slack) & (np.abs(target.normals @ target.normals.T - m @ n) < 2 * wide)
    ok &= (np.abs(start - u @ m) < wide + lean) & (np.abs(end - u @ n) < wide + lean)
    first, second = _thinned(np.nonzero(ok), limit)
    F = _pair_frames(target.normals[first], target.normals[second], step[first, second])
    R = _pair_frames(m, n, q - p) @ np.swapaxes(F, -1, -2)
    Ts = SE3.from_parts(R, 0.5 * (p + q) - SE3.apply(R, 0.5 * (a[first] + b[second])))
    return Ts[_facing(touches, index, Ts, target.normals[np.stack([first, second], axis=1)])]


def _pair_frames(m: Vectors, n: Vectors, line: Vectors) -> FloatArray:
    """Frames from two normals, or from their mean and the line between the points where they are nearly parallel."""
    across = np.cross(m, n)
    parallel = np.linalg.norm(across, axis=-1, keepdims=True) < 0.3
    other = np.where(parallel, line, n)
    x = m / np.linalg.norm(m, axis=-1, keepdims=True)
    z = np.cross(x, other)
    z = z / np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-12)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def _thinned(index: tuple[IntArray, ...], limit: int) -> tuple[IntArray, ...]:
    """Evenly thinned to about ``limit`` entries."""
    step = max(1, -(-len(index[0]) // limit))
    return tuple(np.asarray(i[::step]) for i in index)


def oriented_bases(touches: Touches, count: int) -> list[tuple[int, int]]:
    """Pairs of readings with sensed normals, far apart and turned to each other; each reading used sparingly."""
    rows = np.flatnonzero(touches.oriented)[: 2 * _BASES]
    pairs = np.array(list(combinations(rows, 2)))
    p, n = touches.points, touches.normals
    gap = np.linalg.norm(p[pairs[:, 0]] - p[pairs[:, 1]], axis=1)
    across = np.linalg.norm(np.cross(n[pairs[:, 0]], n[pairs[:, 1]]), axis=1)
    value = gap * (0.1 + across)
    out, used = list[tuple[int, int]](), np.zeros(len(touches))
    for _ in range(min(count, len(pairs))):
        k = int(np.argmax(value * 0.3 ** used[pairs].sum(axis=1)))
        out.append((int(pairs[k, 0]), int(pairs[k, 1])))
        used[pairs[k]] += 1
    return out


def _lifted(target: Target, radius: float) -> Vectors:
    """Where the centre of a ball of that radius is when it touches the samples."""
    return target.samples + radius * target.normals


def _gaps(a: Vectors, b: Vectors, target: Target, radii: FloatArray) -> FloatArray:
    return target.gaps if not radii.any() else np.linalg.norm(a[:, None] - b, axis=-1)


def _align(q: Vectors, p: Vectors) -> Transforms:
    """Rigid motions that carry triangles ``q`` ``(S, 3, 3)`` onto the triangle ``p`` ``(3, 3)``."""
    F, G = _triangle_frames(q), _triangle_frames(p)
    R = G @ np.swapaxes(F, -1, -2)
    return SE3.from_parts(R, p.mean(axis=0) - SE3.apply(R, q.mean(axis=1)))


def _triangle_frames(q: Vectors) -> FloatArray:
    u = q[..., 1, :] - q[..., 0, :]
    u = u / np.maximum(np.linalg.norm(u, axis=-1, keepdims=True), 1e-12)
    w = np.cross(u, q[..., 2, :] - q[..., 0, :])
    w = w / np.maximum(np.linalg.norm(w, axis=-1, keepdims=True), 1e-12)
    return np.stack([u, np.cross(w, u), w], axis=-1)


def _facing(touches: Touches, index: list[int], Ts: Transforms, normals: Vectors) -> BoolArray:
    """Whether the samples look towards where the readings came from, and along the normals that were sensed."""
    if not (touches.directed[index].any() or touches.oriented[index].any()):
        return np.ones(len(Ts), dtype=bool)
    n_world = normals @ np.swapaxes(Ts[:, :3, :3], 1, 2)
    ok = np.all(np.sum(n_world * touches.directions[index], axis=-1) <= _FACING, axis=1)
    cosine = np.where(touches.oriented[index], np.cos(np.minimum(4 * touches.normal_sds[index] + 0.5, np.pi)), -2.0)
    return ok & np.all(np.sum(n_world * touches.normals[index], axis=-1) >= cosine, axis=1)


def score(touches: Touches, Ts: Transforms, target: Target, scale: float, rows: IntArray | None = None) -> FloatArray:
    """Rough misfit of poses ``(S,)``: mean of clipped squared distances, in units of ``scale`` squared."""
    rows = np.arange(len(touches)) if rows is None else rows
    distance, gradient = target.field(to_part(Ts, touches.points[rows]))
    r = (distance - touches.radii[rows]) / scale
    cost = np.minimum(r * r, 9.0)
    if touches.directed[rows].any():
        d = touches.directions[rows] @ Ts[:, :3, :3]
        cost += 9.0 * np.maximum(np.sum(gradient * d, axis=-1), 0.0) ** 2
    if touches.oriented[rows].any():
        m = touches.normals[rows] @ Ts[:, :3, :3]
        cost += np.where(touches.oriented[rows], 4.0 * (1 - np.sum(gradient * m, axis=-1)), 0.0)
    return np.asarray(cost.mean(axis=1))


def to_part(Ts: Transforms, points: Vectors) -> Vectors:
    """World points ``(n, 3)`` in the part at every pose ``(S, n, 3)``."""
    return (points - Ts[:, None, :3, 3]) @ Ts[:, :3, :3]


def distinct(touches: Touches, Ts: Transforms, costs: FloatArray, target: Target, keep: int, cell: float) -> IntArray:
    """Indices of the best poses, one for each neighbourhood in which the readings lie on the part."""
    order = np.argsort(costs, kind="stable")[: 40 * keep]
    ends = to_part(Ts[order], touches.points[[0, len(touches) // 2, len(touches) - 1]])
    key = np.rint(ends.reshape(len(order), 9) / cell).astype(np.int64)
    _, first = np.unique(key, axis=0, return_index=True)
    return order[np.sort(first)][:keep]
