"""Find sharp straight edges and corners of a mesh whose triangles are assigned to faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.faces.elements import Face, ModelEdges, ModelVertices
from tanteo.parts.faces.mesh_faces import SMOOTH_ANGLE
from tanteo.parts.readers.topology import Draft, MeshEdges, components, triangle_geometry

SMOOTH_JOIN = np.deg2rad(2.0)
"""Angle between two faces below which their border is smooth and not an edge [rad]."""

SMOOTH_FREEFORM = np.deg2rad(15.0)
"""Angle below which a border with a free form is smooth, whose normals are known only from facets [rad]."""

STRAIGHT = 1e-2
"""Angle between two mesh edges below which they continue each other [rad]."""

PARALLEL = np.deg2rad(5.0)
"""Angle between two edges below which they count as one direction at a corner [rad]."""

SHORTEST_EDGE, SHORTEST_FREEFORM_EDGE = 1e-5, 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class _Segments:
    """Mesh edges between two faces, directed so that the face with the lower index lies to the left."""

    ends: IntArray
    faces: IntArray
    triangles: IntArray
    normals: FloatArray
    directions: FloatArray
    lengths: FloatArray

    def at(self, chosen: BoolArray) -> _Segments:
        return _Segments(*(getattr(self, name)[chosen] for name in self.__slots__))


def build_edges(draft: Draft, faces: tuple[Face, ...], edges: MeshEdges) -> tuple[ModelEdges, ModelVertices]:
    """Return the sharp straight edges between two faces, and the corners where they meet.

    Args:
        draft: mesh whose triangles are assigned to faces.
        faces: faces of the mesh.
        edges: edges of the mesh.

    Returns:
        Edges with at least one adjacent plane, and corners where three or more directions meet.
    """
    planar = np.array([face.surface == "plane" for face in faces])
    freeform = np.array([face.surface == "freeform" for face in faces])
    segments = _segments(draft, faces, edges)
    touches_plane: BoolArray = np.asarray(planar[segments.faces].any(axis=1))
    segments = segments.at(touches_plane)
    cosines = np.einsum("ni,ni->n", segments.normals[:, 0], segments.normals[:, 1])
    sines = np.linalg.norm(np.cross(segments.normals[:, 0], segments.normals[:, 1]), axis=1)
    limit = np.where(freeform[segments.faces].any(axis=1), SMOOTH_FREEFORM, SMOOTH_JOIN)
    sharp: BoolArray = np.asarray(np.arctan2(sines, cosines) > limit)
    segments = segments.at(sharp)
    segments = segments.at(~_round(draft, segments, planar))
    chains = _chains(segments)
    return _edges(draft, segments, chains, freeform)


def _segments(draft: Draft, faces: tuple[Face, ...], edges: MeshEdges) -> _Segments:
    left = draft.triangle_face[edges.left]
    right = draft.triangle_face[edges.right]
    between = left != right
    ends = edges.ends[between]
    pair = np.stack([left, right], axis=1)[between]
    swap = pair[:, 0] > pair[:, 1]
    ends = np.where(swap[:, None], ends[:, ::-1], ends)
    pair = np.where(swap[:, None], pair[:, ::-1], pair)
    vectors = draft.vertices[ends[:, 1]] - draft.vertices[ends[:, 0]]
    lengths = np.linalg.norm(vectors, axis=1)
    normals = np.stack([_normals_at(draft, faces, pair[:, k], ends) for k in range(2)], axis=1)
    beside = np.where(swap, edges.right[between], edges.left[between])
    return _Segments(ends, pair, beside, normals, vectors / lengths[:, None], lengths)


def _normals_at(draft: Draft, faces: tuple[Face, ...], owners: IntArray, ends: IntArray) -> FloatArray:
    """Return outward normals of the faces ``owners`` at the midpoints of the mesh edges ``ends`` ``(N, 3)``."""
    if not len(ends):
        return np.zeros((0, 3))
    count = len(draft.vertices)
    at_edges = np.zeros(count, dtype=np.bool_)
    at_edges[ends] = True
    rows = at_edges[draft.triangles].any(axis=1)
    triangles = draft.triangles[rows]
    normals, areas = triangle_geometry(draft.vertices, triangles)
    keys = (draft.triangle_face[rows, None] * count + triangles).reshape(-1)
    known, index = np.unique(keys, return_inverse=True)
    weighted = np.repeat(normals * areas[:, None], 3, axis=0)
    summed = np.stack([np.bincount(index.reshape(-1), weighted[:, k]) for k in range(3)], axis=1)
    result = sum(summed[np.searchsorted(known, owners * count + ends[:, k])] for k in range(2))
    result /= np.maximum(np.linalg.norm(result, axis=1, keepdims=True), 1e-300)
    points = draft.vertices[ends].mean(axis=1)
    for face in np.unique(owners):
        mine = owners == face
        exact = _analytic_normals(faces[face], points[mine])
        if exact is not None:
            sign = np.sign(np.einsum("ni,ni->n", exact, result[mine]))
            result[mine] = exact * np.where(sign == 0.0, 1.0, sign)[:, None]
    return result


def _analytic_normals(face: Face, points: FloatArray) -> FloatArray | None:
    """Return normals of a simple surface, up to their sign; None for free forms."""
    if face.surface == "plane":
        assert face.axis_direction is not None
        return np.tile(face.axis_direction, (len(points), 1))
    if face.axis_point is None or face.surface == "freeform":
        return None
    radial = points - face.axis_point
    if face.axis_direction is not None:
        along = (radial @ face.axis_direction)[:, None] * face.axis_direction
        across = radial - along
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
        radial = across
        if face.half_angle is not None:
            radial = across * np.cos(face.half_angle) - face.axis_direction * np.sin(face.half_angle)
        elif face.surface == "torus" and face.radius is not None:
            radial = points - (face.axis_point + face.radius * across)
    return radial / np.maximum(np.linalg.norm(radial, axis=1, keepdims=True), 1e-300)


def _round(draft: Draft, segments: _Segments, planar: BoolArray) -> BoolArray:
    """Return the mask of chords of curved edges.

    As stated in the file, or where a mesh bends slightly more than once.
    """
    curved = ~planar[segments.faces].all(axis=1)
    if draft.round_edges is not None:
        count = len(draft.vertices)
        low = np.sort(segments.ends, axis=1)
        chords = draft.round_edges[:, 0] * count + draft.round_edges[:, 1]
        return np.isin(low[:, 0] * count + low[:, 1], chords) & curved
    first, second = _successors(segments)
    turn = np.arccos(np.clip((segments.directions[first] * segments.directions[second]).sum(axis=1), -1, 1))
    gentle = (turn > STRAIGHT) & (turn < SMOOTH_ANGLE)
    result = np.zeros(len(segments.ends), dtype=np.bool_)
    result[first[gentle]] = result[second[gentle]] = True
    return result & curved


def _successors(segments: _Segments) -> tuple[IntArray, IntArray]:
    """Return pairs of segments of the same two faces, of which the second starts where the first ends."""
    _, group = np.unique(segments.faces, axis=0, return_inverse=True)
    group = group.reshape(-1)
    base = int(segments.ends.max(initial=0)) + 1
    begins = group * base + segments.ends[:, 0]
    finishes = group * base + segments.ends[:, 1]
    order = np.argsort(begins, kind="stable")
    at = np.searchsorted(begins[order], finishes)
    found = at < len(order)
    found[found] = begins[order][at[found]] == finishes[found]
    return np.flatnonzero(found), order[at[found]]


def _chains(segments: _Segments) -> IntArray:
    """Label segments that continue each other in a straight line."""
    first, second = _successors(segments)
    sines = np.linalg.norm(np.cross(segments.directions[first], segments.directions[second]), axis=1)
    ahead = np.einsum("ni,ni->n", segments.directions[first], segments.directions[second]) > 0.0
    straight = (sines < STRAIGHT) & ahead
    return components(len(segments.ends), first[straight], second[straight])


def _edges(
    draft: Draft, segments: _Segments, chains: IntArray, freeform: BoolArray
) -> tuple[ModelEdges, ModelVertices]:
    count = int(chains.max(initial=-1)) + 1
    order = np.argsort(chains, kind="stable")
    begin = np.searchsorted(chains[order], np.arange(count))
    representative = order[begin] if count else np.zeros(0, dtype=np.int64)
    faces = segments.faces[representative]
    # The ends of a chain are the vertices farthest along the direction of its first segment.
    along = segments.directions[representative][chains]
    low = np.einsum("ni,ni->n", draft.vertices[segments.ends[:, 0]], along)
    high = np.einsum("ni,ni->n", draft.vertices[segments.ends[:, 1]], along)
    starts = segments.ends[np.lexsort((low, chains))[begin], 0] if count else np.zeros(0, dtype=np.int64)
    stops = segments.ends[np.lexsort((-high, chains))[begin], 1] if count else np.zeros(0, dtype=np.int64)
    weights = np.bincount(chains, segments.lengths, count)
    normals = np.zeros((count, 2, 3))
    np.add.at(normals, chains, segments.normals * segments.lengths[:, None, None])
    vertex_ends = np.stack([starts, stops], axis=1)
    ends = draft.vertices[vertex_ends]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    diagonal = float(np.linalg.norm(np.ptp(draft.vertices, axis=0)))
    shortest = np.where(freeform[faces].any(axis=1), SHORTEST_FREEFORM_EDGE, SHORTEST_EDGE) * diagonal
    # A chain that is longer than its span is bent after all.
    kept = (lengths > shortest) & (weights < 1.001 * lengths)
    # Numbered by faces, then by the file's triangles: the order does not depend on the part's pose in its file.
    earliest = np.full(count, len(draft.triangles))
    np.minimum.at(earliest, chains, segments.triangles)
    kept = np.flatnonzero(kept)
    kept = kept[np.lexsort((earliest[kept], faces[kept, 1], faces[kept, 0]))]
    normals = normals[kept] / np.maximum(np.linalg.norm(normals[kept], axis=2, keepdims=True), 1e-300)
    edges = _framed(ends[kept], lengths[kept], faces[kept], normals)
    return edges, _corners(draft, edges, vertex_ends[kept])


def _framed(ends: FloatArray, lengths: FloatArray, faces: IntArray, normals: FloatArray) -> ModelEdges:
    x = (ends[:, 1] - ends[:, 0]) / lengths[:, None]
    left = normals[:, 0]
    right = normals[:, 1]
    turn = np.arctan2(np.einsum("ni,ni->n", x, np.cross(left, right)), np.einsum("ni,ni->n", left, right))
    bisector = left + right
    bisector -= np.einsum("ni,ni->n", bisector, x)[:, None] * x
    # Opposite normals (a knife edge) leave no sum: the bisector then lies in both faces, across the edge.
    knife = np.linalg.norm(bisector, axis=1) < 1e-9
    bisector[knife] = np.sign(turn[knife])[:, None] * np.cross(left, x)[knife]
    z = bisector / np.linalg.norm(bisector, axis=1, keepdims=True)
    Ts = np.tile(np.eye(4), (len(ends), 1, 1))
    Ts[:, :3, 0], Ts[:, :3, 1], Ts[:, :3, 2] = x, np.cross(z, x), z
    Ts[:, :3, 3] = ends.mean(axis=1)
    return ModelEdges(Ts, lengths, ends, faces, np.pi - turn, turn > 0.0)


def _corners(draft: Draft, edges: ModelEdges, vertex_ends: IntArray) -> ModelVertices:
    vertices = vertex_ends.reshape(-1)
    owners = np.repeat(np.arange(len(vertex_ends)), 2)
    order = np.argsort(vertices, kind="stable")
    names, begin, counts = np.unique(vertices[order], return_index=True, return_counts=True)
    directions = edges.directions
    points = []
    groups = []
    for name, start, number in zip(names, begin, counts, strict=True):
        if number < 3:
            continue
        mine = np.sort(owners[order[start : start + number]])
        sines = np.linalg.norm(np.cross(directions[mine][:, None], directions[mine][None]), axis=2)
        # Count directions: an edge counts when no earlier one is parallel to it.
        fresh = ~np.tril(sines < np.sin(PARALLEL), -1).any(axis=1)
        if fresh.sum() >= 3:
            points.append(draft.vertices[name])
            groups.append(mine)
    ranks = sorted(range(len(groups)), key=lambda i: tuple(groups[i]))
    points = [points[i] for i in ranks]
    groups = [groups[i] for i in ranks]
    starts = np.concatenate([[0], np.cumsum([len(group) for group in groups])]).astype(np.int64)
    flat = np.concatenate(groups) if groups else np.zeros(0, dtype=np.int64)
    return ModelVertices(np.array(points).reshape(-1, 3), flat, starts)
