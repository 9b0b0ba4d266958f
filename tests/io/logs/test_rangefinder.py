"""Logs of a single beam as example programs print them, and the grids of a TMF882x that a log allows."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.io import read_readings, read_rig
from tanteo.io.logs import Contents, recognise

LOGS = {
    "st": "Status =   0, Distance =   123 mm, Signal =   2000 kcps/spad\n"
    "Status =   4, Distance =     0 mm, Signal = 2 kcps/spad\n"
    "Status =   2, Distance =    50 mm, Signal = 2 kcps/spad\n",
    "pololu": "range: 123\tstatus: range valid\tpeak signal: 1.2\tambient: 0.2\n"
    "range: 900\tstatus: out of bounds fail\tpeak signal: 0\tambient: 0\n"
    "range: 50\tstatus: sigma fail\tpeak signal: 0\tambient: 0\n",
    "sparkfun": "Distance(mm): 123\tSignal rate: 9\tRange Status: Good\n"
    "Distance(mm): 0\tSignal rate: 9\tRange Status: 4\nDistance(mm): 50\tSignal rate: 9\tRange Status: Sigma fail\n",
    "adafruit": "VL53L0X API Simple Ranging example\n\n\nReading a measurement... Distance (mm): 123\n"
    "Reading a measurement...  out of range \n",
    "ping": "Ping: 12.3cm\nPing: out of range\n",
    "stamped": "12:30:01.123 -> Distance: 12.299999999999999 cm\n12:30:01.223 -> out of range\n",
    "numbers": "123 mm\n8190 mm\n65535 TIMEOUT mm\n",
}
RIG = '[sensors.eye]\npreset = "vl53l0x"\nposition_mm = [0, 0, 20]\ndirection = [0, 0, 1]\n'
HAND = "0,0,400mm 180,0,0deg"


def rig(tmp_path, text=RIG):
    (tmp_path / "rig.toml").write_text(text)
    return read_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("name", LOGS)
def test_one_range_one_free_beam_however_printed(tmp_path, name):
    path = tmp_path / "log.txt"
    path.write_text(LOGS[name])
    assert recognise(Contents(path.read_bytes())).name == "rangefinder"
    readings = read_readings(path, rig=rig(tmp_path), hand=HAND)
    assert readings.is_free.tolist() == [False, True]
    np.testing.assert_allclose(readings.ranges.filled(0), [0.123, 0])
    assert readings.sensors == ("eye", "eye")


def test_no_valid_range_is_an_error(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("Status = 2, Distance = 50 mm\n")
    with pytest.raises(InputError, match="at least one valid range"):
        read_readings(path, rig=rig(tmp_path), hand=HAND)


def device(n):
    return f'[sensors.tof]\npreset = "tmf8820_zone3x3"\nzones = [{n}, {n}]\nfield_deg = 33\nposition_mm = [0, 0, 0]\n' \
        "quaternion_wxyz = [1, 0, 0, 0]\n"  # fmt: skip


def line(distances, number=4):
    pairs = np.zeros((36, 2), dtype=int)
    for k, distance in distances.items():
        pairs[k] = distance, 200
    return f"#Obj,65,{number},24,9,1355670293," + ",".join(map(str, pairs.ravel())) + "\n"


def read(tmp_path, text, n):
    path = tmp_path / "tmf.log"
    path.write_text(text)
    return read_readings(path, rig=rig(tmp_path, device(n)), hand=HAND)


def test_nine_results_are_three_by_three_zones(tmp_path):
    readings = read(tmp_path, line({k: 180 + k for k in range(9)} | {18: 900}), 3)
    np.testing.assert_allclose(readings.ranges[:], 0.18 + 1e-3 * np.arange(9))
    assert readings.sensors[::4] == ("tof.1.1", "tof.2.2", "tof.3.3")
    with pytest.raises(InputError, match=r"with 3 x 3 zones, got 'tof' \(8 x 8 zones\)"):
        read(tmp_path, line({8: 200}), 8)


def test_the_rig_decides_between_grids_that_a_log_allows(tmp_path):
    few = line({0: 200, 4: 210})
    counts = {n: len(read(tmp_path, few, n)) for n in (3, 4, 8)}
    assert counts == {3: 9, 4: 16, 8: 16}
    with pytest.raises(InputError, match="results of 18 zones"):
        read(tmp_path, line({8: 200, 17: 210}), 3)


def test_results_of_another_driver_are_the_same_zones(tmp_path):
    text = "Result Number: 1  Number of Results: 3\n" + "".join(
        f"       conf: {c} distance mm: {d} channel: {k} sub_capture: 0\n"
        for k, d, c in ((1, 184, 255), (1, 700, 90), (9, 193, 9))
    ) + "     photon: 1 ref photon: 2 ALS: 3\n\n"  # fmt: skip
    readings = read(tmp_path, text, 3)
    at = dict(zip(readings.sensors, readings.ranges.filled(np.nan), strict=True))
    np.testing.assert_allclose(at["tof.1.1"], 0.184)
    assert "tof.3.3" not in at  # unreliable
    assert len(readings) == 8
