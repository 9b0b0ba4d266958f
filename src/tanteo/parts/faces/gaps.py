"""Close gaps of a mesh: vertices on the side of an adjacent triangle, and small holes."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.readers.topology import edge_counts, mesh_edges

SMALL_HOLE = 0.05
"""Largest rim length of a hole that is filled, as a fraction of the diagonal."""

_PASSES = 8
"""Number of passes, each of which splits a triangle at most once."""


_MOST_OPEN = 20_000
"""Largest number of open edges for which gaps are repaired; a mesh with more is not a surface."""


def open_edges(triangles: IntArray) -> int:
    """Return the number of edges that an odd number of triangles share.

    Args:
        triangles: vertex indices ``(T, 3)``.
    """
    _, ahead, back = edge_counts(triangles)
    return int(((ahead + back) % 2 == 1).sum())


def split_sides(points: FloatArray, faces: IntArray, distance: float) -> tuple[IntArray, int]:
    """Split triangles at vertices of others that lie on their open sides, without moving any point.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``.
        distance: distance within which a vertex lies on a side.

    Returns:
        Triangles, and the number of split sides.
    """
    split = 0
    for _ in range(_PASSES):
        edges = _odd_edges(faces)
        found = _on_sides(points, edges, distance)
        if not found:
            break
        faces, changed = _with_vertices(faces, found)
        split += changed
        if not changed:
            break
    return faces, split


def _odd_edges(faces: IntArray) -> IntArray:
    ends, ahead, back = edge_counts(faces)
    return ends[(ahead + back) % 2 == 1]


def _on_sides(points: FloatArray, edges: IntArray, distance: float) -> dict[tuple[int, int], int]:
    """Return a vertex of other open edges for each open edge on which one lies."""
    from scipy.spatial import cKDTree  # slow to import, and seldom needed

    if not 0 < len(edges) <= _MOST_OPEN:
        return {}
    rim = np.unique(edges)
    tree = cKDTree(points[rim])
    a = points[edges[:, 0]]
    b = points[edges[:, 1]]
    lengths = np.linalg.norm(b - a, axis=1)
    near = tree.query_ball_point((a + b) / 2.0, lengths / 2.0 + distance)
    found = {}
    for (start, end), origin, direction, length, some in zip(edges, a, b - a, lengths, near, strict=True):
        others = rim[np.array(some, dtype=np.int64)]
        others = others[(others != start) & (others != end)]
        if not len(others) or length == 0.0:
            continue
        local = points[others] - origin
        along = local @ direction / length
        off = np.linalg.norm(local - along[:, None] * direction / length, axis=1)
        inside = (off < distance) & (along > distance) & (along < length - distance)
        if inside.any():
            # take the vertex nearest to the midpoint, so that the longest sides are halved first
            k = int(np.argmin(np.where(inside, np.abs(along - length / 2.0), np.inf)))
            found[int(start), int(end)] = int(others[k])
    return found


def _with_vertices(faces: IntArray, found: dict[tuple[int, int], int]) -> tuple[IntArray, int]:
    rows: list[tuple[int, int, int]] = []
    changed = 0
    for a, b, c in faces.tolist():
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
            vertex = found.get((min(p, q), max(p, q)))
            if vertex is not None and vertex != r:
                rows += [(p, vertex, r), (vertex, q, r)]
                changed += 1
                break
        else:
            rows.append((a, b, c))
    return np.array(rows, dtype=np.int64).reshape(-1, 3), changed


def fill_holes(points: FloatArray, faces: IntArray, diagonal: float) -> tuple[FloatArray, IntArray, list[str]]:
    """Fill small holes of a mesh with a fan of triangles about the centre of their rim.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``, at most two at an edge.
        diagonal: diagonal of the mesh.

    Returns:
        Points, triangles, and a sentence if something was filled.
    """
    loops = [loop for loop in _rims(faces) if _length(points[loop]) < SMALL_HOLE * diagonal]
    if not loops:
        return points, faces, []
    widest = 0.0
    middles = [points]
    fans = [faces]
    for k, loop in enumerate(loops):
        middle = points[loop].mean(axis=0)
        widest = max(widest, float(2.0 * np.linalg.norm(points[loop] - middle, axis=1).max()))
        middles.append(middle[None])
        fan = np.stack([np.roll(loop, -1), loop, np.full(len(loop), len(points) + k)], axis=1)
        fans.append(fan if len(loop) > 3 else loop[None, ::-1])
    points = np.concatenate(middles)
    faces = np.concatenate(fans)
    holes = "1 small hole" if len(loops) == 1 else f"{len(loops)} small holes"
    return points, faces, [f"Filled {holes}, up to {100.0 * widest / diagonal:.2g} % of the size wide."]


def _length(ring: FloatArray) -> float:
    return float(np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum())


def _rims(faces: IntArray) -> list[IntArray]:
    """Return closed loops of vertices along rims, in the direction of the adjacent triangles."""
    edges = mesh_edges(faces)
    rims = edges.rims
    ends = edges.ends[rims]
    owners = faces[edges.left[rims]]
    # from the first to the second end where the triangle runs that way
    at = (owners == ends[:, :1]).argmax(axis=1)
    ahead = np.take_along_axis(owners, ((at + 1) % 3)[:, None], axis=1)[:, 0] == ends[:, 1]
    directed = np.where(ahead[:, None], ends, ends[:, ::-1])
    following = dict(directed.tolist())
    loops = []
    while following:
        start, end = following.popitem()
        loop = [start]
        while end != start and end in following:
            loop.append(end)
            end = following.pop(end)
        if end == start and len(loop) > 2:
            loops.append(np.array(loop, dtype=np.int64))
    return loops
