"""Ranges in the names and codes of loggers: one range in each row, JSON lines, lists in cells, printed messages."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.io import read_readings, read_rig

HAND = "400,200,300mm 180,0,0deg"
TOF = '[sensors.tof]\npreset = "vl53l5cx_zone4x4"\nzones = [4, 4]\nfield_deg = 45\nposition_mm = [0, 0, 0]\n' \
    "quaternion_wxyz = [1, 0, 0, 0]\n"  # fmt: skip
SINGLE = '[sensors.eye]\npreset = "vl53l1x"\nposition_mm = [0, 0, 0]\ndirection = [0, 0, 1]\n'
ZONES = list(range(300, 316))
STATUS = [5] * 15 + [255]


def read(tmp_path, text, rig, name="log.csv", **options):
    (tmp_path / "rig.toml").write_text(rig)
    (tmp_path / name).write_text(text)
    return read_readings(tmp_path / name, rig=read_rig(tmp_path / "rig.toml"), **options)


def expect_frame(readings, statuses=False):
    at = dict(zip(readings.sensors, readings.ranges.filled(np.nan), strict=True))
    np.testing.assert_allclose([at["tof.1.1"], at["tof.1.4"], at["tof.2.1"]], [0.3, 0.303, 0.304])
    assert len(at) == 16
    assert np.isnan(at["tof.4.4"]) == statuses


@pytest.mark.parametrize("name", ["z[{r}][{c}]", "z[{k}]", "Distance_mm_Zone_{k}", "zone{k}_distance_mm", "ranges_{k}",
                                  "px_r{r}_c{c}", "field.data{k}", "{letter}{column}", "z_c{c}_r{r}"])  # fmt: skip
def test_zones_are_named_by_words_and_numbers(tmp_path, name):
    cells = [name.format(r=k // 4, c=k % 4, k=k, letter="ABCD"[k // 4], column=k % 4 + 1) for k in range(16)]
    expect_frame(read(tmp_path, f"t,{','.join(cells)}\n0,{','.join(map(str, ZONES))}\n", TOF, hand=HAND))


@pytest.mark.parametrize(
    "row",
    [
        {"time": 0, "distance_mm": ZONES, "target_status": STATUS},
        {
            "zones": [
                {"zone": k, "distance": d, "status": s} for k, (d, s) in enumerate(zip(ZONES, STATUS, strict=True))
            ]
        },
        {"frames": [{"distance_mm": ZONES, "target_status": STATUS}]},
    ],
)
@pytest.mark.parametrize("before", ["", "DATA: "])
def test_objects_in_json_are_frames(tmp_path, row, before):
    expect_frame(read(tmp_path, f"{before}{json.dumps(row)}\n", TOF, hand=HAND), statuses=True)


def test_lists_of_numbers_are_frames(tmp_path):
    listed = ", ".join(map(str, ZONES))
    expect_frame(read(tmp_path, f'time,distances\n0,"[{listed}]"\n', TOF, hand=HAND))
    expect_frame(read(tmp_path, f"0.07,{listed}\n", TOF, "log.txt", hand=HAND))
    expect_frame(read(tmp_path, json.dumps([ZONES[4 * k : 4 * k + 4] for k in range(4)]), TOF, hand=HAND))


def test_a_zone_in_each_row(tmp_path):
    rows = [f"{k},{d},{s}" for k, (d, s) in enumerate(zip(ZONES, STATUS, strict=True))]
    expect_frame(read(tmp_path, "\n".join(["zone,distance_mm,status", *rows]) + "\n", TOF, hand=HAND), statuses=True)
    rows = [f"{k // 4 + 1},{k % 4 + 1},{d}" for k, d in enumerate(ZONES)]
    expect_frame(read(tmp_path, "\n".join(["row,col,distance_mm", *rows]) + "\n", TOF, hand=HAND))


POSE = "hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz"


@pytest.mark.parametrize(
    ("header", "row"),
    [
        (f"distance_mm,{POSE}", "142,400,200,300,0,1,0,0"),
        (f"range_cm,{POSE}", "14.2,400,200,300,0,1,0,0"),
        (f"range_mm,{POSE}", "142 mm,400,200,300,0,1,0,0"),
        ("range_m,x_m,y_m,z_m,qx,qy,qz,qw", "0.142,0.4,0.2,0.3,1,0,0,0"),
        ("range_mm,tcp_x_mm,tcp_y_mm,tcp_z_mm,tcp_qx,tcp_qy,tcp_qz,tcp_qw", "142,400,200,300,1,0,0,0"),
        ("range_mm," + ",".join(f"actual_TCP_pose_{k}" for k in range(6)), "142,.4,.2,.3,3.14159265,0,0"),
    ],
)
def test_a_range_and_a_pose_in_the_words_of_loggers(tmp_path, header, row):
    readings = read(tmp_path, f"{header}\n{row}\n", SINGLE)
    np.testing.assert_allclose(readings.ranges[:], [0.142])
    T = readings.Ts_world_hand[0]
    np.testing.assert_allclose(T[:3], [[1, 0, 0, 0.4], [0, -1, 0, 0.2], [0, 0, -1, 0.3]], atol=1e-8)


def test_statuses_of_a_single_beam_decide(tmp_path):
    text = "time,distance_mm,range_status\n0,142,0\n1,0,4\n2,9,2\n3,,0\n4,143,Range Valid\n"
    readings = read(tmp_path, text, SINGLE, hand=HAND)
    np.testing.assert_allclose(readings.ranges.filled(0), [0.142, 0, 0.143])


@pytest.mark.parametrize("header", ["actual (mm),measured (mm)", "true_mm,reading_mm", "distance_mm,range_mm"])
def test_a_known_distance_beside_a_range(tmp_path, header):
    readings = read(tmp_path, f"{header}\n140,142\n160,163\n", SINGLE, hand=HAND)
    np.testing.assert_allclose(readings.ranges[:], [0.142, 0.163])
    np.testing.assert_allclose(readings.true_distances[:], [0.14, 0.16])
    scaled = header.replace("mm", "cm")
    readings = read(tmp_path, f"{scaled}\n14,14.2\n16,16.3\n", SINGLE, hand=HAND)
    np.testing.assert_allclose(readings.ranges[:], [0.142, 0.163])
    np.testing.assert_allclose(readings.true_distances[:], [0.14, 0.16])


def test_printed_messages_of_ros_are_in_metres(tmp_path):
    header = "header:\n  stamp:\n    sec: {k}\n  frame_id: tof\n"
    message = header + "radiation_type: 1\nfield_of_view: 0.4\nmax_range: 2.0\nrange: {d}\n---\n"
    readings = read(tmp_path, message.format(k=1, d=0.142) + message.format(k=2, d=".inf"), SINGLE, hand=HAND)
    np.testing.assert_allclose(readings.ranges.filled(0), [0.142, 0])
    assert readings.is_free.tolist() == [False, True]
    header = (
        "%time,field.header.seq,field.radiation_type,field.field_of_view,field.min_range,field.max_range,field.range"
    )
    echoed = read(tmp_path, f"{header}\n1,1,1,0.4,0.03,2.0,0.142\n", SINGLE, hand=HAND)
    np.testing.assert_allclose(echoed.ranges[:], [0.142])


def test_a_number_beyond_all_distances_is_a_code(tmp_path):
    with pytest.raises(InputError, match=r"got '1e9', probably a code .* --no-target 1e9"):
        read(tmp_path, "range_mm\n142\n1e9\n", SINGLE, hand=HAND)
