"""First poses for readings without correspondences: three readings on three surface samples the same distances apart.

Every placement of the part puts the three readings near some three samples, so going through all triples of the right
size misses no pose, and needs no guess of where the part is.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tanteo.lie import SE3, SO3
from tanteo.surface_search.target import Target
from tanteo.surface_search.touches import Touches
from tanteo.typing import BoolArray, FloatArray, IntArray, Transforms, Vectors

_BASES = 24
"""Readings among which bases are looked for, and half the number of candidates that a base is chosen from."""

_HASH = np.random.default_rng(1991).integers(-(2**62), 2**62, size=9)
"""Multipliers that make one number of nine."""

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
    sides = np.sqrt(np.stack([_squared(p - q) for p, q in ((a, b), (b, c), (c, a))]))
    area = 0.5 * np.sqrt(_squared(SO3.cross(b - a, c - a)))
    value = area / np.maximum(sides.max(axis=0), 1e-300)  # height over the longest side: neither small nor thin
    value = np.where(sides.max(axis=0) > target.part.diagonal + 4 * touches.sd.max(), 0.0, value)
    out: list[tuple[int, int, int]] = []
    used = np.zeros(n)
    for _ in range(count):
        k = int(np.argmax(value * 0.3 ** used[triples].sum(axis=1)))
        out.append((int(triples[k, 0]), int(triples[k, 1]), int(triples[k, 2])))
        used[triples[k]] += 1
    return out


def triple_poses(touches: Touches, base: tuple[int, ...], target: Target, limit: int) -> Transforms:
    """Poses ``(S, 4, 4)``, ``S`` up to about ``limit``, that put three readings on samples up to their spacing."""
    index = list(base)
    places = [_lifted(target, touches.radii[m]) for m in index]
    p, slack = touches.points[index], target.spacing + 2.0 * touches.sd[index].mean()

    def close(a: int, b: int) -> BoolArray:
        gaps = _gaps(places[a], places[b], target, touches.radii[[index[a], index[b]]])
        return np.asarray(np.abs(gaps - np.linalg.norm(p[a] - p[b])) < slack)

    count = len(target.samples)
    pairs = _thinned(np.flatnonzero(close(0, 1)), limit)
    first, second = np.divmod(pairs, count)
    pair, third = np.divmod(_thinned(np.flatnonzero(close(0, 2)[first] & close(1, 2)[second]), limit), count)
    chosen = np.stack([first[pair], second[pair], third], axis=1)
    Ts = _align([places[m].take(chosen[:, m], axis=0) for m in range(3)], p)
    proper = np.linalg.det(Ts[:, :3, :3]) > 0.5  # three samples in a line give no attitude
    return Ts[proper & _facing(touches, index, Ts, target.normals, chosen)]


def pair_poses(touches: Touches, base: tuple[int, ...], target: Target, limit: int) -> Transforms:
    """The same from two readings with sensed normals, which fix a pose by themselves."""
    index = list(base)
    (p, q), (m, n) = touches.points[index], touches.normals[index]
    radii = touches.radii[index]
    line = q - p - (radii[1] * n - radii[0] * m)  # between the places that the ball touched
    gap = float(np.linalg.norm(line))
    u = line / max(gap, 1e-12)
    wide = np.sin(min(_TILT + 3 * touches.normal_sds[index].max(), 1.0))
    slack = target.spacing + 2.0 * touches.sd[index].mean() + radii.sum() * wide
    lean = np.arcsin(min(slack / max(gap, slack), 1.0))  # a sample off by the slack turns the line between the two
    table = target.pairs
    near = table.between(gap - slack, gap + slack)
    ok = np.abs(table.cosines[near] - m @ n) < 2 * wide
    ok &= np.abs(table.starts[near] - u @ m) < wide + lean
    ok &= np.abs(table.ends[near] - u @ n) < wide + lean
    chosen = near.start + _thinned(np.flatnonzero(ok), limit)
    first, second = table.first[chosen], table.second[chosen]
    a, b = target.samples[first], target.samples[second]
    F = _pair_frames(target.normals[first], target.normals[second], b - a)
    R = _pair_frames(m, n, line) @ np.swapaxes(F, -1, -2)
    middle = 0.5 * (p - radii[0] * m + q - radii[1] * n)
    Ts = SE3.from_parts(R, middle - SE3.apply(R, 0.5 * (a + b)))
    return Ts[_facing(touches, index, Ts, target.normals, np.stack([first, second], axis=1))]


def _pair_frames(m: Vectors, n: Vectors, line: Vectors) -> FloatArray:
    """Frames from two normals, or from their mean and the line between the points where they are nearly parallel."""
    across = SO3.cross(m, n)
    parallel = _squared(across)[..., None] < 0.09
    x = _unit(m)
    z = _unit(SO3.cross(x, np.where(parallel, line, n)))
    return np.stack([x, SO3.cross(z, x), z], axis=-1)


def _thinned(index: IntArray, limit: int) -> IntArray:
    """Evenly thinned to about ``limit`` entries."""
    return np.asarray(index[:: max(1, -(-len(index) // limit))])


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


def _align(q: list[Vectors], p: Vectors) -> Transforms:
    """Rigid motions that carry triangles, their corners ``q`` three of ``(S, 3)``, onto the triangle ``p``."""
    F, G = _triangle_frames(*q), _triangle_frames(*p)
    R = G @ np.swapaxes(F, -1, -2)
    return SE3.from_parts(R, p.mean(axis=0) - SE3.apply(R, (q[0] + q[1] + q[2]) / 3))


def _triangle_frames(a: Vectors, b: Vectors, c: Vectors) -> FloatArray:
    u = _unit(b - a)
    w = _unit(SO3.cross(u, c - a))
    return np.stack([u, SO3.cross(w, u), w], axis=-1)


def _squared(v: Vectors) -> FloatArray:
    return np.asarray(v[..., 0] * v[..., 0] + v[..., 1] * v[..., 1] + v[..., 2] * v[..., 2])


def _unit(v: Vectors) -> Vectors:
    return np.asarray(v / np.maximum(np.sqrt(_squared(v)), 1e-12)[..., None])


def _facing(touches: Touches, index: list[int], Ts: Transforms, normals: Vectors, chosen: IntArray) -> BoolArray:
    """Whether the samples look towards where the readings came from, and along the normals that were sensed."""
    if not (touches.directed[index].any() or touches.oriented[index].any()):
        return np.ones(len(Ts), dtype=bool)
    n_world = normals[chosen] @ np.swapaxes(Ts[:, :3, :3], 1, 2)
    ok = np.all(np.sum(n_world * touches.directions[index], axis=-1) <= _FACING, axis=1)
    cosine = np.where(touches.oriented[index], np.cos(np.minimum(4 * touches.normal_sds[index] + 0.5, np.pi)), -2.0)
    return ok & np.all(np.sum(n_world * touches.normals[index], axis=-1) >= cosine, axis=1)


def score(touches: Touches, Ts: Transforms, target: Target, scale: float, rows: IntArray | None = None) -> FloatArray:
    """Rough misfit of poses: mean of clipped squared distances, in units of ``scale`` squared, as :func:`both_ways`."""
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
    return both_ways(cost)


def both_ways(costs: FloatArray) -> FloatArray:
    """Mean of the costs of readings ``(S, n)``, and mean without the worst, which may be astray ``(S, 2)``."""
    total, n = costs.sum(axis=1), costs.shape[1]
    return np.stack([total / n, (total - costs.max(axis=1)) / max(n - 1, 1)], axis=1)


def either_way(costs: FloatArray, keep: int) -> FloatArray:
    """One cost ``(S,)`` of the two, each in units of the worst that would be kept by it alone.

    One reading astray among eight costs the right pose as much as small misses at all eight cost a wrong one.

    Args:
        costs: from :func:`both_ways` ``(S, 2)``.
        keep: number to keep.
    """
    if not len(costs):
        return costs[:, 0]
    last = np.partition(costs, min(keep, len(costs)) - 1, axis=0)[min(keep, len(costs)) - 1]
    return np.asarray((costs / np.maximum(last, 1e-300)).min(axis=1))


def to_part(Ts: Transforms, points: Vectors) -> Vectors:
    """World points ``(n, 3)`` in the part at every pose ``(S, n, 3)``: one product of matrices for all."""
    Rt = np.ascontiguousarray(np.swapaxes(Ts[:, :3, :3], 1, 2))
    turned = (Rt.reshape(-1, 3) @ points.T).reshape(len(Ts), 3, len(points))
    turned -= Rt @ Ts[:, :3, 3:]
    return np.swapaxes(turned, 1, 2)


def distinct(touches: Touches, Ts: Transforms, costs: FloatArray, target: Target, keep: int, cell: float) -> IntArray:
    """Indices of the best poses, one for each neighbourhood in which the readings lie on the part."""
    chosen = np.zeros(0, dtype=np.int64)
    for share in (5, 40):  # most often the first few hold enough neighbourhoods
        order = lowest(costs, share * keep)
        chosen = order[np.sort(np.unique(cells(touches, Ts[order], cell), return_index=True)[1])][:keep]
        if len(chosen) == keep or len(order) == len(costs):
            break
    return chosen


def cells(touches: Touches, Ts: Transforms, cell: float) -> IntArray:
    """One number ``(S,)`` for poses that put the readings on the same places of the part, within about ``cell``."""
    ends = to_part(Ts, touches.points[[0, len(touches) // 2, len(touches) - 1]])
    return np.asarray(np.rint(ends.reshape(len(Ts), 9) * (1 / cell)).astype(np.int64) @ _HASH)


def lowest(costs: FloatArray, count: int) -> IntArray:
    """Indices of the lowest costs, in order."""
    if count >= len(costs):
        return np.argsort(costs, kind="stable")
    some = np.sort(np.argpartition(costs, count)[:count])
    return np.asarray(some[np.argsort(costs[some], kind="stable")])
