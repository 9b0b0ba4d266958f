"""Motions over simulated surfaces: where they end, what they say, and that nothing is touched."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.hand.motion import (
    Rules,
    align,
    aligned_pose,
    approach,
    cross_edge,
    crossing_sd,
    follow,
    go_to,
    retreat,
    spiral_scan,
)
from tanteo.hand.simulator import Cell, Scene, SimulatedHand, Solid, box, clearances
from tanteo.hand.twists import advance, rotation_twist

STANDOFF = 0.02
RULES = Rules(clearance=0.012)
PLATE = Scene.of([box("plate", [-0.1, -0.1, -0.02], [0.1, 0.1, 0.0])])


def over(x=0.0, y=0.0, height=0.06, tilt=(0.0, 0.0, 0.0)):
    """Return the pose of the hand that points down, its front above a place, rotated about its front."""
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.exp(np.array(tilt))
    return SE3.from_parts(R, np.array([x, y, height]) - R @ gripper().front)


def robot_on(scene, T, seed=0, latency=0.03):
    return SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(seed), cell=Cell(latency=latency))


def front_of(robot):
    T = robot.truth[-1]
    return T[:3, :3] @ gripper().front + T[:3, 3]


def least(scene, robot):
    return clearances(scene, gripper().body, np.array(robot.truth)).min()


@pytest.mark.parametrize("latency", [0.0, 0.03, 0.1])
def test_an_approach_stops_at_the_standoff(latency):
    robot = robot_on(PLATE, over(), latency=latency)
    motion = approach(robot, STANDOFF, RULES, reach=0.1)
    assert motion.status == "reached"
    assert front_of(robot)[2] == pytest.approx(STANDOFF, abs=2.5e-3)
    assert least(PLATE, robot) > 0.5 * STANDOFF
    assert motion.log[0].time == 0
    assert motion.seconds == pytest.approx(0.01 * (len(robot.truth) - 1))


def test_an_approach_to_nothing():
    robot = robot_on(PLATE, over(x=0.3))
    assert approach(robot, STANDOFF, RULES, reach=0.03).status == "nothing"
    assert 0.03 < 0.06 - front_of(robot)[2] < 0.04


def test_an_approach_to_what_gives_no_ranges():
    robot = robot_on(PLATE, over(height=0.03, tilt=(0, math.radians(75), 0)))
    assert approach(robot, STANDOFF, RULES, reach=0.1).status == "lost"


def test_an_approach_keeps_to_the_workspace():
    rules = Rules(clearance=0.012, workspace=Workspace.above(0.02))
    robot = robot_on(PLATE, over())
    motion = approach(robot, STANDOFF, rules, reach=0.1)
    assert motion.status == "limit"
    assert "workspace" in motion.message
    assert front_of(robot)[2] > 0.032 - 1e-6


@pytest.mark.parametrize("latency", [0.0, 0.03, 0.1])
@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_the_palm_keeps_out_of_a_forbidden_box(latency, turned):
    """Nothing is there to be seen: the box alone stops a hand whose palm goes towards it, straight or swinging."""
    T_world_box = SE3.from_parts(SO3.axis_rotation(2, turned), np.array([0.12, 0.0, 0.0]))
    rail = ForbiddenBox("rail", np.array([-0.02, -0.1, 0.12]), np.array([0.02, 0.1, 0.3]), T_world_box)
    rules = Rules(clearance=0.012, workspace=Workspace.everywhere([rail]))
    for goal in (over(x=0.1), over(tilt=(0.0, -1.2, 0.0))):
        robot = robot_on(PLATE, over(), latency=latency)
        motion = go_to(robot, goal, rules)
        assert motion.status == "limit"
        assert "'rail'" in motion.message
        least = rules.workspace.clear(gripper().body, np.array(robot.truth)).min()
        assert 0.0115 < least < 0.014
    robot = robot_on(PLATE, over(x=0.075), latency=latency)
    assert rules.workspace.clear(gripper().body, robot.truth[0]) < 0.012
    assert go_to(robot, over(), rules).reached  # away from a box is free


def test_an_approach_takes_no_longer_than_it_may():
    rules = Rules(clearance=0.012, timeout=0.2)
    assert approach(robot_on(PLATE, over()), STANDOFF, rules, reach=0.1).status == "timeout"


def test_a_lateral_sensor_stops_the_hand():
    scene = Scene.of(
        [box("plate", [-0.2, -0.2, -0.02], [0.2, 0.2, 0.0]), box("wall", [0.06, -0.2, 0], [0.1, 0.2, 0.2])]
    )
    robot = robot_on(scene, over(height=STANDOFF))
    motion = follow(robot, [1, 0, 0], 0.06, STANDOFF, RULES)
    assert motion.status == "limit"
    assert "side_right" in motion.message
    assert least(scene, robot) > 0.5 * STANDOFF


@pytest.mark.parametrize("tilt", [-0.5, -0.1, 0.0, 0.3, 0.5])
def test_alignment_is_square_in_the_plane_of_the_pair(tilt):
    robot = robot_on(PLATE, over(height=0.03, tilt=(0, tilt, 0)))
    assert align(robot, STANDOFF, RULES).reached
    assert abs(math.asin(robot.truth[-1][2, 0])) < math.radians(2)
    assert front_of(robot)[2] == pytest.approx(STANDOFF, abs=2.5e-3)
    assert least(PLATE, robot) > 0.5 * STANDOFF


def test_the_end_pose_of_an_alignment_is_predicted():
    robot = robot_on(PLATE, over(height=0.03, tilt=(0, 0.3, 0)))
    expected = aligned_pose(gripper(), robot.sensed, STANDOFF)
    assert align(robot, STANDOFF, RULES).reached
    off = SE3.log(SE3.inverse(expected) @ robot.sensed.T_world_hand)
    assert np.linalg.norm(off[3:]) < math.radians(2)
    assert np.linalg.norm(SE3.apply(expected, gripper().front) - front_of(robot)) < 2e-3
    assert aligned_pose(gripper(), robot_on(PLATE, over(x=0.1)).sensed, STANDOFF) is None


def test_alignment_needs_both_sensors():
    assert align(robot_on(PLATE, over(x=0.1)), STANDOFF, RULES).status == "lost"


@pytest.mark.parametrize("latency", [0.0, 0.05, 0.1])
@pytest.mark.parametrize("bend", [-45, 45])
def test_following_over_a_bend(bend, latency):
    """A flat that goes over into a slope, outwards and inwards: the clearance is kept, the tilt is taken."""
    slope = SE3.from_parts(SO3.axis_rotation(1, math.radians(bend)), np.zeros(3))
    plates = [box("flat", [-0.1, -0.1, -0.02], [0, 0.1, 0]), box("slope", [0, -0.1, -0.02], [0.2, 0.1, 0], slope)]
    scene = Scene.of(plates)
    robot = robot_on(scene, over(x=-0.05, height=STANDOFF), latency=latency)
    motion = follow(robot, [1, 0, 0], 0.13, STANDOFF, RULES)
    assert motion.reached
    assert least(scene, robot) > 0.5 * STANDOFF
    assert math.degrees(math.asin(-robot.truth[-1][2, 0])) == pytest.approx(bend, abs=3)


@pytest.mark.parametrize("bend", [60, 25])
def test_following_a_flat_face_ends_where_it_bends_away(bend):
    """A scan keeps farther from a ridge than following over it would."""
    slope = SE3.from_parts(SO3.axis_rotation(1, math.radians(bend)), np.zeros(3))
    plates = [box("flat", [-0.1, -0.1, -0.02], [0, 0.1, 0]), box("slope", [0, -0.1, -0.02], [0.2, 0.1, 0], slope)]
    scene = Scene.of(plates)
    robot = robot_on(scene, over(x=-0.05, height=STANDOFF))
    motion = follow(robot, [1, 0, 0], 0.13, STANDOFF, RULES, max_tilt=math.radians(6))
    assert motion.status == "lost"
    assert "bent away after" in motion.message
    assert least(scene, robot) > 0.65 * STANDOFF
    assert -0.04 < front_of(robot)[0] < 0.0


def test_alignment_does_not_turn_into_a_step():
    """One sensor over a face, the other over the floor of a slot beside it: the hand stays out of it."""
    solids = [box("floor", [-0.2, -0.2, -0.09], [0.2, 0.2, -0.05]), box("block", [-0.1, -0.1, -0.05], [0.005, 0.1, 0])]
    scene = Scene.of(solids)
    robot = robot_on(scene, over(height=STANDOFF))
    motion = align(robot, STANDOFF, RULES, max_tilt=math.radians(25))
    assert motion.status == "lost"
    assert "not over one surface" in motion.message
    assert least(scene, robot) > 0.9 * STANDOFF


def test_following_ends_with_the_surface():
    robot = robot_on(PLATE, over(x=0.06, height=STANDOFF))
    motion = follow(robot, [1, 0, 0], 0.1, STANDOFF, RULES)
    assert motion.status == "lost"
    assert 0.078 < front_of(robot)[0] < 0.088  # the leading sensor is 20 mm ahead
    assert follow(robot_on(PLATE, over(x=0.3)), [1, 0, 0], 0.1, STANDOFF, RULES).status == "lost"
    with pytest.raises(InputError, match="direction: expected one across"):
        follow(robot, [0, 0, 1], 0.1, STANDOFF, RULES)


def test_edge_events_are_unbiased_and_follow_their_variance():
    """The true edge is the reference; the errors that each unit keeps are removed by the scatter of one unit."""
    standard = []
    for seed in range(30):
        robot = robot_on(PLATE, over(x=0.0, y=0.08 + 0.0002 * (seed % 7), height=STANDOFF), seed=seed)
        crossing = cross_edge(robot, [0, -1, 0], 0.05, STANDOFF, RULES)
        assert crossing.motion.status == "reached"
        assert crossing.seen == gripper().frontal
        assert [event.outwards for event in crossing.events] == [True, False, True, False]
        for event in crossing.events:
            true = robot._units.T_hand_sensors[event.sensor]
            T = event.T_world_hand @ true
            at = T[:3, 3] + T[2, 3] / -T[2, 2] * T[:3, 2]
            standard.append((at[1] - 0.1) / event.across_sd)
    low, high = chi2.ppf([0.001, 0.999], len(standard))
    assert low < np.sum(np.square(standard)) < high
    assert abs(np.mean(standard)) < 3.3 / math.sqrt(len(standard))


def test_another_edge_beside_crossing_does_not_shift_an_event():
    """A few readings of a long way miss at the side edge: they are no part of the crossing."""
    spot = STANDOFF * math.tan(math.radians(5))
    off, sds = [], []
    for seed in range(16):
        robot = robot_on(PLATE, over(x=0.08 - 0.85 * spot, y=0.05, height=STANDOFF), seed=seed)
        for event in cross_edge(robot, [0, -1, 0], 0.08, STANDOFF, RULES).events:
            T = event.T_world_hand @ robot._units.T_hand_sensors[event.sensor]
            if event.sensor == 1:
                off.append((T[:3, 3] + T[2, 3] / -T[2, 2] * T[:3, 2])[1] - 0.1)
                sds.append(event.across_sd)
    assert len(off) > 8
    assert abs(np.mean(off)) < 1.0 * np.mean(sds)


def test_the_sd_of_an_event_against_its_integral():
    """Draw the readings of a crossing themselves."""
    rng = np.random.default_rng(0)
    stride, spot, n = 0.07, 1.0, 40_000
    starts = -3.0 - stride * rng.random(n)
    places = starts[:, None] + stride * np.arange(90)
    radius, angle = np.sqrt(rng.random(places.shape)), 2 * np.pi * rng.random(places.shape)
    hit = places + spot * radius * np.cos(angle) < 0
    estimates = starts - 0.5 * stride + stride * hit.sum(axis=1)
    assert abs(estimates.mean()) < 5 * crossing_sd(stride, spot) / math.sqrt(n)
    assert estimates.std() == pytest.approx(crossing_sd(stride, spot), rel=0.02)


def test_a_crossing_without_an_edge():
    crossing = cross_edge(robot_on(PLATE, over(height=STANDOFF)), [0, 1, 0], 0.02, STANDOFF, RULES)
    assert (crossing.motion.status, crossing.events) == ("nothing", ())
    beside = cross_edge(robot_on(PLATE, over(x=0.3, height=STANDOFF)), [0, 1, 0], 0.02, STANDOFF, RULES)
    assert beside.motion.status == "lost"


def test_a_wall_is_no_edge():
    scene = Scene.of(
        [box("plate", [-0.2, -0.2, -0.02], [0.2, 0.2, 0.0]), box("wall", [-0.2, 0.06, 0], [0.2, 0.1, 0.2])]
    )
    robot = robot_on(scene, over(height=STANDOFF))
    crossing = cross_edge(robot, [0, -1, 0], 0.08, STANDOFF, RULES)
    assert (crossing.motion.status, crossing.events) == ("limit", ())
    assert least(scene, robot) > 0.5 * STANDOFF


def test_back_along_the_axis():
    robot = robot_on(PLATE, over(height=STANDOFF))
    assert retreat(robot, 0.04, RULES).reached
    assert front_of(robot)[2] == pytest.approx(STANDOFF + 0.04, abs=2e-3)


def test_to_a_pose():
    robot = robot_on(PLATE, over())
    begin = over(x=0.05, y=-0.03, height=0.05, tilt=(0.2, -0.1, 0))
    target = advance(begin, rotation_twist(np.array([0.0, 0.0, 1.2]), gripper().front), 1.0)
    assert go_to(robot, target, RULES).reached
    off = SE3.log(SE3.inverse(robot.sensed.T_world_hand) @ target)
    assert np.linalg.norm(off[3:]) < 4e-3
    assert np.linalg.norm(front_of(robot) - SE3.apply(target, gripper().front)) < 1e-3
    below = over(height=-0.02)
    assert go_to(robot, below, RULES).status == "limit"
    assert least(PLATE, robot) > 0.5 * STANDOFF


def test_a_scan_returns_and_sweeps_a_full_circle():
    robot = robot_on(PLATE, over())
    motion = spiral_scan(robot, 0.25, RULES)
    assert motion.reached
    assert np.linalg.norm(front_of(robot) - [0, 0, 0.06]) < 2e-3
    tilts = [math.acos(-s.T_world_hand[2, 2]) for s in motion.log]
    assert 0.2 < max(tilts) < 0.27
    sides = np.array([(s.T_world_hand[:3, :3] @ gripper().axes[2:].T)[:2] for s in motion.log])
    azimuths = np.sort(np.arctan2(sides[:, 1], sides[:, 0]).ravel())
    assert np.diff(azimuths).max() < math.radians(15)
    assert spiral_scan(robot_on(PLATE, over(height=0.5)), 0.1, RULES).status == "nothing"


@pytest.mark.parametrize("name", ["clearance", "speed", "turn", "patience", "timeout"])
def test_rules_must_be_positive(name):
    with pytest.raises(InputError, match=f"{name}: expected a positive number"):
        Rules(**({"clearance": 0.01} | {name: 0.0}))


def test_a_slanted_solid_is_hit_at_its_place():
    """The truth of a tilted plate, felt square: its own frame is found again."""
    T = SE3.from_parts(SO3.axis_rotation(1, 0.3), np.array([0, 0, 0.01]))
    plate = box("plate", [-0.1, -0.1, -0.02], [0.1, 0.1, 0.0])
    scene = Scene.of([Solid.at("plate", plate.vertices, plate.triangles, T)])
    robot = robot_on(scene, over())
    assert approach(robot, STANDOFF, RULES, reach=0.1).reached
    assert align(robot, STANDOFF, RULES).reached
    assert math.asin(-robot.truth[-1][2, 0]) == pytest.approx(0.3, abs=0.03)
