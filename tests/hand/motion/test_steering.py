"""Reductions of a commanded speed, by a robot with prescribed observations."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry.typing import Tangents
from tanteo.hand import FREE, HIT, LOST, NEAR, ForbiddenBox, HandReading, Workspace
from tanteo.hand.motion import Rules, Steering, approach, seen_surface
from tanteo.hand.twists import advance

AHEAD: Tangents = np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])


class Observation:
    """A robot at rest whose frontal sensors report what they are given: the same, or one range each."""

    latency, period = 0.02, 0.01

    def __init__(self, state, distance=np.nan):
        self.hand, self.commands = gripper(), []
        k = len(self.hand.rig.sensors)
        states, ranges = np.full(k, FREE), np.full(k, np.nan)
        states[list(self.hand.frontal)], ranges[list(self.hand.frontal)] = state, distance
        self.sensed = HandReading(0.0, np.eye(4), ranges, states)

    def step(self, twist):
        self.commands.append(twist)
        return self.sensed


def share(robot, rules, twist=AHEAD):
    steering = Steering("test", robot, rules)
    steering.step(twist)
    np.testing.assert_array_equal(robot.commands[-1], twist * steering.fraction)
    return steering.fraction


def test_what_is_too_near_for_a_range_stops_the_way_there():
    assert share(Observation(NEAR), Rules(0.01)) == 0.0
    assert share(Observation(NEAR), Rules(0.01), -AHEAD) == 1.0
    assert share(Observation(FREE), Rules(0.01)) == 1.0
    assert share(Observation(LOST), Rules(0.01)) == 1.0


def test_the_way_left_beyond_the_clearance_sets_the_speed():
    rules, robot = Rules(0.01), Observation(HIT)
    overhang = robot.hand.overhangs[list(robot.hand.frontal)].max()
    gain = Steering("test", robot, rules).loop.gain
    near = Observation(HIT, 0.01 + overhang + 0.002)
    assert share(near, rules) == pytest.approx(gain * 0.002 / 0.05, rel=1e-6)
    assert share(Observation(HIT, 0.01 + overhang - 1e-4), rules) == 0.0
    assert share(Observation(HIT, 0.01 + overhang + 0.06 / gain), rules) == 1.0


class Blinking(Observation):
    """A robot that follows its commands, before an object whose echo comes at every n-th reading only."""

    def __init__(self, distance, every):
        super().__init__(HIT, distance)
        self.distance, self.every, self.count = distance, every, 0

    def step(self, twist):
        self.count += 1
        T = advance(self.sensed.T_world_hand, twist, self.period)
        states, ranges = np.array(self.sensed.states), np.full(len(self.sensed.ranges), np.nan)
        pair = list(self.hand.frontal)
        echo = self.count % self.every == 0
        states[pair], ranges[pair] = (HIT, self.distance - T[2, 3]) if echo else (FREE, np.nan)
        self.sensed = HandReading(self.sensed.time + self.period, T, ranges, states)
        return self.sensed


def test_what_gives_an_echo_now_and_then_is_there():
    robot = Blinking(0.08, every=7)
    got = approach(robot, 0.02, Rules(0.012), reach=0.2)
    assert got.status == "reached"
    assert min(robot.distance - s.T_world_hand[2, 3] for s in got.log) > 0.95 * 0.02


def test_what_gives_no_echo_any_more_is_forgotten():
    robot = Blinking(0.08, every=1000)
    run = Steering("test", robot, Rules(0.01))
    for _ in range(20):
        run.step(AHEAD)
    gone = run.sensed.T_world_hand[2, 3]
    np.testing.assert_allclose(run.free_range[list(run.hand.frontal)], 0.08 - gone, atol=0.05 * robot.period * 1.01)
    for _ in range(40):
        run.step(0 * AHEAD)
    assert np.isinf(run.free_range).all()


def test_a_box_ahead_slows_the_body_and_one_in_its_back_not():
    robot = Observation(FREE)
    top = (robot.hand.body.centres[:, 2] + robot.hand.body.radii).max()
    for place, slowed in ((top + 0.0105, True), (-1.0, False)):
        box = ForbiddenBox("box", np.array([-1.0, -1.0, place]), np.array([1.0, 1.0, place + 0.1]))
        assert (share(Observation(FREE), Rules(0.01, Workspace.everywhere([box]))) < 1.0) is slowed


@pytest.mark.parametrize("tilt", [-0.6, 0.0, 0.3])
def test_height_and_tilt_are_those_of_plane_under_both_sensors(tilt):
    """A plane 50 mm from the middle between them, perpendicularly."""
    half = 0.5 * gripper().baseline
    ranges = 0.05 / np.cos(tilt) + np.array([-half, half]) * np.tan(tilt)
    height, angle, both = seen_surface(Steering("test", Observation(HIT, ranges), Rules(0.01)))
    assert both
    assert (height, angle) == (pytest.approx(0.05), pytest.approx(tilt))
