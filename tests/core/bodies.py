"""Bodies for the judges of the core: prisms of any outline, and round ones, as arrays made without the core."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tanteo import _core


@dataclass(frozen=True, eq=False)
class Body:
    """What ``make_shape`` is given."""

    vertices: np.ndarray
    triangles: np.ndarray
    faces: np.ndarray
    profile_rows: np.ndarray
    profiles: np.ndarray
    edges: np.ndarray
    corners: np.ndarray
    axes: np.ndarray = field(default_factory=lambda: np.zeros((0, 12)))

    @property
    def across(self):
        """Twice the area of each triangle along its normal."""
        a, b, c = self.vertices[self.triangles].transpose(1, 0, 2)
        return np.cross(b - a, c - a)

    @property
    def centre(self):
        areas = np.linalg.norm(self.across, axis=1)
        return areas @ self.vertices[self.triangles].mean(axis=1) / areas.sum()

    @property
    def diagonal(self):
        used = self.vertices[self.triangles.ravel()]
        return np.linalg.norm(np.ptp(used, axis=0))

    def surface_points(self, n, rng):
        """Points even over the triangles, and their normals."""
        areas = np.linalg.norm(self.across, axis=1)
        rows = rng.choice(len(areas), size=n, p=areas / areas.sum())
        u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
        a, b, c = self.vertices[self.triangles[rows]].transpose(1, 0, 2)
        return u * a + (v - u) * b + (1 - v) * c, self.across[rows] / areas[rows, None]

    def shape(self, cells=6):
        """Compiled."""
        samples, normals = self.surface_points(256, np.random.default_rng(7))
        arrays = self.vertices, self.triangles, self.faces, self.profile_rows, self.profiles, self.edges, self.corners
        arrays = [np.ascontiguousarray(a, dtype=np.int32 if a.dtype.kind == "i" else float) for a in arrays]
        lines = np.column_stack([self.axes, self.axes[:, 11] == 3, np.zeros((len(self.axes), 2))])
        rest = lines, self.vertices, self.centre, samples, normals
        return _core.make_shape(*arrays, *(np.ascontiguousarray(a) for a in rest), cells)

    def moved(self, T):
        """Return the same body in another frame."""
        R, t = T[:3, :3], T[:3, 3]
        profiles = self.profiles.copy()
        profiles[:, :3], profiles[:, 3:6] = profiles[:, :3] @ R.T + t, profiles[:, 3:6] @ R.T
        edges = (self.edges.reshape(-1, 3) @ R.T + t).reshape(-1, 6)
        return replace(
            self, vertices=self.vertices @ R.T + t, profiles=profiles, edges=edges, corners=self.corners @ R.T + t
        )

    def shuffled(self, rng):
        """Vertices, triangles, edges and corners in another order, triangles from another corner on, faces renamed."""
        new = rng.permutation(len(self.vertices))
        vertices = np.empty_like(self.vertices)
        vertices[new] = self.vertices
        order = rng.permutation(len(self.triangles))
        turned = np.stack([np.roll(t, rng.integers(3)) for t in new[self.triangles]])
        names = rng.permutation(self.faces.max() + 1)
        return replace(
            self, vertices=vertices, triangles=turned[order], faces=names[self.faces][order],
            profile_rows=self.profile_rows[order], edges=rng.permutation(self.edges),
            corners=rng.permutation(self.corners),
        )  # fmt: skip

    def split(self):
        """Return the mesh with every triangle split into four at the middles of its sides."""
        corners = self.vertices[self.triangles]
        middles = 0.5 * (corners + np.roll(corners, -1, axis=1))
        points = np.concatenate([corners, middles], axis=1).reshape(-1, 3)
        vertices, index = np.unique(np.round(points, 12), axis=0, return_inverse=True)
        a, b, c, ab, bc, ca = index.reshape(-1, 6).T
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.stack([np.column_stack(p) for p in parts], axis=1).reshape(-1, 3)
        return replace(
            self, vertices=vertices, triangles=triangles, faces=self.faces.repeat(4),
            profile_rows=self.profile_rows.repeat(4),
        )  # fmt: skip


def prism(outline, height):
    """Return a prism on an outline that runs counter-clockwise ``(n, 2)``; its last two faces are bottom and top."""
    outline, n = np.asarray(outline, dtype=float), len(outline)
    low, high = (np.column_stack([outline, np.full(n, z)]) for z in (0.0, height))
    ears = _ears(outline)
    here, there = np.arange(n), np.roll(np.arange(n), -1)
    sides = np.stack([np.column_stack([here, there, there + n]), np.column_stack([here, there + n, here + n])], axis=1)
    triangles = np.concatenate([sides.reshape(-1, 3), ears[:, ::-1], ears + n])
    faces = np.concatenate([here.repeat(2), np.full(len(ears), n), np.full(len(ears), n + 1)])
    edges = np.concatenate(
        [np.hstack([low[here], low[there]]), np.hstack([high[here], high[there]]), np.hstack([low, high])]
    )
    vertices = np.concatenate([low, high])
    return Body(vertices, triangles, faces, np.full(len(faces), -1), np.zeros((0, 11)), edges, vertices.copy())


def _ears(outline):
    """Triangles of a simple polygon, ear by ear."""
    left, out = list(range(len(outline))), []

    def cross(a, b, c):
        u, v = outline[b] - outline[a], outline[c] - outline[a]
        return u[0] * v[1] - u[1] * v[0]

    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            inside = any(min(cross(a, b, p), cross(b, c, p), cross(c, a, p)) >= 0 for p in left if p not in (a, b, c))
            if cross(a, b, c) > 0 and not inside:
                out.append((a, b, c))
                left.pop(k)
                break
    return np.array([*out, tuple(left)])


def revolved(path, faces, rows, profiles, n):
    """Return the body of a path ``(k, 2)`` of radius and height about z, material on its left, ``n`` segments."""
    k, phi = len(path), 2 * np.pi * np.arange(n) / n
    vertices = np.stack([
        path[:, :1] * np.cos(phi), path[:, :1] * np.sin(phi), np.broadcast_to(path[:, 1:], (k, n))
    ], axis=-1).reshape(-1, 3)  # fmt: skip
    triangles, of_face, of_row = [], [], []
    for i in range(k - 1):
        a, b = np.arange(n) + i * n, np.roll(np.arange(n), -1) + i * n
        both = ([np.column_stack([a, b, b + n])] if path[i, 0] > 0 else []) + (
            [np.column_stack([a, b + n, a + n])] if path[i + 1, 0] > 0 else []
        )
        if path[i, 0] == 0:
            both = [np.column_stack([np.full(n, i * n), b + n, a + n])]
        elif path[i + 1, 0] == 0:
            both = [np.column_stack([a, b, np.full(n, (i + 1) * n)])]
        triangles += both
        of_face += [faces[i]] * n * len(both)
        of_row += [rows[i]] * n * len(both)
    return Body(
        vertices, np.concatenate(triangles), np.array(of_face), np.array(of_row), np.asarray(profiles, dtype=float),
        np.zeros((0, 6)), np.zeros((0, 3)),
    )  # fmt: skip


def cylinder(radius=0.03, height=0.05, n=12):
    path = np.array([[0, 0], [radius, 0], [radius, height], [0, height]])
    row = [0, 0, 0, 0, 0, 1, radius, 0, 0, 1, np.cos(1.5 * 2 * np.pi / n)]
    return revolved(path, [0, 1, 2], [-1, 0, -1], [row], n)


def cone(radius=0.04, height=0.06, cut=0.03, n=12):
    """Return a truncated cone; the height of the apex over the base is given."""
    top = radius * (1 - cut / height)
    path = np.array([[0, 0], [radius, 0], [top, cut], [0, cut]])
    row = [0, 0, height, 0, 0, 1, 0, -np.arctan(radius / height), 0, 1, np.cos(1.5 * 2 * np.pi / n)]
    return revolved(path, [0, 1, 2], [-1, 0, -1], [row], n)


def ball(radius=0.03, n=12):
    angle = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)
    path = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    path[[0, -1], 0] = 0
    row = [0, 0, 0, 0, 0, 1, 0, 0, radius, 1, np.cos(1.5 * 2 * np.pi / n)]
    return revolved(path, [0] * (len(path) - 1), [0] * (len(path) - 1), [row], n)


def ring(major=0.04, minor=0.015, n=12):
    angle = 2 * np.pi * np.arange(n + 1) / n
    path = np.column_stack([major + minor * np.cos(angle), minor * np.sin(angle)])
    row = [0, 0, 0, 0, 0, 1, major, 0, minor, 1, np.cos(1.5 * 2 * np.pi / n)]
    body = revolved(path, [0] * n, [0] * n, [row], n)
    last = len(body.vertices) - n  # the path ends where it began
    return replace(body, triangles=np.where(body.triangles >= last, body.triangles - last, body.triangles))


def tent(low=0.0, radius=0.04, height=0.03, n=6):
    """Six triangles about a top, every second of its edges to a corner at ``low``, over a point at the bottom: with
    low corners ridges and valleys take turns about the top. Every triangle is a face."""
    turn, here, there = 2 * np.pi * np.arange(n) / n, np.arange(n), np.roll(np.arange(n), -1)
    ring = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.where(here % 2, low, 0.0)])
    vertices = np.concatenate([ring, [[0, 0, height], [0, 0, -height]]])
    triangles = np.concatenate(
        [np.column_stack([here, there, here * 0 + n]), np.column_stack([there, here, here * 0 + n + 1])]
    )
    edges = np.hstack([vertices[here], vertices[there]])
    return Body(vertices, triangles, np.arange(2 * n), np.full(2 * n, -1), np.zeros((0, 11)), edges, vertices.copy())


def wedge_profile(rng):
    """Return a slanted outline of five corners."""
    angles = np.sort(rng.uniform(0, 1, 5)) * 0.6 + np.arange(5)
    return 0.045 * np.column_stack([np.cos(angles * 2 * np.pi / 5), np.sin(angles * 2 * np.pi / 5)])


def flat_bodies():
    """Right-angled, slanted and concave ones."""
    L = [[0, 0], [0.08, 0], [0.08, 0.02], [0.03, 0.02], [0.03, 0.06], [0, 0.06]]
    return {
        "block": prism([[0, 0], [0.08, 0], [0.08, 0.05], [0, 0.05]], 0.03),
        "bracket": prism(L, 0.04),
        "wedge": prism(wedge_profile(np.random.default_rng(3)), 0.03),
        "plate": prism([[0, 0], [0.06, 0], [0.06, 0.04], [0, 0.04]], 0.002),
    }


def round_bodies():
    """Return one body for every kind of surface."""
    return {"cylinder": cylinder(), "cone": cone(), "ball": ball(), "ring": ring()}
