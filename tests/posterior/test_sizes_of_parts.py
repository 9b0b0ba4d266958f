"""Parts of very different sizes in one folder: a large one makes no small one an unknown object."""

from __future__ import annotations

import manifold3d
import numpy as np
import pytest

from bare_scenes import box_centred_pose, surface_points
from tanteo import Readings, identify, part_from_mesh
from tanteo.geometry import SE3
from tanteo.posterior import prepare


def solid(body, name):
    mesh = body.to_mesh()
    return part_from_mesh(mesh.vert_properties[:, :3].astype(float), mesh.tri_verts, unit="m", name=name)


def block(*size):
    return manifold3d.Manifold.cube(size)


@pytest.mark.parametrize("seed", range(3))
def test_a_small_part_beside_a_large_one_is_recognized(seed):
    """Touches on a small part are a small region of an object of the mean size, for an object with planes as well."""
    rng = np.random.default_rng((7, seed))
    small = prepare(solid(block(0.04, 0.03, 0.012) + block(0.012, 0.03, 0.03), "small"))
    large = solid(block(0.5, 0.35, 0.1) + block(0.1, 0.1, 0.3), "large")
    T = box_centred_pose(rng)
    points = SE3.apply(T, surface_points(small, 14, rng)[0]) + rng.normal(0, 5e-5, (14, 3))
    answer = identify(Readings.from_columns(points), [small.part, large], sd=5e-5)
    assert (answer.status, answer.hypotheses[0].part) == ("recognized", "small")
