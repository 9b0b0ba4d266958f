"""Messages in their order: used once when their frames are known; unusable ones are counted by reason."""

from __future__ import annotations

import time
from types import SimpleNamespace

import numpy as np
import pytest

from tanteo import io
from tanteo.errors import InputError, ReadingsError
from tanteo.geometry import SE3, SO3
from tanteo.ros import Intake, Patience

T_HAND_SENSOR = SE3.from_parts(SO3.axis_rotation(1, np.pi / 2), np.array([0.01, 0.02, 0.03]))
TF, RANGE, POINT, POSE = "tf2_msgs/msg/TFMessage", io.documents.RANGE, io.documents.POINT, io.documents.POSE


def hand(t):
    return SE3.exp((t - 100.0) * np.array([0.05, 0.02, -0.01, 0.1, 0.2, 0.3]))


def objects(fields):
    """Dictionaries as objects with these attributes, as messages are."""
    if isinstance(fields, dict):
        return SimpleNamespace(**{name: objects(value) for name, value in fields.items()})
    return [objects(one) for one in fields] if isinstance(fields, list) else fields


def ns(t):
    return round(1e9 * t)


def frame(t, T, parent="base", child="hand"):
    return objects(io.documents.transform(T, parent, child, ns(t)))


def reading(t, distance, frame="sensor"):
    header = io.documents.ros_header(ns(t), frame)
    return objects({"header": header, "range": distance, "min_range": 0.02, "max_range": 0.5, "variance": 0.0})


def touch(t, place, frame="base"):
    x, y, z = place
    return objects({"header": io.documents.ros_header(ns(t), frame), "point": {"x": x, "y": y, "z": z}})


def listening(*topics, options=None, **patience):
    intake = Intake(options or io.RosOptions(), io.readings.Stated(), Patience(start=0.0, **patience))
    for topic, kind in topics:
        intake.register(topic, kind)
    return intake


@pytest.fixture
def moving():
    """A hand that moves, heard of from 100 s to 101 s."""
    intake = listening(("/tf", TF), ("/tf_static", TF), ("/range", RANGE))
    intake.take("/tf_static", 100.0, frame(0.0, T_HAND_SENSOR, "hand", "sensor"))
    for t in np.arange(100.0, 101.01, 0.1):
        intake.take("/tf", t, frame(t, hand(t)))
    return intake


def test_a_range_is_placed_at_its_stamp(moving):
    moving.take("/range", 100.6, reading(100.55, 0.2))
    finished = moving.ready(101.0)
    T = hand(100.55) @ T_HAND_SENSOR
    assert np.allclose(finished.points[0], T[:3, 3] + 0.2 * T[:3, 0], atol=1e-6)
    assert moving.world == "base"
    assert moving.latest == pytest.approx(100.55)
    assert moving.ready(101.0) is None


def test_nothing_is_extrapolated_but_waited_for(moving):
    moving.take("/range", 101.06, reading(101.05, 0.2))
    assert moving.ready(101.07) is None
    moving.take("/tf", 101.1, frame(101.1, hand(101.1)))
    assert len(moving.ready(101.1)) == 1


def test_patience_ends(moving):
    moving.take("/range", 101.51, reading(101.5, 0.2))
    assert moving.ready(101.9) is None
    assert moving.ready(102.6) is None
    assert dict(moving.drop_counts()) == {"no transform at its stamp": 1}
    moving.take("/tf", 102.7, frame(101.6, hand(101.6)))
    assert moving.ready(102.7) is None


def test_late_and_strange_stamps_are_counted(moving):
    moving.take("/range", 111.0, reading(100.5, 0.2))
    moving.take("/range", 100.6, reading(108.0, 0.2))
    moving.take("/range", 100.6, reading(100.5, 0.2))
    moving.take("/range", 100.6, reading(100.5, 0.2))
    assert len(moving.ready(100.9)) == 1
    assert dict(moving.drop_counts()) == {
        "older than --max-age on arrival": 1, "stamp in the future: clocks differ": 1, "duplicate": 1,
    }  # fmt: skip


def test_a_message_without_a_field_is_refused_by_its_topic(moving):
    lacking = reading(100.5, 0.2)
    del lacking.max_range
    with pytest.raises(InputError, match=r"/range: expected messages of sensor_msgs/msg/Range with the fields"):
        moving.take("/range", 100.6, lacking)


def test_a_reading_costs_the_same_however_many_wait():
    def seconds(count):
        intake = listening(("/tf", TF), ("/range", RANGE), transform=100.0)
        begin = time.process_time()
        for k in range(count):
            intake.take("/range", 100 + 1e-3 * k, reading(100 + 1e-3 * k, 0.2))
        return time.process_time() - begin

    assert seconds(4000) < 9 * seconds(1000)  # four times as many; sixteen times if each took all into account


def test_readings_are_thinned(moving):
    moving.patience = Patience(start=0.0, every=0.1)
    for t in np.arange(100.2, 100.8, 0.01):
        moving.take("/range", t, reading(t, 0.2))
    assert 5 <= len(moving.ready(101.0)) <= 7


def test_numbers_go_on(moving):
    moving.take("/range", 100.3, reading(100.3, 0.2))
    first = moving.ready(101.0)
    moving.take("/range", 100.4, reading(100.4, np.inf))
    second = moving.ready(101.0)
    assert first.ids + second.ids == ("1", "2")
    assert second.is_free.tolist() == [True]


def test_a_clock_set_back_begins_anew(moving):
    moving.take("/range", 101.9, reading(101.5, 0.2))
    for t in np.arange(90.0, 90.5, 0.1):
        moving.take("/tf", t, frame(t, hand(t)))
    moving.take("/range", 90.3, reading(90.25, 0.2))
    finished = moving.ready(90.4)
    assert np.allclose(finished.directions[0], (hand(90.25) @ T_HAND_SENSOR)[:3, 0], atol=1e-6)
    assert any("A clock was set back" in note for note in moving.notes)
    assert dict(moving.drop_counts())["a clock was set back"] == 1


def test_a_frame_that_nothing_places_holds_up_no_other(moving):
    moving.take("/range", 100.3, reading(100.3, 0.2, "lost"))
    moving.take("/range", 100.31, reading(100.31, 0.2))
    assert len(moving.ready(100.9)) == 1
    assert moving.ready(102.0) is None
    assert dict(moving.drop_counts())["no transform at its stamp"] == 1


def test_touches_need_no_frames():
    intake = listening(("/touch", POINT))
    intake.take("/touch", 10.0, touch(10.0, (0.1, 0.2, 0.3)))
    finished = intake.ready(10.1)
    assert np.allclose(finished.points, [[0.1, 0.2, 0.3]])
    assert intake.world == "base"


def test_ranges_are_preferred_to_another_type_and_reported(moving):
    moving.register("/touch", POINT)
    moving.take("/touch", 100.5, touch(100.5, (0.1, 0.2, 0.3)))
    moving.take("/range", 100.6, reading(100.55, 0.2))
    assert len(moving.ready(101.0)) == 1
    assert any("The ranges are used" in note for note in moving.notes)
    assert dict(moving.drop_counts()) == {"type other than ranges": 1}


def test_two_named_types_are_refused():
    intake = listening(("/range", RANGE), options=io.RosOptions(("/range", "/touch")))
    with pytest.raises(ReadingsError, match="topics of one type"):
        intake.register("/touch", POINT)


def test_a_hand_s_pose_is_enough_for_a_rig():
    intake = listening(("/range", RANGE), ("/hand", POSE))
    for t in np.arange(100.0, 100.5, 0.1):
        header = io.documents.ros_header(ns(t), "base")
        intake.take("/hand", t, objects({"header": header, "pose": io.documents.pose(hand(t))}))
    intake.take("/range", 100.3, reading(100.25, 0.2, "tof"))
    finished = intake.ready(100.5)
    assert finished.sensors == ("tof",)
    assert np.allclose(finished.Ts_world_hand[0], hand(100.25), atol=1e-6)
    assert any("--rig" in note for note in intake.notes)


def test_what_is_too_near_is_counted(moving):
    for k, value in enumerate((0.01, np.nan, 0.2)):
        moving.take("/range", 100.5 + 0.01 * k, reading(100.5 + 0.01 * k, value))
    assert len(moving.ready(100.9)) == 1
    assert dict(moving.drop_counts()) == {"below the smallest range, or not a number": 2}


def test_a_late_root_is_reported(moving):
    moving.take("/range", 100.6, reading(100.55, 0.2))
    moving.ready(101.0)
    moving.take("/tf_static", 101.0, frame(0.0, np.eye(4), "map", "base"))
    moving.take("/range", 100.7, reading(100.65, 0.2))
    assert len(moving.ready(101.0)) == 1
    assert moving.world == "base"
    assert any("'map' is now above the world frame 'base'" in note for note in moving.notes)


def test_missing_facts_are_reported_once(moving):
    for t in np.arange(100.0, 104.0, 0.3):
        moving.take("/range", t, reading(t, 0.2, "lost"))
        moving.ready(t)
    assert sum("'lost'" in note or "of lost" in note for note in moving.notes) == 1
