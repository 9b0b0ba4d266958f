"""Plates of one family with bores, sensed with normals on a bore and two or three faces: who can be it is named."""

import manifold3d
import numpy as np
import pytest

import tanteo
from random_parts import write_off
from tanteo.factors import FreeRays, surface_points
from tanteo.geometry import SE3
from tanteo.posterior import identify_points

SD, TILT = 1e-4, 0.02
COUNT = 40


def plate(length):
    """Return a plate with a large and a small bore near one end; only its length varies [mm]."""
    body = manifold3d.Manifold.cube((length, 60, 16))
    for x, y, radius in ((25, 30, 12), (50, 15, 4)):
        body -= manifold3d.Manifold.cylinder(40, radius, radius, 32).translate((x, y, -10))
    mesh = body.to_mesh()
    return np.asarray(mesh.vert_properties[:, :3], dtype=float), np.asarray(mesh.tri_verts)


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plates")
    for k in range(COUNT):
        write_off(folder / f"plate_{k:02d}.off", *plate(90 + 2 * k))
    return tanteo.read_parts(folder, unit="mm")


def sensed(walls, rng):
    """Points on top and bottom, on one side, and on walls of bores: centre, radius, angles and heights [mm]."""
    tops = [(x, y, z) for x, y in ((8, 8), (75, 50), (45, 40)) for z in (0, 16)]
    p = [(0, 30, 9) if not walls else (40, 0, 7), *tops]
    n = [(-1, 0, 0) if not walls else (0, -1, 0), *((0, 0, -1 if z == 0 else 1) for _, _, z in tops)]
    for x, y, radius, angle, z in walls:
        way = np.array([np.cos(angle), np.sin(angle), 0])
        p.append((x, y, z) + radius * way)
        n.append(-way)
    T = SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])
    points = SE3.apply(T, 1e-3 * np.array(p)) + SD * rng.normal(size=(len(p), 3))
    normals = np.array(n) @ T[:3, :3].T + TILT * rng.normal(size=(len(p), 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return surface_points(points, SD, normals=normals, normal_sds=TILT)


LARGE = [(25, 30, 12, 3.8, 8)]
BOTH = [(25, 30, 12, 2.4, 8), (50, 15, 4, 0.3, 6), (25, 30, 12, 5.0, 4)]


@pytest.mark.slow
@pytest.mark.parametrize("walls", [LARGE, BOTH], ids=["one bore and a side", "two bores"])
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_plates_that_are_equal_where_sensed_are_all_named(plates, walls, seed):
    areas = {part.name: part.area for part in plates}
    points = sensed(walls, np.random.default_rng(seed))
    answer = identify_points(points, FreeRays.none(), plates, top=1000)
    shares = {}
    for one in answer.hypotheses:
        shares[one.part] = shares.get(one.part, 0.0) + one.probability
    assert answer.status == "ambiguous"
    assert len(shares) > 0.9 * COUNT
    # the touches are in one region, and its place on a larger part is less probable: once, not for each point
    over = [np.log(share) + np.log(areas[name]) for name, share in shares.items()]
    assert np.ptp(over) < 0.5
