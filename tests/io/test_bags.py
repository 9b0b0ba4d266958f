"""Recordings of ROS: poses in the world at their stamps for every storage format; damaged recordings."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tanteo import io
from tanteo.errors import ReadingsError
from tanteo.geometry import SE3, SO3
from tanteo.io import read_readings

rosbags = pytest.importorskip("rosbags", reason="the extra tanteo[bags] is not installed")

from recordings import KINDS, T_HAND_SENSOR, TIMES, Recording, hand  # noqa: E402


@pytest.mark.parametrize("kind", KINDS)
def test_ranges_are_placed_at_their_stamps(kind, tmp_path):
    recording = Recording(kind).moving()
    times = np.array([0.25, 0.7, 1.234])
    for t, value in zip(times, (0.2, np.inf, 0.3), strict=True):
        recording.range(t, value)
    readings = read_readings(recording.write(tmp_path))
    Ts = np.stack([hand(t) @ T_HAND_SENSOR for t in times])
    assert readings.is_free.tolist() == [False, True, False]
    assert np.allclose(readings.directions, Ts[:, :3, 0], atol=1e-6)
    expected = Ts[:, :3, 3] + np.array([0.2, 0.0, 0.3])[:, None] * Ts[:, :3, 0]
    assert np.allclose(readings.points, expected, atol=1e-6)
    assert np.allclose(readings.ranges.filled(np.nan), [0.2, np.nan, 0.3], equal_nan=True)
    assert readings.max_ranges[1] == pytest.approx(0.5)
    notes = " ".join(readings.notes)
    assert "taken from /range" in notes
    assert "the frame 'base'" in notes
    assert "4.0 ms after their stamp" in notes


@pytest.mark.parametrize("name", ["run.mcap", "run.db3"])
def test_the_file_inside_of_the_folder_is_enough(name, tmp_path):
    recording = Recording("mcap" if name.endswith("mcap") else "sqlite").moving()
    recording.range(0.5, 0.2)
    folder = recording.write(tmp_path)
    assert np.array_equal(read_readings(folder / name).points, read_readings(folder).points)


def test_touches_are_points_of_their_frame(tmp_path):
    recording = Recording("mcap")
    for k, t in enumerate((0.1, 0.2, 0.3)):
        recording.point(t, (0.01 * k, 0.02, 0.03))
    readings = read_readings(recording.write(tmp_path), direction="down")
    assert np.allclose(readings.points[2], [0.02, 0.02, 0.03])
    assert np.allclose(readings.directions, [0, 0, -1])
    assert any("--radius" in note for note in readings.notes)


def test_a_hand_s_poses_and_a_rig_will_do(tmp_path):
    recording = Recording("mcap")
    for t in TIMES:
        recording.pose(t, hand(t))
    recording.range(0.55, 0.2, frame="tof_left")
    readings = read_readings(recording.write(tmp_path))
    assert readings.sensors == ("tof_left",)
    assert np.allclose(readings.Ts_world_hand[0], hand(0.55), atol=1e-6)
    assert any("--rig" in note for note in readings.notes)


def test_latency_moves_the_stamps(tmp_path):
    recording = Recording("mcap").moving()
    recording.range(1.0, 0.2)
    path = recording.write(tmp_path)
    T = hand(0.9) @ T_HAND_SENSOR
    assert np.allclose(read_readings(path, latency=0.1).directions[0], T[:3, 0], atol=1e-6)


def test_stamps_without_transforms_are_left_out(tmp_path):
    recording = Recording("mcap").moving()
    for t in (0.5, 2.5):
        recording.range(t, 0.2)
    readings = read_readings(recording.write(tmp_path))
    assert len(readings) == 1
    assert any("1 of 2 readings were excluded" in note for note in readings.notes)


def test_topics_and_worlds_are_named(tmp_path):
    recording = Recording("mcap").moving()
    recording.range(0.5, 0.2)
    recording.range(0.6, 0.25, topic="/other")
    recording.point(0.5, (0, 0, 0))
    path = recording.write(tmp_path)
    assert len(read_readings(path)) == 2
    assert len(read_readings(path, topics=["/other"])) == 1
    assert len(read_readings(path, topics=["/touch"], direction="down")) == 1
    static = read_readings(path, topics=["/range"], world="hand")
    assert np.allclose(static.directions[0], T_HAND_SENSOR[:3, 0], atol=1e-6)
    with pytest.raises(ReadingsError, match="Did you mean"):
        read_readings(path, topics=["/rang"])
    with pytest.raises(ReadingsError, match="expected a frame that transforms connect with 'sensor'"):
        read_readings(path, world="map")
    with pytest.raises(ReadingsError, match="topics of one type"):
        read_readings(path, topics=["/range", "/touch"])


def test_sensors_that_nothing_places_are_refused(tmp_path):
    recording = Recording("mcap")
    recording.range(0.5, 0.2)
    with pytest.raises(ReadingsError, match="expected transforms"):
        read_readings(recording.write(tmp_path))


def stored_in(path: Path) -> Path:
    return path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".mcap", ".db3"))


@pytest.mark.parametrize("kind", KINDS)
def test_damaged_recordings_are_read_as_far_as_they_hold(kind, tmp_path):
    recording = Recording(kind).moving()
    for k in range(3000):
        recording.range(0.5 + 1e-4 * k, 0.2)
    path = recording.write(tmp_path)
    file = stored_in(path)
    before, whole = read_readings(path), file.read_bytes()
    file.write_bytes(whole[: int(0.7 * len(whole))])
    readings = read_readings(path)
    n = len(readings)
    assert 500 < n < 3000
    assert {tuple(p) for p in readings.points[:].tolist()} < {tuple(p) for p in before.points[:].tolist()}
    assert "is damaged" in readings.notes[0]
    assert "are lost" in readings.notes[0]


@pytest.mark.parametrize("kind", KINDS)
def test_recordings_of_which_nothing_holds_are_refused(kind, tmp_path):
    recording = Recording(kind).moving()
    recording.range(0.5, 0.2)
    file = stored_in(recording.write(tmp_path))
    whole = file.read_bytes()
    for size in (20, 100):
        file.write_bytes(whole[:size])
        with pytest.raises(ReadingsError, match="cannot be read"):
            read_readings(file)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_spoiled_bytes_never_end_in_a_traceback(kind, tmp_path):
    recording = Recording(kind).moving()
    for k in range(50):
        recording.range(0.5 + 0.01 * k, 0.2)
    file = stored_in(recording.write(tmp_path))
    whole, rng = file.read_bytes(), np.random.default_rng(1)
    for _ in range(15):
        spoiled = bytearray(whole)
        for at in rng.integers(0, len(whole), 5):
            spoiled[at] = rng.integers(256)
        file.write_bytes(spoiled)
        try:
            assert len(read_readings(file)) <= 50
        except ReadingsError as error:
            assert "expected" in str(error)  # noqa: PT017  either is right


def test_a_recorder_that_was_killed_leaves_a_folder(tmp_path):
    recording = Recording("mcap").moving()
    recording.range(0.5, 0.2)
    folder = recording.write(tmp_path)
    (folder / "metadata.yaml").unlink()
    assert len(read_readings(folder)) == 1


def test_nothing_is_known_within_a_gap_of_transforms(tmp_path):
    recording = Recording("mcap").moving()
    recording.rows = [row for row in recording.rows if not (row[0] == "/tf" and 0.55 < row[2] < 1.45)]
    for t in (0.3, 1.0, 1.7):
        recording.range(t, 0.2)
    readings = read_readings(recording.write(tmp_path))
    assert len(readings) == 2
    assert any("1 of 3 readings were excluded: no transform" in note for note in readings.notes)


def test_a_hand_that_rests_over_a_gap_is_where_it_was(tmp_path):
    recording = Recording("mcap")
    for t in (0.0, 0.1, 0.2, 2.0, 2.1):
        recording.transform("/tf", t, "base", "sensor", T_HAND_SENSOR)
    recording.range(1.0, 0.2)
    assert len(read_readings(recording.write(tmp_path))) == 1


def test_a_clock_that_was_set_back_makes_stamps_doubtful(tmp_path):
    recording = Recording("mcap").moving()
    recording.range(0.2, 0.2)
    recording.range(1.9, 0.3)
    for t in TIMES[:5] + 0.5:  # the clock goes back to 0.5 s, and the hand is elsewhere by now
        recording.transform("/tf", t, "base", "hand", hand(5 + t))
    recording.range(0.7, 0.25)
    late = [(*row[:2], row[2] + 5, row[3]) for row in recording.rows[-6:]]  # the recorder has another clock
    recording.rows[-6:] = late
    readings = read_readings(recording.write(tmp_path))
    assert readings.ranges[:].tolist() == pytest.approx([0.2])
    assert any("set back by 1.5 s" in note for note in readings.notes)


def test_what_came_twice_counts_once(tmp_path):
    recording = Recording("mcap").moving()
    for t in (0.3, 0.3, 0.4, 0.4):
        recording.range(t, 0.2)
    readings = read_readings(recording.write(tmp_path))
    assert len(readings) == 2
    assert any("2 of 4 readings came twice" in note for note in readings.notes)


def test_a_frame_with_two_parents_is_reported(tmp_path):
    recording = Recording("mcap").moving()
    recording.transform("/tf_static", 0.0, "flange", "sensor", T_HAND_SENSOR)
    recording.range(0.5, 0.2)
    notes = read_readings(recording.write(tmp_path)).notes
    assert any("The frame 'sensor' is in 'hand' and in 'flange'" in note for note in notes)


def test_numbers_that_are_none_are_left_out(tmp_path):
    recording = Recording("mcap").moving()
    recording.transform("/tf", 0.55, "base", "hand", np.full((4, 4), np.nan))
    recording.range(0.55, 0.2)
    for k, value in enumerate((np.nan, -np.inf, 0.0, -0.1, 0.01)):  # the sensor begins at 0.02
        recording.range(0.6 + 0.01 * k, value)
    readings = read_readings(recording.write(tmp_path))
    assert len(readings) == 1
    assert np.allclose(readings.directions[0], (hand(0.55) @ T_HAND_SENSOR)[:3, 0], atol=1e-6)
    notes = " ".join(readings.notes)
    assert "5 of 6 ranges are too near or none" in notes
    assert "1 messages were excluded because their numbers form no valid pose" in notes


def test_of_two_topics_of_hand_poses_one_is_named(tmp_path):
    recording = Recording("mcap")
    for t in TIMES:
        recording.pose(t, hand(t))
    recording.rows += [("/other", kind, t, message) for _, kind, t, message in recording.rows]
    recording.range(0.55, 0.2, frame="tof_left")
    path = recording.write(tmp_path)
    with pytest.raises(ReadingsError, match="/hand, /other"):
        read_readings(path)
    assert len(read_readings(path, topics=["/hand"])) == 1


def test_a_recording_without_readings_is_reported(tmp_path):
    with pytest.raises(ReadingsError, match=r"geometry_msgs/PointStamped, got /tf"):
        read_readings(Recording("mcap").moving().write(tmp_path))


def test_topics_are_of_recordings_only(tmp_path):
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n1,2,3\n")
    with pytest.raises(ReadingsError, match="recording of ROS"):
        read_readings(tmp_path / "r.csv", world="base")


def test_a_message_without_a_field_is_refused_by_name():
    messages = io.documents.RosMessages(kinds={"/range": io.documents.RANGE})
    stamp = SimpleNamespace(sec=1, nanosec=0)
    header = SimpleNamespace(stamp=stamp, frame_id="tof")
    with pytest.raises(ReadingsError, match=r"/range: expected messages of sensor_msgs/msg/Range .*max_range"):
        messages.take("/range", 1.0, SimpleNamespace(header=header, range=0.1, min_range=0.0))


@pytest.mark.parametrize("kind", KINDS)
def test_beams_of_a_scan_have_stamps_of_their_own(kind, tmp_path):
    recording = Recording(kind).moving()
    recording.scan(0.5, [0.2, np.inf, np.nan, 0.3], first=-0.2, step=0.1, gap=0.05)
    readings = read_readings(recording.write(tmp_path))
    assert readings.ids == ("1.1", "1.2", "1.3")
    assert readings.is_free.tolist() == [False, True, False]
    for row, (k, distance) in enumerate(((0, 0.2), (1, 0.0), (3, 0.3))):
        T, angle = hand(0.5 + 0.05 * k) @ T_HAND_SENSOR, -0.2 + 0.1 * k
        beam = T[:3, :3] @ [np.cos(angle), np.sin(angle), 0]
        np.testing.assert_allclose(readings.directions[row], beam, atol=1e-6)
        np.testing.assert_allclose(readings.points[row], T[:3, 3] + distance * beam, atol=1e-6)


def test_points_of_a_cloud_are_seen_from_their_frame(tmp_path):
    recording = Recording("mcap").moving()
    local = np.array([[0.1, 0.02, 0.03], [np.nan, 0, 0], [0.2, -0.05, 0.0]])
    recording.cloud(0.55, local)
    readings = read_readings(recording.write(tmp_path))
    T = hand(0.55) @ T_HAND_SENSOR
    seen = local[[0, 2]] @ T[:3, :3].T
    np.testing.assert_allclose(readings.points[:], seen + T[:3, 3], atol=1e-6)
    np.testing.assert_allclose(readings.directions[:], seen / np.linalg.norm(seen, axis=1, keepdims=True), atol=1e-5)


def test_dense_lines_count_no_more_than_others(tmp_path):
    recording = Recording("mcap").moving()
    for k in range(40):  # slow at first: nine tenths of the lines within a tenth of the way
        recording.scan(0.1 + (0.003 * k if k < 36 else 0.1 * (k - 34)), np.full(200, 0.2), first=-0.3, step=0.003)
    readings = read_readings(recording.write(tmp_path), max_points=150)
    lines = np.array([int(name.partition(".")[0]) for name in readings.ids])
    assert 50 < len(readings) <= 150
    assert (lines > 36).sum() > 0.25 * len(readings)


def test_any_frame_of_the_tree_is_a_world(tmp_path):
    recording = Recording("mcap").moving()
    T_base_table = SE3.from_parts(SO3.axis_rotation(2, 0.7), np.array([0.3, 0.1, -0.2]))
    recording.transform("/tf_static", 0.0, "base", "table", T_base_table)
    recording.range(0.5, 0.2)
    path = recording.write(tmp_path)
    base, table = read_readings(path), read_readings(path, world="table")
    np.testing.assert_allclose(SE3.apply(T_base_table, table.points[:]), base.points[:], atol=1e-9)
    assert (base.frame, table.frame) == ("base", "table")
    assert table.stamp == pytest.approx(0.5)
    with pytest.raises(ReadingsError, match="table"):
        read_readings(path, world="tabel")


def test_a_field_of_view_is_a_spread_across_the_beam(tmp_path):
    recording = Recording("mcap").moving()
    recording.range(0.5, 0.2)
    assert read_readings(recording.write(tmp_path)).across_sds[0] == pytest.approx(0.25 * 0.01 * 0.2)
