"""Assign the triangles of a mesh to faces: planes, and strips of curved surfaces joined to the original surface.

A mesh does not store surfaces, so this is a rule (``docs/reading_cad.md``):

1. Connected triangles in one plane are one *facet*.
2. Facets that meet at less than 30 degrees form a *run*. A facet four times as large as each facet it meets at such an
   angle is *broad*: a plane that a rounding blends into, which ends the run.
3. A run of three or more facets is a curved face. It is a cylinder, cone or sphere if all its corners lie on one,
   otherwise a free form. A run of fewer than six large facets that fits nothing stays planes.
4. Facets smaller than a millionth of the squared diagonal join the adjacent curved face.
5. Thirty-two or more connected facets of one triangle each are a scan: one free form at any angles.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.elements import SurfaceKind
from tanteo.parts.faces.facets import FLOAT32, MeshFacets, find_facets
from tanteo.parts.faces.fits import fit_curved
from tanteo.parts.readers.topology import Draft, MeshEdges, compacted, components, mesh_edges

SMOOTH_ANGLE = np.deg2rad(30.0) - 1e-4
"""Angle between facets below which they belong to one curved surface [rad]."""

SHORTEST_RUN, SHORTEST_PIECE, PIECE_SHARE = 3, 8, 0.2
BROAD = 4.0
FEW_FACETS, LARGE_FACET = 6, 0.01
SCAN_FACETS = 32
CRUMB = 1e-6


def sort_faces(vertices: FloatArray, triangles: IntArray, rounding: float = 0.0) -> Draft:
    """Assign the triangles of a mesh to planes and curved faces.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``, outward.
        rounding: step to which the file rounds coordinates [m]; 0 for that of single precision.

    Returns:
        Mesh with a face for each triangle; faces are numbered by their first triangle.
    """
    edges = mesh_edges(triangles)
    facets = find_facets(vertices, triangles, edges, rounding)
    runs = _crumbs(facets, _scans(facets, _runs(facets)), float(np.linalg.norm(np.ptp(vertices, axis=0))))
    faces, kinds = _named(vertices, triangles, facets, runs)
    return Draft(vertices, triangles, faces[facets.of_triangle], kinds, None, edges)


def label_faces(vertices: FloatArray, triangles: IntArray, numbers: IntArray, rounding: float = 0.0) -> Draft:
    """Make a face of connected triangles with the same number.

    Args:
        vertices: vertices ``(V, 3)`` [m].
        triangles: vertex indices ``(T, 3)``, outward.
        numbers: face number of each triangle ``(T,)``.
        rounding: step to which the file rounds coordinates [m]; 0 for that of single precision.

    Returns:
        Mesh with its faces, numbered by their first triangle: planes if they are flat; cylinders, cones or spheres if
        their facets meet smoothly and their corners lie on one; otherwise free forms.
    """
    edges = mesh_edges(triangles)
    inner = numbers[edges.left] == numbers[edges.right]
    edges = MeshEdges(edges.ends[inner], edges.left[inner], edges.right[inner])
    labels = components(len(triangles), edges.left, edges.right)
    _, first, faces = np.unique(labels, return_index=True, return_inverse=True)
    facets = find_facets(vertices, triangles, edges, rounding)
    owner = np.zeros(len(facets.areas), dtype=np.int64)
    owner[facets.of_triangle] = faces.reshape(-1)
    steepest = np.zeros(len(first))
    np.maximum.at(steepest, owner[facets.links[:, 0]], facets.angles)
    kinds: list[tuple[SurfaceKind, dict[str, Any]]] = []
    for face in range(len(first)):
        members = np.flatnonzero(owner == face)
        if len(members) == 1:
            kinds.append(("plane", {}))
        elif steepest[face] < SMOOTH_ANGLE:
            kinds.append(_fit(vertices, triangles, facets, members))
        else:
            kinds.append(("freeform", {}))
    return Draft(vertices, triangles, faces.reshape(-1), tuple(kinds), None)


def _runs(facets: MeshFacets) -> IntArray:
    """Label each facet with its run of smoothly joined facets; -1 for planes."""
    count = len(facets.areas)
    smooth = facets.angles < SMOOTH_ANGLE
    a, b = facets.links[smooth].T
    lengths = facets.lengths[smooth]
    largest = np.zeros(count)
    np.maximum.at(largest, a, facets.areas[b])
    np.maximum.at(largest, b, facets.areas[a])
    gentle = np.bincount(a, lengths, count) + np.bincount(b, lengths, count)
    perimeters = sum(np.bincount(facets.links[:, k], facets.lengths, count) for k in range(2))
    # A single triangle that is smoothly joined along most of its border belongs to a free form, however large.
    patch = (facets.counts == 1) & (gentle > 0.67 * perimeters)
    broad = (facets.areas > BROAD * largest) & ~patch
    inner = ~broad[a] & ~broad[b]
    labels = components(count, a[inner], b[inner])
    sizes = np.bincount(labels)
    return np.where((sizes[labels] >= SHORTEST_RUN) & ~broad, labels, -1)


def _scans(facets: MeshFacets, runs: IntArray) -> IntArray:
    """Join regions of single triangles, which only a scan has, and isolated facets inside them, to one run."""
    single = facets.counts == 1
    a, b = facets.links.T
    both = single[a] & single[b]
    labels = components(len(runs), a[both], b[both])
    scanned = (np.bincount(labels)[labels] >= SCAN_FACETS) & single & (runs < 0)
    if not scanned.any():
        return runs
    loose = (facets.counts <= 3) & (runs < 0)
    outside = np.zeros(len(runs), dtype=np.bool_)
    inside = scanned | (runs >= 0)
    np.logical_or.at(outside, a, ~inside[b])
    np.logical_or.at(outside, b, ~inside[a])
    scanned |= loose & ~outside
    rough = scanned | (single & (runs >= 0))
    joined = rough[a] & rough[b]
    # Runs adjacent to the scan become part of it: their small angles are coincidental.
    labels = components(len(runs), a[joined], b[joined])
    touched = np.isin(labels, labels[scanned]) & rough
    return np.where(touched, labels + runs.max() + 1, runs)


def _crumbs(facets: MeshFacets, runs: IntArray, diagonal: float) -> IntArray:
    """Assign very small facets to the run with which they share the longest border."""
    tiny = (facets.areas < CRUMB * diagonal**2) & (runs < 0)
    first = np.concatenate([facets.links[:, 0], facets.links[:, 1]])
    second = np.concatenate([facets.links[:, 1], facets.links[:, 0]])
    lengths = np.concatenate([facets.lengths, facets.lengths])
    usable = tiny[first] & (runs[second] >= 0)
    order = np.lexsort((lengths[usable], first[usable]))
    runs = runs.copy()
    runs[first[usable][order]] = runs[second[usable][order]]
    return runs


def _named(
    vertices: FloatArray, triangles: IntArray, facets: MeshFacets, runs: IntArray
) -> tuple[IntArray, tuple[tuple[SurfaceKind, dict[str, Any]], ...]]:
    """Fit each run, split it by its sign of curvature where that helps, and number the faces."""
    groups = runs.copy()
    fitted: dict[int, tuple[SurfaceKind, dict[str, Any]]] = {}
    following = int(runs.max()) + 1
    whole = float(facets.areas.sum())
    for run in compacted(runs[runs >= 0])[0]:
        members = np.flatnonzero(runs == run)
        kind, fields = _fit(vertices, triangles, facets, members)
        if kind != "freeform":
            fitted[int(run)] = kind, fields
            continue
        if len(members) < FEW_FACETS and (facets.areas[members] > LARGE_FACET * whole).all():
            groups[members] = -1
            continue
        fitted[int(run)] = "freeform", {}
        for piece in _pieces(facets, members):
            found = _fit(vertices, triangles, facets, piece)
            # A ring of any free form fits a cone or a sphere, so only cylinders are separated.
            if found[0] == "cylinder":
                groups[piece] = following
                fitted[following] = found
                following += 1
    alone = groups < 0
    groups[alone] = following + np.flatnonzero(alone)
    first = np.full(len(groups), len(triangles))
    np.minimum.at(first, facets.of_triangle, np.arange(len(triangles)))
    names, index = compacted(groups)
    lowest = np.full(len(names), len(triangles))
    np.minimum.at(lowest, index, first)
    order = np.argsort(lowest)
    rank = np.empty(len(names), dtype=np.int64)
    rank[order] = np.arange(len(names))
    plane: tuple[SurfaceKind, dict[str, Any]] = ("plane", {})
    return rank[index], tuple(fitted.get(int(names[i]), plane) for i in order)


def _pieces(facets: MeshFacets, members: IntArray) -> list[IntArray]:
    """Split a run into parts with the same sign of curvature and similar facet areas."""
    inside = np.isin(facets.links, members).all(axis=1) & (facets.angles < SMOOTH_ANGLE)
    pieces: list[IntArray] = []
    for sign in (True, False):
        links = facets.links[inside & (facets.convex == sign)]
        ratio = facets.areas[links[:, 0]] / facets.areas[links[:, 1]]
        links = links[(ratio > 0.25) & (ratio < 4.0)]
        labels = components(len(facets.areas), links[:, 0], links[:, 1])
        mine, sizes = np.unique(labels[members], return_counts=True)
        enough = (sizes >= SHORTEST_PIECE) & (sizes >= PIECE_SHARE * len(members))
        pieces.extend(members[labels[members] == label] for label in mine[enough])
    return pieces


def _fit(
    vertices: FloatArray, triangles: IntArray, facets: MeshFacets, members: IntArray
) -> tuple[SurfaceKind, dict[str, Any]]:
    chosen = np.zeros(len(facets.areas), dtype=np.bool_)
    chosen[members] = True
    used = chosen[facets.of_triangle]
    rows, index = compacted(triangles[used])
    lowest, highest = np.full(len(rows), len(facets.areas)), np.full(len(rows), -1)
    for corners in index.T:
        np.minimum.at(lowest, corners, facets.of_triangle[used])
        np.maximum.at(highest, corners, facets.of_triangle[used])
    between = lowest < highest
    precision = 4.0 * FLOAT32 * float(np.abs(vertices).max())
    of_facets = facets.centres[members], facets.normals[members], facets.areas[members]
    return fit_curved(vertices[rows], between, *of_facets, precision)
