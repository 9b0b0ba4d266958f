"""Repair the triangles of a file to a mesh with outward winding and at most two triangles per edge."""

from __future__ import annotations

import numpy as np

from tanteo import _core
from tanteo.errors import PartError
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.crossings import crossings
from tanteo.parts.faces.cuts import consistently_wound, crowded_edges, cut
from tanteo.parts.faces.gaps import fill_holes, open_edges, split_sides
from tanteo.parts.faces.sides import outward, united, with_sides, without_loose
from tanteo.parts.readers.topology import (
    compacted,
    directed_edges,
    edge_counts,
    first_rows,
    longest_sides,
    near_groups,
    triangle_geometry,
    volume_and_centroid,
)

MERGE_STEPS = (1e-8, 1e-6, 1e-5)
"""Distances, relative to the diagonal, below which vertices are merged, tried in turn until the mesh closes."""

NEEDLE = 1e-7
"""Ratio of height to diagonal below which a triangle counts as having no area."""


def sound_mesh(vertices: FloatArray, triangles: IntArray, label: str) -> tuple[FloatArray, IntArray, list[str]]:
    """Merge, clean, cut, close and orient the triangles of a file.

    Args:
        vertices: vertices ``(V, 3)``.
        triangles: vertex indices ``(T, 3)``.
        label: name of the file for messages.

    Returns:
        Vertices; outward triangles with at most two per edge; and one sentence for each repair. An open surface stays
        open, or has each triangle twice if its outside is unknown.

    Raises:
        PartError: the mesh is empty, not finite, or without area.
    """
    if not len(triangles):
        got = f"{len(vertices):,} points alone" if len(vertices) else "an empty mesh"
        raise PartError(
            f"{label}: expected triangles, got {got}. Is the file a mesh? Export the part again as a solid."
        )
    used = vertices[compacted(triangles)[0]]
    if not np.isfinite(used).all():
        raise PartError(f"{label}: expected finite coordinates, got NaN or infinity. Export the part again.")
    diagonal = float(np.linalg.norm(used.max(axis=0) - used.min(axis=0)))
    if diagonal == 0.0:
        raise PartError(f"{label}: expected a part, got {len(used)} points in one place. Export it again.")
    points, faces, repairs, closed = _merged(vertices, triangles, diagonal)
    if not len(faces) or triangle_geometry(points, faces)[1].sum() < 1e-9 * diagonal**2:
        raise PartError(f"{label}: expected a surface, got triangles without area. Export the part as a solid.")
    if not closed:
        points, faces = _manifold(points, faces, diagonal, repairs)
        closed = not open_edges(faces)
    return (*_wound(points, faces, repairs, diagonal, closed=closed), repairs)


def _merged(vertices: FloatArray, triangles: IntArray, diagonal: float) -> tuple[FloatArray, IntArray, list[str], bool]:
    """Merge vertices by the smallest distance that closes the mesh, or that leaves the fewest open edges.

    Returns:
        Vertices, triangles, one sentence for each repair, and whether each edge has two triangles of one winding.
    """
    best: tuple[int, bool, FloatArray, IntArray, list[str]] | None = None
    for step in MERGE_STEPS:
        points, faces, repairs = _cleaned(vertices, triangles, step * diagonal, diagonal)
        _, ahead, back = edge_counts(faces)
        gaps = int(((ahead + back) % 2 == 1).sum()) if len(faces) else len(triangles)
        if best is None or gaps < best[0]:
            best = gaps, bool(((ahead == 1) & (back == 1)).all()), points, faces, repairs
        if not gaps:
            break
    assert best is not None
    gaps, closed, points, faces, repairs = best
    if gaps and len(faces):
        faces, split = split_sides(points, faces, MERGE_STEPS[-1] * diagonal)
        if split:
            repairs.append(f"Split {split} triangles at corners of others that lie on their sides; no point moved.")
            faces = _without_duplicates(faces)
    return points, faces, repairs, closed


def _manifold(points: FloatArray, faces: IntArray, diagonal: float, repairs: list[str]) -> tuple[FloatArray, IntArray]:
    """Cut the surface where more than two triangles meet, drop loose pieces, and fill small holes."""
    _, ahead, back = edge_counts(faces)
    if ((ahead == 1) & (back == 1)).all():
        return points, faces
    crowded = crowded_edges(faces)
    consistent = consistently_wound(faces)
    turned = (consistent != faces).any()
    points, faces, _ = cut(points, consistent)
    if crowded:
        edges = "1 edge" if crowded == 1 else f"{crowded} edges"
        repairs.append(f"Cut the surface at {edges} of three or more triangles; no point moved.")
    faces, dropped = without_loose(points, faces)
    used, faces = compacted(faces)
    points, faces, filled = fill_holes(points[used], faces, diagonal)
    repairs += dropped + filled
    if turned:
        repairs.append("Made the winding of the triangles consistent.")
    return points, faces


def _wound(
    points: FloatArray, faces: IntArray, repairs: list[str], diagonal: float, *, closed: bool
) -> tuple[FloatArray, IntArray]:
    """Orient the surface outward, unite its bodies, and note unknown sides and self-intersections."""
    if not closed:
        points, faces, _, steps = with_sides(points, faces)
    else:
        consistent = "Made the winding of the triangles consistent." not in repairs
        total = volume_and_centroid(points, faces)[0]
        faces = outward(points, faces[:, ::-1] if consistent and total < 0.0 else faces, as_wound=consistent)
        if consistent and total < 0.0:
            repairs.append("Turned the surface inside out: its normals pointed into the material.")
        points, faces, _, steps = united(points, faces)
    repairs += steps
    if count := crossings(points, faces):
        repairs.append(f"The surface crosses itself at {count} edges or more: it is not repaired.")
    return points, np.ascontiguousarray(faces)


def merge_vertices(points: FloatArray, distance: float) -> tuple[FloatArray, IntArray]:
    """Merge points closer than a distance, including chains of such points.

    Args:
        points: points ``(n, 3)``.
        distance: merge distance.

    Returns:
        Merged points in the order of their first, and for each given point the index of its merged point.
    """
    different, index = _core.weld(np.ascontiguousarray(points, dtype=np.float64))
    labels = near_groups(different, distance)
    return different[first_rows(labels)], labels[index]


def _cleaned(
    vertices: FloatArray, triangles: IntArray, distance: float, diagonal: float
) -> tuple[FloatArray, IntArray, list[str]]:
    used, compact = compacted(triangles)
    points, index = merge_vertices(vertices[used], distance)
    faces = index[compact]
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
    """Keep one of equal triangles, and drop both of a pair with opposite winding (a wall without thickness)."""
    if not len(faces):
        return faces
    low, high = faces.min(axis=1), faces.max(axis=1)
    group = _core.weld(np.stack([low, faces.sum(axis=1) - low - high, high], axis=1).astype(np.float64))[1]
    first = first_rows(group)
    if len(first) == len(faces):
        return faces
    even = np.sum(faces < np.roll(faces, -1, axis=1), axis=1) == 2  # a turn of ascending corners
    net = np.bincount(group, weights=np.where(even, 1.0, -1.0))
    # if every triangle has its opposite, the mesh is a sheet modelled from both sides
    kept = net != 0.0 if (net != 0.0).any() else np.ones(len(first), dtype=np.bool_)
    return faces[np.sort(first[kept])]


def _without_needles(points: FloatArray, faces: IntArray, height: float) -> tuple[IntArray, int]:
    """Flip the long edge of each triangle without area, which keeps the mesh closed."""
    faces = faces.copy()
    flipped = 0
    for _ in range(10):
        longest = longest_sides(points, faces)
        needles = np.flatnonzero(2.0 * triangle_geometry(points, faces)[1] < height * longest)
        if not len(needles):
            break
        corners = points[faces[needles]]
        changed = _flip_needles(faces, needles, np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2))
        flipped += changed
        if not changed:
            break
    return faces, flipped


def _flip_needles(faces: IntArray, needles: IntArray, sides: FloatArray) -> int:
    edges, owner = directed_edges(faces)
    count = int(faces.max()) + 1
    longest = np.argmax(sides, axis=1)
    starts = faces[needles, longest]
    ends = faces[needles, (longest + 1) % 3]
    beside = np.isin(edges[:, 0] * count + edges[:, 1], ends * count + starts)
    across = {(int(a), int(b)): int(t) for (a, b), t in zip(edges[beside], owner[beside], strict=True)}
    touched: set[int] = set()
    for needle, k in zip(needles.tolist(), longest.tolist(), strict=True):
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
