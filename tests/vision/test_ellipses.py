"""Ellipses of an image and the circles behind them: exact, by simulation, refused with the reason, and in use."""

from __future__ import annotations

import doctest
import inspect
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2

import tanteo.vision
from drilled import as_part, drilled
from rendered import table_camera
from tanteo.errors import DegenerateError, InputError
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE
from tanteo.fitting.localization import ModelFeature, Pairing
from tanteo.geometry import SE3, SO3
from tanteo.vision import Camera, find_edges, find_ellipses, prepare_vision, render, see
from tanteo.vision.circles import circle_poses, project_circle
from tanteo.vision.ellipse_fit import fit_ellipse
from tanteo.vision.features import image_centre, image_circle
from tanteo.vision.rendering import Stage, rendered_part

CAMERA = Camera(np.array([[620.0, 0, 317.0], [0, 615.0, 243.0], [0, 0, 1]]), (640, 480), edge_sd=0.0)
T_CAMERA_CIRCLE = SE3.from_parts(SO3.exp(np.array([2.5, 0.4, 0.2])), np.array([0.03, -0.02, 0.15]))
RADIUS = 8e-3


def arc(ellipse, degrees, rng=None, sd=0.1, count=60):
    t = 0.7 + np.radians(degrees) * (np.arange(count) + 0.5) / count
    u = np.stack([np.cos(t), np.sin(t)], axis=1)
    normals = u @ np.linalg.inv(ellipse.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    noise = np.zeros(count) if rng is None else rng.normal(0, sd, count)
    return ellipse.centre + u @ ellipse.shape + noise[:, None] * normals


def disc(shape, centre, semi_axes, blur, rng=None):
    """Return an image of a dark ellipse without error, blurred."""
    import cv2

    y, x = (np.mgrid[: 8 * shape[0], : 8 * shape[1]] + 0.5) / 8 - 0.5
    inside = np.hypot((x - centre[0]) / semi_axes[0], (y - centre[1]) / semi_axes[1]) < 1
    image = cv2.GaussianBlur(np.where(inside, 60.0, 180.0), (0, 0), 8 * blur)
    image = image.reshape(shape[0], 8, shape[1], 8).mean(axis=(1, 3))
    return image if rng is None else image + rng.normal(0, 2.0, shape)


@pytest.mark.parametrize("degrees", [360, 150, 60])
def test_exact_points_give_the_ellipse(degrees):
    truth = project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS)
    found = fit_ellipse(arc(truth, degrees), np.full(60, 1e-6))
    assert found.numbers == pytest.approx(truth.numbers, abs=1e-5)
    assert np.degrees(found.arc) == pytest.approx(degrees, abs=8)


@pytest.mark.parametrize("degrees", [360, 200])
def test_covariances_of_ellipse_and_circle_hold(degrees):
    rng, trials, ellipse, circle = np.random.default_rng(4), 50, [], []
    truth = project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS)
    for _ in range(trials):
        found = fit_ellipse(arc(truth, degrees, rng), np.full(60, 0.1))
        off = found.numbers - truth.numbers
        ellipse.append(off @ np.linalg.solve(found.covariance, off))
        z = []
        for pose in circle_poses(CAMERA, found, RADIUS):
            M = T_CAMERA_CIRCLE[:3, :3].T @ pose.T_camera_circle[:3, :3]
            back = SO3.axis_rotation(2, np.arctan2(M[0, 1] - M[1, 0], M[0, 0] + M[1, 1]))
            T = pose.T_camera_circle @ SE3.from_parts(back, np.zeros(3))
            off = SE3.log(SE3.inverse(T) @ T_CAMERA_CIRCLE)[:5]
            spun = np.eye(5)
            spun[:2, :2] = spun[3:, 3:] = back[:2, :2].T
            z.append(off @ np.linalg.solve(spun @ pose.covariance[:5, :5] @ spun.T, off))
        circle.append(min(z))
    low, high = chi2.ppf([0.001, 0.999], 5 * trials) / trials
    assert low < np.mean(ellipse) < high
    assert low < np.mean(circle) < high


def test_one_of_two_circles_is_the_true_one():
    truth = project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS)
    poses = circle_poses(CAMERA, truth, RADIUS)
    off = [np.linalg.norm(pose.T_camera_circle[:3, 3:] - T_CAMERA_CIRCLE[:3, 3:]) for pose in poses]
    axes = [pose.T_camera_circle[:3, 2] @ T_CAMERA_CIRCLE[:3, 2] for pose in poses]
    assert min(off) < 1e-12
    assert abs(axes[int(np.argmin(off))]) == pytest.approx(1)
    for pose in poses:  # both give equal images
        assert project_circle(CAMERA, pose.T_camera_circle, RADIUS).numbers == pytest.approx(truth.numbers)


def test_an_uncertain_radius_moves_the_centre_along_the_sight():
    truth = project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS)
    pose = circle_poses(CAMERA, truth, RADIUS, 1e-4)[0]
    R, c = pose.T_camera_circle[:3, :3], pose.T_camera_circle[:3, 3]
    assert R @ pose.covariance[:3, :3] @ R.T == pytest.approx(np.outer(c, c) * (1e-4 / RADIUS) ** 2, abs=1e-12)
    assert R @ pose.covariance[:3, 5] == pytest.approx(c / RADIUS * 1e-8)
    assert pose.covariance[3:5, 3:5] == pytest.approx(np.zeros((2, 2)), abs=1e-18)


def test_features_pair_with_the_model_s_circle_and_centre():
    ellipse = fit_ellipse(arc(project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS), 360), np.full(60, 0.05))
    circles = image_circle(CAMERA, ellipse, RADIUS, T_world_camera=np.eye(4))
    line = image_centre(CAMERA, ellipse, T_world_camera=np.eye(4))
    model = ModelFeature(CIRCLE, T_CAMERA_CIRCLE, RADIUS)
    best = min(circles, key=lambda f: np.linalg.norm(f.T_world_feature[:3, 3] - T_CAMERA_CIRCLE[:3, 3]))
    assert best.radius == RADIUS
    assert Pairing(best, model).relation.sensed is CIRCLE
    off = np.cross(line.T_world_feature[:3, 0], T_CAMERA_CIRCLE[:3, 3] / np.linalg.norm(T_CAMERA_CIRCLE[:3, 3]))
    assert np.linalg.norm(off) < 4 * np.sqrt(np.diag(line.P)[2:].sum())
    with pytest.raises(InputError, match="expected its pose"):
        image_circle(CAMERA, ellipse, RADIUS)


def test_short_arcs_are_refused_with_the_reason():
    truth = project_circle(CAMERA, T_CAMERA_CIRCLE, RADIUS)
    with pytest.raises(DegenerateError, match=r"degrees of one. A semi-axis is known to .* Show more"):
        fit_ellipse(arc(truth, 40, np.random.default_rng(1)), np.full(60, 0.1))
    with pytest.raises(DegenerateError, match="one line"):
        fit_ellipse(np.stack([np.arange(20.0), 3 * np.arange(20.0)], axis=1), np.full(20, 0.1))
    with pytest.raises(InputError, match="6 or more"):
        fit_ellipse(np.zeros((4, 2)), np.ones(4))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tilts", "degrees"),
    [
        pytest.param((0, 0.15), 360, marks=pytest.mark.slow),
        ((0.2, 1.2), 360),
        pytest.param((0.3, 0.8), 150, marks=pytest.mark.slow),
    ],
)
def test_circles_and_rays_follow_their_stated_errors(tilts, degrees):
    rng, circles, rays = np.random.default_rng((2, degrees, int(100 * tilts[1]))), [], []
    for _ in range(60):
        turn, tilt = rng.uniform(0, 2 * np.pi), rng.uniform(*tilts)
        at = np.array([*rng.uniform(-0.03, 0.03, 2), rng.uniform(0.15, 0.25)])
        frame = SO3.frame_from_axis(-at / np.linalg.norm(at), 2)
        R = frame @ SO3.exp(tilt * np.array([np.cos(turn), np.sin(turn), 0.0]))
        try:
            found = fit_ellipse(
                arc(project_circle(CAMERA, SE3.from_parts(R, at), RADIUS), degrees, rng), np.full(60, 0.1)
            )
        except DegenerateError:
            continue
        z = []
        for pose in circle_poses(CAMERA, found, RADIUS):
            T = pose.T_camera_circle
            M = T[:3, :3].T @ R
            spin = SO3.axis_rotation(2, np.arctan2(M[0, 1] - M[1, 0], M[0, 0] + M[1, 1]))
            e = SE3.log(SE3.inverse(T) @ SE3.from_parts(R @ spin, at))[:5]
            z.append(e @ np.linalg.solve(pose.covariance[:5, :5], e))
        circles.append(min(z))
        line = image_centre(CAMERA, found, T_world_camera=np.eye(4))
        d = line.T_world_feature[:3, :3].T @ at / np.linalg.norm(at)
        rays.append(np.array([-d[2], d[1]]) @ np.linalg.solve(line.P[2:, 2:], np.array([-d[2], d[1]])))
    n = len(circles)
    assert n > 30
    assert 0.7 * chi2.ppf(0.001, 5 * n) < np.sum(circles)  # of two the nearer is taken
    # tails are longer than normal ones: that regions hold what they say is what counts
    assert np.sum(np.array(circles) < chi2.ppf(0.95, 5)) >= binom.ppf(0.001, n, 0.95)
    assert np.median(circles) < 1.3 * chi2.median(5)
    assert 0.5 * chi2.ppf(0.001, 2 * n) < np.sum(rays) < chi2.ppf(0.999, 2 * n)


def test_a_circle_seen_along_its_axis_is_one_of_unsure_tilt():
    along = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.15]))
    ellipse = fit_ellipse(arc(project_circle(CAMERA, along, RADIUS), 360, np.random.default_rng(2)), np.full(60, 0.1))
    [pose] = circle_poses(CAMERA, ellipse, RADIUS)
    sds = np.sqrt(np.diag(pose.covariance)[3:5])
    assert (sds > 0.01).all()
    assert (sds < 0.2).all()
    assert isinstance(image_circle(CAMERA, ellipse, RADIUS, T_world_camera=np.eye(4)), Feature)
    with pytest.raises(InputError, match="radius"):
        circle_poses(CAMERA, ellipse, -1.0)


@pytest.mark.parametrize("semi_axes", [(40.0, 28.0), (14.0, 10.0)])
def test_blur_does_not_shrink_what_is_found(semi_axes):
    camera = Camera(CAMERA.K, (128, 96), edge_sd=0.0)
    image = disc((96, 128), (61.3, 47.6), semi_axes, 1.5, np.random.default_rng(3))
    found = find_ellipses(camera, find_edges(image)).found
    assert len(found) == 1
    assert found[0].dark
    assert found[0].semi_axes == pytest.approx(semi_axes, abs=0.05)
    assert found[0].centre == pytest.approx([61.3, 47.6], abs=0.05)


@pytest.mark.parametrize(
    "function", [circle_poses, find_ellipses, fit_ellipse, image_centre, image_circle], ids=lambda f: f.__name__
)
def test_the_example_in_its_docstring_runs(function, monkeypatch):
    monkeypatch.chdir(Path(__file__).parents[2] / "examples")
    text, name = inspect.getdoc(function), function.__name__
    test = doctest.DocTestParser().get_doctest(text, {"tanteo": tanteo, "np": np}, name, name, 0)
    found = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(test)
    assert found.attempted and not found.failed  # noqa: PT018


def test_straight_edges_make_no_ellipses():
    image = np.full((96, 128), 180.0)
    image[30:70, 40:100] = 60.0
    found = find_ellipses(Camera(CAMERA.K, (128, 96)), find_edges(image))
    assert found.found == ()


@pytest.fixture(scope="module")
def flange(tmp_path_factory):
    return prepare_vision(as_part(drilled(), tmp_path_factory.mktemp("vision") / "flange.step"))


def test_samples_of_rims_are_on_their_circles(flange):
    frame = flange.frame
    own = np.any(frame.bends != 0, axis=1)
    radii = 1 / np.linalg.norm(frame.bends[own], axis=1)
    middle = frame.points[own] + frame.bends[own] * radii[:, None] ** 2
    assert own.sum() >= 24
    assert np.sum(frame.bends[own] * frame.tangents[own], axis=1) == pytest.approx(0, abs=1e-6)
    assert np.all(np.linalg.norm(middle - frame.points[own], axis=1) == pytest.approx(radii))


def test_holes_place_a_part_without_a_table(flange):
    camera = replace(table_camera(0.3, 30.0), edge_sd=0.0)
    T = SE3.from_parts(SO3.axis_rotation(2, 0.8), np.array([0.005, -0.01, 0.0])) @ flange.rests[0].T_table_part
    image, _ = render(Stage(camera, [rendered_part(flange.part, T, 110)]), np.random.default_rng(5))
    sight = see(image, replace(camera, T_world_camera=None), [flange])
    seen = sight.objects[0]
    assert seen.answer.status == "recognized"
    assert sum(name.startswith("hole") for name in seen.rims) >= 2
    off = SE3.log(SE3.inverse(seen.answer.hypotheses[0].T_world_part) @ SE3.inverse(camera.T_world_camera) @ T)
    assert np.linalg.norm(off[3:]) < np.radians(2)
