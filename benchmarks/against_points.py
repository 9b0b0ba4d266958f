"""Poses, points, beams and made-up parts for ``against_scenes.py``: NumPy and, of a part, its mesh and its cylinders.

Results must not depend on what two commits compute differently: only the inputs of a scene are made here. Metres and
radians.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

REACH = 0.3
"""Length of a beam from its start to the part."""

STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
"""One triangle of a binary STL file."""


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def turn(w):
    """Rotation by a vector."""
    angle = np.linalg.norm(w)
    K = hat(w / max(angle, 1e-300))
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def pose(R, t):
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, t
    return T


def exp(xi):
    """Pose of a twist, translation first."""
    angle, K = np.linalg.norm(xi[3:]), hat(xi[3:])
    a, b = (0.5, 1 / 6) if angle < 1e-6 else ((1 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3)
    return pose(turn(xi[3:]), (np.eye(3) + a * K + b * K @ K) @ xi[:3])


def at(T, points):
    return points @ T[:3, :3].T + T[:3, 3]


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def anywhere(rng):
    x, y, z, w = unit(rng.normal(size=4))
    R = np.eye(3) + 2 * w * hat((x, y, z)) + 2 * hat((x, y, z)) @ hat((x, y, z))
    return pose(R, rng.uniform(-0.5, 0.5, 3))


def spread(place, degrees):
    """Return the covariance of a pose with equal standard deviations on all axes."""
    return np.diag(np.repeat([place, np.radians(degrees)], 3)) ** 2


def facet_points(part, n, rng, triangles=None):
    """Points of the mesh even by area, their outward normals, and the triangles on which they are."""
    triangles = np.arange(len(part.triangles)) if triangles is None else triangles
    a, b, c = part.vertices[part.triangles[triangles]].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    areas = np.linalg.norm(across, axis=1)
    some = rng.choice(len(areas), size=n, p=areas / areas.sum())
    u, v = np.sort(rng.uniform(size=(2, n, 1)), axis=0)
    return u * a[some] + (v - u) * b[some] + (1 - v) * c[some], across[some] / areas[some, None], triangles[some]


def on_surface(part, n, rng, triangles=None):
    """Points even by area, on the cylinder where a face is one, and their outward normals."""
    return onto_cylinders(part, *facet_points(part, n, rng, triangles))


def onto_cylinders(part, points, normals, triangles, along=None):
    """Points of facets moved to the cylinder behind them, along its radius or a direction, and the normals there."""
    points, normals = np.array(points), np.array(normals)
    faces = part.triangle_face[triangles]
    for i in np.flatnonzero([part.faces[k].surface == "cylinder" for k in faces]):
        face = part.faces[faces[i]]
        for _ in range(3):
            v = points[i] - face.axis_point
            v = v - (v @ face.axis_direction) * face.axis_direction
            out = unit(v)
            way = out if along is None else along[i]
            points[i] -= (np.linalg.norm(v) - face.radius) / (way @ out) * way
        normals[i] = np.sign(out @ normals[i]) * out
    return points, normals


def cast(part, origins, directions):
    """Return the distance of the mesh along each ray (infinite: no hit) and the triangle that the ray hits first."""
    a, b, c = part.vertices[part.triangles].transpose(1, 0, 2)
    p = np.cross(directions[:, None], c - a)
    det = np.sum(p * (b - a), axis=-1)
    det = np.where(np.abs(det) < 1e-15, np.nan, det)
    s = origins[:, None] - a
    q = np.cross(s, b - a)
    u, v = np.sum(s * p, axis=-1) / det, np.sum(q * directions[:, None], axis=-1) / det
    t = np.sum(q * (c - a), axis=-1) / det
    t = np.where((u >= -1e-12) & (v >= -1e-12) & (u + v <= 1 + 1e-12) & (t > 1e-9), t, np.inf)
    return t.min(axis=1), t.argmin(axis=1)


def beams(part, n, rng, tilt=0.6):
    """Points that straight ways from outside meet first, and the directions of these ways."""
    points, directions = np.zeros((0, 3)), np.zeros((0, 3))
    while len(points) < n:
        p, normals, _ = facet_points(part, 4 * n, rng)
        d = unit(tilt * rng.normal(size=p.shape) - normals)
        far, triangles = cast(part, p - REACH * d, d)
        ok = (np.sum(d * normals, axis=1) < -0.3) & (np.abs(far - REACH) < 1e-7)
        p, _ = onto_cylinders(part, p[ok], normals[ok], triangles[ok], d[ok])
        points, directions = np.concatenate([points, p]), np.concatenate([directions, d[ok]])
    return points[:n], directions[:n]


def contact_columns(points, T, sd, rng, **columns):
    """Columns of contact points of a part at a pose."""
    n = len(points)
    return {"points": at(T, points) + sd * rng.normal(size=(n, 3)), "sds": np.full(n, sd), **columns}


def beam_columns(part, T, sd, n, rng):
    """Columns of beams, as uncertain across as along."""
    p, d = beams(part, n, rng)
    return contact_columns(p, T, sd, rng, directions=d @ T[:3, :3].T, ranges=np.full(n, REACH))


def hands(z, points, rng):
    """Poses of a hand at points, its z along given directions, its turn about it at random."""
    x = unit(np.cross(z, rng.normal(size=z.shape)))
    return np.array([pose(np.stack(axes, axis=-1), p) for *axes, p in zip(x, np.cross(z, x), z, points, strict=True)])


def made_files(folder: Path, demo: Path) -> None:
    """Parts that no folder has: a bracket far from its origin, a sheet of 1.5 mm, two round bars (STL, mm)."""
    raw = np.frombuffer((demo / "bracket_left.stl").read_bytes()[84:], STL)
    _write(folder / "far.stl", raw["corners"] + np.array([300.0, -400.0, 0.0]))
    outline = np.array([[30, 20], [30, 60], [0, 60], [0, 0], [80, 0], [80, 20]], dtype=float)
    _write(folder / "sheet.stl", _prism(outline, 1.5))
    angles = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    for length in (60, 200):
        _write(folder / f"bar_{length}.stl", _prism(10 * np.column_stack([np.cos(angles), np.sin(angles)]), length))


def _prism(outline, height):
    """Return the triangles ``(T, 3, 3)`` of an extruded outline that is star-shaped about its first corner."""
    low, high = (np.column_stack([outline, np.full(len(outline), z)]) for z in (-height / 2, height / 2))
    k = np.arange(1, len(outline) - 1)
    ends = [[high[0], high[i], high[i + 1]] for i in k] + [[low[0], low[i + 1], low[i]] for i in k]
    after = np.roll(np.arange(len(outline)), -1)
    sides = [[low[i], low[j], high[j]] for i, j in enumerate(after)]
    return np.array([*ends, *sides, *([low[i], high[j], high[i]] for i, j in enumerate(after))])


def _write(path, corners):
    """Write a binary STL file."""
    rows = np.zeros(len(corners), STL)
    rows["corners"] = corners
    path.write_bytes(bytes(80) + np.uint32(len(rows)).tobytes() + rows.tobytes())
