"""Find the rotations that map a part onto itself.

Every symmetry permutes labelled vectors: the normals of planes, and the vectors from the centroid to the centroids of
faces and to corners. Two nonparallel vectors determine a rotation, so every symmetry is among the maps of the rarest
such pair to equal pairs. Each candidate is then checked on the whole surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.geometry.typing import FloatArray, IntArray
from tanteo.parts.faces.elements import SymmetryGroup
from tanteo.parts.part import Part
from tanteo.parts.readers.topology import components
from tanteo.parts.shapes.surface import Surface

TOLERANCE = 2e-4
"""Largest distance of a mapped point from the surface, relative to the diagonal of the part's box."""

FREEFORM_SLACK = 1e-3
"""Largest assumed error of the mesh of a free form, relative to the diagonal."""

PROBES = 4000
"""Largest number of test points."""


_FEW_PLANES = 64
"""Number of planes up to which planes are compared before points."""


@dataclass(frozen=True, slots=True, eq=False)
class SymmetryProbe:
    """Test points of a part's surface with their tolerances.

    Attributes:
        part: part to test.
        surface: surface of the part.
        points: points on the surface ``(n, 3)`` [m].
        slack: largest error of the mesh at the points ``(n,)`` [m].
        face_slack: largest error of the mesh of each face ``(F,)`` [m].
        base: tolerance for mapped points in addition to the mesh error [m].
    """

    part: Part
    surface: Surface
    points: FloatArray
    slack: FloatArray
    face_slack: FloatArray
    base: float

    @staticmethod
    def of(part: Part) -> SymmetryProbe:
        """Return the probe of a part: its vertices and triangle centroids, or a random subset of them.

        Args:
            part: the part.
        """
        most = np.array([np.inf if face.surface != "freeform" else FREEFORM_SLACK for face in part.faces])
        slacks = np.minimum([face.sagitta for face in part.faces], most * part.diagonal)
        sagitta = slacks[part.triangle_face]
        at_vertex = np.zeros(len(part.vertices))
        for corners in part.triangles.T:
            np.maximum.at(at_vertex, corners, sagitta)
        count = len(part.vertices)
        chosen = np.arange(count + len(part.triangles))
        if len(chosen) > PROBES:
            chosen = np.random.default_rng(0).choice(len(chosen), PROBES, replace=False)
        points, slack = np.zeros((len(chosen), 3)), np.concatenate([at_vertex, sagitta])[chosen]
        of_vertices = chosen < count
        points[of_vertices] = part.vertices[chosen[of_vertices]]
        points[~of_vertices] = part.vertices[part.triangles[chosen[~of_vertices] - count]].mean(axis=1)
        surface = Surface(part.vertices, part.triangles)
        return SymmetryProbe(part, surface, points, slack, slacks, TOLERANCE * part.diagonal)

    def accepts(self, T: FloatArray) -> bool:
        """Return whether a motion maps planes to planes and the surface to itself.

        Args:
            T: motion of the part frame ``(4, 4)`` [m].
        """
        if len(self.part.planes) <= _FEW_PLANES and not self._planes_match(T):
            return False
        # a few points reject most candidates
        few = slice(None, None, 1 + len(self.points) // 64)
        every = slice(None)
        return self._on_surface(T, few) and self._planes_match(T) and self._on_surface(T, every)

    def _on_surface(self, T: FloatArray, chosen: slice) -> bool:
        moved = self.points[chosen] @ T[:3, :3].T + T[:3, 3]
        hits = self.surface.closest(moved)
        there = self.face_slack[self.part.triangle_face[hits.triangles]]
        return bool((hits.distances <= self.base + 2.0 * np.maximum(self.slack[chosen], there)).all())

    def _planes_match(self, T: FloatArray) -> bool:
        planes = self.part.planes
        if not len(planes):
            return True
        sagitta = 2.0 * float(self.face_slack.max())
        centroids = planes.centroids @ T[:3, :3].T + T[:3, 3]
        i, j = _near_pairs(centroids, planes.centroids, 10.0 * self.base + sagitta)
        aligned = np.sum((planes.normals[i] @ T[:3, :3].T) * planes.normals[j], axis=1) > 1.0 - 1e-5
        offsets = np.abs(np.sum((centroids[i] - planes.centroids[j]) * planes.normals[j], axis=1))
        spread = np.abs(planes.gyration[i] - planes.gyration[j]).max(axis=1)
        areas = np.abs(planes.areas[i] - planes.areas[j])
        like = aligned & (offsets < self.base) & (spread < 3.0 * self.base + sagitta)
        like &= areas <= (3.0 * self.base + sagitta) * self.part.diagonal
        return len(np.unique(i[like])) == len(planes)


LOOSE = 5e-3
"""Largest difference of the labels of equal vectors, relative to the part's size."""

_FEW_VECTORS = 500
"""Number of vectors up to which all pairs are compared directly."""

_EQUAL = 1e-3
"""Numerical: step over the loose tolerance to which labels are rounded, so that equal ones are compared once."""

_MOST_PAIRS = 20_000_000
"""Largest number of listed pairs of equal vectors; beyond it grid cells are used."""

MOST_CANDIDATES = 4000
"""Largest number of vector pairs that are tried."""


@dataclass(frozen=True, slots=True, eq=False)
class _Vectors:
    """Vectors from the centroid that a symmetry permutes among those with the same label."""

    directions: FloatArray
    labels: IntArray


def find_symmetry(part: Part) -> SymmetryGroup:
    """Return the rotation group of a part.

    Args:
        part: part with its mesh, faces, planes and corners; its own ``symmetry`` is ignored.

    Returns:
        Finite group, or for a solid of revolution its axis and the motions that preserve the axis. Rotations that fit
        to 0.02 % of the part's diagonal (plus the sagitta of tessellated faces) count as symmetries.
    """
    probe = SymmetryProbe.of(part)
    centres = [
        face.axis_point - part.centroid
        for face in part.faces
        if face.surface == "sphere" and face.axis_point is not None
    ]
    if len(centres) == len(part.faces) and np.linalg.norm(centres, axis=1).max() < 10.0 * TOLERANCE * part.diagonal:
        return SymmetryGroup(np.eye(4)[None], spherical=True)
    axis = _revolution_axis(part, probe)
    if axis is not None:
        point, direction = axis
        flip = _about(part.centroid, SO3.exp(np.pi * SO3.frame_from_axis(direction, 2)[:, 0]))
        Ts = [np.eye(4)] + ([flip] if probe.accepts(flip) else [])
        return SymmetryGroup(np.array(Ts), axis=(point, direction))
    found = [np.eye(3)]
    for R in _candidates(part):
        if any(np.abs(R - known).max() < 0.02 for known in found):
            continue
        if probe.accepts(_about(part.centroid, R)):
            found.append(_refined(part, R))
    return SymmetryGroup(np.array([_about(part.centroid, R) for R in _ordered(found)]))


def _near_pairs(first: FloatArray, second: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    """Return the rows of all pairs of points, one of each set, that are nearer than ``reach`` to each other [m]."""
    if len(first) * len(second) <= _FEW_VECTORS**2:  # SciPy takes longer to import
        i, j = np.nonzero(np.linalg.norm(first[:, None] - second[None], axis=2) < reach)
        return i, j
    from scipy.spatial import cKDTree  # slow to import

    found = cKDTree(first).sparse_distance_matrix(cKDTree(second), reach, output_type="ndarray")
    return found["i"], found["j"]


def _about(centre: FloatArray, R: FloatArray) -> FloatArray:
    return SE3.from_parts(R, centre - R @ centre)


def _revolution_axis(part: Part, probe: SymmetryProbe) -> tuple[FloatArray, FloatArray] | None:
    """Return the axis of a solid of revolution from its faces; None if the part is not one."""
    slack = 10.0 * TOLERANCE * part.diagonal
    round_faces = [face for face in part.faces if face.surface in ("cylinder", "cone", "torus")]
    if round_faces:
        face = max(round_faces, key=lambda each: each.area)
        direction = face.axis_direction
        point = face.axis_point
    else:
        direction = _inertia_axis(part)
        point = part.centroid
    if direction is None or point is None:
        return None
    for face in part.faces:
        sagitta = slack + face.sagitta
        if face.surface == "plane":
            assert face.axis_direction is not None
            if abs(face.axis_direction @ direction) < 1.0 - 1e-6 or _off(face.centroid, point, direction) > sagitta:
                return None
        elif face.surface != "freeform":
            assert face.axis_point is not None
            turned = face.axis_direction is not None and abs(face.axis_direction @ direction) < 1.0 - 1e-5
            if turned or _off(face.axis_point, point, direction) > sagitta:
                return None
    # angles that no finite rotation group has in common
    turns = [_about(part.centroid, SO3.exp(angle * direction)) for angle in (0.37, 1.0, 2.3)]
    if not all(probe.accepts(T) for T in turns):
        return None
    return part.centroid, direction


def _off(where: FloatArray, point: FloatArray, direction: FloatArray) -> float:
    return float(np.linalg.norm(np.cross(where - point, direction)))


_BLOCK = 50_000
"""Numerical: number of triangles that are summed at a time, which bounds the memory."""


def _inertia_axis(part: Part) -> FloatArray | None:
    """Return the axis of a surface whose two other principal moments are equal; None if there is none."""
    moments = np.zeros((3, 3))
    for start in range(0, len(part.triangles), _BLOCK):
        corners = part.vertices[part.triangles[start : start + _BLOCK]] - part.centroid
        a, b, c = corners.transpose(1, 0, 2)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        moments += sum((v * areas[:, None]).T @ v for v in (a, b, c, a + b + c))
    values, vectors = np.linalg.eigh(moments)
    gaps = np.diff(values) / values[2]
    if gaps.min() > 0.01 or gaps.max() < 0.01:
        return None
    return np.asarray(vectors[:, 2] if gaps[0] < gaps[1] else vectors[:, 0])


def _candidates(part: Part) -> list[FloatArray]:
    """Return rotations that map the rarest pair of labelled vectors to an equal pair."""
    vectors = _labelled(part)
    counts = np.bincount(vectors.labels)[vectors.labels]
    best: tuple[int, int, int] | None = None
    order = np.argsort(counts, kind="stable")
    for i in order[:12]:
        sines = np.linalg.norm(np.cross(vectors.directions[i], vectors.directions), axis=1)
        others = np.flatnonzero(sines > 0.2)
        if len(others):
            j = int(others[np.argmin(counts[others])])
            cost = int(counts[i] * counts[j])
            if best is None or cost < best[0]:
                best = cost, int(i), j
    if best is None:
        return _principal_candidates(part)
    _, i, j = best
    first = np.flatnonzero(vectors.labels == vectors.labels[i])
    second = np.flatnonzero(vectors.labels == vectors.labels[j])
    cosine = vectors.directions[i] @ vectors.directions[j]
    match = np.abs(vectors.directions[first] @ vectors.directions[second].T - cosine) < 0.02
    pairs = np.argwhere(match)[:MOST_CANDIDATES]
    source = _pair_frame(vectors.directions[i], vectors.directions[j])
    return [_pair_frame(vectors.directions[first[a]], vectors.directions[second[b]]) @ source.T for a, b in pairs]


def _principal_candidates(part: Part) -> list[FloatArray]:
    """Return rotations by fractions of a turn about the principal axes, for parts without usable features."""
    local = part.vertices[part.triangles].mean(axis=1) - part.centroid
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    _, axes = np.linalg.eigh(np.einsum("t,ti,tj->ij", areas, local, local))
    return [
        SO3.exp(2.0 * np.pi * step / fold * axes[:, k])
        for k in range(3)
        for fold in (2, 3, 4, 5, 6, 8)
        for step in range(1, fold)
    ]


def _labelled(part: Part) -> _Vectors:
    size = part.diagonal
    directions: list[FloatArray] = []
    marks: list[tuple[float, ...]] = []
    kinds = {"plane": 0.0, "cylinder": 1.0, "cone": 2.0, "sphere": 3.0, "torus": 4.0, "freeform": 5.0}
    for face in part.faces:
        arm = face.centroid - part.centroid
        scale = np.sqrt(face.area) / size
        reach = float(np.linalg.norm(arm))
        if face.surface == "plane":
            assert face.axis_direction is not None
            offset = float(arm @ face.axis_direction) / size
            directions.append(face.axis_direction)
            marks.append((0.0, scale, offset, reach / size))
        if reach > 0.02 * size:
            directions.append(arm / reach)
            marks.append((1.0 + kinds[face.surface], scale, reach / size, (face.radius or 0.0) / size))
    for point in part.corners.points:
        arm = point - part.centroid
        reach = float(np.linalg.norm(arm))
        if reach > 0.02 * size:
            directions.append(arm / reach)
            marks.append((10.0, 0.0, reach / size, 0.0))
    return _Vectors(np.array(directions).reshape(-1, 3), _clusters(np.array(marks).reshape(-1, 4)))


def _clusters(marks: FloatArray) -> IntArray:
    """Label rows that are equal within the loose tolerance, including chains."""
    step = _EQUAL * LOOSE
    rounded, of_mark = np.unique(np.rint(marks / step), axis=0, return_inverse=True)  # equal facets have equal marks
    return _chained(step * rounded)[of_mark.reshape(-1)]


def _chained(marks: FloatArray) -> IntArray:
    """Label different rows that are equal within the loose tolerance, including chains."""
    cells, counts = np.unique(np.rint(marks / LOOSE), axis=0, return_inverse=True, return_counts=True)[1:]
    if np.sum(counts**2) > _MOST_PAIRS:  # meshes with very many similar facets
        return cells.reshape(-1)
    places = marks[:, 1:] + np.outer(marks[:, 0], [10.0, 0.0, 0.0])  # vectors of two kinds are far from each other
    first, second = _core.near_pairs(np.ascontiguousarray(places), float(np.sqrt(3) * LOOSE)).reshape(-1, 2).T
    near = np.abs(marks[first] - marks[second]).max(axis=1, initial=0.0) <= LOOSE
    return components(len(marks), first[near], second[near])


def _pair_frame(first: FloatArray, second: FloatArray) -> FloatArray:
    z = np.cross(first, second)
    z /= np.linalg.norm(z)
    return np.stack([first, np.cross(z, first), z], axis=1)


def _refined(part: Part, R: FloatArray) -> FloatArray:
    """Refine a rotation on all planes that it permutes, then round its angle to a fraction of a turn."""
    normals = part.planes.normals
    if len(normals) and np.linalg.matrix_rank(normals, tol=0.1) >= 2:
        moved = normals @ R.T
        mates = normals[np.argmax(moved @ normals.T, axis=1)]
        u, _, vt = np.linalg.svd(mates.T @ normals)
        R = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    angle = float(np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0)))
    values, vectors = np.linalg.eigh((R + R.T) / 2.0)
    axis = vectors[:, np.argmax(values)]
    if np.linalg.norm(SO3.exp(angle * axis) - R) > np.linalg.norm(SO3.exp(-angle * axis) - R):
        axis = -axis
    fold = next(
        (n for n in range(2, 400) if abs(angle * n / (2 * np.pi) - round(angle * n / (2 * np.pi))) < n * 1e-4), 0
    )
    return SO3.exp(2.0 * np.pi * round(angle * fold / (2 * np.pi)) / fold * axis) if fold else R


def _ordered(rotations: list[FloatArray]) -> list[FloatArray]:
    """Return the rotations with the identity first, then by angle."""
    return sorted(rotations, key=lambda R: -round(float(np.trace(R)), 6))


_NODES = np.array([[1 / 3, 1 / 3, 1 / 3], [0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
_SHARES = np.array([-27.0, 25.0, 25.0, 25.0]) / 48
"""Definition: barycentric nodes and weights that integrate cubic polynomials over a triangle (Strang and Fix 1973)."""


def chirality(part: Part) -> float:
    """Return a number between -1 and 1 that changes its sign with the handedness of a part.

    With the vector u, the integral of |x|^2 x over the surface about its centroid, and the second moments M, it is the
    volume of the directions of u, M u and M^2 u. Rotations do not change it. It is 0 for a part that is its own mirror
    image, and for some others.

    Args:
        part: the part.
    """
    corners = part.vertices[part.triangles]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    w = (areas[:, None] * _SHARES).ravel() / areas.sum()
    x = np.einsum("nk,tki->tni", _NODES, corners).reshape(-1, 3)
    x = (x - w @ x) / part.diagonal
    u, M = (w * np.sum(x * x, axis=1)) @ x, (x.T * w) @ x
    vectors = np.array([u, M @ u, M @ M @ u])
    lengths = np.linalg.norm(vectors, axis=1)
    if lengths[0] < TOLERANCE:
        return 0.0
    return float(np.linalg.det(vectors / lengths[:, None]))
