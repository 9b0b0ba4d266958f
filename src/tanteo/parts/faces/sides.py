"""Determine the material side of a mesh: closed bodies, nested and overlapping bodies, and open surfaces."""

from __future__ import annotations

import numpy as np

from tanteo.geometry.typing import BoolArray, FloatArray, IntArray
from tanteo.parts.readers.topology import compacted, components, mesh_edges, middles_and_volumes, triangle_geometry

LOOSE = 1e-3
"""Area fraction below which an open piece is dropped."""

OUTSIDE, WITHIN = 0.35, 0.65
"""Limits on the negative winding number just in front of an open surface: below the first the front is outside, above
the second inside, between them unknown."""

_PROBES = 2000
"""Largest number of triangles in front of which the winding number is evaluated."""

_LIFT = 1e-4
"""Distance of these points in front of the surface, in diagonals."""


def bodies(faces: IntArray) -> IntArray:
    """Return the connected piece of each triangle ``(T,)``, numbered from 0.

    Args:
        faces: vertex indices ``(T, 3)``.
    """
    count = int(faces.max()) + 1
    labels = components(count, faces[:, [0, 1]].reshape(-1), faces[:, [1, 2]].reshape(-1))[faces[:, 0]]
    return compacted(labels)[1]


def without_loose(points: FloatArray, faces: IntArray) -> tuple[IntArray, list[str]]:
    """Drop open pieces that are tiny, or lie inside a closed piece, where nothing can touch them; return notes.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``.
    """
    labels = bodies(faces)
    open_ = _open_pieces(faces, labels)
    if not open_.any():
        return faces, []
    _, areas = triangle_geometry(points, faces)
    shares = np.bincount(labels, areas) / areas.sum()
    tiny = open_ & (shares < LOOSE)
    hidden = np.zeros(len(open_), dtype=np.bool_)
    closed = faces[~open_[labels]]
    rows = np.flatnonzero((open_ & ~tiny)[labels])
    if len(closed) and len(rows):
        rows = rows[:: 1 + len(rows) // _PROBES]
        inside = np.abs(_winding(points, closed, points[faces[rows]].mean(axis=1))) > 0.5
        counts = [np.bincount(labels[rows], weights, len(open_)) for weights in (areas[rows] * inside, areas[rows])]
        hidden = (counts[1] > 0.0) & (counts[0] > 0.99 * counts[1])
    steps = []
    for dropped, where in ((tiny, "that hang loose"), (hidden, "inside the material")):
        if dropped.any():
            count = int(dropped[labels].sum())
            share = 100.0 * float(shares[dropped].sum())
            steps.append(f"Dropped {count} triangles {where}, {share:.2g} % of the area.")
    kept = ~(tiny | hidden)[labels]
    return (faces[kept], steps) if kept.any() else (faces, [])  # keep a mesh of loose triangles only


def outward(points: FloatArray, faces: IntArray, *, as_wound: bool) -> IntArray:
    """Orient each closed body outward, and inward if an odd number of others surrounds it.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``, closed.
        as_wound: whether the file's own winding is consistent, so that only inverted bodies are changed.
    """
    labels = bodies(faces)
    normals, areas = triangle_geometry(points, faces)
    inverted = _volumes(points, faces, labels) < 0.0
    if as_wound and not inverted.any():
        return faces
    turned = np.where(inverted[labels][:, None], faces[:, ::-1], faces)
    # just outside each body the winding number counts the bodies that surround it; beside a body that touches it, too,
    # so a cavity has material in front of all its sides
    middles = points[faces].mean(axis=1)
    starts = np.searchsorted(np.sort(labels), np.arange(len(inverted)))
    sides = np.concatenate([np.lexsort((key, labels))[starts] for key in (-areas, *middles.T, *-middles.T)])
    out = np.where(inverted[labels[sides]], -1e-3, 1e-3) * np.sqrt(areas[sides])
    windings = np.rint(_winding(points, turned, middles[sides] + out[:, None] * normals[sides])).astype(np.int64)
    inward = (np.bincount(labels[sides], windings % 2 == 0) == 0) & (inverted | (not as_wound))
    return np.where(inward[labels][:, None], turned[:, ::-1], turned)


def _volumes(points: FloatArray, faces: IntArray, labels: IntArray) -> FloatArray:
    """Return the signed volume of each closed body, negative if it is inside out."""
    volumes = middles_and_volumes(points, faces, points.mean(axis=0))[1]
    return np.bincount(labels, volumes).astype(np.float64)


def united(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray, list[str]]:
    """Unite closed bodies that overlap or share walls, by manifold3d; cavities are kept.

    Where walls touch that are meshed differently, the union leaves thin gaps. Closed pieces of surface that lie in the
    material of the bodies, by the winding number just in front of them, are dropped.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``, closed.

    Returns:
        Vertices, triangles, the triangle that each was before ``(T,)``, and a sentence if bodies were united.
    """
    labels, same = bodies(faces), np.arange(len(faces))
    if labels.max() == 0:
        return points, faces, same, []
    if _volumes(points, faces, labels).min() <= 0.0:
        return points, faces, same, []
    order = np.argsort(labels, kind="stable")
    shells = np.split(faces[order], np.cumsum(np.bincount(labels))[:-1])
    if not _boxes_meet(points, shells):
        return points, faces, same, []
    import manifold3d  # slow to import, and seldom needed

    rows = np.split(order, np.cumsum(np.bincount(labels))[:-1])
    solids = [manifold3d.Manifold(_as_mesh(points, shell, own)) for shell, own in zip(shells, rows, strict=True)]
    if any(solid.status() != manifold3d.Error.NoError for solid in solids):
        return points, faces, same, []
    one = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    before = sum(solid.surface_area() for solid in solids)
    if one.is_empty():
        return points, faces, same, []
    mesh = one.to_mesh64()
    corners, parents = np.asarray(mesh.tri_verts, dtype=np.int64), np.asarray(mesh.face_id, dtype=np.int64)
    vertices = np.array(mesh.vert_properties[:, :3], dtype=np.float64)
    kept = ~_buried(vertices, corners, points, faces)
    after = float(triangle_geometry(vertices, corners[kept])[1].sum())
    if after > (1.0 - 1e-6) * before:
        return points, faces, same, []
    share = 100.0 * (1.0 - after / before)
    steps = f"United {len(shells)} bodies that overlap or touch: {share:.2g} % of their surface was inside."
    used, corners = np.unique(corners[kept], return_inverse=True)
    return vertices[used], corners.reshape(-1, 3), parents[kept], [steps]


_THIN = 1e-3
"""Numerical: width of gaps that a union leaves between walls meshed differently, over the diagonal; the mesher's chords
deviate by a third of it."""


def _buried(vertices: FloatArray, corners: IntArray, points: FloatArray, faces: IntArray) -> BoolArray:
    """Return which triangles are of closed pieces in front of which there is material everywhere ``(T,)``."""
    labels = bodies(corners)
    normals, _ = triangle_geometry(vertices, corners)
    front = vertices[corners].mean(axis=1) + _THIN * float(np.linalg.norm(np.ptp(points, axis=0))) * normals
    inside = np.abs(_winding(points, faces, front)) > 0.5
    return np.asarray(np.bincount(labels, ~inside)[labels] == 0)


def _as_mesh(points: FloatArray, shell: IntArray, rows: IntArray) -> object:
    import manifold3d

    used, corners = np.unique(shell, return_inverse=True)
    corners = corners.reshape(-1, 3).astype(np.uint64)
    return manifold3d.Mesh64(np.ascontiguousarray(points[used]), corners, face_id=rows.astype(np.uint64))


def _boxes_meet(points: FloatArray, shells: list[IntArray]) -> bool:
    lows = np.array([points[shell].min(axis=(0, 1)) for shell in shells])
    highs = np.array([points[shell].max(axis=(0, 1)) for shell in shells])
    order = np.argsort(lows[:, 0])
    lows = lows[order]
    highs = highs[order]
    for k in range(len(shells) - 1):
        later = lows[k + 1 :, 0] <= highs[k, 0]
        if ((lows[k + 1 :] <= highs[k]) & (highs[k + 1 :] >= lows[k])).all(axis=1)[later].any():
            return True
    return False


def with_sides(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray, IntArray, list[str]]:
    """Orient an open surface with its front outside, or duplicate it with both orientations if that is unknown.

    Just in front of an almost closed surface, the winding number is 0 outside and -1 inside (Jacobson et al. 2013). For
    a flat sheet it is -1/2, and the side is unknown.

    Args:
        points: vertices ``(V, 3)``.
        faces: vertex indices ``(T, 3)``.

    Returns:
        Vertices; triangles, with the duplicated ones last; the numbers of the duplicated ones; and notes.
    """
    labels = bodies(faces)
    _, areas = triangle_geometry(points, faces)
    open_ = _open_pieces(faces, labels)
    front = _in_front(points, faces, labels)
    faces = np.where((open_ & (front > WITHIN))[labels][:, None], faces[:, ::-1], faces)
    unknown = (open_ & (front >= OUTSIDE) & (front <= WITHIN))[labels]
    rims = int(mesh_edges(faces).rims.sum())
    share = 100.0 * float(areas[open_[labels]].sum() / areas.sum())
    steps = [f"The surface is open: it ends at {rims} edges ({share:.3g} % of the area is in open pieces)."]
    if not unknown.any():
        return points, faces, np.flatnonzero(unknown), [*steps, "Its outside was found by winding numbers."]
    share = 100.0 * float(areas[unknown].sum() / areas.sum())
    steps.append(f"Which side of {share:.3g} % of it is outside is not known: that part counts on both sides.")
    used, corners = np.unique(faces[unknown], return_inverse=True)
    back = corners.reshape(-1, 3)[:, ::-1] + len(points)
    return np.concatenate([points, points[used]]), np.concatenate([faces, back]), np.flatnonzero(unknown), steps


def _in_front(points: FloatArray, faces: IntArray, labels: IntArray) -> FloatArray:
    """Return the negative mean winding number just in front of each piece of a mesh."""
    normals, areas = triangle_geometry(points, faces)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    rng = np.random.default_rng(0)
    some = np.arange(len(faces)) if len(faces) <= _PROBES else np.sort(rng.choice(len(faces), _PROBES, replace=False))
    places = points[faces[some]].mean(axis=1) + _LIFT * diagonal * normals[some]
    count = int(labels.max()) + 1
    total = np.bincount(labels[some], areas[some], count)
    summed = np.bincount(labels[some], areas[some] * _winding(points, faces, places), count)
    return np.asarray(-summed / np.maximum(total, 1e-300))


def _open_pieces(faces: IntArray, labels: IntArray) -> BoolArray:
    """Return the mask of pieces that do not close."""
    edges = mesh_edges(faces)
    open_ = np.zeros(int(labels.max()) + 1, dtype=np.bool_)
    open_[labels[edges.left[edges.rims]]] = True
    return open_


def _winding(points: FloatArray, faces: IntArray, places: FloatArray) -> FloatArray:
    """Return generalized winding numbers of points ``(n,)``."""
    import igl  # slow to import, and seldom needed

    winding = igl.winding_number if len(faces) * len(places) < 2_000_000 else igl.fast_winding_number
    return np.asarray(winding(points, np.ascontiguousarray(faces), np.ascontiguousarray(places)), dtype=np.float64)
