"""Zero errors of joints: one arm in two notations, angles from poses of the hand, and the joint that is off."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io.documents.arm_file import read_arm, read_joints
from tanteo.planning import Sensing, begin, check_cell, update
from tanteo.planning.start import at_pose
from tanteo.sensors import Readings
from tanteo.sensors.joints import joint_zeros

DH = """a_mm,alpha_deg,d_mm,theta_deg
0,90,89.2,0
-425,0,0,0
-392.3,0,0,0
0,90,109.2,0
0,-90,94.7,0
0,0,82.3,0
"""
"""Universal Robots UR5, nominal."""
ELBOW = np.radians([0, -90, 90, -90, -90, 0])
SD = 5e-5
TIP = np.array([0, 0, 0.1])


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "ur5.csv").write_text(DH)
    return read_arm(str(tmp_path / "ur5.csv"))


def urdf_of(arm):
    """Return the same arm as URDF, with the axes of its joints against y of their frames."""
    turn = SE3.from_parts(SO3.axis_rotation(0, -np.pi / 2), np.zeros(3))
    links, T = ['<robot name="r"><link name="base"/>'], np.eye(4)
    for k in range(len(arm.names) + 1):
        last = k == len(arm.names)
        T = T @ (arm.after if last else arm.before[k] @ turn)
        R, p = T[:3, :3], T[:3, 3]
        rpy = np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0])
        numbers = " ".join(f"{v:.15g}" for v in p), " ".join(f"{v:.15g}" for v in rpy)
        links.append(
            f'<link name="l{k}"/><joint name="j{k}" type="{"fixed" if last else "revolute"}"><axis xyz="0 -1 0"/>'
            f'<parent link="{f"l{k - 1}" if k else "base"}"/><child link="l{k}"/>'
            f'<origin xyz="{numbers[0]}" rpy="{numbers[1]}"/></joint>'
        )
        T = SE3.inverse(turn)
    return "".join([*links, "</robot>"])


def hands_of(arm, rng, count):
    q = ELBOW + rng.uniform(-0.4, 0.4, (count, 6))
    return q, arm.frames(q)[1]


def test_a_urdf_and_a_table_are_one_arm(arm, tmp_path):
    (tmp_path / "ur5.urdf").write_text(urdf_of(arm))
    other = read_arm(f"{tmp_path}/ur5.urdf#base/l6")
    q, hands = hands_of(arm, np.random.default_rng(1), 5)
    np.testing.assert_allclose(other.frames(q)[1], hands, atol=1e-9)
    np.testing.assert_allclose(other.frames(q)[0][..., :3, 2], arm.frames(q)[0][..., :3, 2], atol=1e-9)


def test_angles_follow_from_the_poses_of_the_hand(arm):
    q, hands = hands_of(arm, np.random.default_rng(2), 30)
    found, left = arm.solve(hands, ELBOW[None])
    assert left.max() < 1e-6
    np.testing.assert_allclose(found, q, atol=1e-5)


def scene(part, arm, rng, error, count=60):
    """Touches of a part before the arm, whose joint zeros are off by ``error`` [rad]."""
    triangles = part.vertices[part.triangles]
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(cross, axis=1)
    k = rng.choice(len(areas), count, p=areas / areas.sum())
    a, b = np.sort(rng.random((2, count)), axis=0)
    place = SE3.from_parts(np.eye(3), np.array([-0.5, -0.15, 0.2]))
    points = SE3.apply(place, np.einsum("ni,nij->nj", np.stack([a, b - a, 1 - b], axis=1), triangles[k]))
    ways = -cross[k] / areas[k, None]
    R = arm.frames(ELBOW[None])[1][0, :3, :3] @ SO3.exp(rng.normal(0, 0.3, (count, 3)))
    hands = SE3.from_parts(R, points - R @ TIP)
    q, left = arm.solve(hands, ELBOW[None])
    assert left.max() < 1e-6
    reported = arm.frames(q - error)[1]
    touched = SE3.apply(reported, np.broadcast_to(TIP, (count, 3)))
    return Readings.from_columns(
        touched + rng.normal(0, SD, (count, 3)), directions=ways, Ts_world_hand=reported
    ), place


def test_the_joint_that_is_off_is_named(arm, models):
    part = models["wedge"].part
    readings, place = scene(part, arm, np.random.default_rng(3), np.array([0, 0, 0.01, 0, 0, 0]))
    zeros = joint_zeros(arm, ELBOW[None], np.radians(0.1), readings.Ts_world_hand.values)
    sensing = Sensing(sd=SD, shared_errors=zeros)
    wide = np.diag([0.02] * 3 + [np.radians(10)] * 3) ** 2
    state = update(begin(at_pose(models["wedge"], place, wide)), *sensing.touches(readings))
    errors = check_cell(state, readings, sensing.measured).errors
    worst = min(errors, key=lambda error: error.p_value)
    assert worst.name == "zero of joint 3 (row 3)"
    assert worst.contradicted
    assert abs(worst.estimate[0] - 0.01) < 4 * worst.sd[0] + 5e-4
    assert errors[0].explained < 0.1  # the part's own pose is free, and so is a turn of the base


def test_an_arm_that_is_another_is_refused(arm, tmp_path):
    _, hands = hands_of(arm, np.random.default_rng(4), 3)
    hands[1, :3, 3] += 3.0
    with pytest.raises(InputError, match=r"poses of the hand that the arm reaches, got one that it misses"):
        joint_zeros(arm, ELBOW[None], 1e-3, hands)
    with pytest.raises(InputError, match="expected 6 joint values"):
        joint_zeros(arm, ELBOW[None, :5], 1e-3, hands)
    (tmp_path / "q.csv").write_text("j1_deg,j2_deg\n90,45\n")
    np.testing.assert_allclose(read_joints(str(tmp_path / "q.csv")), np.radians([[90, 45]]))
