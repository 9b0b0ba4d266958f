"""An arm that carries the hand: kinematics, limits, reach, and contacts of its links."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand.simulator import box
from tanteo.hand.simulator.arm import ArmMotion, read_arm

pytest.importorskip("mujoco", reason="an arm needs tanteo[sim]")

BASE = SE3.from_parts(np.eye(3), np.array([-0.45, 0.0, 0.0]))
DOWN = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.25]))


@pytest.fixture(scope="module")
def arm():
    return read_arm("ur5e", gripper(), BASE)


@pytest.fixture
def motion(arm):
    return ArmMotion(arm, DOWN, free=lambda centres, radii: (centres[..., 2] - radii).min(axis=-1) > 0.01)


def dh(a, alpha, d, theta):
    """Return the transform of one row of Denavit-Hartenberg parameters."""
    turn, twist = SE3.exp(np.array([0, 0, d, 0, 0, theta])), SE3.exp(np.array([a, 0, 0, alpha, 0, 0]))
    return turn @ twist


def test_the_flange_follows_published_parameters(arm):
    rows = [
        (0, np.pi / 2, 0.1625), (-0.425, 0, 0), (-0.3922, 0, 0), (0, np.pi / 2, 0.1333), (0, -np.pi / 2, 0.0997),
        (0, 0, 0.0996),
    ]  # fmt: skip
    back = (gripper().body.centres[:, 2] - gripper().body.radii).min()
    for q in np.random.default_rng(0).uniform(-3, 3, (20, 6)):
        T = BASE
        for (a, alpha, d), theta in zip(rows, q, strict=True):
            T = T @ dh(a, alpha, d, theta)
        hand = arm.frames(q)[-1]
        flange = hand @ SE3.exp(np.array([0, 0, back, 0, 0, 0]))
        np.testing.assert_allclose(flange[:3, :3], T[:3, :3], atol=1e-9)
        gap = flange[:3, 3] - T[:3, 3]
        assert np.linalg.norm(gap) == pytest.approx(0.005, abs=1e-9)  # the gap between flange and palm


def test_the_jacobian_is_the_derivative(arm):
    q = np.random.default_rng(1).uniform(-2, 2, (5, 6))
    frames = arm.frames(q)
    J = arm.jacobian(frames)
    for k in range(6):
        moved = arm.frames(q + 1e-6 * (np.arange(6) == k))[:, -1]
        np.testing.assert_allclose(SE3.log(SE3.inverse(frames[:, -1]) @ moved) / 1e-6, J[:, :, k], atol=1e-5)


def test_solved_angles_reach_the_pose_within_limits(arm):
    rng = np.random.default_rng(2)
    goals = arm.frames(rng.uniform(-2.5, 2.5, (100, 6)))[:, -1]
    q, ok = arm.solve(goals, rng.uniform(-2.5, 2.5, (100, 6)))
    assert ok.mean() > 0.5
    assert ((q >= arm.low) & (q <= arm.high)).all()
    gaps = SE3.log(SE3.inverse(arm.frames(q[ok])[:, -1]) @ goals[ok])
    assert np.abs(gaps).max() < 2e-3


def test_reach_ends_where_the_arm_does(motion):
    poses = np.repeat(DOWN[None], 3, axis=0)
    poses[:, 0, 3] = [0.1, 1.0, -0.45]  # near, beyond the arm, inside its base
    assert motion.reaches(poses).tolist() == [True, False, False]


def test_obstacles_of_links_exclude_poses(motion):
    assert motion.reaches(DOWN[None]).all()
    assert not motion.reaches(DOWN[None], lambda centres, radii: np.zeros(centres.shape[0], dtype=bool)).any()


def test_a_path_is_followed_or_refused_as_a_whole(motion):
    path = np.repeat(DOWN[None], 30, axis=0)
    path[:, 0, 3] = np.linspace(0, 0.15, 30)
    assert motion.follows(path)
    path[:, 0, 3] = np.linspace(0, 1.5, 30)
    assert not motion.follows(path)


def test_the_controller_keeps_and_counts_speeds(motion):
    T = motion.carry(DOWN, np.array([3.0, 0, 0, 0, 0, 0]), 0.1)
    assert 0 < T[0, 3] < 0.3
    assert motion.stops == {"speed of a joint": 1}


def test_a_link_in_a_solid_is_a_contact(arm):
    wall = box("wall", [-0.5, -0.5, 0.3], [0.5, 0.5, 0.9])  # where the forearm is
    motion = ArmMotion(arm, DOWN, solids=[wall])
    motion.carry(DOWN, np.array([0.01, 0, 0, 0, 0, 0]), 0.01)
    assert {solid for _, solid in motion.contacts} == {"wall"}
    clear = ArmMotion(arm, DOWN, solids=[box("far", [3, 3, 3], [4, 4, 4])])
    clear.carry(DOWN, np.array([0.01, 0, 0, 0, 0, 0]), 0.01)
    assert not clear.contacts


def test_what_is_no_arm_is_refused(arm):
    with pytest.raises(InputError, match="expected ur5e"):
        read_arm("robbie", gripper(), BASE)
    with pytest.raises(InputError, match="in the reach of the ur5e"):
        ArmMotion(arm, SE3.from_parts(DOWN[:3, :3], np.array([3.0, 0, 0.2])))
