"""Shapes: closed, turned outward, of the size that they say."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.render.live.primitives import ball, dashed, ellipsoids, hand_mesh, joined


def volume(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return float(np.sum(np.cross(a, b) * c) / 6)


def test_the_ball_is_one():
    vertices, triangles = ball()
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 1)
    assert 0.9 < volume(vertices, triangles) / (4 * np.pi / 3) < 1


def test_ellipsoids_lie_at_so_many_standard_deviations():
    rng = np.random.default_rng(7)
    A = rng.normal(size=(5, 3, 3)) * 1e-3
    points, covariances = rng.normal(size=(5, 3)), A @ np.swapaxes(A, 1, 2)
    vertices, triangles = ellipsoids(points, covariances, 2.0)
    each = vertices.reshape(5, -1, 3) - points[:, None]
    d2 = np.einsum("nki,nij,nkj->nk", each, np.linalg.inv(covariances), each)
    np.testing.assert_allclose(d2, 4, rtol=1e-6)
    n = len(triangles) // 5
    size = len(vertices) // 5
    for k in range(5):  # turned outward, for any axes: the volume is positive, and that of the ellipsoid
        own = volume(each[k], triangles[k * n : (k + 1) * n] - k * size)
        assert own == pytest.approx(8 * np.sqrt(np.linalg.det(covariances[k])) * volume(*ball(1)), rel=1e-6)


def test_a_reading_without_spread_across_is_drawn_all_the_same():
    vertices, _ = ellipsoids(np.zeros((1, 3)), np.diag([0.0, 0.0, 1e-6])[None], 2.0)
    assert np.isfinite(vertices).all()
    assert np.abs(vertices[:, 2]).max() == pytest.approx(2e-3, rel=0.05)


def test_the_hand_has_a_finger_a_frontal_sensor_and_a_palm():
    body = gripper().body
    vertices, triangles = hand_mesh(body)
    assert triangles.max() == len(vertices) - 1
    low, high = (body.centres - body.radii[:, None]).min(axis=0), (body.centres + body.radii[:, None]).max(axis=0)
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], [low, high], atol=2e-3)
    capsules = sum(np.pi * r * r * (length + 4 * r / 3) for r, length in _columns(body))
    assert 0.85 * capsules < volume(vertices, triangles) < capsules


def _columns(body):
    for xy in np.unique(np.round(np.c_[body.centres[:, :2], body.blind], 6), axis=0):
        own = (np.round(np.c_[body.centres[:, :2], body.blind], 6) == xy).all(axis=1)
        yield body.radii[own][0], float(np.ptp(body.centres[own, 2]))


def test_dashes_cover_half_of_a_line_and_begin_with_it():
    a, b = np.array([[0.0, 0, 0], [0, 0, 0]]), np.array([[0.12, 0, 0], [0, 10.0, 0]])
    lines = dashed(a, b, 0.006)
    lengths = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1)
    assert lengths[:10].sum() == pytest.approx(0.06)
    assert lengths[10:].sum() == pytest.approx(5.0)
    assert len(lines) == 10 + 24
    np.testing.assert_array_equal(lines[0, 0], a[0])
    assert dashed(a[:0], b[:0], 0.006).shape == (0, 2, 3)


def test_nothing_is_a_mesh_too():
    vertices, triangles = joined([])
    assert vertices.shape == triangles.shape == (0, 3)
