"""Measure the faces of a mesh, and collect the planar ones as arrays."""

from __future__ import annotations

import numpy as np

from tanteo.geometry import SO3
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.elements import Face, ModelPlanes
from tanteo.parts.readers.topology import Draft, MeshEdges, angles_between, middles_and_volumes, triangle_geometry


def face_normals(draft: Draft) -> FloatArray:
    """Return the area-weighted mean outward normal of each face ``(F, 3)``, which is exact for planes.

    Args:
        draft: mesh whose triangles are assigned to faces.
    """
    normals, areas = triangle_geometry(draft.vertices, draft.triangles)
    summed = _sums(draft, normals * areas[:, None])
    return summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)


def build_faces(draft: Draft, edges: MeshEdges) -> tuple[Face, ...]:
    """Return the measured faces of a mesh.

    Args:
        draft: mesh whose triangles are assigned to faces.
        edges: edges of the mesh.

    Returns:
        One :class:`Face` for each entry of ``draft.kinds``.
    """
    _, areas = triangle_geometry(draft.vertices, draft.triangles)
    count = len(draft.kinds)
    total = np.bincount(draft.triangle_face, areas, count)
    middle, _ = middles_and_volumes(draft.vertices, draft.triangles, np.zeros(3))
    centroids = _sums(draft, middle * areas[:, None]) / np.maximum(total, 1e-300)[:, None]
    normals = face_normals(draft)
    sagittas = _sagittas(draft, edges)
    faces = []
    for index, (kind, fields) in enumerate(draft.kinds):
        known = dict(fields)
        if kind == "plane":
            known.update(axis_direction=normals[index], axis_point=centroids[index])
        faces.append(
            Face(
                name=f"face {index}",
                surface=kind,
                area=float(total[index]),
                centroid=centroids[index],
                sagitta=0.0 if kind == "plane" else float(sagittas[index]),
                **known,
            )
        )
    return tuple(faces)


def build_planes(draft: Draft, faces: tuple[Face, ...], edges: MeshEdges) -> ModelPlanes:
    """Return the planar faces with frames: z outward, origin at the centroid, x and y the principal axes of the area.

    Args:
        draft: mesh whose triangles are assigned to faces.
        faces: faces of the mesh.
        edges: edges of the mesh.
    """
    chosen = np.array([i for i, face in enumerate(faces) if face.surface == "plane"], dtype=np.int64)
    count = len(chosen)
    if not count:
        return ModelPlanes(
            np.zeros((0, 4, 4)), chosen, np.zeros(0), np.zeros((0, 2)), np.zeros((0, 3)), np.zeros(1, dtype=np.int64)
        )
    areas = np.array([faces[i].area for i in chosen])
    centroids = np.array([faces[i].centroid for i in chosen])
    normals = face_normals(draft)[chosen]
    second = _second_moments(draft, faces, chosen)[chosen] / areas[:, None, None]
    frames, gyration = _principal_frames(normals, second)
    Ts = np.tile(np.eye(4), (count, 1, 1))
    Ts[:, :3, :3], Ts[:, :3, 3] = frames, centroids
    hulls = _hulls(draft, edges, chosen, Ts)
    starts = np.concatenate([[0], np.cumsum([len(hull) for hull in hulls])])
    return ModelPlanes(Ts, chosen, areas, gyration, np.concatenate(hulls), starts)


def _sums(draft: Draft, values: FloatArray) -> FloatArray:
    """Return sums of values ``(T, 3)`` over the triangles of each face."""
    count = len(draft.kinds)
    return np.stack([np.bincount(draft.triangle_face, values[:, k], count) for k in range(3)], axis=1)


def _second_moments(draft: Draft, faces: tuple[Face, ...], chosen: IntArray) -> FloatArray:
    """Return the integral of (p - centroid)(p - centroid)^T over each chosen face ``(F, 3, 3)`` [m^4]; 0 for others."""
    counted = np.zeros(len(faces), dtype=np.bool_)
    counted[chosen] = True
    rows = counted[draft.triangle_face]
    triangles, owners = draft.triangles[rows], draft.triangle_face[rows]
    _, areas = triangle_geometry(draft.vertices, triangles)
    centroids = np.array([face.centroid for face in faces])
    local = draft.vertices[triangles] - centroids[owners][:, None]
    sums = local.sum(axis=1)
    # Exact for a triangle: A / 12 (sum of v v^T + (sum of v)(sum of v)^T).
    each = np.einsum("tki,tkj->tij", local, local) + np.einsum("ti,tj->tij", sums, sums)
    each *= areas[:, None, None] / 12.0
    result = np.zeros((len(faces), 3, 3))
    np.add.at(result, owners, each)
    return result


def _principal_frames(normals: FloatArray, second: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return right-handed frames and standard deviations along x and y, from normals and second moments per area."""
    basis = SO3.frame_from_axis(normals, 2)[..., :2]
    flat = np.einsum("mia,mij,mjb->mab", basis, second, basis)
    values, vectors = np.linalg.eigh(flat)
    values = np.maximum(values[:, ::-1], 0.0)
    x = np.einsum("mia,ma->mi", basis, vectors[:, :, 1])
    # A square or round face has no unique principal axes: use a fixed direction instead of rounding noise.
    even = values[:, 0] - values[:, 1] < 1e-6 * values[:, 0]
    x = np.where(even[:, None], basis[..., 0], x)
    largest = np.take_along_axis(x, np.argmax(np.abs(x) > 0.5, axis=1)[:, None], axis=1)
    x = np.where(largest < 0.0, -x, x)
    return np.stack([x, np.cross(normals, x), normals], axis=2), np.sqrt(values)


def _hulls(draft: Draft, edges: MeshEdges, chosen: IntArray, Ts: FloatArray) -> list[FloatArray]:
    """Return the vertices of each plane's convex outline, counter-clockwise seen from outside."""
    left = draft.triangle_face[edges.left]
    right = draft.triangle_face[edges.right]
    border = (left != right) | edges.rims
    owners = np.concatenate([left[border], right[border]]).repeat(2)
    vertices = np.concatenate([edges.ends[border], edges.ends[border]]).reshape(-1)
    pairs = np.unique(np.stack([owners, vertices], axis=1), axis=0)
    begin = np.searchsorted(pairs[:, 0], chosen, side="left")
    end = np.searchsorted(pairs[:, 0], chosen, side="right")
    hulls = []
    for k in range(len(chosen)):
        points = draft.vertices[pairs[begin[k] : end[k], 1]]
        flat = (points - Ts[k, :3, 3]) @ Ts[k, :3, :2]
        hulls.append(points[convex_outline(flat)])
    return hulls


def convex_outline(points: FloatArray) -> IntArray:
    """Return the indices of the convex hull of plane points, counter-clockwise without collinear ones (Andrew 1979).

    Args:
        points: points in the plane ``(N, 2)``.
    """
    order = np.lexsort((points[:, 1], points[:, 0]))
    x = points[:, 0].tolist()
    y = points[:, 1].tolist()
    slack = 1e-12 * max(float(np.ptp(points[:, 0]) * np.ptp(points[:, 1])), 1e-300)

    def chain(indices: list[int]) -> list[int]:
        hull: list[int] = []
        for i in indices:
            while len(hull) > 1:
                a = hull[-2]
                b = hull[-1]
                if (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a]) > slack:
                    break
                hull.pop()
            hull.append(i)
        return hull[:-1]

    forward = order.tolist()
    return np.array(chain(forward) + chain(forward[::-1]), dtype=np.int64)


def _sagittas(draft: Draft, edges: MeshEdges) -> FloatArray:
    """Estimate the largest distance of the mesh of each curved face from its true surface [m].

    Two neighbouring facets that meet at an angle t and are h1 and h2 wide are chords of a circle of radius
    (h1 + h2) / (2 t); the sagitta of such a chord is t (h1 + h2) / 16 for equal widths, doubled here for unequal.
    """
    normals, areas = triangle_geometry(draft.vertices, draft.triangles)
    same = draft.triangle_face[edges.left] == draft.triangle_face[edges.right]
    left = edges.left[same]
    right = edges.right[same]
    ends = edges.ends[same]
    angles = angles_between(normals, left, right)
    lengths = np.linalg.norm(draft.vertices[ends[:, 1]] - draft.vertices[ends[:, 0]], axis=1)
    widths = 2.0 * (areas[left] + areas[right]) / np.maximum(lengths, 1e-300)
    result = np.zeros(len(draft.kinds))
    np.maximum.at(result, draft.triangle_face[left], angles * widths / 8.0)
    return result
