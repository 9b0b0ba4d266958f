"""Edges in images: the visible ones, their hits, and their best positions, against plain NumPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.image_oracle import DIAGONAL, SIZE, meet, refine, scene, see
from tanteo import _core
from tanteo.geometry import SE3
from tanteo.vision.camera import project

LENSES = [(), (-0.2, 0.05, 1e-3, -2e-3), (-0.2, 0.05, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.005)]
REACH = 40.0


@pytest.mark.parametrize("hidden", [False, True])
def test_visible_faces_are_unhidden_and_front_facing(hidden):
    s = scene(2, ())
    shown, rims = _core.visible_edges(s.frame(), s.Ts, hidden)
    expected, ends = see(s, s.Ts, hidden)
    np.testing.assert_array_equal(shown, expected)
    np.testing.assert_array_equal(rims, ends)
    if hidden:
        assert 0.1 < expected.sum() / see(s, s.Ts, False)[0].sum() < 0.9


def test_without_a_surface_nothing_is_hidden():
    s = scene(2, ())
    shown, _ = _core.visible_edges(s.frame(corners=np.zeros((0, 3, 3))), s.Ts, True)
    np.testing.assert_array_equal(shown, see(s, s.Ts, False)[0])


@pytest.mark.parametrize("lens", LENSES, ids=len)
def test_edges_and_their_pose_derivatives_equal_numpy(lens):
    s = scene(3, lens)
    shown = np.random.default_rng(3).uniform(size=(5, 40)) < 0.8
    numbers, which, inside = _core.match_edges(s.frame(), *s.image, s.Ts, shown, REACH)
    edge_hits = meet(s, s.Ts, shown, REACH)
    assert 0 < np.isfinite(edge_hits.pixels[..., 0]).sum() < edge_hits.inside.size
    np.testing.assert_allclose(numbers[..., :2], edge_hits.pixels, rtol=1e-9)
    np.testing.assert_array_equal(inside, edge_hits.inside)
    assert 0 < inside.sum() < inside.size
    np.testing.assert_allclose(numbers[inside][:, 2:4], edge_hits.normals[inside], atol=1e-9)
    np.testing.assert_allclose(numbers[..., 4], edge_hits.spans, rtol=1e-9)
    np.testing.assert_array_equal(which, edge_hits.which)
    assert edge_hits.hits.sum() > 5
    np.testing.assert_allclose(numbers[..., 5], edge_hits.offsets, atol=1e-9)
    np.testing.assert_allclose(numbers[..., 6], edge_hits.sds)
    np.testing.assert_allclose(numbers[inside][:, 7:], edge_hits.jacobian[inside], rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("lens", LENSES, ids=len)
def test_their_slopes_are_differences(lens):
    s = scene(4, lens)
    Ts = s.Ts[:4]
    numbers, _, inside = _core.match_edges(s.frame(), *s.image, Ts, np.ones((4, 40), bool), REACH)
    normals = numbers[..., 2:4]
    for k in range(6):
        step = 1e-7 * np.eye(6)[k]
        there, back = (
            project(s.camera, s.points @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3])
            for T in (Ts @ SE3.exp(step), Ts @ SE3.exp(-step))
        )
        moved = np.sum((there - back) / 2e-7 * normals, axis=-1)
        np.testing.assert_allclose(numbers[..., 7 + k][inside], moved[inside], rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("prior", [0.0, 50.0])
@pytest.mark.parametrize("lens", LENSES, ids=len)
def test_the_best_meeting_pose_is_maximized_as_numpy_does(lens, prior):
    s = scene(7, lens)
    Ts = s.Ts[:4]
    starts = Ts @ SE3.exp(np.random.default_rng(8).normal(size=(4, 6)) * np.repeat([3e-3, 0.05], 3))
    priors = prior * np.diag([1.0, 2, 3, 4, 5, 6]) + 0.1 * prior * np.ones((4, 6, 6))
    reaches, wanted = np.array([40.0, 20, 12, 8]), np.array([True, False, False, True])
    got = _core.refine_edges(s.frame(), *s.image, Ts, starts, priors, reaches, wanted, 0.1, 4.0)
    expected = refine(s, Ts, starts, priors, zip(reaches, wanted, strict=True), 0.1, 4.0)
    assert np.linalg.norm(expected - Ts, axis=(1, 2)).max() > 1e-2
    np.testing.assert_allclose(got, expected, atol=1e-8)


def test_without_an_edge_hit_only_the_prior_acts():
    s = scene(9, ())
    s = replace(s, nearest=np.full_like(s.nearest, -1))
    away = s.Ts[:2] @ SE3.exp(np.array([1e-3, 2e-3, -1e-3, 0.02, -0.01, 0.03]))
    reaches, wanted = np.ones(8), np.arange(8) == 0
    fixed, free = (
        _core.refine_edges(s.frame(), *s.image, away, s.Ts[:2], np.stack([A, A]), reaches, wanted, 0.1, 4.0)
        for A in (1e3 * np.eye(6), np.zeros((6, 6)))
    )
    np.testing.assert_allclose(fixed, s.Ts[:2], atol=1e-9)
    np.testing.assert_allclose(free, away, atol=1e-12)


def test_what_cannot_be_meant_is_refused():
    s = scene(5, ())
    parts = {
        "points": s.points * np.nan, "tangents": s.tangents[:-1], "normals": s.normals[:, 0], "lengths": s.lengths[:3],
        "sharp": s.sharp[1:], "corners": s.corners[0], "middle": np.zeros(2),
    }  # fmt: skip
    for name, value in parts.items():
        with pytest.raises(ValueError, match="expected"):
            s.frame(**{name: value})
    frame, shown = s.frame(), np.ones((5, 40), bool)
    right = [*s.image, s.Ts, shown]
    wrong = [s.camera.numbers[:4], s.nearest[0], s.pixels[:, :1], s.sds[:-1], s.Ts[:, :3], shown[:, 1:]]
    for k, value in enumerate(wrong):
        with pytest.raises(ValueError, match="expected"):
            _core.match_edges(frame, *[value.copy() if j == k else right[j] for j in range(6)], REACH)
    far = np.full_like(s.nearest, 10**6)  # of another image: there is no hit, and no memory beyond is read
    _, which, _ = _core.match_edges(frame, s.camera.numbers, far, *right[2:], REACH)
    assert (which == -1).all()
    right = [s.Ts, s.Ts, np.zeros((5, 6, 6)), np.ones(3), np.ones(3, bool)]
    for k in range(5):
        short = [a[:-1].copy() if j == k else a for j, a in enumerate(right)]
        with pytest.raises(ValueError, match="expected"):
            _core.refine_edges(frame, *s.image, *short, 0.1, 4.0)


def test_an_edge_at_the_border_of_the_image_is_in_it():
    """Pixels reach half of one beyond their middles, and no farther."""
    s = scene(6, ())
    ends = np.array([[-0.49, 10], [-0.51, 10], [SIZE[0] - 0.51, 10], [SIZE[0] - 0.49, 10], [5, SIZE[1] - 0.51]])
    points = np.c_[(ends - s.camera.centre) / s.camera.focal, np.ones(5)] * 0.2
    one = replace(
        s, points=points, tangents=np.tile([1.0, 0, 0], (5, 1)), lengths=np.ones(5), normals=s.normals[:5],
        sharp=s.sharp[:5],
    )  # fmt: skip
    _, _, inside = _core.match_edges(one.frame(), *s.image, np.eye(4)[None], np.ones((1, 5), bool), REACH)
    assert DIAGONAL * s.camera.focal[0] / 0.2 > 1
    assert inside[0].tolist() == [True, False, True, False, True]
