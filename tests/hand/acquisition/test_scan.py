"""A scan: several planes are not taken for one, and a small clearance makes the scan narrower."""

import math

import numpy as np
import pytest

from felt_scenes import gripper, nees, roof
from tanteo.geometry import SE3, SO3
from tanteo.hand import Workspace
from tanteo.hand.acquisition import FaceGuess, sense_plane
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.scan import WIDTHS, scan
from tanteo.hand.motion import Rules, go_to, retreat, spiral_scan
from tanteo.hand.simulator import Scene, SimulatedHand, box, clearances
from tanteo.words.findings import Followed, NoSpace, NotOneFeature

STANDOFF = 0.027
RULES = Rules(clearance=0.6 * STANDOFF)


def over(y, turn, tilt=0.0, height=STANDOFF):
    """Return the pose of the hand over (0, y), rotated about its axis and then tilted about x."""
    R = SO3.axis_rotation(0, tilt) @ np.diag([1.0, -1.0, -1.0]) @ SO3.axis_rotation(2, turn)
    return SE3.from_parts(R, np.array([0.0, y, height]) - R @ gripper().front)


@pytest.mark.parametrize("degrees", [15, 22])
def test_two_lines_along_a_bend_are_no_plane(degrees):
    """One sensor on each side of it, scanned along it: the two rows of readings are in one plane that is not there."""
    bend = math.radians(degrees)
    for seed in range(2):
        T = over(0.001, math.pi / 2, -0.5 * bend)
        robot = SimulatedHand(roof(bend), gripper(), T, rng=np.random.default_rng(seed))
        session = SensingRun(robot, STANDOFF, RULES, None)
        status, message, feature = scan(session, "plane", WIDTHS[0])
        assert (status, feature, session.readings) == ("unclear", None, [])
        assert isinstance(message, NotOneFeature)


def test_beside_a_bend_the_plane_is_that_of_its_own_side():
    scene = roof(math.radians(22))
    robot = SimulatedHand(scene, gripper(), over(-0.025, 0.0), rng=np.random.default_rng(0))
    session = SensingRun(robot, STANDOFF, RULES, None)
    status, _, feature = scan(session, "plane", WIDTHS[0])
    assert status == "acquired"
    assert nees(scene, feature)[0] < 20
    assert len(session.readings[0]) == 80


def test_in_a_trench_the_scan_is_narrower():
    """Fingers of 8 mm and a clearance of 12 mm between walls 37 mm away leave no space for 15 mm to each side."""
    walls = [box("left", [-0.1, 0.037, 0], [0.1, 0.06, 0.015]), box("right", [-0.1, -0.06, 0], [0.1, -0.037, 0.015])]
    scene = Scene.of([box("floor", [-0.1, -0.06, -0.02], [0.1, 0.06, 0.0]), *walls])
    robot = SimulatedHand(scene, gripper(), over(0.0, 0.1, height=0.07), rng=np.random.default_rng(2))
    rules = Rules(clearance=0.012, workspace=Workspace.above(-0.02))
    got = sense_plane(robot, FaceGuess([0, 0, 0], [0, 0, 1]), standoff=0.016, rules=rules)
    assert got.acquired, got.message
    paths = {m.finding.distance for m in got.motions if isinstance(m.finding, Followed)}
    assert 0.0075 in paths
    assert 0.015 not in paths
    assert clearances(scene, gripper().body, np.array(robot.truth)).min() > 0.008


def test_the_hand_turns_square_where_clearance_is_known():
    """Ten degrees move the upper ends of the fingers by 15 mm, where no beam has been; after a scan they may."""
    scene = Scene.of([box("plate", [-0.1, -0.1, -0.02], [0.1, 0.1, 0.0])])
    T = over(0.0, 0.0, height=0.03) @ SE3.exp([0, 0, 0, 0, math.radians(10), 0])
    robot = SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(0))
    session = SensingRun(robot, STANDOFF, RULES, None)
    status, message, _ = scan(session, "plane", WIDTHS[0])
    assert (status, session.motions) == ("limit", [])
    assert isinstance(message, NoSpace)
    assert retreat(robot, 0.05, RULES).reached
    session.does(spiral_scan(robot, 0.3, RULES, spacing=0.05))
    assert session.does(go_to(robot, T, RULES)).reached
    status, message, _ = scan(session, "plane", WIDTHS[0])
    assert status == "acquired", message
