"""Bores and bosses sensed by the hand: what is acquired is there, what is not there is not acquired."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from bore_scenes import plate, round_error, round_task, slot, solid, whole_covariance
from felt_scenes import gripper
from tanteo.errors import InputError
from tanteo.hand.acquisition import RoundGuess, features_of, sense_circle, sense_cylinder
from tanteo.hand.motion import Rules
from tanteo.hand.simulator import Cell, SimulatedHand, clearances
from tanteo.words.findings import OtherRim

SENSE = {"circle": sense_circle, "cylinder": sense_cylinder}
NEAR = 0.004, 0.05, 0.1
CELL = Cell(period=0.02)
"""Half as many commands and readings a second as usual, which halves the time of the simulation."""


def sensed(kind, task, seed=0):
    robot = SimulatedHand(task.scene, gripper(), task.T_world_hand, rng=np.random.default_rng(seed), cell=CELL)
    rules = Rules(clearance=0.6 * task.standoff, workspace=task.workspace)
    return SENSE[kind](robot, task.guess, standoff=task.standoff, rules=rules, label="it"), robot


@pytest.mark.slow
@pytest.mark.parametrize("convex", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_cylinder_is_sensed_without_contact(convex):
    rng = np.random.default_rng(5)
    task = round_task(rng, convex=convex, radius=0.035 if convex else 0.015, standoff=0.02, wrong=NEAR)
    got, robot = sensed("cylinder", task)
    assert got.acquired, got.message
    assert clearances(task.scene, gripper().body, np.array(robot.truth)).min() > 0.5 * task.standoff
    rim = next(f for f in got.others if f.kind.name == "circle")
    for feature in (got.feature, rim):
        error, C = round_error(feature, task.T_world_rim, task.radius), whole_covariance(feature)
        assert feature.convex is convex
        assert error @ np.linalg.solve(C, error) < chi2.ppf(0.9999, len(error))
    again, _ = features_of(got.readings, gripper().rig)
    assert np.array_equal(again["it"].T_world_feature, got.feature.T_world_feature)


def test_a_plain_face_has_no_bore():
    task = round_task(np.random.default_rng(1), radius=0.012, standoff=0.02, mesh=solid(), wrong=NEAR)
    got, _ = sensed("circle", task)
    assert got.status == "nothing"
    assert "no bore" in got.message


@pytest.mark.slow
def test_a_slot_is_no_bore():
    mesh = plate(slot(0.012, 0.024))
    got, _ = sensed("circle", round_task(np.random.default_rng(2), radius=0.012, standoff=0.02, mesh=mesh, wrong=NEAR))
    assert got.status == "unclear"
    assert got.feature is None


@pytest.mark.slow
def test_a_bore_of_another_size_is_another_bore():
    task = round_task(np.random.default_rng(3), radius=0.015, standoff=0.02, wrong=NEAR)
    task = replace(task, guess=replace(task.guess, radius=0.011, radius_share=0.04))
    got, _ = sensed("circle", task)
    assert got.status == "unclear"
    assert isinstance(got.finding, OtherRim)


@pytest.mark.parametrize("wrong", [{"radius": 0.0}, {"radius": np.nan}, {"radius": 0.01, "radius_share": 1.5}])
def test_a_guess_of_no_radius_is_refused(wrong):
    with pytest.raises(InputError, match="radius"):
        RoundGuess([0, 0, 0], [0, 0, 1], **wrong)


@pytest.mark.parametrize("corners", [3, 4, 5, 6])
def test_no_polygon_passes_for_a_circle_at_crossed_rims(corners):
    """Its harmonic at the sampled places is not that of a larger or slightly shifted circle."""
    count = sense_circle.__globals__["ENOUGH"]
    turn = np.radians(sense_circle.__globals__["ANGLES"][:count])
    circle = np.linalg.qr(np.column_stack([np.ones(count), np.cos(turn), np.sin(turn)]))[0]
    polygon = np.column_stack([np.cos(corners * turn), np.sin(corners * turn)])
    left = np.linalg.svd(polygon - circle @ (circle.T @ polygon), compute_uv=False)
    assert left.min() > 0.9 * np.sqrt(count / 2)
