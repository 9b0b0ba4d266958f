"""Poses of twins: the touched planes of a maximum on other faces, and on other parts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import box_centred_pose, off, surface_points
from tanteo import _core
from tanteo.geometry import SE3
from tanteo.posterior import prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "bracket_left", "bracket_right", "block", "housing"


@pytest.fixture(scope="module")
def parts():
    return [prepare(tanteo.read_part(PARTS / f"{name}.step")) for name in NAMES]


def corner_touches(own, rng, count=16, reach=0.2):
    """Return a pose and touches near a corner of a part."""
    p, _ = surface_points(own, 4000, rng)
    corner = own.part.corners.points[rng.integers(len(own.part.corners))]
    p = p[np.linalg.norm(p - corner, axis=1) < reach * own.part.diagonal][:count]
    T = box_centred_pose(rng)
    return T, SE3.apply(T, p) + 1e-4 * rng.normal(size=p.shape)


def identified(points, parts, seed=0):
    readings = tanteo.Readings.from_columns(points, sds=np.full(len(points), 1e-4))
    return tanteo.identify(readings, [p.part for p in parts], seed=seed, conventions=False, top=12)


@pytest.mark.slow
@pytest.mark.parametrize("k", [0, 1, 2])
def test_a_mirror_image_of_a_corner_is_not_lost(parts, k):
    own = parts[k % 2]
    T, points = corner_touches(own, np.random.default_rng(k))
    answer = identified(points, parts)
    there = [h for h in answer.hypotheses if h.part == own.part.name and off(own.part, h.T_world_part, T)[0] < 5e-3]
    assert there or dict(answer.parts)[own.part.name] > 0.3
    assert answer.status != "recognized" or answer.best.part == own.part.name


@pytest.mark.slow
def test_seeds_agree_on_the_corner_of_a_mirrored_part(parts):
    _, points = corner_touches(parts[0], np.random.default_rng(3))
    shares = [dict(identified(points, parts[:2], seed=seed).parts) for seed in range(3)]
    left = [one["bracket_left"] / (one["bracket_left"] + one["bracket_right"]) for one in shares]
    assert np.ptp(left) < 0.1


def test_an_edge_touched_on_a_face_fits_longer_edges_too(parts):
    rng = np.random.default_rng(5)
    own = parts[2].part
    low, high = own.box
    u = rng.uniform(0.25, 0.75, size=(14, 2))
    p = low + np.c_[u, np.ones(14)] * (high - low)
    p[6:10, 0], p[10:, 1] = low[0], low[1]
    labels = ["top"] * 6 + ["front"] * 4 + ["side"] * 4
    kinds = ["plane"] * 6 + ["edge"] * 8
    T = box_centred_pose(rng)
    readings = tanteo.Readings.from_columns(
        SE3.apply(T, p) + 1e-4 * rng.normal(size=p.shape), features=labels, kinds=kinds, sds=np.full(14, 1e-4)
    )
    answer = tanteo.identify(readings, [q.part for q in parts], conventions=False, top=12)
    assert "block" in dict(answer.parts)
    assert answer.status != "recognized" or answer.best.part == "block"


def test_poses_of_leaders_are_maximized_once(parts, monkeypatch):
    rng, starts = np.random.default_rng(5), []
    p, _ = surface_points(parts[0], 12, rng)
    maximize = _core.maximize

    def noted(shape, problem, Ts, *rest):
        starts.extend((id(shape), T.tobytes()) for T in Ts)
        return maximize(shape, problem, Ts, *rest)

    monkeypatch.setattr(_core, "maximize", noted)
    points = SE3.apply(box_centred_pose(rng), p) + 2e-3 * rng.normal(size=p.shape)
    readings = tanteo.Readings.from_columns(points, sds=np.full(len(points), 2e-3))
    tanteo.identify(readings, [p.part for p in parts[:3]], conventions=False)
    print(len(starts), len(set(starts)))
    assert len(set(starts)) > 0.8 * len(starts)
