"""Triangles of a mesh file -> faces: real planes, and strips of curved surfaces joined to what they were cut from.

A mesh holds no surfaces, so this is a rule, written down in ``docs/reading_cad.md``:

1. Triangles in one plane that touch are one *facet*.
2. Facets that meet at less than 30 degrees form a *run*. A facet four times as large as each facet it meets so
   gently is *broad*: a plane that a rounding runs into, which ends the run.
3. A run of three or more facets is a curved face. It is a cylinder, cone or sphere where all its corners lie on one,
   else a free form; but a run of fewer than six large facets that fits nothing stays planes.
4. Facets smaller than a millionth of the diagonal squared go to the curved face they touch.
5. Thirty-two or more connected facets of one triangle each are a scan: one free form, whatever their angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from tanteo.parts.fits import fit_curved
from tanteo.parts.part import SurfaceKind
from tanteo.parts.topology import MeshEdges, components, mesh_edges, triangle_geometry
from tanteo.typing import BoolArray, FloatArray, IntArray

SMOOTH_ANGLE = np.deg2rad(30.0) - 1e-4
"""Facets that meet at less than this belong to one curved surface [rad]."""

SHORTEST_RUN, SHORTEST_PIECE, PIECE_SHARE = 3, 8, 0.2
BROAD = 4.0
FEW_FACETS, LARGE_FACET = 6, 0.01
SCAN_FACETS = 32
CRUMB = 1e-6

_FLAT_ANGLE = 2e-3
_FLOAT32 = 1.2e-7


@dataclass(frozen=True, slots=True, eq=False)
class Draft:
    """A closed mesh whose triangles are sorted into faces, before features are taken from it.

    Attributes:
        vertices: ``(V, 3)`` [m].
        triangles: ``(T, 3)``, closed and outward.
        triangle_face: ``(T,)``, index into ``kinds``.
        kinds: kind of each face and the fields of :class:`Face` that describe it.
        round_edges: ``(R, 2)``, mesh edges (lower vertex first) known to be chords of a curved edge; None where a
            mesh file leaves that open.
    """

    vertices: FloatArray
    triangles: IntArray
    triangle_face: IntArray
    kinds: tuple[tuple[SurfaceKind, dict[str, Any]], ...]
    round_edges: IntArray | None


@dataclass(frozen=True, slots=True, eq=False)
class _Facets:
    """Planar patches and how they meet: one link for each pair that shares mesh edges."""

    of_triangle: IntArray
    normals: FloatArray
    areas: FloatArray
    centres: FloatArray
    counts: IntArray
    links: IntArray
    angles: FloatArray
    lengths: FloatArray
    convex: BoolArray


def sort_faces(vertices: FloatArray, triangles: IntArray) -> Draft:
    """Sort the triangles of a closed mesh into planes and curved faces.

    Args:
        vertices: ``(V, 3)`` [m].
        triangles: ``(T, 3)``, closed, consistently wound.

    Returns:
        The mesh with a face for each triangle; faces are numbered by their first triangle.
    """
    edges = mesh_edges(triangles)
    facets = _facets(vertices, triangles, edges)
    runs = _crumbs(facets, _scans(facets, _runs(facets)), float(np.linalg.norm(np.ptp(vertices, axis=0))))
    faces, kinds = _named(vertices, triangles, facets, runs)
    return Draft(vertices, triangles, faces[facets.of_triangle], kinds, None)


def _facets(vertices: FloatArray, triangles: IntArray, edges: MeshEdges) -> _Facets:
    normals, areas = triangle_geometry(vertices, triangles)
    labels = _flat_components(vertices, triangles, edges, normals, areas)
    count = int(labels.max()) + 1
    total: FloatArray = np.bincount(labels, areas, count).astype(np.float64)
    summed = np.stack([np.bincount(labels, areas * normals[:, k], count) for k in range(3)], axis=1)
    middle = vertices[triangles].mean(axis=1)
    centres = np.stack([np.bincount(labels, areas * middle[:, k], count) for k in range(3)], axis=1)
    facet_normals = summed / np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-300)
    facet_centres = centres / np.maximum(total, 1e-300)[:, None]
    # One link for each pair of facets that touch.
    left, right = labels[edges.left], labels[edges.right]
    between = left != right
    pairs = np.sort(np.stack([left, right], axis=1)[between], axis=1)
    sides = np.linalg.norm(np.diff(vertices[edges.ends[between]], axis=1)[:, 0], axis=1)
    links, index = np.unique(pairs, axis=0, return_inverse=True)
    lengths: FloatArray = np.bincount(index.reshape(-1), sides, len(links)).astype(np.float64)
    first, second = facet_normals[links[:, 0]], facet_normals[links[:, 1]]
    sines = np.linalg.norm(np.cross(first, second), axis=1)
    angles = np.arctan2(sines, np.einsum("ni,ni->n", first, second))
    # Convex where each facet lies behind the other's plane.
    ahead = facet_centres[links[:, 1]] - facet_centres[links[:, 0]]
    convex = np.einsum("ni,ni->n", first - second, ahead) < 0.0
    counts = np.bincount(labels, minlength=count)
    return _Facets(labels, facet_normals, total, facet_centres, counts, links, angles, lengths, convex)


def _flat_components(
    vertices: FloatArray, triangles: IntArray, edges: MeshEdges, normals: FloatArray, areas: FloatArray
) -> IntArray:
    """Label triangles that lie in one plane and touch; slivers join the neighbour whose plane they lie in."""
    corners = vertices[triangles]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    heights = 2.0 * areas / np.maximum(sides.max(axis=1), 1e-300)
    noise = _FLOAT32 * np.abs(vertices).max()
    blur = noise / np.maximum(heights, 1e-300)
    sliver = blur > 0.02
    cosines = np.einsum("ni,ni->n", normals[edges.left], normals[edges.right])
    sines = np.linalg.norm(np.cross(normals[edges.left], normals[edges.right]), axis=1)
    allowed = _FLAT_ANGLE + 2.0 * np.maximum(blur[edges.left], blur[edges.right])
    flat = (np.arctan2(sines, cosines) < allowed) & ~sliver[edges.left] & ~sliver[edges.right]
    labels = components(len(triangles), edges.left[flat], edges.right[flat])
    # A chain of tiny angles can lead round a rounding: what is not flat as a whole goes back to single triangles.
    mean = np.stack([np.bincount(labels, areas * normals[:, k]) for k in range(3)], axis=1)
    mean = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    off = np.linalg.norm(normals - mean[labels], axis=1) > 2.0 * _FLAT_ANGLE + 4.0 * blur
    bent = np.isin(labels, labels[off & ~sliver])
    labels = np.where(bent, len(triangles) + np.arange(len(triangles)), labels)
    waiting = sliver & ~bent
    while waiting.any():
        labels, left_over = _attach(vertices, triangles, edges, normals, labels, waiting)
        if left_over.sum() == waiting.sum():
            break
        waiting = left_over
    return np.unique(labels, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _attach(
    vertices: FloatArray,
    triangles: IntArray,
    edges: MeshEdges,
    normals: FloatArray,
    labels: IntArray,
    waiting: BoolArray,
) -> tuple[IntArray, BoolArray]:
    """Give each waiting sliver the label of the settled neighbour whose plane it leaves least."""
    slivers = np.concatenate([edges.left, edges.right])
    hosts = np.concatenate([edges.right, edges.left])
    usable = waiting[slivers] & ~waiting[hosts]
    slivers, hosts = slivers[usable], hosts[usable]
    offsets = vertices[triangles[slivers]] - vertices[triangles[hosts, 0]][:, None]
    leave = np.abs(np.einsum("nki,ni->nk", offsets, normals[hosts])).max(axis=1)
    order = np.lexsort((leave, slivers))
    first, at = np.unique(slivers[order], return_index=True)
    labels, waiting = labels.copy(), waiting.copy()
    labels[first] = labels[hosts[order][at]]
    waiting[first] = False
    return labels, waiting


def _runs(facets: _Facets) -> IntArray:
    """Label each facet with its run of gently joined facets; -1 for those that are planes."""
    count = len(facets.areas)
    smooth = facets.angles < SMOOTH_ANGLE
    a, b = facets.links[smooth].T
    lengths = facets.lengths[smooth]
    largest = np.zeros(count)
    np.maximum.at(largest, a, facets.areas[b])
    np.maximum.at(largest, b, facets.areas[a])
    gentle = np.bincount(a, lengths, count) + np.bincount(b, lengths, count)
    around = sum(np.bincount(facets.links[:, k], facets.lengths, count) for k in range(2))
    # One triangle that is gently joined nearly all around is a piece of a free form, however large.
    patch = (facets.counts == 1) & (gentle > 0.67 * around)
    broad = (facets.areas > BROAD * largest) & ~patch
    inner = ~broad[a] & ~broad[b]
    labels = components(count, a[inner], b[inner])
    sizes = np.bincount(labels)
    return np.where((sizes[labels] >= SHORTEST_RUN) & ~broad, labels, -1)


def _scans(facets: _Facets, runs: IntArray) -> IntArray:
    """Join regions of single triangles, which only a scan has, and the odd facets inside them, to one run."""
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
    # Runs that the scan touches become part of it: their gentle angles were luck.
    labels = components(len(runs), a[joined], b[joined])
    touched = np.isin(labels, labels[scanned]) & rough
    return np.where(touched, labels + runs.max() + 1, runs)


def _crumbs(facets: _Facets, runs: IntArray, diagonal: float) -> IntArray:
    """Give facets too small to be felt to the run that they share the longest border with."""
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
    vertices: FloatArray, triangles: IntArray, facets: _Facets, runs: IntArray
) -> tuple[IntArray, tuple[tuple[SurfaceKind, dict[str, Any]], ...]]:
    """Fit each run, split it by its sign of curvature where that helps, and number the faces."""
    groups = runs.copy()
    fitted: dict[int, tuple[SurfaceKind, dict[str, Any]]] = {}
    following = int(runs.max()) + 1
    whole = float(facets.areas.sum())
    for run in np.unique(runs[runs >= 0]):
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
            # A ring of any free form fits a cone or a sphere: only bores and rods are worth taking out.
            if found[0] == "cylinder":
                groups[piece] = following
                fitted[following] = found
                following += 1
    alone = groups < 0
    groups[alone] = following + np.flatnonzero(alone)
    first = np.full(len(groups), len(triangles))
    np.minimum.at(first, facets.of_triangle, np.arange(len(triangles)))
    names, index = np.unique(groups, return_inverse=True)
    lowest = np.full(len(names), len(triangles))
    np.minimum.at(lowest, index.reshape(-1), first)
    order = np.argsort(lowest)
    rank = np.empty(len(names), dtype=np.int64)
    rank[order] = np.arange(len(names))
    plane: tuple[SurfaceKind, dict[str, Any]] = ("plane", {})
    return rank[index.reshape(-1)], tuple(fitted.get(int(names[i]), plane) for i in order)


def _pieces(facets: _Facets, members: IntArray) -> list[IntArray]:
    """Split a run into stretches of like facets: same sign of curvature, similar angle and width."""
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
    vertices: FloatArray, triangles: IntArray, facets: _Facets, members: IntArray
) -> tuple[SurfaceKind, dict[str, Any]]:
    used = np.isin(facets.of_triangle, members)
    corners = vertices[np.unique(triangles[used])]
    precision = 4.0 * _FLOAT32 * float(np.abs(vertices).max())
    return fit_curved(corners, facets.centres[members], facets.normals[members], facets.areas[members], precision)
