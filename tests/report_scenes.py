"""Parts and readings for the tests of reports."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from sensing_scenes import EXACT_MACHINE
from tanteo.geometry import SE3, SO3
from tanteo.planning import Probe, Sensing, Session, Stop, at_place
from tanteo.posterior import prepare
from tanteo.sensors import Readings
from tanteo.sensors.presets import NoiseLaw

TRUTH = SE3.from_parts(SO3.exp(np.array([0.1, -0.2, 0.7])), np.array([0.4, -0.13, 0.05]))
SD = 5e-5


ROUGH = np.diag(np.repeat([3e-3, 0.05], 3) ** 2)
TOUCH = Probe("touch", NoiseLaw.of(SD), contact=True, standoff=0.03)


def touched_session(*parts):
    """Return a session with touches of the first part face by face and one beam that hit nothing, no plan."""
    targets = [prepare(part) for part in parts]
    session = Session(
        at_place(targets, TRUTH @ SE3.from_parts(np.eye(3), parts[0].centroid), ROUGH),
        TOUCH,
        Sensing(sd=SD, shared_errors=EXACT_MACHINE),
    )
    session.stop = Stop(tolerance=1e-3)
    all_ = replace(touches(parts[0], np.random.default_rng(3), n=2), features=("",) * 2 * len(parts[0].planes),
                   kinds=("point",) * 2 * len(parts[0].planes))  # fmt: skip
    for k in range(0, len(all_), 2):
        session.tell(all_.take(np.arange(k, k + 2)))
    away = Readings.from_columns(
        TRUTH[:3, 3][None] + [0.2, 0, 0], ids=["away"], directions=np.array([[0, 0, 1.0]]), is_free=np.array([True]),
        max_ranges=np.array([0.1]),
    )  # fmt: skip
    session.tell(away)
    return session


def off_text(vertices, polygons):
    """Text of an OFF file."""
    lines = ["OFF", f"{len(vertices)} {len(polygons)} 0"]
    lines += [" ".join(f"{v:.9g}" for v in p) for p in vertices]
    return "\n".join([*lines, *(" ".join(map(str, (len(p), *p))) for p in polygons), ""])


def prism_text(corners, height):
    """Return a right prism over a convex polygon given counter-clockwise."""
    n = len(corners)
    vertices = [(x, y, z) for z in (0, height) for x, y in corners]
    sides = [(i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n)]
    triangles = [(a, b, c) for a, b, c, _ in sides] + [(a, c, d) for a, _, c, d in sides]
    triangles += [(0, i + 1, i) for i in range(1, n - 1)] + [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    return off_text(vertices, triangles)


def touches(part, rng, n=5, *, planes=None, wrong=(), **columns):
    """Labelled touches of planar faces with noise; those named in ``wrong`` are 2 mm off."""
    points, labels, directions = [], [], []
    for k in range(len(part.planes)) if planes is None else planes:
        ours = part.triangles[part.triangle_face == part.planes.faces[k]]
        corners = part.vertices[ours[rng.integers(len(ours), size=n)]]
        weights = rng.dirichlet(np.ones(3), size=n)
        normal = part.planes.normals[k]
        points.append(np.einsum("ni,nij->nj", weights, corners) + SD * rng.normal(size=(n, 1)) * normal)
        directions += [-TRUTH[:3, :3] @ normal] * n
        labels += [f"side {k}"] * n
    world = SE3.apply(TRUTH, np.concatenate(points))
    for i in wrong:
        world[i] -= 2e-3 * np.array(directions[i])
    return Readings.from_columns(
        points=world, directions=np.array(directions), sds=np.full(len(world), SD), features=labels,
        kinds=["plane"] * len(world), source="touches.csv", **columns,
    )  # fmt: skip


def ball(part, subdivisions):
    """Return the part with the mesh of a ball of 20 mm, one face of each half."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.02)
    return replace(
        part, vertices=mesh.vertices, triangles=mesh.faces, triangle_face=(mesh.face_normals[:, 2] > 0).astype(int),
        box=mesh.bounds,
    )  # fmt: skip
