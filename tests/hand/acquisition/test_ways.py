"""A first look swings the fingers no farther than the start is free."""

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand import Workspace
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.ways import SWING, scan_surroundings
from tanteo.hand.motion import Rules, go_to
from tanteo.hand.simulator import Scene, SimulatedHand, box, clearances

TILT, SPACING = 0.25, 0.09
STANDOFF = 0.02
OVER = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 0.18]))
"""The front of the hand is 80 mm above the table."""
TABLE = box("table", [-0.3, -0.3, -0.05], [0.3, 0.3, 0.0])


def session_on(*solids):
    scene = Scene.of([TABLE, *solids])
    robot = SimulatedHand(scene, gripper(), OVER, rng=np.random.default_rng(0))
    session = SensingRun(robot, STANDOFF, Rules(clearance=0.012, workspace=Workspace.above(0.0)), None)
    return session, scene


def farthest(log):
    """Return the largest displacement of any sphere of the body from its start [m]."""
    centres = gripper().body.placed(np.array([s.T_world_hand for s in log]))
    return float(np.linalg.norm(centres - centres[0], axis=-1).max())


def test_first_scans_swing_within_free_space_later_ones_more():
    session, _ = session_on()
    assert scan_surroundings(session, TILT, SPACING).reached
    assert scan_surroundings(session, TILT, SPACING).reached
    assert all(0.015 < farthest(motion.log) < SWING for motion in session.motions)
    shifted = SE3.from_parts(OVER[:3, :3], OVER[:3, 3] + [0.001, 0.0, 0.0])
    assert session.does(go_to(session.robot, shifted, session.rules)).reached
    assert scan_surroundings(session, TILT, SPACING).reached
    assert farthest(session.motions[-1].log) > 0.026


@pytest.mark.parametrize("angle", np.radians([20, 45, 70, 110]))
def test_a_corner_that_no_beam_meets_is_not_swung_into(angle):
    """A post beside the tips, as near as the start allows: its edge points at the hand, between the lateral beams."""
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    away = np.array([0.028 + SWING + STANDOFF / 2 + 0.006, 0.0]) @ R.T
    session, scene = session_on(box("post", [*(away - 0.004), 0.0], [*(away + 0.004), 0.094]))
    body = gripper().body
    assert clearances(scene, body, OVER[None])[0] > SWING + STANDOFF / 2
    scan_surroundings(session, TILT, SPACING)
    assert clearances(scene, body, np.array(session.robot.truth)).min() > STANDOFF / 2
