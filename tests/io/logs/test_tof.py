"""Frames of zones: the same picture in every way that drivers print it, with the status of each zone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.io import read_readings, read_rig
from tanteo.io.logs import Contents, recognise
from tanteo.sensors import Rig, RigSensor, measure
from tanteo.sensors.presets import sensor_preset

DISTANCES = 300 + np.arange(64).reshape(8, 8)
"""Millimetres, row by row."""

STATUS = np.full((8, 8), 5)
STATUS[0, 3], STATUS[2, 1], STATUS[7, 7] = 255, 13, 9
"""No target, unreliable, merged."""


def lines(d, s):
    body = "".join(f"Zone : {k:3d}, Status : {s.flat[k]:3d}, Distance : {d.flat[k]:4d} mm\n" for k in range(d.size))
    return f"Print data no :   1\n{body}\n"


def cells(d, s):
    out = "Cell Format :\n\n \x1b[38;5;10m       Distance [mm]\x1b[0m :               Status\n\n\n"
    for row, codes in zip(d, s, strict=True):
        out += " -----------------" * len(row) + "\n" + "|                 " * len(row) + "|\n"
        for distance, code in zip(row[::-1], codes[::-1], strict=True):
            gone = code == 255
            out += "|     X  :      X " if gone else f"| \x1b[38;5;10m{distance:5d}\x1b[0m  :  {code:5d} "
        out += "|\n" + "|    12  :      3 " * len(row) + "|\n"
    return out


def grid(d, s):
    return "".join("\t" + "\t".join(f"{x} ({c})" for x, c in zip(r[::-1], k[::-1], strict=True)) + "\n"
                   for r, k in zip(d, s, strict=True)) + "\n"  # fmt: skip


def save(tmp_path, text):
    path = tmp_path / "frames.log"
    path.write_text(text)
    return path


RIG = """[sensors.tof]
preset = "vl53l5cx_zone8x8"
zones = [8, 8]
field_deg = 45
position_mm = [0, 0, 0]
quaternion_wxyz = [1, 0, 0, 0]
"""


def rig(rows, columns=None):
    columns = columns or rows
    turned = SE3.from_parts(np.eye(3), np.zeros(3))
    one = RigSensor("", turned, sensor_preset("vl53l5cx_zone8x8"), np.nan, 0.05, 4.0, 0.0, np.zeros((6, 6)))
    zones = [(r, c) for r in range(rows) for c in range(columns)]
    return Rig(tuple(replace(one, name=f"tof.{r + 1}.{c + 1}", unit="tof", T_hand_unit=turned) for r, c in zones))


HAND = {"rig": rig(8), "hand": "0,0,0mm 180,0,0deg"}


@pytest.mark.parametrize("way", [lines, cells, grid])
def test_zones_and_their_status_however_they_are_printed(tmp_path, way):
    path = save(tmp_path, "boot\n" * (way is lines) + way(DISTANCES, STATUS))
    assert recognise(Contents(path.read_bytes())).name == "tof"
    readings = read_readings(path, **HAND)
    assert len(readings) == 63
    assert readings.is_free.sum() == 1
    at = dict(zip(readings.sensors, readings.ranges.filled(np.nan), strict=True))
    assert "tof.3.2" not in at
    assert np.isnan(at["tof.1.4"])
    np.testing.assert_allclose(at["tof.1.1"], 0.3)
    np.testing.assert_allclose(at["tof.8.8"], 0.363)
    np.testing.assert_allclose(at["tof.2.1"], 0.308)
    assert "64 zones: 62 with a target, 1 without, 1 unreliable" in readings.notes[0]


def test_frames_are_measured_with_a_rig(tmp_path):
    (tmp_path / "rig.toml").write_text(RIG)
    readings = read_readings(save(tmp_path, lines(DISTANCES, STATUS)), **HAND)
    measured = measure(readings, rig=read_rig(tmp_path / "rig.toml"))
    assert len(measured) == 62
    assert len(measured.free.ids) == 1
    assert (measured.points[:, 2] < -0.2).all()


def test_a_grid_without_status_and_one_of_four_rows(tmp_path):
    bare = "\n".join("\t".join(map(str, row[::-1])) for row in DISTANCES) + "\n\n"
    readings = read_readings(save(tmp_path, 2 * bare), **HAND)
    assert len(readings) == 128
    assert "have no status codes" in readings.notes[0]
    small = read_readings(save(tmp_path, lines(DISTANCES[:4, :4], STATUS[:4, :4])), rig=rig(4), hand=HAND["hand"])
    assert set(small.sensors) >= {"tof.1.1", "tof.4.4"}


def objects(capture, distances, confidences):
    """Return one line of the TMF8828's driver: 36 results, where 9, 18, 27 and 36 belong to the reference."""
    pairs = np.stack([distances, confidences], axis=1).ravel()
    return f"#Obj,65,{capture},18,18,388525," + ",".join(map(str, pairs)) + "\n"


def test_four_captures_are_one_frame(tmp_path):
    distances, confidences = np.zeros(36, dtype=int), np.full(36, 60)
    distances[6], distances[15], distances[0] = 500, 510, 520
    confidences[15] = 7
    text = "".join(objects(k, distances + k * (distances > 0), confidences) for k in range(4))
    readings = read_readings(save(tmp_path, "# ... reset\n" + text), **HAND)
    at = dict(zip(readings.sensors, readings.ranges.filled(np.nan), strict=True))
    assert len(readings) == 60  # four unreliable ones
    np.testing.assert_allclose([at["tof.2.1"], at["tof.2.3"], at["tof.1.1"], at["tof.1.3"]], [0.5, 0.501, 0.502, 0.503])
    np.testing.assert_allclose(at["tof.8.1"], 0.52)
    assert readings.is_free.sum() == 60 - 8
    with pytest.raises(InputError, match="line 1: expected #Obj with 77"):
        read_readings(save(tmp_path, objects(0, distances[:9], confidences[:9])), **HAND)


def test_a_frame_of_distances_and_one_of_confidences(tmp_path):
    def block(values):
        return "".join("  " + " ".join(f"{x:5d}" for x in row) + "\n" for row in values)

    sure = np.full((8, 8), 90)
    sure[0, 1] = 3
    text = f"Temp=25C\nDistance (mm):\n{block(DISTANCES)}Confidence:\n{block(sure)}\n"
    readings = read_readings(save(tmp_path, text), **HAND)
    assert len(readings) == 63
    np.testing.assert_allclose(readings.ranges[0], 0.3)
    assert readings.sensors[:2] == ("tof.1.1", "tof.1.3")


def test_missing_facts_of_a_frame_are_requested(tmp_path):
    path = save(tmp_path, lines(DISTANCES, STATUS))
    with pytest.raises(InputError, match=r"expected --rig and --hand with frames of a multi-zone.*--hand '400"):
        read_readings(path)
    with pytest.raises(InputError, match="at least one reliable zone"):
        read_readings(save(tmp_path, lines(DISTANCES, np.full((8, 8), 13))), **HAND)
    with pytest.raises(InputError, match="distances up to 6000 mm"):
        read_readings(save(tmp_path, lines(DISTANCES + 9000, STATUS)), **HAND)
