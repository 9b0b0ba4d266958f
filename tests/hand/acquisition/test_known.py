"""What was seen free, what was taken, and that nothing unseen is run into."""

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3, SO3
from tanteo.hand import Workspace
from tanteo.hand.acquisition import FaceGuess, sense_plane
from tanteo.hand.acquisition.seen import CELL, GAP, Known, cells_of, middles_of
from tanteo.hand.motion import Rules, spiral_scan
from tanteo.hand.simulator import Scene, SimulatedHand, box, clearances

RULES = Rules(clearance=0.012, workspace=Workspace.above(0.0))
TABLE = Scene.of([box("table", [-0.3, -0.3, -0.05], [0.3, 0.3, 0.0])])


def over(x=0.0, y=0.0, height=0.08, turn=0.0):
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.axis_rotation(2, turn)
    return SE3.from_parts(R, np.array([x, y, height]) - R @ gripper().front)


def robot_on(scene, T, seed=0):
    return SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(seed))


def test_a_beam_has_a_free_path():
    """One instant over a table: two frontal beams down to it, four to the sides as far as they reach."""
    robot = robot_on(TABLE, over())
    known = Known(gripper(), [robot.sensed])
    beside, below = 0.8 * GAP, np.array([-0.02, 0.0, 0.04])
    assert known.has(below)
    assert known.has(below + np.array([0.0, beside, 0.0]))
    assert not known.has(below + np.array([0.0, 1.5 * GAP, 0.0]))
    assert not known.has(np.array([-0.02, 0.0, -0.01]))  # behind what it met
    side = SE3.apply(robot.truth[0], gripper().origins[3] + 0.1 * gripper().axes[3])
    assert known.has(side)
    assert not known.has(side + 0.03 * robot.truth[0][:3, :3] @ gripper().axes[3])  # beyond its reach


def test_a_beam_without_a_range_has_no_information():
    robot = robot_on(TABLE, over(height=0.001))  # too near for a range
    known = Known(gripper(), [robot.sensed])
    assert not known.has(np.array([-0.02, 0.0, -0.004]))


def test_what_was_known_stays_known():
    first, second = (robot_on(TABLE, over(x=x)).sensed for x in (0.0, 0.15))
    before = Known(gripper(), [first])
    both = Known(gripper(), [second], before)
    for x in (0.0, 0.15):
        assert both.has(np.array([x - 0.02, 0.0, 0.04]))
        assert both.has(gripper().body.placed(over(x=x))[0])
    assert not before.has(np.array([0.13, 0.0, 0.04]))


def test_where_the_hand_was_is_known():
    known = Known(gripper(), [robot_on(TABLE, over()).sensed])
    body = gripper().body
    for T, there in ((over(), True), (over(x=0.1), False)):
        centres = body.placed(T)[:3]  # towards the tip of one finger; the other's palm is elsewhere
        assert known.has(centres + np.array([0.007, 0.0, 0.0])).all() == there


def test_a_scan_frees_its_own_space_and_no_more():
    robot = robot_on(TABLE, over())
    before = Known(gripper(), [robot.sensed])
    assert not before.holds(gripper().body, over(x=0.005, y=0.005)[None], 0.0)
    known = Known(gripper(), spiral_scan(robot, 0.22, RULES, spacing=0.05).log)
    near = np.stack([over(height=0.08, y=0.004), *(over(height=h) for h in (0.03, 0.04, 0.05, 0.08))])
    assert known.holds(gripper().body, near, 0.0)
    assert not known.holds(gripper().body, over(x=0.06)[None], 0.0)
    assert not known.holds(gripper().body, over(y=0.06)[None], 0.0)
    assert not known.holds(gripper().body, over(height=0.03)[None], 0.05)
    # one pose that is not known is enough
    assert not known.holds(gripper().body, np.stack([near[0], over(x=0.06)]), 0.0)


@pytest.mark.parametrize(
    ("away", "turn"),
    [(0.05, 0.5), *(pytest.param(*at, marks=pytest.mark.slow) for at in ((0.04, 1.2), (0.04, 2.0), (0.05, 2.0)))],
)
def test_a_post_that_no_beam_hit_is_avoided(away, turn):
    """A post of 10 mm beside the place, higher than the hand's tips come: each of these was run at before."""
    foot = np.array([0.06, 0.04]) + away * np.array([np.cos(turn), np.sin(turn)])
    scene = Scene.of(
        [
            box("block", [-0.02, -0.04, 0.0], [0.14, 0.12, 0.05]),
            box("post", [*(foot - 0.005), 0.05], [*(foot + 0.005), 0.1]),
        ]
    )
    robot = robot_on(scene, over(0.06, 0.04, 0.12, turn=0.2))
    got = sense_plane(robot, FaceGuess([0.06, 0.04, 0.05], [0, 0, 1]), standoff=0.02, rules=RULES)
    assert got.status in ("acquired", "limit")
    assert clearances(scene, gripper().body, np.array(robot.truth)).min() > 0.5 * 0.02


def test_every_cell_that_holds_a_point_counts_once():
    points = np.random.default_rng(3).normal(scale=0.01, size=(5000, 3))
    expected = np.unique(np.round(points / CELL), axis=0) * CELL
    np.testing.assert_allclose(middles_of(cells_of(points)), expected, atol=1e-12)
    assert len(middles_of(cells_of(np.zeros((0, 3))))) == 0
