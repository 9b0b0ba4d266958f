"""Where a surface bends away instead of ending, a crossing reports the bend and no edge."""

import math

import numpy as np
import pytest

from felt_scenes import gripper, roof
from tanteo.geometry import SE3, SO3
from tanteo.hand.motion import STEEP, Rules, Track, cross_edge
from tanteo.hand.simulator import Scene, SimulatedHand, box


def crossing(scene, standoff=0.02, seed=0):
    """Return a motion from 15 mm before y = 0 across it."""
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.exp(np.array([0.01, -0.01, 0.0]))
    T = SE3.from_parts(R, np.array([0.0, -0.015, standoff]) - R @ gripper().front)
    robot = SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(seed))
    return cross_edge(robot, [0, -1, 0], 0.05, standoff, Rules(clearance=0.6 * standoff))


def across(event):
    """Return where the sensor's beam hit the surface, across the edge [m]."""
    local = gripper().origins[event.sensor] + event.distance * gripper().axes[event.sensor]
    return SE3.apply(event.T_world_hand, local)[1]


@pytest.mark.parametrize("degrees", [15, 30, 60])
@pytest.mark.parametrize("standoff", [0.012, 0.035])
def test_a_bend_is_no_edge(degrees, standoff):
    got = crossing(roof(math.radians(degrees)), standoff)
    assert (got.motion.status, got.events) == ("nothing", ())
    assert "bends away by about" in got.motion.message
    assert math.degrees(np.median([b.angle for b in got.creases])) == pytest.approx(degrees, abs=8)
    assert abs(np.median([across(b) for b in got.creases])) < 0.1 * standoff + 0.002
    assert {b.sensor for b in got.creases} <= set(gripper().frontal)


def test_a_bend_that_gives_no_ranges_is_steep():
    got = crossing(roof(math.radians(78)))
    assert (got.motion.status, got.events) == ("nothing", ())
    assert "too steeply" in got.motion.message
    assert {b.angle for b in got.creases} == {STEEP}
    assert max(abs(across(b)) for b in got.creases) < 0.002


@pytest.mark.parametrize("step", [0.005, 0.03])
def test_a_step_is_an_edge(step):
    """Beyond it the surface is farther at once, and goes on level."""
    low = box("low", [-0.1, -0.01, -0.05], [0.1, 0.1, -step])
    got = crossing(Scene.of([box("high", [-0.1, -0.1, -0.05], [0.1, 0.0, 0.0]), low]))
    assert got.motion.reached
    assert got.creases == ()
    assert max(abs(across(e)) for e in got.events) < 0.002


def test_a_track_ends_where_all_readings_are_off():
    """One millimetre from reading to reading: on up to 9, a single one at 12, then off, or without ranges."""
    ways = 1e-3 * np.arange(30)
    on = (np.arange(30) < 10) | (np.arange(30) == 12)
    Ts = np.broadcast_to(np.eye(4), (30, 4, 4)).copy()
    Ts[:, 0, 3] = ways
    drops = Track(Ts, ways, np.where(on, 0.02, np.nan), on, ~on, ~on & False)
    assert drops.last_on(0.005) == 12
    assert drops.last_on(0.002) is None  # not enough readings to call it an edge
    assert drops.last_on(0.025) is None  # the leg ends before
    lost = Track(Ts, ways, np.where(on, 0.02, np.nan), on, ~on & False, ~on)
    assert lost.last_on(0.005) is None
    assert lost.last_on(0.005, blindly=True) == 12
    np.testing.assert_allclose(drops.pose_at(0.0123)[:3, 3], [0.0123, 0, 0], atol=1e-12)
