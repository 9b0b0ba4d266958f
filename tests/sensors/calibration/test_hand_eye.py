"""Hand-eye calibration: exact data, covariance by Monte Carlo, outliers, degenerate motions, the next pose."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.sensors.calibration import calibrate_hand_eye

NOISE = np.array([3e-4, 3e-4, 1e-3, 1e-3, 1e-3, 1e-3])
"""Standard deviations of an observation: position in the camera's frame [m], rotation [rad]."""


@pytest.fixture
def rng():
    return np.random.default_rng(57)


def random_pose(rng, length=0.1, turn=0.5):
    return SE3.exp(np.r_[rng.normal(size=3) * length, rng.normal(size=3) * turn])


def scene(rng, n, noise=NOISE, turns=None):
    """Return samples of a camera on a hand 0.5 m above a target; ``turns`` are rotation vectors ``(n, 3)``."""
    X, Y = random_pose(rng), random_pose(rng, 0.3, 1.0)
    turns = rng.normal(size=(n, 3)) * 0.35 if turns is None else turns
    views = SE3.from_parts(SO3.exp(turns), np.zeros((n, 3)))
    back = np.eye(4)
    back[:3, 3] = [0.0, 0.0, 0.5]
    camera = SE3.inverse(back @ views @ SE3.exp(rng.normal(size=(n, 6)) * [0.05, 0.05, 0.05, 0, 0, 0]))
    A = Y @ camera @ SE3.inverse(X)
    B = SE3.inverse(A @ X) @ Y
    seen = B @ SE3.from_parts(SO3.exp(rng.normal(size=(n, 3)) * noise[3:]), np.zeros((n, 3)))
    seen[:, :3, 3] += rng.normal(size=(n, 3)) * noise[:3]
    return A, seen, X, Y


def test_exact_samples_give_the_exact_poses(rng):
    A, B, X, Y = scene(rng, 6, 0 * NOISE)
    found = calibrate_hand_eye(A, B)
    np.testing.assert_allclose(found.T_mount_camera, X, atol=1e-8)
    np.testing.assert_allclose(found.T_other_target, Y, atol=1e-8)
    assert found.used.all()


def test_a_fixed_camera_is_the_same_with_inverted_poses(rng):
    A, B, _, _ = scene(rng, 12)
    hand = calibrate_hand_eye(A, B)
    fixed = calibrate_hand_eye(SE3.inverse(A), B, mounted="world")
    np.testing.assert_allclose(hand.T_mount_camera, fixed.T_mount_camera, atol=1e-12)
    np.testing.assert_allclose(hand.covariance, fixed.covariance, rtol=1e-9)
    np.testing.assert_allclose(SE3.inverse(fixed.T_next), hand.T_next, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("trials", [40, pytest.param(120, marks=pytest.mark.slow)])
def test_few_clean_samples_are_rarely_excluded(rng, trials):
    """With six samples the estimate follows each of them, and the variances are estimated with few deviations."""
    lost = sum(not calibrate_hand_eye(*scene(rng, 6)[:2]).used.all() for _ in range(trials))
    assert lost < 0.2 * trials


@pytest.mark.parametrize("trials", [40, pytest.param(150, marks=pytest.mark.slow)])
def test_the_covariance_is_that_of_the_errors(rng, trials):
    """NEES over many calibrations with estimated noise, within 4 standard errors of chi-square."""
    squared = []
    for _ in range(trials):
        A, B, X, _ = scene(rng, 15)
        found = calibrate_hand_eye(A, B)
        error = SE3.log(SE3.inverse(found.T_mount_camera) @ X)
        squared.append(error @ np.linalg.solve(found.covariance, error))
    mean = np.mean(squared)
    assert abs(mean - 6) < 4 * np.std(squared) / np.sqrt(trials)
    assert np.mean(np.array(squared) < chi2.isf(0.05, 6)) > 0.95 - 4 * np.sqrt(0.05 * 0.95 / trials)


def test_the_noise_is_estimated(rng):
    A, B, _, _ = scene(rng, 200)
    sds = calibrate_hand_eye(A, B).sds
    np.testing.assert_allclose(sds, NOISE[[0, 2, 3]], rtol=0.2)


def test_three_wrong_samples_of_twelve_are_named(rng):
    A, B, X, _ = scene(rng, 12)
    for k in (2, 5, 11):
        B[k] = B[k] @ SE3.exp(rng.normal(size=6) * [0.03, 0.03, 0.03, 0.2, 0.2, 0.2])
    found = calibrate_hand_eye(A, B)
    assert np.flatnonzero(~found.used).tolist() == [2, 5, 11]
    assert "3, 6, 12" in found.message
    assert np.abs(SE3.log(SE3.inverse(found.T_mount_camera) @ X)[:3]).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("trials", "most"), [(25, 4), pytest.param(100, 12, marks=pytest.mark.slow)])
def test_few_of_many_good_samples_are_excluded(rng, trials, most):
    """Of 100 calibrations without a wrong sample about one may lose one, by the level of the test."""
    lost = sum(int(not calibrate_hand_eye(*scene(rng, 12)[:2]).used.all()) for _ in range(trials))
    assert lost <= most


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_rotations_about_one_axis_are_insufficient(rng, noise):
    turns = np.outer(np.linspace(-0.8, 0.8, 12), [0.0, 0.0, 1.0])
    A, B, _, _ = scene(rng, 12, noise * NOISE, turns)
    found = calibrate_hand_eye(A, B)
    assert found.status == "insufficient"
    assert "position along" in found.message
    assert "too parallel" in found.message


def test_translations_alone_are_insufficient(rng):
    A, B, _, _ = scene(rng, 10, NOISE, np.zeros((10, 3)))
    found = calibrate_hand_eye(A, B)
    assert found.status == "insufficient"
    assert found.covariance[:3, :3].max() > 1.0


def test_the_next_pose_frees_a_degenerate_calibration(rng):
    turns = np.outer(np.linspace(-0.8, 0.8, 8), [0.0, 0.0, 1.0])
    A, B, X, Y = scene(rng, 8, NOISE, turns)
    found = calibrate_hand_eye(A, B)
    T = found.T_next
    seen = SE3.inverse(T @ X) @ Y
    better = calibrate_hand_eye(np.concatenate([A, T[None]]), np.concatenate([B, seen[None]]))
    assert np.linalg.det(better.covariance) < 1e-2 * np.linalg.det(found.covariance)
    assert better.status == "calibrated"


def test_a_change_of_frames_changes_the_result_with_it(rng):
    A, B, _, _ = scene(rng, 12)
    Z, W = random_pose(rng), random_pose(rng)
    one = calibrate_hand_eye(A, B)
    other = calibrate_hand_eye(W @ A @ SE3.inverse(Z), B)
    np.testing.assert_allclose(other.T_mount_camera, Z @ one.T_mount_camera, atol=1e-7)
    np.testing.assert_allclose(other.T_other_target, W @ one.T_other_target, atol=1e-7)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=1e-3, atol=1e-12)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_samples_are_refused(rng, count):
    A, B, _, _ = scene(rng, 4)
    with pytest.raises(InputError, match="3 or more"):
        calibrate_hand_eye(A[:count], B[:count])


def test_other_numbers_of_poses_are_refused(rng):
    A, B, _, _ = scene(rng, 4)
    with pytest.raises(InputError, match="one pose of the target for each"):
        calibrate_hand_eye(A, B[:3])
