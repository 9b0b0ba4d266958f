"""Edges at which the surface only creases: where the planes of both faces meet."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from felt_scenes import bevelled, gripper, nees, roof
from tanteo.fitting import edge_from_planes
from tanteo.geometry import SE3, SO3
from tanteo.hand.acquisition import EdgeGuess, acquire_crease, features_of, sense_edge
from tanteo.hand.acquisition.run import SensingRun
from tanteo.hand.acquisition.scan import scan
from tanteo.hand.motion import Crease, Rules
from tanteo.hand.simulator import SimulatedHand, clearances


def over(y, height, turned=(0.0, 0.0, 0.0)):
    R = np.diag([1.0, -1.0, -1.0]) @ SO3.exp(np.array(turned))
    return SE3.from_parts(R, np.array([0.0, y, height]) - R @ gripper().front)


def felt(degrees, seed, standoff=0.02):
    scene = roof(math.radians(degrees))
    T = over(-0.02, standoff + 0.05, (0.05, 0.1, 0.2))
    robot = SimulatedHand(scene, gripper(), T, rng=np.random.default_rng(seed))
    guess = EdgeGuess([0, 0.004, 0.0], [-1, 0.1, 0], [0, 0.1, 1])
    got = sense_edge(robot, guess, standoff=standoff, rules=Rules(clearance=0.6 * standoff))
    assert clearances(scene, gripper().body, np.array(robot.truth)).min() > 0.5 * standoff
    return scene, got


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [35, pytest.param(75, marks=pytest.mark.slow)])
def test_the_edge_of_a_bend(degrees):
    scene, got = felt(degrees, seed=1)
    assert got.acquired, got.message
    assert "bends" in got.message
    assert nees(scene, got.feature)[0] < chi2.ppf(0.9999, 4)
    assert [f.label for f in got.others] == ["edge face", "edge other face"]
    planes, _ = features_of(got.readings, gripper().rig)
    again = edge_from_planes(*(planes[f.label] for f in got.others), got.feature.T_world_feature[:3, 3])
    np.testing.assert_allclose(again.P, got.feature.P, rtol=1e-9)


@pytest.mark.slow
def test_a_slight_bend_is_not_sensed_and_the_reason_is_given():
    _, got = felt(10, seed=0)
    assert got.status == "nothing"
    assert "bends away by about" in got.message
    assert "The face beyond it is not acquired. No flat face was seen" in got.message
    assert got.others[0].label == "edge face"


def test_planes_that_meet_elsewhere_are_of_another_edge():
    """The stated position of the bend is 10 mm off."""
    scene = roof(math.radians(45))
    robot = SimulatedHand(scene, gripper(), over(-0.03, 0.02), rng=np.random.default_rng(0))
    session = SensingRun(robot, 0.02, Rules(clearance=0.012), None)
    _, _, face = scan(session, "face", 0.015)
    bend = Crease(0, over(0.01, 0.02), 0.02, math.radians(45))
    status, message, edge = acquire_crease(session, face, np.array([0.0, 1.0, 0.0]), [bend], "edge")
    assert (status, edge) == ("unclear", None), message
    assert "mm beside the bend of the surface" in message.message


@pytest.mark.slow
def test_the_far_end_of_a_bevel_is_not_taken_for_edge_of_face():
    """Two millimetres of bevel; the same border without it is acquired (``test_acquisition``)."""
    robot = SimulatedHand(bevelled(0.002), gripper(), over(-0.02, 0.07), rng=np.random.default_rng(0))
    guess = EdgeGuess([0, 0, 0], [-1, 0, 0], [0, 0, 1])
    got = sense_edge(robot, guess, standoff=0.02, rules=Rules(clearance=0.012))
    assert got.status == "unclear", got.message
    assert "mm below the face: the border seems to be bevelled" in got.message
