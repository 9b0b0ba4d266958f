"""Expected information of a view: of the pose as the image gives it, of the part where edges differ."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.vision import Camera, prepare_vision, see
from tanteo.vision.camera import Mounting
from tanteo.vision.expected import expected_information
from tanteo.vision.rendering import Stage, render, rendered_part
from vision_scenes import PARTS, looking

K = np.array([[1000.0, 0, 319.5], [0, 1000.0, 239.5], [0, 0, 1]])
WIDE = np.diag(np.repeat(np.square([0.01, np.radians(5.0)]), 3))
T = SE3.from_parts(SO3.exp(np.array([0.4, -0.5, 0.3])), np.array([0.4, 0.1, 0.3]))


@pytest.fixture(scope="module")
def part():
    return read_part(PARTS / "step_12mm.step")


def camera_from(way, part, away=0.5):
    middle = SE3.apply(T, part.centroid)
    way = np.asarray(way) / np.linalg.norm(way)
    return Camera(K, (640, 480), T_world_camera=looking(middle + away * way, middle))


def test_the_pose_gains_what_an_image_gives(part):
    camera = camera_from([0.4, 0.3, 1.0], part)
    gain, share = expected_information([(prepare_vision(part), T, WIDE)], np.ones(1), camera)
    pixels, _ = render(Stage(camera, [rendered_part(part, T, 120)]), np.random.default_rng(0))
    best = see(pixels, camera, [part], on_table=False).objects[0].answer.best
    given = 0.5 * (np.linalg.slogdet(WIDE)[1] - np.linalg.slogdet(best.covariance)[1])
    assert gain == pytest.approx(given, abs=4.0)  # of some 20 nats: two thirds of a digit in each direction
    assert 0.2 < share < 1.0


def test_errors_of_the_mounting_lessen_the_gain(part):
    camera, known = camera_from([0.4, 0.3, 1.0], part), [(prepare_vision(part), T, WIDE)]
    gains = [
        expected_information(known, np.ones(1), replace(camera, mounting=Mounting(np.eye(4), sd**2 * np.eye(6))))[0]
        for sd in (1e-5, 1e-3, 1e-2)
    ]
    assert gains == sorted(gains, reverse=True)
    assert gains[2] < 0.6 * gains[0]


def test_what_is_known_exactly_gains_nothing(part):
    gain, _ = expected_information(
        [(prepare_vision(part), T, 1e-16 * np.eye(6))], np.ones(1), camera_from([0, 0.1, 1], part)
    )
    assert gain == pytest.approx(0.0, abs=1e-3)


def test_a_view_past_the_part_shows_nothing(part):
    camera = camera_from([0.4, 0.3, 1.0], part)
    turned = replace(camera, T_world_camera=camera.T_world_camera @ SE3.exp(np.array([0, 0, 0, 0, 1.5, 0])))
    gain, share = expected_information([(prepare_vision(part), T, WIDE)], np.ones(1), turned)
    assert (gain, share) == (0.0, 0.0)


def test_parts_differ_where_their_edges_differ(part):
    """Two steps of 12 and 15 mm in exactly known poses: the step is in sight from above, hidden from below."""
    other = read_part(PARTS / "step_15mm.step")
    exact = 1e-16 * np.eye(6)
    both = [(prepare_vision(one), T, exact) for one in (part, other)]
    up = T[:3, 2]
    across = T[:3, 0]
    above, below = (
        expected_information(both, np.array([0.5, 0.5]), camera_from(way, part))[0]
        for way in (up + 0.4 * across, -up + 1e-3 * across)
    )
    assert above > 0.5
    assert above <= np.log(2) + 1e-9  # one of two
    assert below < 0.5 * above
    same = [(prepare_vision(part), T, exact)] * 2
    assert expected_information(same, np.array([0.5, 0.5]), camera_from(up + 0.4 * across, part))[0] < 1e-3
