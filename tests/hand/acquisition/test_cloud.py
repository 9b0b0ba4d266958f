"""Hits as points with their uncertainty, and the clearance that they leave."""

import math

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand import Body
from tanteo.hand.acquisition.seen import Cloud, beside, clearance, cloud_of, over
from tanteo.hand.motion import Rules, spiral_scan
from tanteo.hand.simulator import Scene, SimulatedHand, box


def straight_down(points, with_hit=True, sd=4e-4, slope=0.0):
    """Beams from 50 mm above some points."""
    points = np.atleast_2d(np.asarray(points, dtype=float))
    n = len(points)
    beams = np.tile([0.0, 0.0, -1.0], (n, 1))
    ranges, ones = np.full(n, 0.05), np.ones(n)
    return Cloud(points - 0.05 * beams, beams, ranges, np.full(n, with_hit), sd * ones, slope * ones, np.full(n, True))


def test_clearance_is_from_the_skin_to_the_hits():
    body = Body(np.array([[0.0, 0, 0], [0.1, 0, 0]]), np.array([0.01, 0.02]), np.array([False, True]))
    poses = np.stack([np.eye(4), SE3.from_parts(np.eye(3), np.array([0.0, 0.0, 0.3]))])
    np.testing.assert_allclose(
        clearance(straight_down([0.1, 0.05, 0.0]), body, poses), [0.03, np.hypot(0.3, 0.05) - 0.02]
    )
    assert np.isinf(clearance(straight_down([0.1, 0.05, 0.0], with_hit=False), body, poses)).all()


@pytest.mark.parametrize("incidence", [0.0, 30.0, 60.0])
def test_deviations_are_those_of_a_point_anywhere_in_the_cone(incidence):
    """Draw where in its disc the echo comes from, and the noise of the range; heights over an oblique plane."""
    rng, n = np.random.default_rng(0), 200_000
    beta, slope, sd, distance = math.radians(incidence), math.tan(math.radians(5)), 3e-4, 0.05
    radius, turn = np.sqrt(rng.random(n)), 2 * math.pi * rng.random(n)
    heights = math.sin(beta) * distance * slope * radius * np.cos(turn) + math.cos(beta) * sd * rng.normal(size=n)
    stated = straight_down([0, 0, 0], sd=sd, slope=slope).deviations(np.array([math.cos(beta)]))
    assert heights.std() == pytest.approx(stated[0], rel=0.01)


def test_over_and_beside_a_plane():
    """At 4 mm above, on it within the noise, 4 mm below."""
    cloud = straight_down([[0, 0, 0.004], [0.01, 0, 0.001], [0.02, 0, -0.004]])
    above, off = (f(cloud, np.zeros(3), np.array([0.0, 0.0, 1.0])) for f in (over, beside))
    np.testing.assert_allclose(above.points[:, 0], [0.0], atol=1e-12)
    np.testing.assert_allclose(off.points[:, 0], [0.0, 0.02], atol=1e-12)


def test_only_forward_beams_without_a_hit_are_kept():
    """Lateral ones reach too short a way to say where a face ends."""
    scene = Scene.of([box("plate", [-0.02, -0.2, -0.02], [0.2, 0.2, 0.0])])
    R = np.diag([1.0, -1.0, -1.0])
    start = SE3.from_parts(R, np.array([0.0, 0.0, 0.06]) - R @ gripper().front)
    robot = SimulatedHand(scene, gripper(), start, rng=np.random.default_rng(0))
    cloud = cloud_of(gripper(), [spiral_scan(robot, 0.25, Rules(clearance=0.012))])
    assert cloud.ahead[~cloud.hit].all()
    assert (~cloud.hit).any()
