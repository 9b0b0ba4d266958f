"""What every simulated robot does, on an arm or not: the interface :class:`tanteo.hand.Robot` and its laws."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand.motion import Rules, go_to
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, box
from tanteo.hand.simulator.arm import ArmMotion, read_arm
from tanteo.hand.twists import advance, translation_twist

DOWN = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.25]))
TABLE = Scene.of([box("table", [-0.5, -0.5, -0.05], [0.5, 0.5, 0.0])])
BASE = SE3.from_parts(np.eye(3), np.array([-0.45, 0.0, 0.0]))


def above(centres, radii):
    """Return whether links are above the table."""
    return (centres[..., 2] - radii).min(axis=-1) > 0.01


@pytest.fixture(params=["hand", "ur5e"])
def make(request):
    """Return a function that makes a robot."""
    if request.param == "ur5e":
        pytest.importorskip("mujoco", reason="an arm needs tanteo[sim]")

    def made(seed=0, **cell):
        hand = gripper()
        carrier = None
        if request.param == "ur5e":
            carrier = ArmMotion(read_arm("ur5e", hand, BASE), DOWN, free=above, solids=TABLE.solids)
        rng = np.random.default_rng(seed)
        return SimulatedHand(TABLE, hand, DOWN, rng=rng, cell=Cell(**cell), carrier=carrier)

    return made


def test_a_twist_moves_the_hand_in_its_own_frame(make):
    robot, expected = make(latency=0.0), DOWN
    twist = np.array([0.02, -0.05, 0.03, 0.1, 0.2, -0.15])
    for _ in range(50):
        sensed = robot.step(twist)
        expected = advance(expected, twist, 0.01)
    np.testing.assert_allclose(sensed.T_world_hand, expected, atol=2e-4)


def test_motion_starts_after_the_latency(make):
    robot = make(latency=0.037)
    for k in range(1, 31):
        sensed = robot.step(translation_twist([0.05, 0, 0]))
        assert sensed.T_world_hand[0, 3] == pytest.approx(0.05 * max(k * 0.01 - 0.037, 0.0), abs=1e-5)


def test_a_seed_gives_one_run(make):
    twist = np.array([0.05, 0.02, 0, 0, 0.1, 0])
    runs = [[robot.step(twist).ranges for _ in range(10)] for robot in (make(3), make(3))]
    np.testing.assert_array_equal(*runs)


def test_a_robot_at_rest_stays(make):
    robot = make()
    first = robot.sensed.T_world_hand
    for _ in range(20):
        sensed = robot.step(np.zeros(6))
    np.testing.assert_allclose(sensed.T_world_hand, first, atol=1e-9)
    assert sensed.time == pytest.approx(20 * robot.period)
    assert sensed.ranges.shape == sensed.states.shape == (len(robot.hand.origins),)


@pytest.mark.parametrize("twist", [np.full(6, np.nan), np.zeros(5)])
def test_commands_are_six_finite_numbers(make, twist):
    with pytest.raises((InputError, ValueError)):
        make().step(twist)


def test_a_motion_arrives(make):
    robot = make(latency=0.0)
    goal = DOWN @ SE3.exp(np.array([0.05, 0.08, 0.02, 0.1, -0.1, 0.3]))
    motion = go_to(robot, goal, Rules(clearance=0.012))
    assert motion.reached
    np.testing.assert_allclose(robot.sensed.T_world_hand[:3, 3], goal[:3, 3], atol=2e-3)
