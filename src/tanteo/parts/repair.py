"""Triangles as a file lists them -> a closed mesh with outward winding, or a sentence that says why not."""

from __future__ import annotations

import numpy as np

from tanteo.errors import PartError
from tanteo.parts.topology import components, directed_edges, edge_counts, near_groups, volume_and_centroid, wound_alike
from tanteo.typing import FloatArray, IntArray

MERGE_STEPS = (1e-8, 1e-6, 1e-5)
"""Distances below which two vertices are one, tried in turn until the mesh closes, relative to the diagonal."""

NEEDLE = 1e-7
"""A triangle this much lower than long (relative to the diagonal) has no area."""

SMALL_HOLE = 0.03
"""A hole is filled when its rim is shorter than this share of the diagonal."""


def closed_mesh(vertices: FloatArray, triangles: IntArray, label: str) -> tuple[FloatArray, IntArray, list[str]]:
    """Merge, clean, wind and check the triangles of a file.

    Returns:
        Vertices, triangles (closed, outward) and one sentence for each repair.

    Raises:
        PartError: empty, not finite, open, non-manifold, not orientable, or without volume.
    """
    if not len(triangles):
        raise PartError(
            f"{label}: expected triangles, got an empty mesh. Is the file a mesh? Export the part again as a solid."
        )
    used = vertices[np.unique(triangles)]
    if not np.isfinite(used).all():
        raise PartError(f"{label}: expected finite coordinates, got NaN or infinity. Export the part again.")
    diagonal = float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))
    if diagonal == 0.0:
        raise PartError(f"{label}: expected a part, got {len(used)} points in one place. Export it again.")
    for step in MERGE_STEPS:
        points, faces, repairs = _cleaned(vertices, triangles, step * diagonal, diagonal)
        if len(faces) and not open_edges(faces):
            break
    points, faces = _filled(points, faces, diagonal, repairs)
    faces = _wound(points, faces, label, repairs)
    volume, _ = volume_and_centroid(points, faces)
    if volume < 1e-9 * diagonal**3:
        raise PartError(f"{label}: expected a solid, got a mesh without volume. Export the part as a solid.")
    return points, faces, repairs


def open_edges(triangles: IntArray) -> int:
    """Count the edges that an odd number of triangles share."""
    _, ahead, back = edge_counts(triangles)
    return int(((ahead + back) % 2 == 1).sum())


def merge_vertices(points: FloatArray, distance: float) -> tuple[FloatArray, IntArray]:
    """Merge points closer than ``distance`` (chains of them too).

    Returns:
        The merged points and, for each given point, the index of the one it became.
    """
    unique, index = np.unique(points, axis=0, return_inverse=True)
    labels = near_groups(unique, distance)
    _, first = np.unique(labels, return_index=True)
    return unique[first], labels[index.reshape(-1)]


def _cleaned(
    vertices: FloatArray, triangles: IntArray, distance: float, diagonal: float
) -> tuple[FloatArray, IntArray, list[str]]:
    used, compact = np.unique(triangles, return_inverse=True)
    points, index = merge_vertices(vertices[used], distance)
    faces = index[compact.reshape(-1)].reshape(-1, 3)
    repairs = []
    equal = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    if equal.any():
        repairs.append(f"Dropped {int(equal.sum())} triangles whose corners coincide.")
        faces = faces[~equal]
    kept = _without_duplicates(faces)
    if len(kept) < len(faces):
        repairs.append(f"Dropped {len(faces) - len(kept)} duplicate triangles.")
    faces, flipped = _without_needles(points, kept, NEEDLE * diagonal)
    if flipped:
        repairs.append(f"Retriangulated {flipped} triangles that had no area.")
    return points, faces, repairs


def _without_duplicates(faces: IntArray) -> IntArray:
    """Keep one of equal triangles; drop both of a pair that faces opposite ways (a wall without thickness)."""
    if not len(faces):
        return faces
    order = np.argsort(faces, axis=1)
    even = (order == [0, 1, 2]).all(1) | (order == [1, 2, 0]).all(1) | (order == [2, 0, 1]).all(1)
    _, first, group = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True)
    net = np.bincount(group.reshape(-1), weights=np.where(even, 1.0, -1.0))
    return faces[np.sort(first[net != 0.0])]


def _without_needles(points: FloatArray, faces: IntArray, height: float) -> tuple[IntArray, int]:
    """Flip the long edge of each triangle without area, which keeps the mesh closed (dropping would open it)."""
    faces = faces.copy()
    flipped = 0
    for _ in range(10):
        corners = points[faces]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        needles = np.flatnonzero(doubled < height * sides.max(axis=1))
        if not len(needles):
            break
        changed = _flip_needles(faces, needles, sides)
        flipped += changed
        if not changed:
            break
    return faces, flipped


def _flip_needles(faces: IntArray, needles: IntArray, sides: FloatArray) -> int:
    edges, owner = directed_edges(faces)
    across = {(int(a), int(b)): int(t) for (a, b), t in zip(edges, owner, strict=True)}
    touched: set[int] = set()
    for needle in map(int, needles):
        k = int(np.argmax(sides[needle]))
        a, c, b = (int(faces[needle, (k + i) % 3]) for i in range(3))
        other = across.get((c, a))
        if other is None or needle in touched or other in touched:
            continue
        d = int(next(v for v in faces[other] if v not in (a, c)))
        if d == b:
            continue
        # The neighbour (c, a, d) and the needle (a, c, b) become (b, a, d) and (c, b, d).
        faces[needle], faces[other] = (b, a, d), (c, b, d)
        touched.update((needle, other))
    return len(touched) // 2


def _filled(points: FloatArray, faces: IntArray, diagonal: float, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Close small holes with a fan of triangles about the middle of their rim."""
    if not len(faces) or not open_edges(faces):
        return points, faces
    edges, _ = directed_edges(faces)
    following = {(int(a), int(b)) for a, b in edges}
    rim = {b: a for a, b in following if (b, a) not in following}
    filled = 0
    while rim:
        start, end = next(iter(rim.items()))
        loop = [start]
        while end != start and end in rim and len(loop) <= len(rim):
            loop.append(end)
            end = rim[end]
        for vertex in loop:
            rim.pop(vertex, None)
        ring = points[loop]
        length = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1).sum()
        if end != start or len(loop) < 3 or length > SMALL_HOLE * diagonal:
            continue
        points = np.vstack([points, ring.mean(axis=0)])
        fan = [(loop[i], loop[(i + 1) % len(loop)], len(points) - 1) for i in range(len(loop))]
        faces = np.vstack([faces, np.array(fan, dtype=np.int64)])
        filled += 1
    if filled:
        repairs.append(f"Filled {filled} small holes.")
    return points, faces


def _wound(points: FloatArray, faces: IntArray, label: str, repairs: list[str]) -> IntArray:
    """Make the winding consistent and outward; refuse what has no inside."""
    _, ahead, back = edge_counts(faces)
    total = ahead + back
    if (total == 1).any():
        raise PartError(
            f"{label}: expected a closed surface, got {int((total == 1).sum())} open edges. "
            "Repair the mesh or export the part as a solid."
        )
    if (total != 2).any():
        raise PartError(
            f"{label}: expected two triangles at every edge, got {int((total != 2).sum())} non-manifold edges. "
            "Unite the bodies in CAD and export them again."
        )
    if (ahead != back).any():
        alike = wound_alike(faces)
        if alike is None:
            raise PartError(f"{label}: expected two sides, got a surface that cannot be oriented. Repair it.")
        faces = _outward(points, alike)
        repairs.append("Made the winding of the triangles consistent.")
    elif volume_and_centroid(points, faces)[0] < 0.0:
        faces = faces[:, ::-1].copy()
        repairs.append("Turned the surface inside out: its normals pointed into the material.")
    return faces


def _outward(points: FloatArray, faces: IntArray) -> IntArray:
    """Turn each closed shell outward, and inward where an odd number of other shells surrounds it."""
    import igl  # slow to import, and seldom needed

    labels = bodies(faces)
    shells = [faces[labels == label] for label in range(labels.max() + 1)]
    result = faces.copy()
    for label, shell in enumerate(shells):
        inside = 0
        for other, outer in enumerate(shells):
            if other != label:
                probe = points[shell[0, :1]]
                inside += int(abs(igl.winding_number(points, outer, probe)[0]) > 0.5)
        if (volume_and_centroid(points, shell)[0] < 0.0) != (inside % 2 == 1):
            result[labels == label] = shell[:, ::-1]
    return result


def bodies(faces: IntArray) -> IntArray:
    """Label the connected shells of a mesh: ``(T,)`` from 0."""
    count = int(faces.max()) + 1
    labels = components(count, faces[:, [0, 1]].reshape(-1), faces[:, [1, 2]].reshape(-1))[faces[:, 0]]
    return np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64)
