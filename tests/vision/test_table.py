"""The camera's pose from marks: exact without noise, calibrated with it; and the table's information about a pose."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import DegenerateError, InputError
from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera
from tanteo.vision.camera import project
from tanteo.vision.table import TableErrors, fit_camera, lying_information, seen_table

CAMERA = Camera(np.array([[620.0, 0, 317.0], [0, 615.0, 243.0], [0, 0, 1]]), (640, 480), np.array([-0.1, 0.04, 0, 0]))
MARKS = np.array(
    [[-0.1, -0.1, 0], [0.12, -0.09, 0], [0.11, 0.1, 0], [-0.09, 0.11, 0], [0.0, 0.02, 0], [0.05, -0.03, 0]]
)


def standing(tilt, turn):
    R = SO3.exp(np.array([0, 0, turn])) @ SO3.exp(np.array([np.pi - tilt, 0.0, 0.0]))
    return SE3.from_parts(R, -0.6 * R[:, 2] + np.array([0.02, 0.01, 0.0]))


def seen_from(T_world_camera, points=MARKS):
    return project(CAMERA, SE3.apply(SE3.inverse(T_world_camera), points))


@pytest.mark.parametrize("tilt", [0.0, 0.3, 0.8])
@pytest.mark.parametrize("turn", [0.0, 2.0, -3.0])
def test_marks_give_the_place_back(tilt, turn):
    truth = standing(tilt, turn)
    fit = fit_camera(CAMERA, seen_from(truth), MARKS)
    assert fit.T_world_camera == pytest.approx(truth, abs=1e-7)
    assert fit.rms < 1e-6


def test_marks_off_the_table_do_too():
    truth, points = standing(0.5, 0.4), MARKS + np.array([[0, 0, 0.05 * k] for k in range(6)])
    assert fit_camera(CAMERA, seen_from(truth, points), points).T_world_camera == pytest.approx(truth, abs=1e-7)


@pytest.mark.parametrize("runs", [80, pytest.param(300, marks=pytest.mark.slow)])
def test_the_covariance_of_the_camera_s_pose_holds(runs):
    """Eighty runs show a variance that is off by a quarter."""
    rng, truth, sd = np.random.default_rng(3), standing(0.4, 1.0), 0.3
    pixels, nees = seen_from(truth), []
    for _ in range(runs):
        fit = fit_camera(CAMERA, pixels + rng.normal(0, sd, pixels.shape), MARKS, sd=sd)
        e = SE3.log(SE3.inverse(truth) @ fit.T_world_camera)
        squares = fit.rms**2 * len(MARKS)
        C = fit.covariance / (2 * sd**2 + squares) * (2 + 2 * len(MARKS) - 6) * sd**2
        nees.append(e @ np.linalg.solve(C, e))
    low, high = chi2.ppf([0.001, 0.999], 6 * runs) / runs
    assert low < np.mean(nees) < high


def test_the_pixels_deviation_is_learned_from_the_marks():
    rng, truth = np.random.default_rng(6), standing(0.4, 1.0)
    points = np.concatenate([rng.uniform(-0.12, 0.12, (40, 2)), np.zeros((40, 1))], axis=1)
    pixels = seen_from(truth, points)
    exact, rough = (fit_camera(CAMERA, pixels + rng.normal(0, sd, pixels.shape), points) for sd in (0.05, 1.0))
    ratio = np.sqrt(np.trace(rough.covariance) / np.trace(exact.covariance))
    assert 8 < ratio < 21


def test_marks_on_a_line_or_too_few_are_refused():
    line = np.array([[0.02 * k, 0.01 * k, 0.0] for k in range(5)])
    with pytest.raises(DegenerateError, match="line"):
        fit_camera(CAMERA, seen_from(standing(0.3, 0.0), line), line)
    with pytest.raises(InputError, match="four"):
        fit_camera(CAMERA, seen_from(standing(0.3, 0.0))[:3], MARKS[:3])


def test_marks_that_contradict_each_other_are_refused_by_number():
    pixels = seen_from(standing(0.3, 0.0))
    pixels[4] += 60.0
    with pytest.raises(InputError, match="number 5"):
        fit_camera(CAMERA, pixels, MARKS)


def test_a_mark_given_twice_counts_once():
    twice = np.concatenate([MARKS[:3], MARKS[:1]])
    with pytest.raises(InputError, match="different points"):
        fit_camera(CAMERA, seen_from(standing(0.3, 0.0), twice), twice)


def test_the_table_resists_height_and_tilt_only():
    rng, errors = np.random.default_rng(4), TableErrors(3e-4, 4e-3)
    T = SE3.exp(rng.normal(size=6))
    centre = np.array([0.03, -0.02, 0.05])
    L = lying_information(T, centre, errors)
    moves = {
        "slide": np.array([1e-3, -2e-3, 0, 0, 0, 0]),
        "turn": np.array([0, 0, 0, 0, 0, 0.01]),
        "lift": np.array([0, 0, 3e-4, 0, 0, 0]),
        "tip": np.array([0, 0, 0, 4e-3, 0, 0]),
    }
    world_centre = SE3.apply(T, centre)
    costs = {}
    for name, move in moves.items():
        about = SE3.from_parts(np.eye(3), world_centre)
        xi = SE3.log(SE3.inverse(T) @ about @ SE3.exp(move) @ SE3.inverse(about) @ T)
        costs[name] = xi @ L @ xi
    assert costs["slide"] == pytest.approx(0, abs=1e-9)
    assert costs["turn"] == pytest.approx(0, abs=1e-9)
    assert costs["lift"] == pytest.approx(1)
    assert costs["tip"] == pytest.approx(1, rel=1e-4)


def test_the_camera_s_errors_are_the_table_s_too():
    rng, T = np.random.default_rng(5), standing(0.4, 1.0)
    half = rng.normal(size=(6, 6)) * np.r_[np.full(3, 1e-3), np.full(3, 2e-3)][:, None]
    C = half @ half.T
    camera = Camera(CAMERA.K, CAMERA.size, CAMERA.distortion, T, C)
    got = seen_table(TableErrors(1e-9, 1e-9), camera, np.eye(4))
    # where a camera that stands elsewhere puts the point of the table on its optical axis
    middle = T[:3, 3] - T[2, 3] / T[2, 2] * T[:3, 2]
    draws = T @ SE3.exp(rng.multivariate_normal(np.zeros(6), C, 20000)) @ SE3.inverse(T)
    lifted = SE3.apply(draws, middle)[:, 2]
    tipped = SE3.log(draws)[:, 3:5]
    assert got.height == pytest.approx(lifted.std(), rel=0.03)
    assert got.tilt == pytest.approx(np.sqrt(np.mean(tipped**2)), rel=0.03)
    assert seen_table(TableErrors(), Camera(CAMERA.K, CAMERA.size, T_world_camera=T), np.eye(4)) == TableErrors()


def test_a_table_without_errors_is_refused():
    with pytest.raises(InputError, match="above zero"):
        TableErrors(0.0)
