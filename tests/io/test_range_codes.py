"""Values of ranges that are no distances: codes of devices, REP 117, words, the largest range itself."""

from __future__ import annotations

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.io import read_readings, read_rig
from tanteo.sensors.presets import MEANINGS, codes_of, known_codes, sensor_presets

HAND = "0,0,0,1,0,0,0"
HEADER = "range_mm,sensor,hand_x_mm,hand_y_mm,hand_z_mm,hand_qw,hand_qx,hand_qy,hand_qz"


def rig_file(tmp_path, preset="", reach=1200):
    keys = f'preset = "{preset}"' if preset else f"sd_mm = 0.5\nbeam_half_angle_deg = 0.2\nmax_mm = {reach}"
    path = tmp_path / "rig.toml"
    path.write_text(f"[sensors.eye]\n{keys}\nposition_mm = [0, 0, 20]\ndirection = [0, 0, 1]\n")
    return read_rig(path)


def table(tmp_path, *cells, unit="mm"):
    rows = [f"{cell},eye,{HAND}" for cell in cells]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEADER.replace("range_mm", f"range_{unit}"), *rows]) + "\n")
    return path


def free_and_count(readings):
    return readings.is_free.tolist(), len(readings)


def test_every_code_has_a_meaning_and_presets_that_exist():
    for value, names in known_codes().items():
        for name in names:
            assert name in sensor_presets()
            assert codes_of(name)[value] in MEANINGS
    assert not codes_of("keyence_il030")


@pytest.mark.parametrize(("preset", "code", "free"), [("vl53l0x", "8190", True), ("vl53l0x", "65535", False),
                                                      ("hc_sr04", "0", True), ("vl53l1x", "0", False)])  # fmt: skip
def test_codes_of_a_preset_are_its_own(tmp_path, preset, code, free):
    readings = read_readings(table(tmp_path, 300, code, 310), rig=rig_file(tmp_path, preset))
    assert free_and_count(readings) == (([False, True, False], 3) if free else ([False, False], 2))
    assert any(code in note for note in readings.notes)


def test_a_code_is_recognized_in_any_unit(tmp_path):
    readings = read_readings(table(tmp_path, "0.3", "8.19", unit="m"), rig=rig_file(tmp_path, "vl53l0x"))
    assert readings.is_free.tolist() == [False, True]


@pytest.mark.parametrize("word", ["inf", "+Inf", "Infinity"])
def test_infinity_means_a_free_beam(tmp_path, word):
    assert read_readings(table(tmp_path, 300, word), rig=rig_file(tmp_path)).is_free.tolist() == [False, True]


@pytest.mark.parametrize("word", ["-inf", "nan"])
def test_too_near_and_errors_exclude_a_row(tmp_path, word):
    assert len(read_readings(table(tmp_path, 300, word, 310), rig=rig_file(tmp_path))) == 2


@pytest.mark.parametrize("code", ["0", "-1", "OL", "----"])
def test_codes_of_an_unknown_device_are_requested(tmp_path, code):
    path, rig = table(tmp_path, 300, code), rig_file(tmp_path)
    with pytest.raises(InputError, match=f"line 3, column 'range_mm'.*--no-target {code}.*--invalid {code}"):
        read_readings(path, rig=rig)
    assert read_readings(path, rig=rig, no_target=code).is_free.tolist() == [False, True]
    assert len(read_readings(path, rig=rig, invalid=code)) == 1


def test_a_repeated_code_of_other_devices_is_requested(tmp_path):
    with pytest.raises(InputError, match="as vl53l0x writes it"):
        read_readings(table(tmp_path, 8190, 300, 8190), rig=rig_file(tmp_path))
    far = rig_file(tmp_path, reach=20_000)
    assert len(read_readings(table(tmp_path, 8190, 8000, 9000), rig=far)) == 3  # once, it is a distance


def test_a_stated_value_with_a_unit_is_a_length(tmp_path):
    path = table(tmp_path, "0.3", "4", unit="m")
    assert read_readings(path, rig=rig_file(tmp_path, reach=9000), no_target="4000mm").is_free.tolist() == [False, True]


def test_the_largest_range_itself_is_a_free_beam(tmp_path):
    readings = read_readings(table(tmp_path, 300, 1200, 1199.9), rig=rig_file(tmp_path))
    assert readings.is_free.tolist() == [False, True, False]
    np.testing.assert_allclose(readings.max_ranges[1], 1.2)
    assert "exactly the sensor's reach" in " ".join(readings.notes)


def test_a_heap_of_equal_largest_ranges_is_noted(tmp_path):
    rig = rig_file(tmp_path, reach=5000)
    heap = read_readings(table(tmp_path, 300, 301, 302, 303, 800, 800, 800), rig=rig)
    assert "--no-target 800mm" in " ".join(heap.notes)
    still = read_readings(table(tmp_path, 299, 300, 300, 300, 301, 301, 301), rig=rig)
    assert not any("--no-target" in note for note in still.notes)


def test_status_decides_before_codes(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"-1,eye,{HAND},none", f"0,eye,{HAND},invalid", f"300,eye,{HAND},ok"]
    path.write_text("\n".join([HEADER + ",status", *rows]))
    readings = read_readings(path, rig=rig_file(tmp_path))
    assert readings.is_free.tolist() == [True, False]
    assert "1 row of status invalid" in " ".join(readings.notes)


def test_analog_signals_are_ranges_by_their_scale(tmp_path):
    path = table(tmp_path, 0, 5, 10, "10.9", unit="v")
    rig = rig_file(tmp_path)
    readings = read_readings(path, rig=rig, analog="0V=160mm,10V=450mm")
    np.testing.assert_allclose(readings.ranges[:], [0.16, 0.305, 0.45])
    with pytest.raises(InputError, match="expected --analog for the signal 'range_v'"):
        read_readings(path, rig=rig)
    with pytest.raises(InputError, match="in the unit of 'range_v'"):
        read_readings(path, rig=rig, analog="4mA=160mm,20mA=450mm")
    for text in ("0V=1mm", "0V=1mm,0V=2mm", "0V=1mm,20mA=2mm", "x"):
        with pytest.raises(InputError, match="expected two points"):
            read_readings(path, rig=rig, analog=text)


def test_few_ranges_outside_the_limits_are_excluded(tmp_path):
    rig = rig_file(tmp_path, "vl53l0x")
    readings = read_readings(table(tmp_path, *[300] * 9, 12, 1900), rig=rig)
    assert len(readings) == 9
    assert "1 range below the smallest one and 1 range beyond the largest one" in " ".join(readings.notes)
    assert len(read_readings(table(tmp_path, 0.3, 0.31, unit="mm"), rig=rig)) == 2  # metres: refused when measured
