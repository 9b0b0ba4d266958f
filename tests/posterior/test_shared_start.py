"""Errors that readings share and that are large beside the noise."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import Sensing, beams, box_centred_pose, mounted, nees, scene, surface_points, touches_of
from tanteo.factors import FreeRays
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, identify_points, prepare

LASER = Sensing("laser", 5e-5, True, (20,))


@pytest.fixture(scope="module")
def bracket():
    return prepare(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "bracket_left.step"))


def points(bracket, shared_jacobian):
    p, _ = surface_points(bracket, len(shared_jacobian), np.random.default_rng(3))
    return touches_of(p, 1e-4, shared_jacobian=shared_jacobian)


@pytest.mark.parametrize("k", range(6))
def test_a_bias_of_forty_times_the_noise_is_found(bracket, k):
    rng = np.random.default_rng((5, k))
    T = box_centred_pose(rng)
    touches, _, shared = scene(bracket, T, LASER, 20, rng, bias_sd=2e-3)
    answer = identify_points(touches, FreeRays.none(), [bracket], shared=shared)
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert best.outliers == ()
    assert nees(bracket.part, best.T_world_part, best.covariance, T)[0] < 22.5  # chi-square of 6 at 0.1 %


def test_bias_is_no_outlier_where_few_readings_fix_the_pose(bracket):
    """At once it hardly bends seven readings; the last reading is off by tens of sds once the others are fitted."""
    C = np.diag(np.repeat([5e-3, np.radians(3)], 3)) ** 2
    for k in range(4):
        rng = np.random.default_rng((7, k))
        T = SE3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
        p, d = beams(bracket, 7, rng, tilt=0.1)
        w, d = SE3.apply(T, p), d @ T[:3, :3].T
        bias = (2 + rng.uniform()) * rng.choice([-1, 1])
        points = w + (1e-5 * rng.normal(size=(7, 1)) - 3e-4 * bias) * d
        touches = touches_of(points, 1e-5, directions=d, shared_jacobian=3e-4 * d[:, :, None])
        priors = Priors(pose=PosePrior(np.eye(4), C), radius=bracket.part.radius)
        best = identify_points(touches, FreeRays.none(), [bracket], priors=priors).hypotheses[0]
        assert best.outliers == (), k


@pytest.fixture(scope="module")
def housing():
    return prepare(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "housing.step"))


@pytest.mark.parametrize("k", [7, 55])
def test_a_sensor_that_is_mounted_roughly_hides_no_pose(housing, k):
    """Pose proposals alone lead to maxima that exclude six readings, or that lie 15 standard deviations off."""
    rng = np.random.default_rng((90, k))
    T = box_centred_pose(rng)
    answer = identify_points(mounted(housing, T, 25, rng, off=3e-3, turned=0.03), FreeRays.none(), [housing])
    assert answer.status == "recognized"
    best = answer.hypotheses[0]
    assert best.outliers == ()
    assert nees(housing.part, best.T_world_part, best.covariance, T)[0] < 22.5
