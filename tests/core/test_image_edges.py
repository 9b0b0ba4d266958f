"""Edges in images: what the core says of them, against plain NumPy; and slid drawings."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo import _core
from tanteo.lie import SE3
from tanteo.vision.camera import Camera, project, project_linearised
from tanteo.vision.edge_map import CHANNELS, cell_of, channel_of

SIZE = 96, 64
LENSES = [(), (-0.2, 0.05, 1e-3, -2e-3), (-0.2, 0.05, 1e-3, -2e-3, 0.01, 0.02, -0.01, 0.005)]
DIAGONAL, REACH = 0.1, 40.0


def scene(seed, lens):
    """A camera, samples of edges in front of it and beside, poses, and edge points with a table of the nearest."""
    rng = np.random.default_rng(seed)
    K = np.array([[90.0, 0, 47], [0, 88.0, 31], [0, 0, 1]])
    camera = Camera(K, SIZE, np.array(lens))
    points, tangents = rng.uniform(-0.06, 0.06, (40, 3)), rng.normal(size=(40, 3))
    tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
    middle = SE3.from_parts(np.eye(3), np.array([0.0, 0, 0.15]))
    Ts = middle @ SE3.exp(rng.normal(size=(5, 6)) * np.repeat([0.01, 0.8], 3))
    Ts[-1, 2, 3] = 0.0  # half of it is behind the camera
    pixels = rng.uniform([0, 0], [SIZE[0] - 1, SIZE[1] - 1], (30, 2))
    nearest = rng.integers(-1, 30, (CHANNELS, SIZE[1], SIZE[0])).astype(np.int32)
    shown = rng.uniform(size=(5, 40)) < 0.8
    return camera, points, tangents, rng.uniform(1e-3, 1e-2, 40), Ts, pixels, rng.uniform(0.1, 0.5, 30), nearest, shown


@pytest.mark.parametrize("lens", LENSES, ids=len)
def test_they_are_where_numpy_says_and_follow_the_pose_as_it_says(lens):
    camera, points, tangents, lengths, Ts, pixels, sds, nearest, shown = scene(3, lens)
    numbers, which, inside = _core.meet_edges(
        camera.numbers, nearest, pixels, sds, points, tangents, lengths, Ts, shown, DIAGONAL, REACH
    )
    local = points @ np.swapaxes(Ts[:, :3, :3], 1, 2) + Ts[:, None, :3, 3]
    at, D = project_linearised(camera, local)
    along = ((D @ Ts[:, None, :3, :3]) @ tangents[:, :, None])[..., 0]
    scale = np.linalg.norm(along, axis=-1)
    ahead = local[..., 2] > 0
    assert 0 < ahead.sum() < ahead.size
    np.testing.assert_allclose(numbers[..., :2], at, rtol=1e-9)
    row, column, within = cell_of((SIZE[1], SIZE[0]), at)
    within &= shown & ahead & (scale * DIAGONAL > 1)
    np.testing.assert_array_equal(inside, within)
    assert 0 < within.sum() < within.size
    normals = np.stack([-along[..., 1], along[..., 0]], axis=-1) / scale[..., None]
    np.testing.assert_allclose(numbers[within][:, 2:4], normals[within], atol=1e-9)
    np.testing.assert_allclose(numbers[within][:, 4], (scale * lengths)[within], rtol=1e-9)
    point = nearest[channel_of(np.nan_to_num(normals)), row, column]
    gap = pixels[point] - at
    off, aside = np.sum(gap * normals, axis=-1), np.abs(gap[..., 0] * normals[..., 1] - gap[..., 1] * normals[..., 0])
    hits = within & (point >= 0) & (np.abs(off) < REACH) & (aside < max(2.0, 0.5 * REACH))
    assert hits.sum() > 5
    np.testing.assert_array_equal(which, np.where(hits, point, -1))
    np.testing.assert_allclose(numbers[hits][:, 5], off[hits], atol=1e-9)
    np.testing.assert_allclose(numbers[hits][:, 6], sds[point[hits]])
    assert (numbers[~hits][:, 5] == 0).all()


@pytest.mark.parametrize("lens", LENSES, ids=len)
def test_their_slopes_are_differences(lens):
    camera, points, tangents, lengths, Ts, pixels, sds, nearest, shown = scene(4, lens)
    Ts, shown = Ts[:4], shown[:4]
    numbers, _, inside = _core.meet_edges(
        camera.numbers, nearest, pixels, sds, points, tangents, lengths, Ts, shown, DIAGONAL, REACH
    )
    normals, on = numbers[..., 2:4], inside.astype(bool)
    for k in range(6):
        step = 1e-7 * np.eye(6)[k]
        there, back = (
            project(camera, points @ np.swapaxes(T[:, :3, :3], 1, 2) + T[:, None, :3, 3])
            for T in (Ts @ SE3.exp(step), Ts @ SE3.exp(-step))
        )
        moved = np.sum((there - back) / 2e-7 * normals, axis=-1)
        np.testing.assert_allclose(numbers[..., 7 + k][on], moved[on], rtol=1e-4, atol=1e-2)


def test_what_cannot_be_meant_is_refused():
    camera, points, tangents, lengths, Ts, pixels, sds, nearest, shown = scene(5, ())
    right = [camera.numbers, nearest, pixels, sds, points, tangents, lengths, Ts, shown]
    wrong = {
        0: camera.numbers[:4], 1: nearest[0], 2: pixels[:, :1], 3: sds[:-1], 4: points * np.nan, 5: tangents[:-1],
        6: lengths[:3], 7: Ts[:, :3], 8: shown[:, 1:],
    }  # fmt: skip
    for k, value in wrong.items():
        with pytest.raises(ValueError, match="expected"):
            _core.meet_edges(*[value.copy() if j == k else right[j] for j in range(9)], DIAGONAL, REACH)
    far = nearest.copy()
    far[:] = 10**6  # of another image: no edge point is met, and no memory beyond is read
    _, which, _ = _core.meet_edges(*[far if j == 1 else right[j] for j in range(9)], DIAGONAL, REACH)
    assert (which == -1).all()


def test_a_slid_drawing_costs_the_mean_of_what_is_under_it():
    rng = np.random.default_rng(6)
    distances, bare = rng.uniform(0, 6, 500).astype(np.float32), (rng.uniform(size=90) < 0.5).astype(np.float32)
    drawn, inner = rng.integers(-50, 600, (3, 8)), rng.integers(-50, 200, (3, 5))
    slides = rng.integers(0, 60, 11)
    got = _core.slid_costs(distances, bare, drawn, inner, slides, 0.7, 12.0)
    for y in range(3):
        share = bare.take(inner[y][:, None] + slides, mode="clip").mean(axis=0)
        far = distances.take(drawn[y][:, None] + slides, mode="clip").mean(axis=0)
        np.testing.assert_allclose(got[y], np.where(share < 0.7, far + 12 * share, np.inf), rtol=1e-6)
    assert np.isinf(got).any()
    assert np.isfinite(got).any()
    with pytest.raises(ValueError, match="expected"):
        _core.slid_costs(distances[:0], bare, drawn, inner, slides, 0.7, 12.0)
    with pytest.raises(ValueError, match="expected"):
        _core.slid_costs(distances, bare, drawn, inner[:2], slides, 0.7, 12.0)
