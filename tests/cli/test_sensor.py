"""``sensor list``, ``show``, ``rig`` and ``fit``: what they print, draw and write, and how they refuse."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tanteo.io import read_readings, read_rig, write_readings
from tanteo.sensors import Readings
from tanteo.sensors.presets import robot_presets, sensor_presets

READINGS = Path(__file__).parents[2] / "examples" / "readings"
LOG, RIG = READINGS / "plane_log.csv", READINGS / "tof_rig.toml"
TRUE_ORIGIN, TRUE_BEAM = np.array([1.4, 38.2, 61.7]) * 1e-3, np.array([0.021, -0.015, 1.0])
TRUE_BEAM /= np.linalg.norm(TRUE_BEAM)


def as_json(result):
    return json.loads(result.out, parse_constant=pytest.fail)


def test_list_has_every_name_with_its_verification(run):
    result = run("sensor", "list")
    assert result.code == 0
    for name in (*sensor_presets(), *robot_presets(), "paper-gripper"):
        assert name in result.out
    assert "V stated in the source" in result.out.replace("\n", " ")
    assert max(map(len, result.out.splitlines())) <= 120
    document = as_json(run("sensor", "list", "--json"))
    assert len(document["sensors"]) == 23
    assert all(row["source"] and row["check"] for row in document["sensors"] + document["robots"])
    assert document["rigs"] == ["paper-gripper"]


@pytest.mark.parametrize("name", sensor_presets())
def test_show_describes_every_sensor(run, name):
    result = run("sensor", "show", name)
    assert (result.code, result.err) == (0, "")
    preset = sensor_presets()[name]
    assert preset.source in result.out
    assert ("noise in mm at range mm" in result.out) != preset.is_contact
    assert as_json(run("sensor", "show", name, "--json"))["name"] == name


def test_the_table_of_noise_is_the_model_s(run):
    """The last row, at the farthest range: law, cone, bias and scale of the preset."""
    row = run("sensor", "show", "vl53l4cd").out.splitlines()[-1].split()
    sigma, cone = np.hypot(0.0015, 0.003 * 1.2), 0.5 * 1.2 * np.deg2rad(9)
    expected = [1.2, sigma, *np.hypot(sigma, cone * np.tan(np.deg2rad([15, 30, 45]))), 0.0035]
    np.testing.assert_allclose([float(x) for x in row], 1e3 * np.array(expected), rtol=6e-3)


def test_show_describes_a_robot(run):
    result = run("sensor", "show", "xarm")
    assert "absolute  1 mm" in result.out
    assert result.code == 0


def test_pictures_are_drawn(run, tmp_path):
    pytest.importorskip("matplotlib")
    for suffix in ("png", "svg", "pdf"):
        file = tmp_path / f"noise.{suffix}"
        result = run("sensor", "show", "vl53l0x", "--picture", file)
        assert (result.code, result.err) == (0, "")
        assert file.stat().st_size > 5_000
    assert "range [mm]" not in (tmp_path / "noise.png").read_bytes().decode("latin1")
    file = tmp_path / "covered.png"
    assert run("sensor", "fit", LOG, "--picture", file).code == 0
    assert file.read_bytes().startswith(b"\x89PNG")


def test_pictures_without_matplotlib_name_the_package(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    result = run("sensor", "show", "vl53l0x", "--picture", tmp_path / "x.png")
    assert (result.code, result.out) == (2, "")
    assert "pip install -e '.[plot]'" in result.err


def test_rig_shows_the_paper_s_gripper(run):
    result = run("sensor", "rig", "paper-gripper")
    assert (result.code, result.err) == (0, "")
    lines = result.out.splitlines()
    assert lines[0] == "paper-gripper: 6 sensors in the hand's frame"
    assert lines[2].split()[:8] == ["front_left", "infrared_intensity", "-20", "0", "100", "0", "0", "1"]
    document = as_json(run("sensor", "rig", "paper-gripper", "--json"))
    assert [s["name"] for s in document["sensors"]][:2] == ["front_left", "front_right"]
    assert document["sensors"][0]["matrix"][2][3] == pytest.approx(0.1)


def test_fit_finds_beam_strays_and_coverage(run):
    result = run("sensor", "fit", LOG, "--rig", RIG)
    assert result.code == 0
    assert "49 of 288 ranges are exactly the largest one, 450 mm" in result.err
    for words in (
        "calibrated: 288 readings at 48 places on 2 planes", "the offset of the ranges is in it", "sd deg", "wall",
        "0-15 deg", "Excluded: 6 places saturated", "saturated: 7 .. 12 (6) on table read 450.0 mm",
        "holds for these ranges and incidences",
    ):  # fmt: skip
        assert words in result.out


def test_fit_is_true_within_its_covariance(run, tmp_path):
    """The truth is in the comments of the log; the written rig holds it, too."""
    out = tmp_path / "fitted.toml"
    result = run("sensor", "fit", LOG, "--rig", RIG, "--write", out, "--json")
    document = as_json(result)
    assert (result.code, document["status"]) == (0, "calibrated")
    beam = document["beams"][0]
    T, C = np.array(beam["matrix"]), np.array(beam["covariance"]["matrix"])
    # 2.6 mm too far is an origin 2.6 mm farther back
    origin = T[:3, :3].T @ (TRUE_ORIGIN - 2.6e-3 * TRUE_BEAM - T[:3, 3])
    aim = T[:3, :3].T @ TRUE_BEAM
    e = np.r_[origin, -aim[1], aim[0], 0.012 - beam["scale"], -beam["slant"]]
    assert e @ np.linalg.solve(C, e) < 24.3  # chi2, 7 degrees of freedom, 0.999
    assert sum(len(o["readings"]) for o in document["outliers"]) == 36
    assert len(document["places"]) == 48
    sensor = read_rig(out).sensors[0]
    np.testing.assert_allclose(sensor.T_hand_sensor, T, atol=1e-9)
    np.testing.assert_allclose(sensor.cov_mount[:5, :5], C[:5, :5], atol=1e-15)
    assert out.read_text().startswith("# Calibrated by `tanteo sensor fit` from plane_log.csv: 42 places.")
    assert run("sensor", "rig", out).code == 0


def test_fit_without_a_rig_needs_nothing(run):
    document = as_json(run("sensor", "fit", LOG, "--json"))
    assert document["status"] == "calibrated"
    np.testing.assert_allclose(np.array(document["beams"][0]["matrix"])[:3, 2], TRUE_BEAM, atol=0.02)


def test_an_uninformative_log_exits_3_and_writes_nothing(run, tmp_path):
    readings = read_readings(LOG)
    one = np.repeat(readings.Ts_world_hand[:1], 60, axis=0)
    one[:, :3, 3] += np.random.default_rng(0).uniform(-0.05, 0.05, (60, 3)) * [1, 1, 0]
    still = Readings.from_columns(
        ranges=np.full(60, 0.12), sensors=["eye"] * 60, Ts_world_hand=one
    )  # fmt: skip
    log, out = tmp_path / "still.csv", tmp_path / "rig.toml"
    write_readings(still, log)
    result = run("sensor", "fit", log, "--write", out)
    assert result.code == 3
    assert result.out.startswith("insufficient")
    assert "undetermined" in result.out
    assert "was not written" in result.err
    assert not out.exists()
    quiet = run("sensor", "fit", log, "--json")
    assert (quiet.code, as_json(quiet)["status"]) == (3, "insufficient")
    assert quiet.err.startswith("insufficient: ")


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["show", "vl53l1"], 2, "Did you mean 'vl53l1x'"),
        (["show", "xarm", "--picture", "x.png"], 2, "expected a range sensor, got the robot 'xarm'"),
        (["show", "touch_probe_hobby", "--picture", "x.png"], 2, "got the touch probe"),
        (["show", "vl53l0x", "--picture", "x.gif"], 2, "ends in .png, .svg, .pdf, got 'x.gif'"),
        (["show", "vl53l0x", "--picture", "no/such/folder/x.png"], 1, "No such file or directory"),
        (["rig", "nono"], 1, "expected a rig file or one of paper-gripper"),
        (["fit", "nono.csv"], 1, "No such file or directory"),
        (["fit", LOG, "--rig", "paper-gripper"], 2, "got 'eye'"),
        (["fit", LOG, "--sensor", "nono"], 2, "sensor: expected one of"),
        (["fit", LOG, "--robot", "nono"], 2, "robot: expected one of"),
        (["fit", LOG, "--write", "no/such/folder/x.toml"], 1, "--write: expected a file that can be written"),
        (["fit", READINGS / "bracket_left.csv"], 1, "expected a range with its sensor and the hand's pose"),
    ],
)
def test_refusals(run, words, code, message):
    if "--picture" in words:
        pytest.importorskip("matplotlib")
    result = run("sensor", *words)
    assert (result.code, result.out) == (code, "")
    assert message in result.err
    assert sum(not line.startswith("warning") for line in result.err.splitlines()) == 1
