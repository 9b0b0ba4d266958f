"""Closest points and rays of the core, against libigl and Embree."""

from __future__ import annotations

import numpy as np
import pytest

from core.bodies import flat_bodies, round_bodies
from tanteo import _core
from tanteo.parts import Surface

BODIES = {**flat_bodies(), **round_bodies()}


@pytest.mark.parametrize("name", BODIES)
def test_closest_points_are_those_of_libigl(name):
    body, rng = BODIES[name], np.random.default_rng(0)
    points = body.centre + 0.05 * rng.normal(size=(500, 3))
    distances, places, triangles = _core.closest_points(body.shape(), points)
    expected = Surface(body.vertices, body.triangles).closest(points)
    assert distances == pytest.approx(np.linalg.norm(points - expected.points, axis=1), abs=1e-12)
    assert np.linalg.norm(points - places, axis=1) == pytest.approx(distances, abs=1e-12)
    corners = body.vertices[body.triangles[triangles]]
    inside = np.linalg.solve(np.swapaxes(corners, 1, 2) + 1.0, places[..., None] + 1.0)[..., 0]  # barycentric
    assert inside.min() > -1e-6


@pytest.mark.parametrize("far", [0.0, 10.0])
@pytest.mark.parametrize("name", BODIES)
def test_first_hits_are_those_of_embree(name, far):
    body, rng = BODIES[name], np.random.default_rng(1)
    d = rng.normal(size=(500, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    origins = body.centre + 0.03 * rng.normal(size=(500, 3)) - far * body.diagonal * d
    distances, triangles = _core.first_hits(body.shape(), origins, d)
    expected = Surface(body.vertices, body.triangles).cast(origins, d)
    hit = triangles >= 0
    assert np.array_equal(hit, np.isfinite(distances))
    assert np.mean(hit != (expected.triangles >= 0)) <= 0.004  # Embree casts in single precision
    both = hit & (expected.triangles >= 0)
    assert np.mean(np.abs(distances[both] - expected.distances[both]) > 1e-9) <= 0.004


def test_rays_along_faces_and_axes_hit_or_miss():
    """A grid of rays along z onto a block: its top, wherever they start over it."""
    body = BODIES["block"]
    x, y = np.meshgrid(np.linspace(0, 0.08, 9), np.linspace(0, 0.05, 6))
    origins = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 1.0)])
    distances, _ = _core.first_hits(body.shape(), origins, np.tile([0.0, 0.0, -1.0], (x.size, 1)))
    assert distances == pytest.approx(np.full(x.size, 0.97), abs=1e-12)
    distances, triangles = _core.first_hits(body.shape(), origins, np.tile([0.0, 0.0, 1.0], (x.size, 1)))
    assert np.all(np.isinf(distances))
    assert np.all(triangles == -1)
