"""Flats that are small beside the noise count as one place: the sum over all of them judges it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.bodies import Body, ball, cylinder
from core.oracle import Oracle
from core.questions import directed, near_pose, random_pose, touched, with_shared
from core.test_slopes import differences
from tanteo import _core

N = 20


def meshed(body):
    """Return the same body as a mesh with one face and without round surfaces."""
    rows = np.full(len(body.triangles), -1)
    return replace(body, faces=np.zeros(len(body.triangles), dtype=np.int64), profile_rows=rows)


BODIES = {"ball": meshed(ball(n=N)), "bar": meshed(cylinder(n=N))}
MAKES = {
    "points": lambda q, normals, rng: q,
    "beams": lambda q, normals, rng: directed(q, normals, rng),
    "shared": lambda q, normals, rng: with_shared(q, 2, rng),
}


def scene(body, make, sd, seed, n=5):
    rng = np.random.default_rng(seed)
    T = random_pose(rng)
    q, normals = touched(body, T, n, sd, rng, outliers=0)
    q = make(q, normals, rng)
    Ts = np.stack([near_pose(T, rng, 0.5 * sd, 0.02) for _ in range(2)])
    return q, Ts, rng.normal(size=(len(Ts), q.states))


def size_of(body):
    """Largest side of a typical triangle."""
    corners = body.vertices[body.triangles]
    return np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1))


@pytest.mark.quick_sets(2)
@pytest.mark.parametrize("make", MAKES)
@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("facets", [0.8, *(pytest.param(n, marks=pytest.mark.slow) for n in (0.4, 2.5, 5))])
def test_many_small_flats_agree_with_the_sum_over_all(name, make, facets):
    """Noise that is so many facets wide: places stand for one of them, for several, or for those far away."""
    body = BODIES[name]
    q, Ts, zs = scene(body, MAKES[make], facets * size_of(body), 3)
    oracle = Oracle(body, q)
    got = _core.log_densities(body.shape(), q.core(), Ts, zs)
    for T, z, log in zip(Ts, zs, got, strict=True):
        exact = oracle.log_density(T, z)
        assert abs(log - exact) < 2e-3 * len(q.points)
        assert log != exact  # it is one place that is tested here, not one flat


@pytest.mark.parametrize("name", BODIES)
def test_the_slope_is_that_of_the_places(name):
    body = BODIES[name]
    q, Ts, zs = scene(body, MAKES["shared"], 4 * size_of(body), 4)
    shape, core = body.shape(), q.core()
    _, gradient, information = _core.slopes(shape, core, Ts, zs)
    sd = 1 / np.sqrt(np.maximum(np.einsum("sii->si", information), 1 / shape.diagonal**2))
    assert np.abs((gradient - differences(shape, core, Ts, zs)) * sd).max() < 0.02


def grid(n):
    """Return a face of n x n flats, each slightly off the plane so that no two are coplanar."""
    x = np.linspace(-0.1, 0.1, n + 1)
    X, Y = np.meshgrid(x, x, indexing="ij")
    heights = 2e-5 * np.random.default_rng(0).normal(size=X.shape)
    vertices = np.column_stack([X.ravel(), Y.ravel(), heights.ravel()])
    k = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = k[:-1, :-1].ravel(), k[1:, :-1].ravel(), k[1:, 1:].ravel(), k[:-1, 1:].ravel()
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rows = np.full(len(triangles), -1)
    return Body(vertices, triangles, 0 * rows, rows, np.zeros((0, 11)), np.zeros((0, 6)), np.zeros((0, 3)))


@pytest.mark.parametrize("sd", [3e-4, 2e-3, 8e-3])
def test_facets_of_a_face_do_not_hold_a_point_on_it(sd):
    """Along a plane of many flats a point is as free as on one, whether they are large, small, or one place."""
    body = grid(40)
    shape, rng = body.shape(), np.random.default_rng(5)
    on = np.column_stack([rng.uniform(-0.04, 0.04, (12, 2)), sd * rng.normal(size=12)])
    q, _ = touched(body, np.eye(4), 12, sd, rng, outliers=0)
    q = replace(q, points=on)
    _, _, information = _core.slopes(shape, q.core(), np.eye(4)[None], np.zeros((1, 0)))
    along, across = information[0, [0, 1], [0, 1]], information[0, 2, 2]
    assert across == pytest.approx(12 / sd**2, rel=0.35)
    assert along.max() < 0.02 * across
