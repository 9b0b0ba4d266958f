"""Laws of the surface search: derivatives against differences, first poses near the truth, invariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, nees, no_paths, off, scene, surface_points, touches_of
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.surface_search import identify_touches, prepare_target
from tanteo.surface_search.distinct import distinct_maxima
from tanteo.surface_search.likelihood import densities_at, explain
from tanteo.surface_search.polish import polish
from tanteo.surface_search.refine import residuals
from tanteo.surface_search.starts import bases, oriented_bases, pair_poses, triple_poses

TOUCH, LASER, FLIGHT = SENSORS
RIGHT = 0.002, 0.03
"""Near enough to be the same pose [m, rad]."""


@pytest.fixture(scope="module")
def targets(parts):
    return {name: prepare_target(parts[name]) for name in ("bracket_left", "block", "flange", "clamp")}


def mixed(target, rng, n=9):
    """Touches of every sort: full covariances, tips, directions, normals, shared errors, at a pose not quite right."""
    T = box_centred_pose(rng)
    points, normals = surface_points(target, n, rng)
    A = rng.normal(size=(n, 3, 3))
    radii = np.where(rng.uniform(size=n) < 0.5, 2e-3, 0.0)
    towards = np.where(rng.uniform(size=(n, 1)) < 0.5, -normals @ T[:3, :3].T, 0.0)
    sensed = np.where(rng.uniform(size=(n, 1)) < 0.5, normals @ T[:3, :3].T, 0.0)
    touches = touches_of(
        SE3.apply(T, points + radii[:, None] * normals + 1e-3 * rng.normal(size=(n, 3))), 1e-3,
        radii=radii, directions=towards, normals=sensed, normal_sd=0.1, gains=1e-3 * rng.normal(size=(n, 3, 2)),
    )  # fmt: skip
    covs = 1e-6 * (A @ np.swapaxes(A, 1, 2) + np.eye(3))
    return replace(touches, covs=covs), T


def close_to_differences(J, differences, share=0.9):
    """Equal but where a step crosses from one face to the next."""
    scale = np.abs(J).max()
    assert (np.abs(J - differences) < 1e-4 * scale).all(axis=-1).mean() > share


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_the_rough_residuals(targets, seed):
    rng, target = np.random.default_rng(seed), targets["bracket_left"]
    touches, T = mixed(target, rng)
    touches = replace(touches, covs=np.tile(1e-6 * np.eye(3), (len(touches), 1, 1)))

    def at(T):
        return residuals(touches, T[None], target)

    h, J = 1e-6, at(T)[1][0]
    steps = [(at(T @ SE3.exp(h * e))[0] - at(T @ SE3.exp(-h * e))[0])[0] / (2 * h) for e in np.eye(6)]
    distances = len(touches)
    close_to_differences(J[:distances], np.stack(steps, axis=-1)[:distances])
    # beyond an edge the gradient turns as well, which the rows of normals leave out
    flat = np.flatnonzero(touches.oriented)
    assert len(flat)
    close_to_differences(J[distances:], np.stack(steps, axis=-1)[distances:], share=0.6)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_of_the_likelihood_by_the_pose_and_by_shared_errors(targets, seed):
    rng, target = np.random.default_rng(seed), targets["bracket_left"]
    touches, T = mixed(target, rng)
    touches = replace(touches, covs=np.tile(1e-6 * np.eye(3), (len(touches), 1, 1)))
    priors, z, n = Priors(radius=target.part.radius), rng.normal(size=(1, 2)), len(touches)

    def at(xi):
        return explain(touches, (T @ SE3.exp(xi[:6]))[None], z + xi[6:], target, priors)

    h, J = 1e-6, at(np.zeros(8)).J[0]
    steps = np.stack([(at(h * e).r - at(-h * e).r)[0] / (2 * h) for e in np.eye(8)], axis=-1)
    close_to_differences(J[:n], steps[:n])
    close_to_differences(J[n:, :6], steps[n:, :6], share=0.6)


@pytest.mark.parametrize("seed", range(4))
def test_without_derivatives_the_likelihood_is_the_same(targets, seed):
    rng, target = np.random.default_rng(seed), targets["bracket_left"]
    touches, T = mixed(target, rng, 60)
    touches = replace(touches, radii=np.zeros(len(touches)))
    priors, Ts = Priors(radius=target.part.radius), T @ SE3.exp(1e-3 * rng.normal(size=(40, 6)))
    z = rng.normal(size=(40, touches.gains.shape[-1]))
    both = explain(touches, Ts, z, target, priors)
    assert both.edges is not None
    alone = densities_at(touches, Ts, z, target, priors)
    np.testing.assert_allclose(alone.log_hit, both.densities.log_hit, rtol=1e-12)
    np.testing.assert_array_equal(alone.log_stray, both.densities.log_stray)


@pytest.mark.parametrize("radius", [0.0, 3e-3])
def test_some_first_pose_is_near_the_truth(targets, radius):
    target = targets["bracket_left"]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        T = box_centred_pose(rng)
        points, normals = surface_points(target, 10, rng)
        touches = touches_of(SE3.apply(T, points + radius * normals), 1e-4, radii=radius)
        Ts = np.concatenate([triple_poses(touches, base, target, 12000) for base in bases(touches, 2, target)])
        moved = SE3.apply(SE3.inverse(T) @ Ts, target.part.centroid) - target.part.centroid
        turned = np.linalg.norm(SE3.log(SE3.inverse(T) @ Ts)[:, 3:], axis=1)
        nearest = np.min(np.linalg.norm(moved, axis=1) + target.part.radius * turned)
        assert nearest < 4 * target.spacing


def test_two_oriented_touches_give_a_pose_near_the_truth(targets):
    target = targets["bracket_left"]
    for seed in range(5):
        rng = np.random.default_rng(seed)
        T = box_centred_pose(rng)
        points, normals = surface_points(target, 6, rng)
        touches = touches_of(SE3.apply(T, points), 1e-4, normals=normals @ T[:3, :3].T, normal_sd=0.02)
        Ts = np.concatenate([pair_poses(touches, base, target, 2000) for base in oriented_bases(touches, 2)])
        turned = np.linalg.norm(SE3.log(SE3.inverse(T) @ Ts)[:, 3:], axis=1)
        moved = np.linalg.norm(SE3.apply(SE3.inverse(T) @ Ts, target.part.centroid) - target.part.centroid, axis=1)
        assert np.min(moved + target.part.radius * turned) < 4 * target.spacing


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
    moved = replace(
        touches,
        points=SE3.apply(G, touches.points),
        covs=R @ touches.covs @ R.T,
        directions=touches.directions @ R.T,
    )
    a, b = (identify_touches(t, no_paths(), [target]).hypotheses[0] for t in (touches, moved))
    xi = SE3.log(SE3.inverse(G @ a.T_world_part) @ b.T_world_part)
    assert xi @ np.linalg.solve(a.covariance, xi) < 1e-2  # where the climb ends, not where noise would put it
    np.testing.assert_allclose(b.covariance, a.covariance, rtol=0.05, atol=1e-10)
    assert b.probability == pytest.approx(a.probability, abs=1e-3)


def test_the_order_of_the_readings_does_not_matter(targets):
    target = targets["bracket_left"]
    touches, *_ = laser_scene(target, 2, stray=0.1)
    order = np.random.default_rng(3).permutation(len(touches))
    a, b = (identify_touches(t, no_paths(), [target]).hypotheses[0] for t in (touches, touches.take(order)))
    xi = SE3.log(SE3.inverse(a.T_world_part) @ b.T_world_part)
    assert xi @ np.linalg.solve(a.covariance, xi) < 1e-2
    assert set(a.outliers) == set(b.outliers)
    assert b.probability == pytest.approx(a.probability, abs=1e-3)


def test_the_same_readings_give_the_same_numbers(targets):
    target = targets["clamp"]
    touches, *_ = laser_scene(target, 3)
    a, b = (identify_touches(touches, no_paths(), [target]).hypotheses[0] for _ in range(2))
    np.testing.assert_array_equal(a.T_world_part, b.T_world_part)
    np.testing.assert_array_equal(a.covariance, b.covariance)
    assert a.probability == b.probability


def test_probabilities_sum_to_one(targets):
    for seed, n in ((4, 5), (5, 8), (6, 20)):
        touches, *_ = laser_scene(targets["bracket_left"], seed, n)
        answer = identify_touches(touches, no_paths(), list(targets.values()), top=10_000)
        total = answer.unknown_probability + sum(h.probability for h in answer.hypotheses)
        assert total == pytest.approx(1.0, abs=1e-3)  # what is negligible is not reported
        ps = [h.probability for h in answer.hypotheses]
        assert ps == sorted(ps, reverse=True)


def test_poses_that_symmetry_makes_one_are_one_mode(targets):
    target = targets["block"]
    touches, T, *_ = laser_scene(target, 7)
    answer = identify_touches(touches, no_paths(), [target])
    best = answer.hypotheses[0]
    assert answer.status == "recognized"
    assert best.symmetry_order == 4
    assert best.symmetry_poses.shape == (3, 4, 4)
    everywhere = np.concatenate([best.T_world_part[None], best.symmetry_poses])
    assert min(off(target.part, X, T)[0] for X in everywhere) < RIGHT[0]
    gaps = [np.linalg.norm(SE3.log(SE3.inverse(X) @ T)[3:]) for X in everywhere]
    assert sum(gap < RIGHT[1] for gap in gaps) == 1


def test_symmetric_starts_are_merged_and_others_are_not(targets):
    target = targets["block"]
    touches, T, *_ = laser_scene(target, 8)
    images = T @ target.part.symmetry.Ts
    elsewhere = T @ SE3.exp(np.array([0.02, 0, 0, 0, 0, 0]))
    priors = Priors(radius=target.part.radius)
    found = polish(touches, no_paths(), np.concatenate([images, elsewhere[None]]), target, priors)
    np.testing.assert_allclose(found.log_evidence[:4], found.log_evidence[0], atol=0.05)
    maxima = distinct_maxima(found, target)
    assert len(maxima.Ts) <= 2
    assert off(target.part, maxima.Ts[0], T)[0] < RIGHT[0]


def test_two_poses_that_fit_alike_are_both_reported(targets):
    """Touches only where the part also has a surface after half a turn: it may be either way round."""
    target, rng = targets["bracket_left"], np.random.default_rng(11)
    turn, T = target.turns[2], box_centred_pose(rng)
    p, _ = surface_points(target, 4000, rng)
    both = p[target.surface.closest(SE3.apply(SE3.inverse(turn), p)).distances < 1e-9][:60]
    assert len(both) == 60
    touches = touches_of(SE3.apply(T, both) + 3e-4 * rng.normal(size=both.shape), 3e-4)
    priors = Priors(radius=target.part.radius)
    found = distinct_maxima(polish(touches, no_paths(), np.stack([T, T @ turn]), target, priors), target)
    assert len(found.Ts) == 2
    assert abs(found.log_evidence[0] - found.log_evidence[1]) < 5
    assert {off(target.part, pose, T)[1] < 0.05 for pose in found.Ts} == {True, False}


@pytest.mark.parametrize("sensing", [TOUCH, LASER, FLIGHT], ids=lambda s: s.name)
def test_the_covariance_is_that_of_the_errors(targets, sensing):
    """Normalised errors of repeated noise at one pose, started at the truth: mean of chi-square over its freedom."""
    target, values = targets["bracket_left"], []
    rng = np.random.default_rng(12)
    T = box_centred_pose(rng)
    exact, *_ = scene(target, T, replace(sensing, sd=1e-12), 40, rng)
    priors = Priors(radius=target.part.radius)
    for _ in range(60):
        noise = sensing.sd * rng.normal(size=(40, 3))
        touches = replace(
            exact, points=exact.points + noise, covs=np.tile(sensing.sd**2 * np.eye(3), (40, 1, 1)),
            sd=np.full(40, sensing.sd),
        )  # fmt: skip
        found = polish(touches, no_paths(), T[None], target, priors)
        values.append(nees(target.part, found.Ts[0], np.linalg.inv(found.information[0]), T)[0])
    # 60 draws of chi-square with 6 degrees: sd of the mean 0.45; noise at edges of 3 mm bends the surface
    assert 6 - 4 * 0.45 < np.mean(values) < 6 + (4 if sensing.sd < 1e-3 else 8) * 0.45


def test_an_error_that_all_readings_share_does_not_shrink(targets):
    target, corners = targets["bracket_left"], []
    for n in (20, 80, 320):
        touches, T, _, shared = laser_scene(target, 13, n, base_sd=5e-4)
        best = identify_touches(touches, no_paths(), [target], shared=shared).hypotheses[0]
        place = np.sqrt(np.linalg.eigvalsh(best.covariance[:3, :3]))
        same = np.sqrt(np.linalg.eigvalsh(best.covariance_same_robot[:3, :3]))
        assert place.min() > 0.99 * 5e-4
        corners.append(same.max())
        value, dof = nees(target.part, best.T_world_part, best.covariance, T)
        assert value < 4 * dof
    assert corners[0] / corners[2] > 0.7 * np.sqrt(320 / 20)
