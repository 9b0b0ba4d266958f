"""The camera: projection and rays are inverse, derivatives are derivatives, OpenCV agrees."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from rendered import table_camera
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.vision.camera import Camera, on_plane, project, project_linearized, rays, without_distortion
from tanteo.vision.rendering import RenderedObject, Stage, render

K = np.array([[620.0, 0, 317.0], [0, 615.0, 243.0], [0, 0, 1]])
LENSES = {
    "none": (),
    "brown": (-0.21, 0.09, 4e-4, -7e-4),
    "plumb_bob": (-0.21, 0.09, 4e-4, -7e-4, -0.02),
    "rational": (0.4, -0.2, 2e-4, 3e-4, 0.03, 0.6, -0.1, 0.02),
}


@pytest.fixture(params=LENSES, ids=str)
def camera(request):
    return Camera(K, (640, 480), np.array(LENSES[request.param]))


@pytest.fixture
def points():
    rng = np.random.default_rng(1)
    return np.concatenate([rng.uniform(-0.25, 0.25, (5, 40, 2)), rng.uniform(0.5, 1.0, (5, 40, 1))], axis=-1)


def test_projection_is_opencv_s(camera, points):
    expected = cv2.projectPoints(points.reshape(-1, 3), np.zeros(3), np.zeros(3), K, camera.distortion)[0]
    assert project(camera, points).reshape(-1, 2) == pytest.approx(expected.reshape(-1, 2), abs=1e-9)


def test_rays_go_back(camera, points):
    pixels = project(camera, points)
    assert rays(camera, pixels) == pytest.approx(points / points[..., 2:], abs=1e-9)
    ideal = points[..., :2] / points[..., 2:] * camera.focal + camera.centre
    assert without_distortion(camera, pixels) == pytest.approx(ideal, abs=1e-6)


def test_the_derivative_is_one(camera, points):
    pixels, D = project_linearized(camera, points)
    assert pixels == pytest.approx(project(camera, points), abs=1e-12)
    h = 1e-7
    for k, e in enumerate(np.eye(3)):
        difference = (project(camera, points + h * e) - project(camera, points - h * e)) / (2 * h)
        assert D[..., k] == pytest.approx(difference, rel=1e-5, abs=1e-3)


def test_a_point_in_the_back_has_no_pixel(camera):
    beyond = np.array([[0.1, 0.0, -1.0], [0.0, 0.1, 0.0], [0.0, 0.0, 1.0]])
    seen = project(camera, beyond)
    assert np.isnan(seen[:2]).all()
    assert seen[2] == pytest.approx(camera.centre)


def test_points_of_a_plane_are_found_again(camera):
    rng = np.random.default_rng(2)
    T = SE3.from_parts(SO3.exp(np.array([np.pi - 0.4, 0.1, 0.3])), np.array([0.02, -0.01, 0.8]))
    flat = np.concatenate([rng.uniform(-0.15, 0.15, (30, 2)), np.zeros((30, 1))], axis=1)
    pixels = project(camera, SE3.apply(T, flat))
    assert on_plane(camera, pixels, T) == pytest.approx(flat, abs=1e-9)


def test_a_ray_away_from_the_plane_has_no_point():
    camera = Camera(K, (640, 480))
    level = SE3.from_parts(SO3.exp(np.array([np.pi / 2, 0.0, 0.0])), np.array([0.0, 0.3, 0.0]))
    found = on_plane(camera, np.array([[317.0, 400.0], [317.0, 243.0], [317.0, 10.0]]), level)
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1:]).all()


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"K": np.eye(2)}, "K"),
        ({"K": -K}, "K"),
        ({"K": K + np.array([[0, 3.0, 0], [0, 0, 0], [0, 0, 0]])}, "skew"),
        ({"distortion": np.ones(3)}, "distortion"),
        ({"distortion": np.array([np.nan] * 4)}, "distortion"),
        ({"size": (0, 480)}, "size"),
        ({"T_world_camera": 2 * np.eye(4)}, "T_world_camera"),
        ({"edge_sd": -0.1}, "edge_sd"),
        ({"edge_sd": np.nan}, "edge_sd"),
    ],
)
def test_what_is_no_camera_is_refused(change, word):
    with pytest.raises(InputError, match=word):
        Camera(**{"K": K, "size": (640, 480), **change})


def test_an_object_that_reaches_beyond_the_lens_is_rendered():
    camera = table_camera(distance=0.1, tilt=80.0, size=(64, 48), focal=60.0)
    bar = RenderedObject.of_mesh(np.array([[-1, 0, 0], [1, 0, 0], [0, 0.02, 0], [0, 0, 0.02]]), np.arange(3)[None])
    value, whose = render(Stage(camera, [bar]), np.random.default_rng(0))
    assert np.isfinite(value).all()
    assert set(np.unique(whose)) <= {-1, 0}
