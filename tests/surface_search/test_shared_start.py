"""Errors that readings share and that are large beside the noise."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import Sensing, box_centred_pose, nees, scene, surface_points, touches_of
from tanteo.lie import SO3
from tanteo.matching import Priors
from tanteo.surface_search import FreePaths, identify_touches, prepare_target
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
