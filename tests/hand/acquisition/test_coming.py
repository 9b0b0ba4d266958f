"""Approaches of the hand before its first scan."""

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand.acquisition import FaceGuess
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.ways import come_near
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Scene, SimulatedHand, box

TABLE = Scene.of([box("table", [-0.3, -0.3, -0.05], [0.3, 0.3, 0.0])])


@pytest.mark.parametrize(
    ("height", "standoff", "comes_to"),
    [
        (0.09, 0.02, None),  # well within the range of 120 mm
        (0.1, 0.04, None),  # near its end, but 80 mm is as near as it would come
        (0.1, 0.02, 0.06),
        (0.125, 0.055, 0.11),  # out of range
        (0.2, 0.02, 0.06),
    ],
)
def test_it_comes_nearer_where_that_shows_more(height, standoff, comes_to):
    R = np.diag([1.0, -1.0, -1.0])
    T = SE3.from_parts(R, np.array([0.0, 0.0, height]) - R @ gripper().front)
    robot = SimulatedHand(TABLE, gripper(), T, rng=np.random.default_rng(0))
    session = SensingRun(robot, standoff, Rules(clearance=0.6 * standoff), None)
    motion = come_near(session, FaceGuess([0.0, 0.0, 0.0], [0, 0, 1]))
    if comes_to is None:
        assert motion is None
        assert session.motions == []
        return
    assert motion.reached
    front = SE3.apply(robot.truth[-1], gripper().front)
    np.testing.assert_allclose(front, [0, 0, comes_to], atol=2e-3)
