"""Crossings stay within the space that is known to be free, and scans enlarge it."""

import numpy as np

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand.acquisition import crossings
from tanteo.hand.acquisition.crossings import Search, cross_at, known_way, pose_over, scan_above
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.scan import scan
from tanteo.hand.acquisition.ways import nearly_known
from tanteo.hand.motion import Rules, spiral_scan
from tanteo.hand.simulator import Scene, SimulatedHand, box, clearances

STANDOFF = 0.02
ALONG, OUTWARDS = np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
PLACE = np.array([0.06, 0.014, 0.0])
BLOCK = box("block", [0.0, 0.0, -0.05], [0.12, 0.08, 0.0])
POST = box("post", [0.03, -0.026, -0.05], [0.05, -0.018, 0.03])
"""Beyond the edge, before one finger, higher than its tip; no beam has been there."""


def over(x, y, height):
    R = np.diag([1.0, -1.0, -1.0])
    return SE3.from_parts(R, np.array([x, y, height]) - R @ gripper().front)


def beside_the_edge(*solids):
    """Return a session that has scanned only the block's top."""
    robot = SimulatedHand(
        Scene.of([BLOCK, *solids]), gripper(), over(0.06, 0.022, STANDOFF), rng=np.random.default_rng(0)
    )
    session = SensingRun(robot, STANDOFF, Rules(clearance=0.6 * STANDOFF), None)
    status, message, face = scan(session, "face", 0.0075)
    assert status == "acquired", message
    return session, face


def test_an_obstacle_beyond_the_edge_is_scanned_and_avoided():
    session, face = beside_the_edge(POST)
    T = pose_over(session, face, PLACE, ALONG)
    assert known_way(session, T, OUTWARDS, 0.05) < 0.02
    crossing = cross_at(session, face, PLACE, ALONG, OUTWARDS, Search(0.03, 0.04, 0.01))
    assert crossing.motion.status == "limit", crossing.motion.message
    assert "known free space ends" in crossing.motion.message
    assert "look" in [m.name for m in session.motions]
    least = clearances(Scene.of([BLOCK, POST]), gripper().body, np.array(session.robot.truth)).min()
    assert least > 0.5 * STANDOFF


def test_the_same_edge_without_a_post_is_crossed():
    session, face = beside_the_edge()
    crossing = cross_at(session, face, PLACE, ALONG, OUTWARDS, Search(0.03, 0.04, 0.01))
    assert crossing.motion.reached, crossing.motion.message
    assert crossing.seen == gripper().frontal


def test_scans_end_when_all_is_known_and_are_two_at_most(monkeypatch):
    """After a first look elsewhere, which is a small one."""
    session, face = beside_the_edge()
    assert session.does(spiral_scan(session.robot, 0.02, session.rules)).reached
    needed = pose_over(session, face, PLACE - 0.012 * ALONG, ALONG)[None]
    assert not nearly_known(session, needed)
    assert scan_above(session, face, needed).reached
    assert nearly_known(session, needed)
    scans = [m for m in session.motions if m.name == "look"]
    assert len(scans) == 1 + 1
    monkeypatch.setattr(crossings, "nearly_known", lambda *_: False)
    scan_above(session, face, needed)
    assert len([m for m in session.motions if m.name == "look"]) == 1 + 3
