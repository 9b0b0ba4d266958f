"""Sharp edges and corners of a mesh: found, nearest, and with the faces that meet there."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tanteo.parts import Surface
from tanteo.parts.shapes.borders import borders


def box(*sides):
    mesh = trimesh.creation.box(sides)
    return Surface(mesh.vertices, mesh.faces)


def angle():
    """Return an L-shaped bar: one reflex edge, and two ends with a reflex corner each."""
    outline = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]], dtype=float)
    caps = np.array([[0, 1, 3], [1, 2, 3], [0, 3, 5], [3, 4, 5]])
    n = len(outline)
    vertices = np.concatenate([np.c_[outline, np.zeros(n)], np.c_[outline, np.full(n, 2.0)]])
    sides = np.concatenate([[[k, (k + 1) % n, n + k], [(k + 1) % n, n + (k + 1) % n, n + k]] for k in range(n)])
    return Surface(vertices, np.concatenate([caps[:, ::-1], caps + n, sides]))


def segment_distances(points, a, b):
    u = b - a
    t = np.clip(np.einsum("qei,ei->qe", points[:, None] - a, u) / np.sum(u * u, axis=1), 0, 1)
    return np.linalg.norm(points[:, None] - a - t[..., None] * u, axis=-1)


def test_a_box_has_twelve_edges_and_eight_corners():
    found = borders(box(1.0, 2.0, 3.0))
    assert len(found.edges) == 12
    assert np.sum(found.corners >= 0) == 8
    corners = found.junctions.take(found.corners)
    assert np.all(corners.valid.sum(axis=1) == 3)
    assert not corners.reflex.any()


def test_what_is_flat_or_smooth_has_no_edge():
    sphere = trimesh.creation.icosphere(subdivisions=3)
    found = borders(Surface(sphere.vertices, sphere.faces))
    assert len(found.edges) == 0
    assert not found.near(np.zeros((4, 3)), np.full(4, 1e9)).any()


def test_an_edge_that_has_one_triangle_is_left_out():
    mesh = trimesh.creation.box((1, 1, 1))
    found = borders(Surface(mesh.vertices, mesh.faces[:-2]))
    assert len(found.edges) == 8


@pytest.mark.parametrize("surface", [box(1.0, 2.0, 3.0), angle()], ids=["box", "angle"])
def test_the_nearest_edge_is_that_of_all_edges(surface):
    rng, found = np.random.default_rng(1), borders(surface)
    points = rng.uniform(-1, 4, (500, 3))
    a, b = found.vertices[found.edges[:, 0]], found.vertices[found.edges[:, 1]]
    truth = segment_distances(points, a, b).min(axis=1)
    gaps, rows = found.nearest(points, np.zeros(500))
    np.testing.assert_allclose(gaps, truth, atol=1e-12)
    assert (rows < len(found.edges)).all()
    near = found.near(points, np.full(500, 0.3))
    assert near[truth <= 0.3].all()
    assert not near[truth > 0.8].any()


@pytest.mark.parametrize("surface", [box(1.0, 2.0, 3.0), angle()], ids=["box", "angle"])
def test_points_of_the_faces_at_an_edge_are_inside_their_lines(surface):
    found = borders(surface)
    j = found.junctions.take(np.arange(len(found.edges)))
    middle = found.vertices[found.edges].mean(axis=1)
    for side in range(2):
        p = middle + 1e-3 * j.inward[:, side, 0]
        np.testing.assert_allclose(np.sum(j.normals[:, side] * p, axis=1), j.offsets[:, side], atol=1e-12)
        np.testing.assert_allclose(np.sum(j.inward[:, side, 0] * p, axis=1) - j.limits[:, side, 0], 1e-3, atol=1e-12)
        near = surface.closest(p)
        assert near.distances.max() < 1e-12
        np.testing.assert_allclose(surface.normals[near.triangles], j.normals[:, side], atol=1e-9)


def test_corners_know_which_of_their_faces_are_reflex():
    surface = angle()
    found = borders(surface)
    at = np.flatnonzero(found.corners >= 0)
    reflex = found.junctions.take(found.corners[at]).reflex.sum(axis=1)
    inner = np.all(found.vertices[at][:, :2] == 1.0, axis=1)
    assert len(at) == 12
    assert (reflex[inner] == 1).all()
    assert (reflex[~inner] == 0).all()


def test_a_corner_is_taken_within_reach_only():
    found = borders(box(1.0, 1.0, 1.0))
    points = np.array([[0.5, 0.5, 0.45], [0.5, 0.5, 0.1]])
    _, rows = found.nearest(points, np.full(2, 0.1))
    assert rows[0] >= len(found.edges)
    assert rows[1] < len(found.edges)


def test_a_face_that_goes_on_past_a_gap_has_only_a_seam_there():
    """Two boxes side by side, a hair apart: their tops are one face, and end at the outer edges alone."""
    left = trimesh.creation.box((1, 1, 1))
    right = left.copy()
    right.apply_translation((1.0005, 0, 0))
    both = trimesh.util.concatenate(left, right)
    found = borders(Surface(both.vertices, both.faces))
    j = found.junctions.take(np.arange(len(found.edges)))
    middle = found.vertices[found.edges].mean(axis=1)
    top = np.abs(middle[:, 2] - 0.5) < 1e-9
    seam = top & (np.abs(middle[:, 0] - 0.5) < 1e-2)
    upward = j.normals[..., 2] > 0.9
    line = np.any(j.inward[:, :, 0] != 0, axis=-1)
    assert seam.sum() == 2
    assert not line[seam & upward.any(axis=1)][upward[seam]].any()
    outer = top & ~seam & (np.abs(middle[:, 1]) < 1e-9)
    assert outer.sum() == 2
    assert line[outer][upward[outer]].all()


def test_a_face_has_its_extent():
    found = borders(box(1.0, 2.0, 3.0))
    widths = found.junctions.take(np.arange(len(found.edges))).widths[:, :2, 0]
    np.testing.assert_allclose(np.unique(widths.round(9)), [1.0, 2.0, 3.0])
