"""Distances where the nearest surface is one plane: equal to those of the tree, wherever they are claimed to hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tanteo.parts import Surface, read_part, signed_distance
from tanteo.parts.shapes import distance_field
from tanteo.parts.shapes.near_planes import near_planes, nearest

EXAMPLES = Path(__file__).parents[3] / "examples" / "parts"


@pytest.fixture(scope="module", params=["block", "bracket_left", "step_12mm", "flange", "clamp"])
def surface(request):
    part = read_part(EXAMPLES / f"{request.param}.step")
    return Surface(part.vertices, part.triangles)


def points_near(surface, n, rng):
    """Points near the surface and far from it, inside and outside, most of them within a tenth of its size."""
    corners = surface.vertices[surface.triangles]
    on = np.einsum("nk,nki->ni", rng.dirichlet(np.ones(3), n), corners[rng.integers(len(corners), size=n)])
    size = np.ptp(surface.vertices, axis=0).max()
    return on + size * rng.choice([1e-4, 1e-2, 0.05, 0.3], (n, 1)) * rng.normal(size=(n, 3))


def test_distances_and_gradients_are_those_of_the_tree(surface):
    rng = np.random.default_rng(0)
    points = points_near(surface, 20_000, rng).reshape(100, 200, 3)
    phi, g, triangles = nearest(surface, near_planes(surface, distance_field(surface)), points)
    exact, gradient = signed_distance(surface, points)
    np.testing.assert_allclose(phi, exact, atol=1e-9)
    far = np.abs(exact) > 1e-6  # nearer, the difference of two points has no direction
    np.testing.assert_allclose(g[far], gradient[far], atol=1e-3)
    normals, heights = surface.normals[triangles], surface.vertices[surface.triangles[triangles, 0]]
    off = np.abs(np.sum(normals * (points - heights), axis=-1))
    assert (off <= np.abs(exact) + 1e-9).all()


def test_most_points_near_a_part_of_planes_need_no_tree():
    part = read_part(EXAMPLES / "block.step")
    surface = Surface(part.vertices, part.triangles)
    planes = near_planes(surface, distance_field(surface))
    points = points_near(surface, 5_000, np.random.default_rng(1))
    holds = planes(points)[3]
    assert holds.mean() > 0.4


def test_a_mesh_that_is_open_leaves_everything_to_the_tree():
    part = read_part(EXAMPLES / "block.step")
    surface = Surface(part.vertices, part.triangles[1:])
    planes = near_planes(surface, distance_field(surface))
    points = points_near(surface, 1_000, np.random.default_rng(2))
    assert not planes(points)[3].any()
    np.testing.assert_array_equal(nearest(surface, planes, points)[0], signed_distance(surface, points)[0])
