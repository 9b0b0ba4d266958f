"""Tables with one row for each frame: zones in columns, with statuses, poses beside them or in a file of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.io import read_readings, read_rig

TOF = """[sensors.{name}]
preset = "{preset}"
zones = [{n}, {n}]
field_deg = 45
position_mm = [{x}, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
"""
HAND = "0,0,0mm 180,0,0deg"


def rig_of(tmp_path, *devices):
    path = tmp_path / "rig.toml"
    path.write_text(
        "\n".join(TOF.format(name=name, n=n, preset=preset, x=10 * k) for k, (name, n, preset) in enumerate(devices))
    )
    return read_rig(path)


@pytest.fixture
def rig(tmp_path):
    return rig_of(tmp_path, ("tof", 4, "vl53l5cx_zone4x4"))


def write(tmp_path, header, *rows, name="log.csv"):
    path = tmp_path / name
    path.write_text("\n".join([",".join(header), *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def numbered(stem, n=16, first=0, unit=""):
    return [f"{stem}{k}{unit}" for k in range(first, first + n)]


@pytest.mark.parametrize("names", [numbered("z"), numbered("zone_", first=1), numbered("d", unit="_mm"),
                                   *([name.format(r, c) for r in range(4) for c in range(4)]
                                     for name in ("z_{}_{}", "d{}{}", "r{}c{}", "row{}_col{}"))])  # fmt: skip
def test_a_frame_in_a_row_is_all_its_zones(tmp_path, rig, names):
    readings = read_readings(write(tmp_path, ["time_s", *names], [0, *range(300, 316)]), rig=rig, hand=HAND)
    at = dict(zip(readings.sensors, readings.ranges[:], strict=True))
    np.testing.assert_allclose([at["tof.1.1"], at["tof.1.4"], at["tof.2.1"], at["tof.4.4"]], [0.3, 0.303, 0.304, 0.315])


def test_statuses_of_zones_decide(tmp_path, rig):
    statuses = [5] * 16
    statuses[1], statuses[2], statuses[3] = 255, 13, 9
    header = [*numbered("z"), *numbered("status"), *numbered("q")]
    readings = read_readings(write(tmp_path, header, [300] * 16 + statuses + [7] * 16), rig=rig, hand=HAND)
    at = dict(zip(readings.sensors, readings.ranges.filled(np.nan), strict=True))
    assert len(readings) == 15
    assert np.isnan(at["tof.1.2"])
    assert "tof.1.3" not in at
    assert "Columns q0 .. q15 are not used." in readings.notes


def test_each_frame_has_the_pose_of_its_row(tmp_path, rig):
    header = [
        "frame",
        *numbered("z"),
        "hand_x_mm",
        "hand_y_mm",
        "hand_z_mm",
        "hand_qw",
        "hand_qx",
        "hand_qy",
        "hand_qz",
    ]
    rows = [[k, *[300 + k] * 16, 100 * k, 0, 0, 1, 0, 0, 0] for k in range(2)]
    readings = read_readings(write(tmp_path, header, *rows), rig=rig)
    np.testing.assert_allclose(readings.Ts_world_hand[:][[0, 16], 0, 3], [0, 0.1])


def test_poses_of_another_file_are_interpolated(tmp_path, rig):
    header = ["time_s", "x_mm", "y_mm", "z_mm", "rx_rad", "ry_rad", "rz_rad"]
    hands = write(tmp_path, header, *[[t, 100 * t, 0, 500, 0, 3.14159, 0] for t in (0, 0.2, 0.4)], name="robot.csv")
    frames = write(tmp_path, ["time_ms", *numbered("z")], *[[t, *[300] * 16] for t in (100, 300, 900)])
    readings = read_readings(frames, rig=rig, hand=hands)
    assert len(readings) == 32
    np.testing.assert_allclose(readings.Ts_world_hand[:][[0, 16], 0, 3], [0.01, 0.03], atol=1e-9)
    assert "16 of 48 readings were excluded" in " ".join(readings.notes)
    with pytest.raises(InputError, match="expected a column time_s"):
        read_readings(write(tmp_path, numbered("z"), [300] * 16), rig=rig, hand=hands)
    with pytest.raises(InputError, match="expected times within those of --hand"):
        read_readings(write(tmp_path, ["time_s", *numbered("z")], [99, *[300] * 16]), rig=rig, hand=hands)


def test_the_device_is_recognized_or_requested(tmp_path, rig):
    path = write(tmp_path, numbered("z"), [300] * 16)
    with pytest.raises(InputError, match="expected --rig with frames of 16 zones"):
        read_readings(path, hand=HAND)
    with pytest.raises(InputError, match=r"16 zones, .* got 'tof' \(8 x 8\)"):
        read_readings(path, rig=rig_of(tmp_path, ("tof", 8, "vl53l5cx_zone8x8")), hand=HAND)
    two = rig_of(tmp_path, ("left", 4, "vl53l5cx_zone4x4"), ("right", 4, "vl53l8cx_zone8x8"))
    with pytest.raises(InputError, match="--device"):
        read_readings(path, rig=two, hand=HAND)
    assert read_readings(path, rig=two, hand=HAND, device="right").sensors[0] == "right.1.1"
    named = write(tmp_path, numbered("left_z"), [300] * 16)
    assert read_readings(named, rig=two, hand=HAND).sensors[0] == "left.1.1"


def test_columns_named_as_sensors_are_their_ranges(tmp_path):
    path = tmp_path / "ring.toml"
    path.write_text("".join(f'[sensors.{name}]\npreset = "vl53l4cd"\nposition_mm = [{x}, 0, 0]\ndirection = [0, 0, 1]\n'
                            for name, x in (("front", 10), ("back", -10))))  # fmt: skip
    readings = read_readings(write(tmp_path, ["t", "back_mm", "front_mm"], [0, 50, 60]), rig=read_rig(path), hand=HAND)
    assert readings.sensors == ("back", "front")
    np.testing.assert_allclose(readings.ranges[:], [0.05, 0.06])


def test_a_cell_of_a_frame_is_named_by_its_line(tmp_path, rig):
    path = write(tmp_path, numbered("z"), [300] * 16, [300] * 15 + ["OL"])
    with pytest.raises(InputError, match=r"line 3, column 'z0 \.\. z15'"):
        read_readings(path, rig=rig, hand=HAND)
