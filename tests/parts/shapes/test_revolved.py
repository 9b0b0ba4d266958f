"""Exact surfaces behind a mesh: against points made of their equations, and against differences."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.parts import Surface
from tanteo.parts.shapes.revolved import Profiles, revolved

KINDS = {"cylinder": (0.03, 0.0, 0.0), "cone": (0.0, 0.4, 0.0), "sphere": (0.0, 0.0, 0.05), "torus": (0.06, 0.0, 0.02)}
"""Distance of the profile from the axis [m], its slope [rad] and its radius [m]."""


def surface_of(kind, u, v):
    """Points and outward normals of a convex surface about z at the origin, by its own equations."""
    radial, up = np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1), np.array([0.0, 0.0, 1.0])
    if kind == "cylinder":
        return 0.03 * radial + 0.1 * v[:, None] * up, radial
    if kind == "cone":
        height = 0.06 + 0.03 * v[:, None]
        return height * (up + np.tan(0.4) * radial), np.cos(0.4) * radial - np.sin(0.4) * up
    n = np.cos(v)[:, None] * radial + np.sin(v)[:, None] * up
    return (0.05 * n, n) if kind == "sphere" else (0.06 * radial + 0.02 * n, n)


def placed(kind, sign, count):
    """Return the surface with its axis along (2, 3, 6) / 7 through a point off the origin, for a number of rows."""
    axis, point = np.array([2.0, 3.0, 6.0]) / 7, np.array([0.1, -0.2, 0.05])
    x = np.cross(axis, [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    R = np.stack([x, np.cross(axis, x), axis], axis=1)
    offset, slope, radius = (np.full(count, value) for value in KINDS[kind])
    rows = np.broadcast_to(point, (count, 3)), np.broadcast_to(axis, (count, 3))
    return Profiles(*rows, offset, slope, radius, np.full(count, sign)), R, point


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_points_off_the_surface_are_as_far_as_they_were_put(kind, sign):
    rng = np.random.default_rng(1)
    q, n = surface_of(kind, rng.uniform(0, 2 * np.pi, 50), rng.uniform(-1, 1, 50))
    profiles, R, point = placed(kind, sign, 50)
    off = rng.uniform(-5e-3, 5e-3, 50)
    phi, g = profiles.distance((q + off[:, None] * n) @ R.T + point)
    assert phi == pytest.approx(sign * off, abs=1e-15)
    assert g == pytest.approx(sign * n @ R.T, abs=1e-13)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bends_are_the_derivative_of_the_gradient(kind, sign):
    rng = np.random.default_rng(2)
    q, n = surface_of(kind, rng.uniform(0, 2 * np.pi, 30), rng.uniform(-1, 1, 30))
    profiles, R, point = placed(kind, sign, 30)
    at = (q + rng.uniform(-5e-3, 5e-3, (30, 1)) * n) @ R.T + point
    b, e, g = profiles.curvatures(at)
    H = np.einsum("kc,kci,kcj->kij", b, e, e)
    for axis, step in enumerate(1e-7 * np.eye(3)):
        slope = (profiles.distance(at + step)[1] - profiles.distance(at - step)[1]) / 2e-7
        assert H[:, :, axis] == pytest.approx(slope, abs=1e-5 * np.abs(H).max())
    assert np.sum(e * g[:, None], axis=-1) == pytest.approx(0.0, abs=1e-12)


def test_on_the_axis_there_is_no_gradient_and_the_mesh_stays():
    profiles, _, point = placed("cylinder", 1.0, 1)
    phi, g = profiles.distance(point[None])
    assert phi == pytest.approx(-0.03)
    assert not g.any()
    assert not profiles.curvatures(point[None])[0].any()


def tube(count=24, radius=0.03, height=0.1):
    """Return a prism with that many sides, and its ends, about z."""
    u = 2 * np.pi * np.arange(count) / count
    ring = radius * np.stack([np.cos(u), np.sin(u)], axis=1)
    vertices = np.concatenate([np.c_[ring, 0 * u], np.c_[ring, height + 0 * u], [[0, 0, 0], [0, 0, height]]])
    i, j = np.arange(count), (np.arange(count) + 1) % count
    sides = np.concatenate([np.stack([i, j, j + count], axis=1), np.stack([i, j + count, i + count], axis=1)])
    ends = [
        np.stack([j, i, 0 * i + 2 * count], axis=1),
        np.stack([i + count, j + count, 0 * i + 2 * count + 1], axis=1),
    ]
    return Surface(vertices, np.concatenate([sides, *ends])), np.repeat([0, -1], [2 * count, 2 * count])


def exact_tube(radius, precision=1e-6, count=24):
    surface, rows = tube(count)
    profile = Profiles(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.array([radius]), *np.zeros((2, 1)), np.ones(1))
    corners = surface.vertices[surface.triangles]
    return surface, revolved(profile, rows, corners, surface.normals, np.array([precision]))


def test_facet_distances_become_cylinder_distances():
    surface, found = exact_tube(0.03)
    side = np.pi / 24  # the middle of a facet, where the mesh lies deepest
    out = np.array([np.cos(side + 0.05), np.sin(side + 0.05), 0.0])
    points = np.stack([0.031 * out + [0, 0, 0.05], [0.0, 0.0, 0.101], 0.031 * out + [0, 0, 0.101]])
    near = surface.closest(points)
    g = (points - near.points) / near.distances[:, None]
    phi, before = near.distances.copy(), near.distances.copy()
    found.replace(points, near.triangles, phi, g)
    assert before[0] > 0.001 + 1e-4  # the facet is deeper by its sagitta, less the 0.05 rad from its middle
    assert phi[0] == pytest.approx(0.001, abs=1e-12)
    assert g[0] == pytest.approx(out, abs=1e-12)
    assert phi[1:] == pytest.approx(before[1:], abs=0)  # over an end, and beyond the rim


def test_a_surface_that_the_mesh_is_not_on_is_left_out():
    assert exact_tube(0.0301)[1] is None
    assert exact_tube(0.0301, precision=2e-4)[1] is not None


def test_a_prism_of_few_sides_may_be_one():
    assert exact_tube(0.03, count=14)[1] is None
    assert exact_tube(0.03, count=18)[1] is not None


def test_a_bore_is_recognized_from_its_triangles():
    surface, rows = tube()
    profile = Profiles(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.array([0.03]), *np.zeros((2, 1)), np.ones(1))
    flipped = Surface(surface.vertices, surface.triangles[:, ::-1])
    corners = flipped.vertices[flipped.triangles]
    assert revolved(profile, rows, corners, flipped.normals, np.array([1e-6])).profiles.signs == -1.0
    assert exact_tube(0.03)[1].profiles.signs == 1.0


def test_the_apex_of_cone_and_slivers_of_mesh_not_leave_it_out():
    u = 2 * np.pi * np.arange(24) / 24
    ring = 0.05 * np.stack([np.tan(0.4) * np.cos(u), np.tan(0.4) * np.sin(u), 1 + 0 * u], axis=1)
    vertices = np.concatenate([ring, np.zeros((1, 3)), [0.5 * ring[0]], [0.5 * ring[0] + [0.0, 0.0, 1e-12]]])
    i, j = np.arange(24), (np.arange(24) + 1) % 24
    triangles = np.concatenate([np.stack([i, 0 * i + 24, j], axis=1), [[0, 25, 26]]])
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    zero = np.zeros(1)
    cone = Profiles(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), zero, zero + 0.4, zero, zero + 1)
    found = revolved(cone, np.zeros(len(triangles), dtype=int), corners, normals, np.array([1e-9]))
    assert found is not None
    assert np.abs(found.profiles.signs) == 1.0
    assert np.arccos(found.min_cosines[0]) < 0.2
