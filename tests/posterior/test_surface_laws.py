"""Laws of the surface search: derivatives against differences, pose proposals near the truth, invariances."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2

from altered import altered
from bare_scenes import SENSORS, box_centred_pose, nees, no_paths, off, scene
from tanteo.geometry import SE3
from tanteo.posterior import identify_points, prepare

TOUCH, LASER, FLIGHT = SENSORS
RIGHT = 0.002, 0.03
"""Near enough to be the same pose [m, rad]."""


@pytest.fixture(scope="module")
def targets(parts):
    return {name: prepare(parts[name]) for name in ("bracket_left", "block", "flange", "clamp")}


def laser_scene(target, seed, n=20, **options):
    rng = np.random.default_rng(seed)
    T = box_centred_pose(rng)
    touches, rows, shared = scene(target, T, LASER, n, rng, **options)
    return touches, T, rows, shared


def test_moving_the_world_moves_the_answer(targets):
    target = targets["bracket_left"]
    touches, *_ = laser_scene(target, 1)
    G = box_centred_pose(np.random.default_rng(9), 2.0)
    R = G[:3, :3]
    moved = altered(
        touches,
        points=SE3.apply(G, touches.points),
        covs=R @ touches.covs @ R.T,
        directions=touches.directions @ R.T,
    )
    a, b = (identify_points(t, no_paths(), [target]).hypotheses[0] for t in (touches, moved))
    xi = SE3.log(SE3.inverse(G @ a.T_world_part) @ b.T_world_part)
    assert xi @ np.linalg.solve(a.covariance, xi) < 1e-2  # where the maximization ends, not where noise would put it
    np.testing.assert_allclose(b.covariance, a.covariance, rtol=0.05, atol=1e-10)
    assert b.probability == pytest.approx(a.probability, abs=1e-3)


def test_the_order_of_the_readings_does_not_matter(targets):
    target = targets["bracket_left"]
    touches, *_ = laser_scene(target, 2, outlier=0.1)
    order = np.random.default_rng(3).permutation(len(touches))
    a, b = (identify_points(t, no_paths(), [target]).hypotheses[0] for t in (touches, touches.take(order)))
    xi = SE3.log(SE3.inverse(a.T_world_part) @ b.T_world_part)
    # a mode that is not normal is at the mean of at least 400 effective samples: both means to 99.9 %
    assert xi @ np.linalg.solve(a.covariance, xi) < chi2.ppf(0.999, 6) * 2 / 400
    assert set(a.outliers) == set(b.outliers)
    assert b.probability == pytest.approx(a.probability, abs=1e-3)


def test_the_same_readings_give_the_same_numbers(targets):
    target = targets["clamp"]
    touches, *_ = laser_scene(target, 3)
    a, b = (identify_points(touches, no_paths(), [target]).hypotheses[0] for _ in range(2))
    np.testing.assert_array_equal(a.T_world_part, b.T_world_part)
    np.testing.assert_array_equal(a.covariance, b.covariance)
    assert a.probability == b.probability


def test_probabilities_sum_to_one(targets):
    for seed, n in ((4, 5), (5, 8), (6, 20)):
        touches, *_ = laser_scene(targets["bracket_left"], seed, n)
        answer = identify_points(touches, no_paths(), list(targets.values()), top=10_000)
        total = answer.unknown_probability + answer.missed_probability + sum(h.probability for h in answer.hypotheses)
        assert total == pytest.approx(1.0, abs=1e-3)  # what is negligible is not reported
        ps = [h.probability for h in answer.hypotheses]
        assert all(
            b < 1.002 * a for a, b in pairwise(ps)
        )  # twins, but for where maximizations end, by the order of parts


def test_poses_that_symmetry_makes_one_are_one_mode(targets):
    target = targets["block"]
    touches, T, *_ = laser_scene(target, 7)
    answer = identify_points(touches, no_paths(), [target])
    best = answer.hypotheses[0]
    assert answer.status == "recognized"
    assert best.symmetry_order == 4
    assert best.symmetry_poses.shape == (3, 4, 4)
    everywhere = np.concatenate([best.T_world_part[None], best.symmetry_poses])
    assert min(off(target.part, X, T)[0] for X in everywhere) < RIGHT[0]
    gaps = [np.linalg.norm(SE3.log(SE3.inverse(X) @ T)[3:]) for X in everywhere]
    assert sum(gap < RIGHT[1] for gap in gaps) == 1


def test_an_error_that_all_readings_share_does_not_shrink(targets):
    target, corners = targets["bracket_left"], []
    for n in (20, 80, 320):
        touches, T, _, shared = laser_scene(target, 13, n, base_sd=5e-4)
        best = identify_points(touches, no_paths(), [target], shared=shared).hypotheses[0]
        place = np.sqrt(np.linalg.eigvalsh(best.covariance[:3, :3]))
        same = np.sqrt(np.linalg.eigvalsh(best.covariance_relative[:3, :3]))
        assert place.min() > 0.99 * 5e-4
        corners.append(same.max())
        value, dof = nees(target.part, best.T_world_part, best.covariance, T)
        assert value < 4 * dof
    assert corners[0] / corners[2] > 0.7 * np.sqrt(320 / 20)
