"""Solids made in the tests, as vertices and triangles in millimetres, and the files they are written to."""

from types import SimpleNamespace

import numpy as np
import pytest


def prism(outline, height):
    """Return a prism over a convex outline (N, 2), counter-clockwise, from z = 0 to ``height``."""
    n = len(outline)
    ring = np.asarray(outline, dtype=float)
    bottom, top = np.c_[ring, np.zeros(n)], np.c_[ring, np.full(n, float(height))]
    triangles = []
    for i in range(1, n - 1):
        triangles += [(0, i + 1, i), (n, n + i, n + i + 1)]
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, n + j), (i, n + j, n + i)]
    return np.concatenate([bottom, top]), np.array(triangles)


def polygon(sides, radius=30.0, phase=0.0):
    angles = phase + 2 * np.pi * np.arange(sides) / sides
    return radius * np.c_[np.cos(angles), np.sin(angles)]


def box(a=80.0, b=60.0, c=50.0):
    return prism([(0, 0), (a, 0), (a, b), (0, b)], c)


def tetrahedron(size=50.0):
    vertices = size * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    return vertices, np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)])


def lathe(profile, steps=48):
    """Turn a profile of (radius, height) about z; it begins and ends on the axis."""
    vertices, triangles = [(0.0, 0.0, profile[0][1])], []
    rings = profile[1:-1]
    for radius, height in rings:
        angles = 2 * np.pi * np.arange(steps) / steps
        vertices.extend((radius * np.cos(angle), radius * np.sin(angle), height) for angle in angles)
    vertices.append((0.0, 0.0, profile[-1][1]))
    last = len(vertices) - 1
    for i in range(steps):
        j = (i + 1) % steps
        triangles.append((0, 1 + j, 1 + i))
        for k in range(len(rings) - 1):
            a, b = 1 + k * steps, 1 + (k + 1) * steps
            triangles += [(a + i, a + j, b + j), (a + i, b + j, b + i)]
        top = 1 + (len(rings) - 1) * steps
        triangles.append((last, top + i, top + j))
    return np.array(vertices), np.array(triangles)


def sphere(radius=30.0, steps=32):
    angles = np.linspace(-np.pi / 2, np.pi / 2, steps // 2 + 1)
    return lathe([(radius * np.cos(t), radius * np.sin(t)) for t in angles], steps)


def rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


def write_off(path, vertices, triangles):
    lines = ["OFF", f"{len(vertices)} {len(triangles)} 0"]
    lines += [" ".join(repr(float(c)) for c in v) for v in vertices]
    lines += ["3 " + " ".join(map(str, map(int, t))) for t in triangles]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_stl(path, vertices, triangles):
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["v"] = np.asarray(vertices)[np.asarray(triangles)]
    path.write_bytes(b"\0" * 80 + np.uint32(len(rows)).tobytes() + rows.tobytes())
    return path


@pytest.fixture(scope="session")
def solids():
    return SimpleNamespace(
        prism=prism,
        polygon=polygon,
        box=box,
        tetrahedron=tetrahedron,
        lathe=lathe,
        sphere=sphere,
        rotation=rotation,
        write_off=write_off,
        write_stl=write_stl,
    )


@pytest.fixture
def read(tmp_path):
    """Write a solid to an STL file in millimetres and read it back."""
    from tanteo.parts import read_part

    def reader(solid, name="part"):
        return read_part(write_stl(tmp_path / f"{name}.stl", *solid), unit="mm")

    return reader
