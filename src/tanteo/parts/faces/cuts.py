"""Cut a mesh with three or more triangles at an edge into sheets with at most two, without moving any point.

Vertices are duplicated, and each triangle is assigned the adjacent triangle that continues it (Gueziec et al. 2001,
*Cutting and stitching: converting sets of polygons to manifold surfaces*).
"""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.readers.topology import components, directed_edges, edge_counts

_MANY = 32
"""Number of triangles at one edge above which they are paired in angular order without optimization."""


def crowded_edges(triangles: IntArray) -> int:
    """Return the number of edges that three or more triangles share.

    Args:
        triangles: vertex indices ``(T, 3)``.
    """
    _, ahead, back = edge_counts(triangles)
    return int((ahead + back > 2).sum())


def cut(vertices: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Cut a surface so that each edge has one triangle, or two with consistent winding.

    Around an edge with equally many triangles in both directions, the two with material between them stay together, so
    that bodies that touch along an edge separate. Otherwise those triangles stay together that continue each other with
    the smallest angle. The remaining triangles end there, at a rim.

    Args:
        vertices: vertices ``(V, 3)``.
        triangles: vertex indices ``(T, 3)``, consistently wound wherever two share an edge.

    Returns:
        Vertices, some of them duplicated; triangles, which may be reversed; and the original triangle of each.
    """
    points, faces, parents = _parted(vertices, triangles, _pairs(vertices, triangles))
    consistent = consistently_wound(faces)
    if (consistent != faces).any():
        points, faces, again = _parted(points, consistent, _pairs(points, consistent))
        parents = parents[again]
    return points, faces, parents


def consistently_wound(triangles: IntArray) -> IntArray:
    """Return triangles with consistent winding across edges of two triangles, as far as possible.

    Args:
        triangles: vertex indices ``(T, 3)``.
    """
    _, ahead, back = edge_counts(triangles)
    if not ((ahead + back == 2) & (ahead != back)).any():
        return triangles
    import igl  # slow to import, and seldom needed

    return np.asarray(igl.bfs_orient(triangles)[0], dtype=np.int64)


def _pairs(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Return pairs of directed edges (by number) across which the surface continues; a rim is paired with itself."""
    edges, _ = directed_edges(triangles)
    forward: BoolArray = edges[:, 0] < edges[:, 1]
    keys = edges.min(axis=1) * (int(triangles.max()) + 1) + edges.max(axis=1)
    order = np.argsort(keys, kind="stable")
    _, starts, counts = np.unique(keys[order], return_index=True, return_counts=True)
    twos = starts[counts == 2]
    pairs = np.stack([order[twos], order[twos + 1]], axis=1)
    found = [pairs[forward[pairs[:, 0]] != forward[pairs[:, 1]]]]
    for start, count in zip(starts[counts > 2], counts[counts > 2], strict=True):
        mine = order[start : start + count]
        some = _edge_pairs(vertices, triangles, mine, forward[mine])
        found.append(np.array(some, dtype=np.int64).reshape(-1, 2))
    paired = np.concatenate(found)
    alone = np.setdiff1d(np.arange(len(edges)), paired)
    return np.concatenate([paired, np.stack([alone, alone], axis=1)])


def _edge_pairs(vertices: FloatArray, triangles: IntArray, mine: IntArray, forward: BoolArray) -> list[tuple[int, int]]:
    """Return pairs of the triangles at one edge."""
    angles = _angles(vertices, triangles, mine)
    ranks = np.argsort(angles, kind="stable")
    if 2 * int(forward.sum()) == len(mine):
        # Counter-clockwise about the edge, material begins at a triangle that runs back and ends at one ahead.
        opens = [not bool(forward[k]) for k in ranks]
        return [(int(mine[ranks[i]]), int(mine[ranks[j]])) for i, j in _brackets(opens)]
    if len(mine) > _MANY:
        return [(int(mine[a]), int(mine[b])) for a, b in zip(ranks[::2], ranks[1::2], strict=False)]
    found: list[tuple[int, int]] = []
    left = list(range(len(mine)))
    while True:
        turns = [(abs(np.pi - abs(angles[i] - angles[j])), i, j) for n, i in enumerate(left) for j in left[n + 1 :]]
        if not turns:
            return found
        _, i, j = min(turns)
        found.append((int(mine[i]), int(mine[j])))
        left = [k for k in left if k not in (i, j)]


def _brackets(opens: list[bool]) -> list[tuple[int, int]]:
    """Return matching pairs of opening and closing brackets on a ring with equally many of each."""
    depth = 0
    lowest = 0
    first = 0
    for k, opening in enumerate(opens):
        depth += 1 if opening else -1
        if depth < lowest:
            lowest = depth
            first = k + 1
    waiting: list[int] = []
    pairs = []
    for k in [*range(first, len(opens)), *range(first)]:
        if opens[k]:
            waiting.append(k)
        else:
            pairs.append((waiting.pop(), k))
    return pairs


def _angles(vertices: FloatArray, triangles: IntArray, mine: IntArray) -> FloatArray:
    """Return the angles of the triangles of directed edges around their common edge, in -pi to pi [rad]."""
    rows = mine % len(triangles)
    sides = mine // len(triangles)
    corners = triangles[rows]
    ends = np.sort(corners[0, [sides[0], (sides[0] + 1) % 3]])
    apexes = vertices[np.take_along_axis(corners, (sides[:, None] + 2) % 3, axis=1)[:, 0]]
    axis = vertices[ends[1]] - vertices[ends[0]]
    axis = axis / max(float(np.linalg.norm(axis)), 1e-300)
    away = apexes - vertices[ends[0]]
    away = away - (away @ axis)[:, None] * axis
    first = away[int(np.argmax(np.linalg.norm(away, axis=1)))]
    first = first / max(float(np.linalg.norm(first)), 1e-300)
    return np.asarray(np.arctan2(away @ np.cross(axis, first), away @ first))


def _parted(vertices: FloatArray, triangles: IntArray, pairs: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Give each fan of triangles around a vertex, as connected by the pairs, its own vertex."""
    count = len(triangles)
    rows = pairs % count
    sides = pairs // count
    first = rows * 3 + sides
    second = rows * 3 + (sides + 1) % 3
    flat = triangles.reshape(-1)
    same = flat[first[:, 0]] == flat[first[:, 1]]
    begins = np.where(same, first[:, 1], second[:, 1])
    finishes = np.where(same, second[:, 1], first[:, 1])
    labels = components(3 * count, np.r_[first[:, 0], second[:, 0]], np.r_[begins, finishes])
    _, lowest = np.unique(labels, return_index=True)
    return _halved(vertices[flat[lowest]], labels.reshape(-1, 3), pairs)


def _halved(points: FloatArray, faces: IntArray, pairs: IntArray) -> tuple[FloatArray, IntArray, IntArray]:
    """Insert a midpoint where several pairs of triangles still share both ends of an edge."""
    edges, _ = directed_edges(faces)
    ends = edges[pairs[:, 0]]
    keys = ends.min(axis=1) * len(points) + ends.max(axis=1)
    _, first = np.unique(keys, return_index=True)
    doubled = np.setdiff1d(np.arange(len(pairs)), first)
    middles: dict[tuple[int, int, int], int] = {}
    for k, pair in enumerate(doubled.tolist()):
        for edge in pairs[pair].tolist():
            start, end = edges[edge].tolist()
            middles[edge % len(faces), start, end] = len(points) + k
    if not middles:
        return points, faces, np.arange(len(faces))
    points = np.concatenate([points, points[ends[doubled]].mean(axis=1)])
    touched = np.unique([row for row, _, _ in middles])
    rest = np.setdiff1d(np.arange(len(faces)), touched)
    pieces = [(row, piece) for row in touched.tolist() for piece in _pieces(row, tuple(faces[row].tolist()), middles)]
    corners = np.array([piece for _, piece in pieces], dtype=np.int64)
    return points, np.concatenate([faces[rest], corners]), np.r_[rest, [row for row, _ in pieces]]


def _pieces(
    row: int, corners: tuple[int, int, int], middles: dict[tuple[int, int, int], int]
) -> list[tuple[int, int, int]]:
    """Return a triangle cut at the midpoints of its sides."""
    a, b, c = corners
    for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
        if (row, p, q) in middles:
            m = middles[row, p, q]
            return [*_pieces(row, (p, m, r), middles), *_pieces(row, (m, q, r), middles)]
    return [corners]
