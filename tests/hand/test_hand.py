"""Twists against the exponential, bodies, workspaces, and what a hand must have."""

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import Body, Hand, gripper_body
from tanteo.hand.twists import advance, point_velocities, pose_difference, rotation_twist, translation_twist
from tanteo.io import read_rig
from tanteo.sensors import Rig


@pytest.fixture(scope="module")
def rig():
    return read_rig("paper-gripper")


@pytest.mark.parametrize("size", [1e-9, 1e-5, 1e-3, 0.3, 3.0])
def test_advance_is_the_exponential(size):
    rng = np.random.default_rng(0)
    for _ in range(50):
        T, twist = SE3.exp(rng.normal(size=6)), size * rng.normal(size=6)
        np.testing.assert_allclose(advance(T, twist, 0.7), T @ SE3.exp(0.7 * twist), atol=1e-14)


def test_gap_is_what_is_missing():
    rng = np.random.default_rng(1)
    for _ in range(50):
        a, b = SE3.exp(rng.normal(size=(2, 6)))
        p, w = pose_difference(a, b)
        D = SE3.inverse(a) @ b
        np.testing.assert_allclose(p, D[:3, 3], atol=1e-14)
        np.testing.assert_allclose(w, SO3.log(D[:3, :3]), atol=1e-9)
    np.testing.assert_allclose(pose_difference(a, a)[1], 0, atol=1e-15)


@pytest.mark.parametrize("axis", range(3))
def test_gap_of_half_a_turn(axis):
    half = SE3.from_parts(SO3.axis_rotation(axis, np.pi), np.zeros(3))
    w = pose_difference(np.eye(4), half)[1]
    np.testing.assert_allclose(SO3.exp(w), half[:3, :3], atol=1e-9)


def test_turn_leaves_its_pivot_where_it_is():
    rng = np.random.default_rng(2)
    pivot, rate = rng.normal(size=(2, 3))
    np.testing.assert_allclose(point_velocities(pivot[None], rotation_twist(rate, pivot)), 0, atol=1e-15)
    T = advance(np.eye(4), rotation_twist(rate, pivot), 0.5)
    np.testing.assert_allclose(SE3.apply(T, pivot), pivot, atol=1e-14)


def test_velocities_of_points_against_differences():
    rng = np.random.default_rng(3)
    points, twist, h = (
        rng.normal(size=(4, 3)),
        translation_twist([1, 2, 3]) + rotation_twist([0.3, -0.2, 0.5], np.zeros(3)),
        1e-6,
    )
    moved = [SE3.apply(advance(np.eye(4), twist, s * h), points) for s in (1, -1)]
    np.testing.assert_allclose(point_velocities(points, twist), (moved[0] - moved[1]) / (2 * h), atol=1e-8)


def test_the_body_covers_the_sensors(rig):
    body = gripper_body(rig)
    for sensor in rig.sensors:
        if sensor.T_hand_sensor[2, 2] > 0.9:
            d = np.linalg.norm(body.centres - sensor.T_hand_sensor[:3, 3], axis=1) - body.radii
            assert abs(d.min()) < 1e-12  # a frontal sensor is the front of its finger


def test_the_body_moves_with_the_hand(rig):
    rng = np.random.default_rng(4)
    body, T = gripper_body(rig), SE3.exp(rng.normal(size=(5, 6)))
    for k in range(5):
        np.testing.assert_allclose(body.placed(T)[k], SE3.apply(T[k], body.centres), atol=1e-14)


@pytest.mark.parametrize(
    ("centres", "radii"),
    [(np.zeros((2, 3)), [1.0]), (np.zeros((1, 2)), [1.0]), (np.zeros((1, 3)), [0.0]), ([[np.nan, 0, 0]], [1.0])],
)
def test_bodies_that_are_none(centres, radii):
    with pytest.raises(InputError, match="body: expected"):
        Body(np.array(centres), np.array(radii))


def test_a_hand_has_its_frontal_pair(rig):
    hand = Hand(rig, gripper_body(rig))
    assert [rig.sensors[i].name for i in hand.frontal] == ["front_left", "front_right"]
    np.testing.assert_allclose(hand.pair, [1, 0, 0], atol=1e-12)
    assert hand.baseline == pytest.approx(0.04)
    np.testing.assert_allclose(hand.front, [0, 0, 0.1], atol=1e-12)


def test_a_hand_needs_two_frontal_sensors(rig):
    with pytest.raises(InputError, match="expected two sensors along"):
        Hand(Rig(rig.sensors[1:]), gripper_body(rig))
    with pytest.raises(InputError, match="expected a sensor along"):
        gripper_body(Rig(rig.sensors[2:]))
