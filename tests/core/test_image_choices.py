"""What the core chooses among: places of a slid drawing, samples of edges, poses, edges that are another's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.image_oracle import Sliding, scene
from core.questions import per_width
from tanteo import _core
from tanteo.geometry import SE3, SO3
from tanteo.vision.settings import EDGES

YAWS, APART = 12, 6.0
CENTRE = np.array([0.01, 0.0, 0.01])


def sliding(seed):
    """Return a scene, poses for each yaw, and tables of random distances."""
    rng = np.random.default_rng(seed)
    s = scene(seed, (-0.2, 0.05, 1e-3, -2e-3))
    s = replace(s, corners=s.corners[:3])
    turned = SE3.from_parts(SO3.axis_rotation(2, 2 * np.pi * np.arange(YAWS) / YAWS), np.array([0.0, 0, 0.25]))
    x, y = np.meshgrid(np.arange(20.0, 75, 6), np.arange(10.0, 50, 6))
    margin, shape = 6, (16 + 12, 24 + 12)
    distances = np.full((EDGES.channels, *shape), 6, np.float32)
    distances[:, 6:-6, 6:-6] = rng.uniform(0, 6, (EDGES.channels, 16, 24))
    places = np.stack([x, y], axis=-1).reshape(-1, 2)
    table = Sliding(distances, places, 4.0, margin, 19)
    return s, turned @ SE3.exp(np.array([0, 0, 0, 0.3, -0.2, 0.1])), table


def slide(s, Ts, t, keep, **others):
    values = {
        "distances": t.distances, "places": t.places, "cell": t.cell, "margin": t.margin,
        "samples": t.samples, "apart": APART, "keep": keep,
    }  # fmt: skip
    return _core.slide_edges(s.frame(), s.camera.numbers, Ts, CENTRE, **{**values, **others})


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("keep", [1, 4, 200])
def test_slid_drawings_keep_the_best_that_are_apart(seed, keep):
    s, Ts, t = sliding(seed)
    costs = t.costs(s, Ts, CENTRE)
    yaw, place, cost = slide(s, Ts, t, keep)
    np.testing.assert_allclose(cost, costs[yaw, place], rtol=1e-6)
    order = [divmod(k, costs.shape[1]) for k in np.argsort(costs, axis=None, kind="stable")[: 40 * keep]]
    kept = []
    for a, p in order:
        turns = [min((a - b) % YAWS, (b - a) % YAWS) for b, _ in kept]
        gaps = [np.abs(t.places[p] - t.places[q]).max() for _, q in kept]
        if not any(turn <= 1 and gap <= APART for turn, gap in zip(turns, gaps, strict=True)):
            kept.append((a, p))
    assert list(zip(yaw.tolist(), place.tolist(), strict=True)) == kept[:keep]


def test_every_width_slides_drawings_to_the_same_places():
    s, Ts, t = sliding(3)
    found = per_width(lambda: slide(s, Ts, t, 40))
    for other in found[1:]:
        for one, same in zip(found[0], other, strict=True):
            np.testing.assert_array_equal(one, same)


def test_a_drawing_that_cannot_be_slid_is_refused():
    s, Ts, t = sliding(0)
    wrong = {
        "distances": t.distances[:0], "places": t.places + 500, "cell": 0.0, "margin": 0,
        "samples": 0, "keep": 0,
    }  # fmt: skip
    for name, value in wrong.items():
        with pytest.raises(ValueError, match="expected"):
            slide(s, Ts, t, **{"keep": 4, name: value})
    for place in ([-3.0, 10.0], [10.0, -3.0], [np.nan, 10.0], [99.0, 10.0], [10.0, 67.0]):
        with pytest.raises(ValueError, match="places"):
            slide(s, Ts, t, 4, places=np.array([place]))
    assert [len(a) for a in slide(s, Ts, t, 4, places=np.zeros((0, 2)))] == [0, 0, 0]


def test_the_nearest_pixels_are_found_within_reach():
    rng = np.random.default_rng(4)
    pixels, places = rng.uniform(0, 100, (300, 2)), rng.uniform(-5, 105, (200, 2))
    far = np.linalg.norm(places[:, None] - pixels, axis=-1)
    expected = np.where(far.min(axis=1) < 3, far.argmin(axis=1), -1)
    np.testing.assert_array_equal(_core.nearest_pixels(pixels, places, 3.0), expected)
    assert 10 < (expected < 0).sum() < 190
    assert (_core.nearest_pixels(pixels[:0], places, 3.0) == -1).all()


def test_of_sets_of_points_those_far_from_all_before_are_kept():
    rng = np.random.default_rng(5)
    points, order = rng.uniform(0, 1, (60, 1, 3)) + rng.normal(0, 0.05, (60, 7, 3)), rng.permutation(60)
    kept = []
    for k in order:
        if all(np.linalg.norm(points[k] - points[j], axis=-1).max() >= 0.5 for j in kept):
            kept.append(k)
    assert _core.far_apart(points, order, 0.5).tolist() == kept
    assert 3 < len(kept) < 50
    assert len(_core.far_apart(points[:0], order[:0], 0.5)) == 0
    with pytest.raises(ValueError, match="order"):
        _core.far_apart(points[:5], order, 0.5)
