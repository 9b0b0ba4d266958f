"""A session as MCAP: the same session again, and messages that others read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import drawn_truth, new_session, rough, true_range
from tanteo.errors import InputError
from tanteo.geometry import from_ros_covariance
from tanteo.io import load_record, pose_from_brand, read_readings, read_record, write_record
from tanteo.io.documents import session_document
from tanteo.parts import read_part
from tanteo.posterior import prepare
from tanteo.sensors import Readings

Writer = pytest.importorskip("mcap.writer", reason="the extra tanteo[bags] is not installed").Writer
highlevel = pytest.importorskip("rosbags.highlevel", reason="the extra tanteo[bags] is not installed")

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def target():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    return prepare(read_part(EXAMPLES / "parts" / "wedge.step"))


@pytest.fixture
def session(target):
    """Two planned ranges, and one beam beside the part."""
    rng = np.random.default_rng(4)
    start = rough([target])
    _, T = drawn_truth(start, rng)
    session = new_session(start, seed=3, max_measurements=50)
    for _ in range(2):
        action = session.ask()
        session.tell(action.read(true_range(target, T, action) + 3e-4 * rng.normal()))
    session.tell(
        Readings.from_columns(
            T[None, :3, 3] + [0, 0, 0.2], ids=["beside"], directions=np.array([[0.0, 1.0, 0.0]]),
            is_free=np.array([True]), max_ranges=np.array([0.3]),
        )
    )  # fmt: skip
    return session


def messages(path):
    """Topic, stamp and message of each, as rosbags reads them."""
    with highlevel.AnyReader([path]) as reader:
        return [(c.topic, stamp, reader.deserialize(raw, c.msgtype)) for c, stamp, raw in reader.messages()]


@pytest.mark.parametrize("name", ["run.json", "run.mcap"])
def test_a_record_has_the_readings_of_its_session(session, tmp_path, name):
    write_record(session, tmp_path / name)
    found = read_readings(tmp_path / name)
    assert found.ids == session.readings.ids
    hit = ~found.is_free
    assert np.array_equal(found.points, session.readings.points)
    assert set(found.sds[hit]) == {session.sensing.sd}
    assert ("/tanteo/record" in " ".join(found.notes)) == name.endswith(".mcap")


def test_the_record_inside_is_the_session(session, tmp_path, target):
    path = tmp_path / "run.mcap"
    write_record(session, path)
    write_record(session, tmp_path / "run.json")
    assert session_document(read_record(path, [target])) == session_document(session)
    assert load_record(path).answer == load_record(tmp_path / "run.json").answer


def test_other_readers_get_equal_messages(session, tmp_path):
    path = tmp_path / "run.mcap"
    write_record(session, path)
    reread = read_readings(path, topics=["/tanteo/range"])
    kept = ~session.readings.is_free
    assert np.allclose(reread.points[kept], session.readings.points[kept], atol=1e-7)
    assert np.allclose(reread.directions, session.readings.directions, atol=1e-7)
    assert reread.is_free.tolist() == session.readings.is_free.tolist()
    by_topic = {}
    for topic, _, message in messages(path):
        by_topic.setdefault(topic, []).append(message)
    assert len(by_topic["/tanteo/corner_sd"]) == len(session.steps)
    pose, step = by_topic["/tanteo/pose"][-1].pose, session.steps[-1]
    p, q = pose.pose.position, pose.pose.orientation
    frame = from_ros_covariance(pose_from_brand("ros", [p.x, p.y, p.z, q.x, q.y, q.z, q.w]), pose.covariance)
    assert np.allclose(frame.T, step.T_world_part)
    assert np.allclose(frame.C, step.covariance, rtol=1e-6)
    assert by_topic["/diagnostics"][0].status[0].values[0].key == "probability wedge"
    lines = [marker for marker in by_topic["/tanteo/hypotheses"][-1].markers if len(marker.points) > 10]
    assert lines


@pytest.mark.slow
def test_steps_keep_their_times_when_more_follow(session, tmp_path):
    path = tmp_path / "run.mcap"
    write_record(session, path)
    before = [stamp for topic, stamp, _ in messages(path) if topic == "/tanteo/corner_sd"]
    action = session.ask()
    session.tell(action.read(action.expected))
    write_record(session, path)
    after = [stamp for topic, stamp, _ in messages(path) if topic == "/tanteo/corner_sd"]
    assert after[:3] == before
    assert after[3] > before[0]


def test_a_file_of_another_session_gives_no_moments(session, tmp_path, target):
    path = tmp_path / "run.mcap"
    write_record(session, path)
    before = [stamp for topic, stamp, _ in messages(path) if topic == "/tanteo/corner_sd"]
    other = new_session(rough([target]), seed=8, max_measurements=50)
    action = other.ask()
    other.tell(action.read(action.expected))
    write_record(other, path)
    after = [stamp for topic, stamp, _ in messages(path) if topic == "/tanteo/corner_sd"]
    assert len(after) == 1
    assert after[0] not in before


def test_damaged_text_inside_is_refused(tmp_path):
    """The length of the text is larger than the message."""
    path = tmp_path / "run.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/tanteo/record", "cdr", schema)
        writer.add_message(channel, 0, b"\x00\x01\x00\x00\xff\x00\x00\x00{}", 0)
        writer.finish()
    with pytest.raises(InputError, match="got damaged text"):
        load_record(path)


def test_what_is_no_record_is_refused(session, tmp_path):
    path = tmp_path / "run.mcap"
    write_record(session, path)
    whole = path.read_bytes()
    for size in (9, len(whole) // 2):
        path.write_bytes(whole[:size])
        with pytest.raises(InputError, match="expected an MCAP file with the record of a session"):
            load_record(path)
