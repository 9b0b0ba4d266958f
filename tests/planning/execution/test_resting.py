"""Readings at rest are averaged where they agree; furniture is separated from parts, and its readings are kept."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3
from tanteo.hand import FREE, HIT, LOST, HandReading
from tanteo.hand.simulator import Scene, box
from tanteo.planning import Furniture, begin
from tanteo.planning.execution import PossiblePoses, as_readings, beyond_furniture, of_parts
from tanteo.planning.start import at_pose
from tanteo.sensors import error_model, measure

HAND = gripper()
FIRST, SECOND = HAND.frontal
ABOVE = SE3.from_parts(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 0.15])
"""The fingertips are 50 mm over the table."""


def log(first, second, T=ABOVE):
    """Return readings of the frontal sensors; NaN is a free-space ray, minus one a lost echo."""
    out = []
    for a, b in zip(first, second, strict=True):
        ranges, states = np.full(len(HAND.origins), np.nan), np.full(len(HAND.origins), LOST)
        for i, value in ((FIRST, a), (SECOND, b)):
            states[i] = FREE if np.isnan(value) else LOST if value < 0 else HIT
            ranges[i] = value if value > 0 else np.nan
        out.append(HandReading(0.0, T, ranges, states))
    return out


def test_readings_that_agree_are_one_with_less_noise():
    rng = np.random.default_rng(1)
    sd = float(error_model(HAND.rig).law.sigma(np.full(len(HAND.origins), 0.04))[FIRST])
    means, stated = [], []
    for _ in range(300):
        readings = as_readings(HAND, log(0.04 + sd * rng.normal(size=10), [-1] * 10), "1")
        assert readings.ids == ("1.1",)
        means.append(readings.ranges[0])
        stated.append(readings.sds[0])
    # the variance of 300 means is known to 8 percent (1 sd)
    assert np.var(means) / np.mean(stated) ** 2 == pytest.approx(1, abs=0.3)


def test_readings_over_an_edge_are_used_one_by_one():
    readings = as_readings(HAND, log([0.04, 0.07] * 5, [0.05] * 10), "1")
    assert len(readings) > 3
    assert {0.04, 0.07} <= set(np.round(readings.ranges, 6))
    assert not readings.sds.given[readings.ranges[:] != 0.05].any()


def test_a_mean_over_a_low_step_is_of_neither_face():
    """3 mm is less than the beam's spot is wide, and the only difference between two parts of the examples."""
    readings = as_readings(HAND, log([0.04] * 5 + [0.043] * 5, [-1] * 10), "1")
    assert set(np.round(readings.ranges, 6)) == {0.04, 0.043}


def test_free_beams_are_used_and_lost_ones_are_not():
    readings = as_readings(HAND, log([np.nan] * 10, [-1] * 10), "1")
    assert readings.is_free.tolist() == [True]
    assert readings.sensors == (HAND.rig.sensors[FIRST].name,)
    assert as_readings(HAND, log([-1] * 10, [-1] * 10), "1") is None


@pytest.mark.parametrize("hit_rays", [1, 4, 9])
def test_a_beam_that_passes_an_edge_is_neither_free_nor_a_touch(hit_rays):
    """The axis of the beam may meet what most of its drawn rays miss."""
    both = as_readings(HAND, log([0.04] * hit_rays + [np.nan] * (10 - hit_rays), [0.05] * 10), "1")
    assert both.sensors == (HAND.rig.sensors[SECOND].name,)
    assert not both.is_free.any()


def test_side_beams_are_used_only_where_the_part_may_be(targets):
    """A bracket is possible 60 mm to the right of the hand; what the beam to the left meets is no part."""
    states, ranges = np.full(len(HAND.origins), FREE), np.full(len(HAND.origins), np.nan)
    names = [sensor.name for sensor in HAND.rig.sensors]
    for name, value in (("side_left", 0.05), ("side_right", 0.06)):
        states[names.index(name)], ranges[names.index(name)] = HIT, value
    readings = as_readings(HAND, [HandReading(0.0, ABOVE, ranges, states)] * 10, "1")
    assert set(readings.sensors) == set(names)
    box = targets[0].part.box
    tip = ABOVE @ HAND.rig.sensors[names.index("side_right")].T_hand_sensor
    place = tip[:3, 3] + 0.06 * tip[:3, 2] - [box[0, 0], box[:, 1].mean(), box[:, 2].mean()]
    for away, used in ((0.0, True), (0.2, False)):
        T = SE3.from_parts(np.eye(3), place + np.array([away, 0.0, 0.0]))
        possible = PossiblePoses(tuple(targets[:1]), np.zeros(1, dtype=np.int64), T[None])
        kept = of_parts(HAND, readings, possible)
        assert ("side_right" in kept.sensors) is used
        assert {"front_left", "front_right"} <= set(kept.sensors)
        assert "side_left" not in kept.sensors
    states[list(HAND.frontal)] = LOST
    sides = HandReading(0.0, ABOVE, ranges, states)
    assert of_parts(HAND, as_readings(HAND, [sides], "2"), possible) is None


def test_beams_to_furniture_are_free_as_far_as_it():
    furniture = Furniture(Scene.of([box("table", [-1, -1, -0.05], [1, 1, 0])]).surface)
    readings = as_readings(HAND, log([0.05] * 10, [0.02] * 10), "1")
    of_it = furniture.hit(readings, HAND.rig, None)
    assert of_it.tolist() == [True, False]
    used = beyond_furniture(readings, of_it, HAND.rig)
    assert used.is_free.tolist() == [True, False]
    assert 0.03 < used.max_ranges[0] < 0.05
    assert len(measure(used, rig=HAND.rig).free) == 1
    none = furniture.hit(as_readings(HAND, log([np.nan] * 3, [0.02] * 3), "2"), HAND.rig, None)
    assert not none.any()
    assert beyond_furniture(readings, np.zeros(2, dtype=bool), HAND.rig) is readings


TABLE = Furniture(Scene.of([box("table", [-1, -1, -0.05], [1, 1, 0])]).surface)


def tilted_hand(tilt):
    """Return a hand whose first frontal sensor hits the table at 80 mm at an angle [deg], and its beam."""
    turn = SE3.exp(np.r_[np.zeros(3), 0.0, np.radians(tilt), 0.0])
    T = turn @ ABOVE
    axis = T[:3, :3] @ HAND.axes[FIRST]
    T[2, 3] += 0.08 * -axis[2] - SE3.apply(T, HAND.origins[FIRST])[2]
    return T, axis


def nearest(axis):
    """Return the axial reading of the ray of the cone that hits the table first."""
    slope, half = np.arccos(-axis[2]), error_model(HAND.rig).beam_half_angle[FIRST]
    return 0.08 * np.cos(slope) / np.cos(slope - half) * np.cos(half)


@pytest.mark.parametrize("tilt", [0.0, 40.0, 65.0])
def test_any_ray_of_a_flat_cone_may_have_hit_the_furniture(tilt):
    """The ray nearest to the table gives the shortest range; a point 8 mm higher is of something else."""
    T, axis = tilted_hand(tilt)
    for sooner, of_it in ((0.0, True), (0.008 / -axis[2], False)):
        readings = as_readings(HAND, log([nearest(axis) - sooner] * 10, [-1] * 10, T), "1")
        assert TABLE.hit(readings, HAND.rig, None).tolist() == [of_it]


@pytest.mark.parametrize(("offset", "unknown", "of_it"), [(0.0, 0.02, False), (0.2, 0.02, True), (0.0, 0.95, True)])
def test_a_reading_near_table_is_of_part_that_is_expected_there(targets, offset, unknown, of_it):
    """And of the table where the part is elsewhere, or where it is most probably another one."""
    T, axis = tilted_hand(65.0)
    readings = as_readings(HAND, log([nearest(axis)] * 10, [-1] * 10, T), "1")
    origin, part = SE3.apply(T, HAND.origins[FIRST]), targets[2].part
    place = origin + nearest(axis) * axis - part.centroid
    sooner = targets[2].surface.cast(origin - place, axis).distances
    T_world_part = SE3.from_parts(np.eye(3), place + (nearest(axis) - sooner) * axis + np.array([0.0, offset, 0.0]))
    state = begin(at_pose(targets[2], T_world_part, np.diag(np.repeat([1e-6, 1e-4], 3))))
    assert TABLE.hit(readings, HAND.rig, None, replace(state, unknown=unknown)).tolist() == [of_it]
