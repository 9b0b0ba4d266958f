"""Families of parts as a distributor has them: brackets, plates, stepped blocks, flanges, rails, one dimension changed.

A family is a template with its own sizes. Its members differ from the first one in one dimension by whole steps.
This is the hard case: one face or one hole distinguishes two of them. Member ``k`` of a seed is always the same.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from manifold3d import Manifold

MEMBERS = 40
"""Parts of a family."""

STEP = 2.0
"""By whole numbers of which one dimension of a member is longer than the first one's [mm]."""

_FACETS = 24


def box(low, high):
    """Return a block between two opposite corners."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    return Manifold.cube(tuple(high - low)).translate(tuple(low))


def bore(x, y, radius, low=-10.0, high=300.0):
    """Return a cylinder along z, to be subtracted or added."""
    return Manifold.cylinder(high - low, radius, radius, _FACETS).translate((x, y, low))


def lying(z, x, radius, low=-10.0, high=300.0):
    """Return a cylinder along y."""
    return Manifold.cylinder(high - low, radius, radius, _FACETS).rotate((-90, 0, 0)).translate((x, low, z))


def bracket(x, y, z, foot, wall, rib, hole, margin):
    """Return an angle with a rib and a hole in each leg."""
    angle = box((0, 0, 0), (x, y, foot)) + box((0, 0, 0), (wall, y, z)) + box((0, 0, 0), (0.6 * x, rib, 0.6 * z))
    across = Manifold.cylinder(300, hole, hole, _FACETS).rotate((0, 90, 0)).translate((-10, 0.7 * y, z - margin))
    return angle - bore(x - margin, 0.7 * y, hole) - across


def plate(x, y, z, first, second, big, margin, slot):
    """Return a plate with three holes and a slot at its end."""
    holes = bore(margin, margin, first) + bore(x - margin, margin, second) + bore(0.4 * x, 0.6 * y, big)
    return box((0, 0, 0), (x, y, z)) - holes - box((x - slot, 0.7 * y, -1), (x + 1, 0.85 * y, z + 1))


def steps(x, y, first, second, third, one, two, deep):
    """Return a block of three steps with a pocket."""
    body = box((0, 0, 0), (x, y, first)) + box((one, 0, 0), (x, y, first + second))
    body += box((one + two, 0.2 * y, 0), (x, y, first + second + third))
    return body - box((0.2 * one, 0.3 * y, first - deep), (0.8 * one, 0.8 * y, first + 1))


def flange(x, y, z, hub, high, inner, hole, margin):
    """Return a flange with a hub, a bore and two holes."""
    body = box((-x / 2, -y / 2, 0), (x / 2, y / 2, z)) + bore(-0.1 * x, 0, hub, 0, z + high)
    return (
        body
        - bore(-0.1 * x, 0, inner)
        - bore(x / 2 - margin, y / 2 - margin, hole)
        - bore(margin - x / 2, -y / 4, hole)
    )


def rail(x, y, z, slot, neck, deep, hole, margin):
    """Return a rail with a T-shaped slot off its middle, and a hole."""
    middle = 0.45 * y
    body = box((0, 0, 0), (x, y, z)) - box((-1, middle - neck / 2, z - 2 * deep), (x + 1, middle + neck / 2, z + 1))
    return (
        body
        - box((-1, middle - slot / 2, z - 2 * deep), (x + 1, middle + slot / 2, z - deep))
        - lying(0.2 * z, margin, hole)
    )


def clevis(x, y, z, wall, floor, hole, high, nose):
    """Return a fork with a hole through its arms and a slanted nose."""
    body = box((0, 0, 0), (x, y, z)) - box((floor, wall, -1), (x + 1, y - 0.7 * wall, z + 1))
    body -= lying(high, x - 2 * hole, hole)
    return body.trim_by_plane((-1.0, 0.0, -0.7), -(x + 0.7 * z) + nose)


TEMPLATES = {
    "bracket": (bracket, (80, 50, 70, 10, 12, 9, 5, 16)),
    "plate": (plate, (110, 70, 14, 5, 7, 14, 15, 22)),
    "steps": (steps, (100, 60, 16, 14, 16, 30, 26, 6)),
    "flange": (flange, (120, 80, 14, 24, 26, 13, 5, 16)),
    "rail": (rail, (120, 60, 44, 32, 15, 9, 5, 25)),
    "clevis": (clevis, (90, 60, 40, 13, 30, 7, 20, 14)),
}


def sizes(k: int, seed: int = 0) -> tuple[str, np.ndarray]:
    """Template and dimensions of part ``k`` [mm]."""
    family, member = divmod(k, MEMBERS)
    rng = np.random.default_rng((seed, family))
    name = list(TEMPLATES)[family % len(TEMPLATES)]
    own = np.round(np.array(TEMPLATES[name][1]) * rng.uniform(0.75, 1.3, size=8) * rng.uniform(0.7, 1.4), 1)
    which, by = member % 8, (member // 8 + 1) // 2 * (-1) ** (member // 8)
    if member // 8:
        own[which] = max(own[which] + STEP * by, 0.5 * own[which])
    elif member:  # the first eight: the first one, and longer by three steps in one dimension
        own[which] += 3 * STEP
    return name, own


def solid(k: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [mm] and triangles of part ``k``."""
    name, own = sizes(k, seed)
    mesh = TEMPLATES[name][0](*own).to_mesh()
    return np.asarray(mesh.vert_properties[:, :3], dtype=float), np.asarray(mesh.tri_verts)


def write_family(folder: Path, count: int, seed: int = 0, first: int = 0) -> None:
    """OFF files of parts ``first`` to ``first + count``."""
    folder.mkdir(parents=True, exist_ok=True)
    for k in range(first, first + count):
        name, _ = sizes(k, seed)
        vertices, triangles = solid(k, seed)
        lines = ["OFF", f"{len(vertices)} {len(triangles)} 0"]
        lines += [f"{x:.6g} {y:.6g} {z:.6g}" for x, y, z in vertices]
        lines += [f"3 {a} {b} {c}" for a, b, c in triangles]
        (folder / f"{name}_{k:06d}.off").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    write_family(Path(sys.argv[1]), int(sys.argv[2]))
