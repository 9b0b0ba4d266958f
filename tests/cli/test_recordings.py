"""The command on recordings of ROS: a sensor that moves past a part, with a delay that its motion determines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tanteo.cli import main
from tanteo.geometry import SE3, SO3
from tanteo.parts import Surface, read_part

pytest.importorskip("rosbags", reason="the extra tanteo[bags] is not installed")
pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")

from recordings import T_HAND_SENSOR, Recording

PARTS = Path(__file__).parents[2] / "examples" / "parts"
T_WORLD_PART = SE3.from_parts(SO3.axis_rotation(2, 0.6), np.array([0.42, -0.13, 0.035]))


def sensor_at(t, part):
    """Return the pose of a sensor that swings about the part at 0.1 to 0.4 m/s, directed at its middle."""
    turn = np.array([0.9 * np.sin(1.3 * t), 0.8 * np.sin(1.9 * t), 0.0])
    beam = SO3.exp(turn) @ np.array([0.0, 0.0, -1.0])
    wanders = 0.025 * np.array([np.sin(2.9 * t), np.cos(2.3 * t), np.sin(1.7 * t)])
    middle = SE3.apply(T_WORLD_PART, part.centroid) + wanders
    return SE3.from_parts(SO3.frame_from_axis(beam, 0), middle - 0.2 * beam)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Ranges that are stamped 15 ms after they were sensed."""
    part, rng = read_part(PARTS / "bracket_left.step"), np.random.default_rng(2)
    surface, inverse = Surface(part.vertices, part.triangles), SE3.inverse(T_WORLD_PART)
    recording = Recording("mcap")
    for t in np.arange(9.8, 15.2, 0.01):
        recording.transform("/tf", t, "base", "hand", sensor_at(t, part) @ SE3.inverse(T_HAND_SENSOR))
    recording.transform("/tf_static", 0.0, "hand", "sensor", T_HAND_SENSOR)
    for t in np.arange(10.0, 15.0, 0.05):
        T = inverse @ sensor_at(t, part)
        hit = float(surface.cast(T[None, :3, 3], T[None, :3, 0]).distances[0])
        if hit < 0.45:
            recording.range(t + 0.015, hit + 2e-4 * rng.normal())
    return recording.write(tmp_path_factory.mktemp("recorded"))


def identified(recorded, capsys, *more):
    with pytest.raises(SystemExit) as end:
        main(["identify", str(recorded), "--sd", "0.2mm", "--parts", str(PARTS / "bracket_left.step"), *more])
    captured = capsys.readouterr()
    return end.value.code, captured.out, captured.err


def test_the_motion_determines_a_delay(recorded, capsys):
    _, _, err = identified(recorded, capsys)
    assert "older than assumed. Use --latency 1" in err
    latency = float(err.split("Use --latency ")[1].split("ms")[0])
    assert latency == pytest.approx(15.0, abs=1.0)


def test_with_the_delay_the_part_is_found(recorded, capsys):
    code, out, err = identified(recorded, capsys, "--latency", "15ms", "-v")
    assert code == 0, out + err
    assert "bracket_left at x 420.0" in out or "bracket_left at x 419.9" in out
    assert "readings are 15." in err or "readings are 14." in err
    assert "say --latency" not in err


def test_every_output_names_the_frame_of_the_pose(recorded, capsys):
    _, out, _ = identified(recorded, capsys, "--latency", "15ms", "--as", "ros")
    assert "frame_id: base\n" in out
    assert "stamp: {sec: 0," not in out
    _, out, err = identified(recorded, capsys, "--latency", "15ms", "--as", "ur", "--json")
    assert '"frame": "base"' in out
    assert "the pose is in the frame 'base'" in out + err
