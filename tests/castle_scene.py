"""The wooden polyhedron of the depth frames: its part, frames as beams, the dense fit, samples of a few pixels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import tanteo
from altered import altered
from bare_scenes import touches_of
from tanteo.geometry import SE3, SO3

FOLDER = Path(__file__).resolve().parents[1].parent / "shared" / "data" / "depth_castle"
FRAMES = 0, 3, 6, 9

_FOCAL, _CENTRE = np.array([476.0536, 476.0535]), np.array([311.4846, 246.2832])
_METRES = 0.000124986647

_THICK, _GAP = 5e-4, 2e-4
"""The model has open faces: each becomes a plate this thick, corners drawn in by the gap so that no two touch [m]."""

_STEEP = 0.25
"""Cosine of incidence below which a pixel is not used."""

_IN_VIEW = 150
"""A face with fewer pixels is not well in view."""


def polygons():
    """Return the model's faces, counter-clockwise seen from outside [m]."""
    out = []
    for path in sorted((FOLDER / "chateau_parts").glob("*.cao")):
        lines = [line.split("#")[0].split("name")[0].split() for line in path.read_text().splitlines()]
        lines = [line for line in lines if line]
        n = int(lines[1][0])
        vertices = np.array([line[:3] for line in lines[2 : 2 + n]], dtype=float)
        rest = lines[2 + n :]
        out += [vertices[[int(i) for i in line[1 : 1 + int(line[0])]]] for line in rest[3 : 3 + int(rest[2][0])]]
    return out


def castle(folder):
    """Return the part, made of one plate for every face."""
    vertices, triangles = [], []
    for face in polygons():
        centre = face.mean(axis=0)
        edges = np.cross(face - centre, np.roll(face, -1, axis=0) - centre).sum(axis=0)
        normal = edges / np.linalg.norm(edges)
        arms = face - centre
        top = centre + arms * (1 - _GAP / np.linalg.norm(arms, axis=1, keepdims=True))
        m, first = len(top), sum(map(len, vertices))
        faces = [t for a, b, c in _ears(top, normal) for t in ((a, b, c), (m + a, m + c, m + b))]
        for i in range(m):
            j = (i + 1) % m
            faces += [(i, m + i, m + j), (i, m + j, j)]
        vertices.append(np.concatenate([top, top - _THICK * normal]))
        triangles.append(np.array(faces) + first)
    v, t = np.concatenate(vertices), np.concatenate(triangles)
    lines = ["OFF", f"{len(v)} {len(t)} 0", *(" ".join(map(str, row)) for row in v.tolist())]
    path = Path(folder) / "castle.off"
    path.write_text("\n".join([*lines, *(f"3 {a} {b} {c}" for a, b, c in t.tolist())]) + "\n")
    return tanteo.read_part(path, unit="m")


def _ears(v, normal):
    """Triangles of a simple polygon."""
    left, out = list(range(len(v))), []
    while len(left) > 3:
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            sides = ((a, b), (b, c), (c, a))
            others = [o for o in left if o not in (a, b, c)]
            inside = any(all(np.cross(v[q] - v[p], v[o] - v[p]) @ normal >= 0 for p, q in sides) for o in others)
            if np.cross(v[b] - v[a], v[c] - v[a]) @ normal > 0 and not inside:
                out.append((a, b, c))
                left.pop(k)
                break
    return [*out, tuple(left)]


def first_pose():
    """Return the pose of the object in the depth camera at frame 0, with an error of some millimetres."""
    start = np.array((FOLDER / "chateau.0.pos").read_text().split(), dtype=float)
    M = np.array((FOLDER / "depth_M_color.txt").read_text().split(), dtype=float).reshape(4, 4)
    return M @ SE3.from_parts(SO3.exp(start[3:]), start[:3])


def beams_of(frame):
    """Points [m], unit directions and ranges [m] of all pixels, in the depth camera."""
    data = (FOLDER / f"depth_image_{frame:04d}.bin").read_bytes()
    h, w = np.frombuffer(data[:8], "<u4")
    z = np.frombuffer(data[8:], "<u2").reshape(h, w) * _METRES
    v, u = np.nonzero(z > 0)
    d = np.column_stack([(np.column_stack([u, v]) - _CENTRE) / _FOCAL, np.ones(len(u))])
    length = np.linalg.norm(d, axis=1)
    return d * z[v, u][:, None], d / length[:, None], z[v, u] * length


def against(surface, T, directions, ranges):
    """Range residual [m], inf where the beam misses; cosine of incidence, and triangle."""
    local = directions @ T[:3, :3]
    hits = surface.cast(np.broadcast_to(SE3.apply(SE3.inverse(T), np.zeros(3)), local.shape), local)
    return ranges - hits.distances, -np.sum(surface.normals[hits.triangles] * local, axis=1), hits.triangles


def dense_fit(surface, frame, T, steps=25):
    """Pose from every seventh pixel near the object: robust point to plane along the beam."""
    points, directions, ranges = (a[::7] for a in beams_of(frame))
    near = surface.closest(SE3.apply(SE3.inverse(T), points)).distances < 0.03
    points, directions, ranges = points[near], directions[near], ranges[near]
    for k in range(steps):
        gap, cosine, triangles = against(surface, T, directions, ranges)
        ok = np.isfinite(gap) & (np.abs(gap) < max(0.02 * 0.8**k, 0.006)) & (cosine > 0.2)
        normal, p = surface.normals[triangles[ok]], SE3.apply(SE3.inverse(T), points[ok])
        e = -gap[ok] * cosine[ok]
        J = -np.concatenate([normal, np.cross(p, normal)], axis=1)
        w = 1 / (1 + (e / 1.5e-3) ** 2)
        T = T @ SE3.exp(np.linalg.solve((J * w[:, None]).T @ J + 1e-9 * np.eye(6), -(J * w[:, None]).T @ e))
    return T


@dataclass(frozen=True)
class Pixels:
    """Pixels of one frame that see the object: those to draw from, and the noise of the others.

    Attributes:
        points: in the depth camera [m].
        directions: of their beams.
        ranges: along them [m].
        faces: face of the part that each is on at the dense fit.
        sd_of_face: rms distance from the plane of each face that is well in view [m].
        tolerance: sd of what all pixels of a face share: the wood is not where the model has it [m].
    """

    points: np.ndarray
    directions: np.ndarray
    ranges: np.ndarray
    faces: np.ndarray
    sd_of_face: dict[int, float]
    tolerance: float

    @property
    def sd(self):
        """Noise of a drawn pixel: all faces count equally, as in a draw."""
        return float(np.sqrt(np.mean(np.square(list(self.sd_of_face.values())))))

    def choose(self, n, rng):
        """Rows of ``n`` pixels spread over the faces that are well in view."""
        each = -(-n // len(self.sd_of_face))
        rows = [rng.choice(np.flatnonzero(self.faces == f), each, replace=False) for f in self.sd_of_face]
        return rng.permutation(np.concatenate(rows))[:n]

    def beams(self, rows):
        """Return chosen pixels as readings."""
        touches = touches_of(self.points[rows], self.sd, directions=self.directions[rows])
        return altered(touches, reach=self.ranges[rows] - 0.02, tolerance=self.tolerance)

    def draw(self, n, rng):
        """``n`` pixels spread over the faces, as readings."""
        return self.beams(self.choose(n, rng))


def pixels_of(part, surface, frame, T):
    """Pixels within 10 mm of the object at the dense fit; noise along the normal from every other one of them."""
    points, directions, ranges = beams_of(frame)
    gap, cosine, triangles = against(surface, T, directions, ranges)
    seen = np.flatnonzero(np.isfinite(gap) & (np.abs(gap) < 0.01) & (cosine > _STEEP))
    off, faces = (gap * cosine)[seen], part.triangle_face[triangles[seen]]
    ids, counts = np.unique(faces[1::2], return_counts=True)
    of_face = {int(f): off[::2][faces[::2] == f] for f in ids[counts > _IN_VIEW]}
    sds = {f: float(np.sqrt(np.mean(gaps**2))) for f, gaps in of_face.items()}
    shared = float(np.std([np.mean(gaps) for gaps in of_face.values()], ddof=1))
    kept = seen[1::2]
    return Pixels(points[kept], directions[kept], ranges[kept], faces[1::2], sds, shared)
