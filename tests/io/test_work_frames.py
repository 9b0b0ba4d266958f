"""Frames of machines and robots: read back, what a turn about z cannot hold, LinuxCNC's own interpreter."""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3, UncertainFrame
from tanteo.io import pose_from_brand
from tanteo.io.poses import parse_work_frame, write_work_frame

C = np.diag([1e-8] * 3 + [1e-10] * 3)
CORNERS = np.stack(np.meshgrid([0, 0.1], [0, 0.2], [0, 0.05]), axis=-1).reshape(8, 3)
NUMBER = re.compile(r"-?\d+\.\d+")


@pytest.fixture
def rng():
    return np.random.default_rng(35)


def upright(rng, tilt):
    turn = SO3.axis_rotation(2, rng.uniform(-3, 3)) @ SO3.axis_rotation(0, tilt)
    return UncertainFrame(SE3.from_parts(turn, rng.uniform(-1, 1, 3)), C)


def written(name, frame, **how):
    return write_work_frame(parse_work_frame(name), frame, CORNERS, note, **how)


def note(omitted):
    return "block: recognized (99 %)" if omitted < 1e-6 else f"block: omitted {1e3 * omitted:.4f} mm"


def words(line):
    return {letter: float(value) for letter, value in re.findall(r"([A-Z])(-?[\d.]+)", line)}


def test_an_offset_holds_place_and_turn(rng):
    frame = upright(rng, 0.0)
    got = written("G54", frame)
    line = got.text.splitlines()[-1]
    values = words(line)
    assert line.startswith("G10 L2 P1 X")
    R = SO3.axis_rotation(2, np.radians(values["R"]))
    np.testing.assert_allclose([values[a] / 1e3 for a in "XYZ"], frame.T[:3, 3], atol=1e-6)
    np.testing.assert_allclose(R, frame.T[:3, :3], atol=1e-6)
    assert "(block: recognized [99 %])" in got.text
    assert len(got.warnings) == 1


@pytest.mark.parametrize(("name", "p"), [("G55", 2), ("g59", 6), ("G59.1", 7), ("G59.3", 9), ("linuxcnc:G59.2", 8)])
def test_every_offset_has_its_number(name, p, rng):
    assert f"G10 L2 P{p} X" in written(name, upright(rng, 0.0)).text


def test_heidenhain_shifts_and_turns_the_datum(rng):
    frame = upright(rng, 0.0)
    got = written("heidenhain", frame)
    lines = got.text.splitlines()
    shift = [float(re.fullmatch(rf"CYCL DEF 7\.{k} [XYZ]([+-][\d.]+)", lines[2 + k])[1]) for k in (1, 2, 3)]
    np.testing.assert_allclose(shift, 1e3 * frame.T[:3, 3], atol=1e-3)
    turn = float(re.fullmatch(r"CYCL DEF 10\.1 ROT([+-][\d.]+)", lines[-1])[1])
    R = SO3.axis_rotation(2, np.radians(turn))
    assert np.linalg.norm((CORNERS @ R.T + frame.T[:3, 3]) - SE3.apply(frame.T, CORNERS), axis=1).max() < 1e-5
    with pytest.raises(InputError, match="farthest corner"):
        written("heidenhain", upright(rng, np.radians(2.0)))


def test_a_tilt_is_reported_at_the_far_corner(rng):
    frame = upright(rng, np.radians(2.0))
    got = written("G54", frame, accept_lost=True)
    stated = float(re.search(r"farthest corner is ([\d.e-]+) mm", got.warnings[0])[1])
    values = words(got.text.splitlines()[-1])
    rotated = SE3.from_parts(SO3.axis_rotation(2, np.radians(values["R"])), frame.T[:3, 3])
    worst = np.linalg.norm(SE3.apply(frame.T, CORNERS) - SE3.apply(rotated, CORNERS), axis=1).max()
    assert stated == pytest.approx(1e3 * worst, rel=0.01)
    assert stated == pytest.approx(np.radians(2) * np.hypot(200, 50), rel=0.01)


def test_no_offset_holds_a_part_on_its_side(rng):
    with pytest.raises(InputError, match="got a tilt of 90"):
        written("G54", upright(rng, np.pi / 2))


def turned(degrees, sd=6e-4):
    T = SE3.from_parts(SO3.axis_rotation(2, np.radians(degrees)), np.array([0.3, 0.1, -0.02]))
    return UncertainFrame(T, np.diag([1e-8] * 3 + [1e-10] * 2 + [np.radians(sd) ** 2]))


def test_an_offset_without_turn_has_none():
    got = written("grbl:G54", turned(-170.0), accept_lost=True)
    assert "\nG21 G90\n" in got.text
    assert " R" not in got.text.splitlines()[-1]
    assert "cannot represent any rotation of the part (it has a turn of -170.0000" in got.warnings[0]


@pytest.mark.parametrize(("frame", "name"), [(turned(-170.0), "grbl:G54"), (turned(0.03), "grbl:g55")])
def test_a_lost_turn_is_refused(frame, name):
    with pytest.raises(InputError, match=r"mm off\. Align the part, .* --accept-turn-lost"):
        written(name, frame)


def test_a_lost_tilt_is_refused(rng):
    with pytest.raises(InputError, match=r"cannot represent a tilt of 2\.0+ \+- "):
        written("G54", upright(rng, np.radians(2.0)))


@pytest.mark.parametrize("name", ["grbl:G54", "G54", "heidenhain"])
def test_a_rotation_within_its_sd_is_written(name):
    """0.1 +- 0.08 degrees displace the far corner by 0.39 mm; 0.1 +- 0.02 degrees are a rotation that is there."""
    turn = SO3.axis_rotation(2 if "grbl" in name else 1, np.radians(0.1))
    for sd, allowed in ((0.08, True), (0.02, False)):
        frame = UncertainFrame(SE3.from_parts(turn, np.zeros(3)), np.diag([1e-8] * 3 + [np.radians(sd) ** 2] * 3))
        if not allowed:
            with pytest.raises(InputError, match=r"0\.100 \+- 0\.020 deg"):
                written(name, frame)
            continue
        got = written(name, frame)
        worst = 1e3 * np.linalg.norm(CORNERS @ turn.T - CORNERS, axis=1).max()
        assert f"omitted {worst:.4f} mm" in got.text
        assert "do not distinguish this rotation from none" in got.warnings[0]


def test_a_certain_turn_beside_an_unsure_tilt():
    """A turn of 0.2 +- 0.02 degrees is refused although the tilt of 1 +- 1 degrees alone may be none."""
    T = SE3.from_parts(SO3.axis_rotation(2, np.radians(0.2)) @ SO3.axis_rotation(0, np.radians(1.0)), np.zeros(3))
    frame = UncertainFrame(T, np.diag([1e-8] * 3 + list(np.radians([1.0, 1.0, 0.02]) ** 2)))
    with pytest.raises(InputError, match="cannot represent any rotation"):
        written("grbl:G54", frame)


def test_a_turn_below_a_tenth_is_a_warning():
    """The far corner of the box is 0.2236 m from the axis: 0.025 deg are 0.098 mm there."""
    got = written("grbl:G54", turned(0.025))
    assert "0.0976 mm off" in got.warnings[0]


def test_haas_turns_by_g68(rng):
    frame = upright(rng, 0.0)
    got = written("haas:g55", frame)
    offset, select, turn = got.text.splitlines()[-3:]
    assert offset.startswith("G10 L2 P2 X")
    assert select == "G55"
    values = words(turn)
    assert (values["X"], values["Y"]) == (0.0, 0.0)
    np.testing.assert_allclose(SO3.axis_rotation(2, np.radians(values["R"])), frame.T[:3, :3], atol=1e-5)
    assert "until G69" in "".join(got.warnings)
    assert "G68" not in written("haas:G54", turned(0.0)).text


def test_fanuc_controls_turn_as_haas(rng):
    frame = upright(rng, 0.0)
    assert written("fanuc:g55", frame).text == written("haas:G55", frame).text


def test_siemens_holds_the_whole_pose(rng):
    frame = upright(rng, 0.7)
    got = written("siemens:G55", frame)
    (line,) = [line for line in got.text.splitlines() if line.startswith("$P_UIFR[2] = ")]
    x, y, z, roll, pitch, yaw = (float(v) for v in re.findall(r"[XYZ],(-?[\d.]+)", line))
    axes = zip((2, 1, 0), np.radians([yaw, pitch, roll]), strict=True)
    R = np.linalg.multi_dot([SO3.axis_rotation(axis, angle) for axis, angle in axes])
    np.testing.assert_allclose(R, frame.T[:3, :3], atol=1e-6)
    np.testing.assert_allclose(1e-3 * np.array([x, y, z]), frame.T[:3, 3], atol=1e-6)
    with pytest.raises(InputError, match="expected siemens:G54"):
        written("siemens:G58", frame)


@pytest.mark.parametrize(
    ("name", "brand", "mark"),
    [
        ("kuka:5", "kuka", "BASE_DATA[5] = {FRAME: X"),
        ("abb:w1", "abb", "PERS wobjdata w1 := [FALSE, TRUE,"),
        ("ur:fixture", "ur", "global fixture = p["),
        ("fanuc:3", "fanuc", "UFRAME[3]=PR[100]"),
    ],
)
def test_robots_hold_the_whole_pose(name, brand, mark, rng):
    frame = upright(rng, 1.2)
    text = written(name, frame).text
    assert mark in text
    T = pose_from_brand(brand, np.array([float(v) for v in NUMBER.findall(text)][: 7 if brand == "abb" else 6]))
    np.testing.assert_allclose(T, frame.T, atol=2e-6)


@pytest.mark.parametrize(
    "name",
    [
        "G53",
        "G60",
        "fanuc:12",
        "kuka:0",
        "abb:2x",
        "ur:a b",
        "grbl:G59.1",
        "siemens:1",
        "",
        "G54:2",
        "G54@G54",
        "G55@G60",
    ],
)
def test_frames_that_are_none(name):
    with pytest.raises(InputError):
        parse_work_frame(name)


@pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 of linuxcnc-uspace is not installed")
def test_linuxcnc_takes_the_offset(rng, tmp_path):
    frame = upright(rng, 1e-4)
    (tmp_path / "wcs.ngc").write_text(written("G55", frame).text + "G55\nG0 X0 Y0 Z0\nM2\n", encoding="utf-8")
    (tmp_path / "tool.tbl").write_text("", encoding="utf-8")
    done = subprocess.run(
        ["rs274", "-g", "-t", "tool.tbl", "wcs.ngc"], cwd=tmp_path, capture_output=True, text=True, timeout=20
    )
    assert done.returncode == 0, done.stderr
    offset = re.findall(r"SET_G5X_OFFSET\(2, ([^)]*)\)", done.stdout)[-1]
    np.testing.assert_allclose([float(v) / 1e3 for v in offset.split(",")[:3]], frame.T[:3, 3], atol=1e-6)


@pytest.mark.skipif(shutil.which("rs274") is None, reason="rs274 of linuxcnc-uspace is not installed")
def test_linuxcnc_puts_a_frame_into_another(rng, tmp_path):
    """Readings in a turned and shifted G54: its offset and turn are in what G55 gets."""
    frame = upright(rng, 0.0)
    got = written("G55@G54", frame)
    assert "taken as coordinates of G54" in got.warnings[-1]
    lines = "G21\nG10 L2 P1 X100 Y-50 Z20 R30\n" + got.text + "G55\nG0 X0 Y0 Z0\nM2\n"
    (tmp_path / "wcs.ngc").write_text(lines, encoding="utf-8")
    (tmp_path / "tool.tbl").write_text("", encoding="utf-8")
    command = ["rs274", "-g", "-t", "tool.tbl", "wcs.ngc"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=20)
    assert done.returncode == 0, done.stderr
    T = SE3.from_parts(SO3.axis_rotation(2, np.radians(30)), np.array([0.1, -0.05, 0.02])) @ frame.T
    offset = re.findall(r"SET_G5X_OFFSET\(2, ([^)]*)\)", done.stdout)[-1]
    np.testing.assert_allclose([float(v) / 1e3 for v in offset.split(",")[:3]], T[:3, 3], atol=2e-6)
    turns = np.radians([float(v) for v in re.findall(r"SET_XY_ROTATION\(([^)]*)\)", done.stdout)])
    closest = min(np.abs(SO3.axis_rotation(2, turn) - T[:3, :3]).max() for turn in turns)
    assert closest < 2e-6  # the last is that of G54 again, at the end of the program
