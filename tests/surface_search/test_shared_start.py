"""Errors that readings share and that are large beside the noise."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import Sensing, beams, box_centred_pose, mounted, nees, scene, surface_points, touches_of
from tanteo.lie import SE3, SO3
from tanteo.localization import pose_information
from tanteo.matching import PosePrior, Priors
from tanteo.surface_search import FreePaths, identify_touches, prepare_target
from tanteo.surface_search.hops import hop
from tanteo.surface_search.likelihood import log_posterior
from tanteo.surface_search.polish import polish
from tanteo.surface_search.shared_start import bend, start_of

LASER = Sensing("laser", 5e-5, True, (20,))


@pytest.fixture(scope="module")
def bracket():
    return prepare_target(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "bracket_left.step"))


def points(bracket, gains):
    p, _ = surface_points(bracket, len(gains), np.random.default_rng(3))
    return touches_of(p, 1e-4, gains=gains)


def test_what_moves_all_readings_alike_bends_nothing(bracket):
    assert bend(points(bracket, np.zeros((10, 3, 0)))) == 0
    assert bend(points(bracket, np.broadcast_to(0.01 * np.eye(3), (10, 3, 3)))) < 1e-6
    p = points(bracket, np.zeros((10, 3, 0))).points
    turn = np.swapaxes(SO3.hat(p), -1, -2) * 0.1  # of the robot's base
    assert bend(points(bracket, turn)) < 1e-6


def test_a_bias_along_beams_bends_by_its_size(bracket):
    rng = np.random.default_rng(4)
    d = rng.normal(size=(200, 3, 1))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    assert 10 < bend(points(bracket, 1e-3 * d)) < 12  # directions of all sides: next to nothing is a motion


def test_small_shared_errors_start_at_none(bracket):
    some = points(bracket, np.full((10, 3, 1), 1e-5))
    Ts, z = start_of(some, np.eye(4)[None], bracket, Priors(radius=0.1))
    assert np.array_equal(Ts[0], np.eye(4))
    assert not z.any()


def test_without_a_reading_there_is_nothing_to_start_from(bracket):
    none = points(bracket, np.zeros((10, 3, 2))).take(np.zeros(0, dtype=np.int64))
    Ts, z = start_of(none, np.eye(4)[None], bracket, Priors(radius=0.1))
    assert np.array_equal(Ts[0], np.eye(4))
    assert z.shape == (1, 2)


@pytest.mark.parametrize("k", range(6))
def test_a_bias_of_forty_times_the_noise_is_found(bracket, k):
    rng = np.random.default_rng((5, k))
    T = box_centred_pose(rng)
    touches, _, shared = scene(bracket, T, LASER, 20, rng, bias_sd=2e-3)
    answer = identify_touches(touches, FreePaths.none(), [bracket], shared=shared)
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert best.outliers == ()
    assert nees(bracket.part, best.T_world_part, best.covariance, T)[0] < 22.5  # chi-square of 6 at 0.1 %


@pytest.mark.parametrize("count", [4, 5, 7])
def test_no_climb_ends_lower_than_the_given_pose(bracket, count):
    """A precise probe with a bias, a rough place: few readings hold the pose, and settling leads it far away."""
    C = np.diag(np.repeat([15e-3, 0.15], 3)) ** 2
    for k in range(12):
        rng = np.random.default_rng((55, count, k))
        T = SE3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
        p, d = beams(bracket, count, rng)
        d = d @ T[:3, :3].T
        touches = touches_of(
            SE3.apply(T, p) + 8e-6 * rng.normal(size=(count, 1)) * d, 8e-6, directions=d, gains=2e-5 * d[..., None]
        )
        priors = Priors(radius=0.1, pose=PosePrior(np.eye(4), C))
        found = polish(touches, FreePaths.none(), T[None], bracket, priors)
        start = log_posterior(touches, FreePaths.none(), T[None], np.zeros((1, 1)), bracket, priors)
        assert log_posterior(touches, FreePaths.none(), found.Ts, found.z, bracket, priors) > start - 1e-6


def test_a_bias_is_not_taken_for_a_stray_where_few_readings_just_fix_the_pose(bracket):
    """All at once it hardly bends seven readings; the last of them is off by tens of sds once the others are met."""
    C = np.diag(np.repeat([5e-3, np.radians(3)], 3)) ** 2
    for k in range(4):
        rng = np.random.default_rng((7, k))
        T = SE3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
        p, d = beams(bracket, 7, rng, tilt=0.1)
        w, d = SE3.apply(T, p), d @ T[:3, :3].T
        bias = (2 + rng.uniform()) * rng.choice([-1, 1])
        points = w + (1e-5 * rng.normal(size=(7, 1)) - 3e-4 * bias) * d
        touches = touches_of(points, 1e-5, directions=d, gains=3e-4 * d[:, :, None])
        priors = Priors(pose=PosePrior(np.eye(4), C), radius=bracket.part.radius)
        best = identify_touches(touches, FreePaths.none(), [bracket], priors=priors).hypotheses[0]
        assert best.outliers == (), k


@pytest.fixture(scope="module")
def housing():
    return prepare_target(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "housing.step"))


@pytest.mark.parametrize("k", [7, 55])
def test_a_sensor_that_is_mounted_roughly_hides_no_pose(housing, k):
    """First poses alone lead to maxima that leave six readings aside, or that lie 15 standard deviations off."""
    rng = np.random.default_rng((90, k))
    T = box_centred_pose(rng)
    answer = identify_touches(mounted(housing, T, 25, rng, off=3e-3, turned=0.03), FreePaths.none(), [housing])
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert best.outliers == ()
    assert nees(housing.part, best.T_world_part, best.covariance, T)[0] < 22.5


def test_from_a_maximum_others_are_found_that_fit_better(housing):
    """From where the climb ends that begins at the true pose with the errors which seem to fit it."""
    rng = np.random.default_rng((90, 7))
    T = box_centred_pose(rng)
    touches = mounted(housing, T, 25, rng, off=3e-3, turned=0.03)
    priors, none = Priors(radius=housing.part.radius), FreePaths.none()
    first = polish(touches, none, T[None], housing, priors)
    beside = hop(touches, none, first, housing, priors, 0, 3)
    assert beside.log_evidence[0] > first.log_evidence[0] + 10
    assert np.all(np.diff(beside.log_evidence) <= 0)
    assert np.all(beside.groups == 8)
    at_rest = polish(touches, none, beside.Ts, housing, priors, z=beside.z)
    assert at_rest.log_evidence[0] == pytest.approx(beside.log_evidence[0], abs=1e-2)
    assert nees(housing.part, beside.Ts[0], np.linalg.inv(pose_information(beside.information[0])), T)[0] < 22.5
