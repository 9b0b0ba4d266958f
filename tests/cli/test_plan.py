"""``tanteo plan``: tables, files, and the messages for misuse."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.geometry import SO3
from tanteo.io import read_readings

PARTS = Path(__file__).parents[2] / "examples" / "parts"
BRACKET = str(PARTS / "bracket_left.step")


@pytest.mark.slow
def test_a_plan_as_text_csv_and_json(run, tmp_path):
    out = tmp_path / "plan.csv"
    report = tmp_path / "plan.html"
    got = run("plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.1mm", "--csv", str(out), "--report", str(report))
    assert got.code == 0
    assert f"report written: {report}" in got.out
    assert "readings place bracket_left." in report.read_text(encoding="utf-8")
    assert "all corners of bracket_left within 0.5 mm" in got.out
    rows = list(csv.DictReader(line for line in out.read_text().splitlines() if not line.startswith("#")))
    assert len(rows) >= 6
    assert float(rows[-1]["within_tolerance"]) >= 0.95
    document = json.loads(run("plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.1mm", "--json").out)
    assert document["schema"] == "tanteo.plan/1"
    assert len(document["readings"]) == len(rows)
    assert document["readings"][0]["origin_m"][0] == pytest.approx(float(rows[0]["start_x_mm"]) / 1e3, abs=1e-7)
    assert document["covariance"]["frame"] == "part"
    last = document["readings"][-1]
    assert 0.95 <= document["within_tolerance"] == last["within_tolerance"] <= last["within_tolerance_if_met"]
    assert 0.5 < document["within_tolerance_assumed"] < document["within_tolerance"]
    assert last["within_tolerance"] == pytest.approx(float(rows[-1]["within_tolerance"]), abs=1e-4)
    assert last["within_tolerance_if_met"] == pytest.approx(float(rows[-1]["within_tolerance_if_met"]), abs=1e-4)
    assert last["meets_face"] == pytest.approx(float(rows[-1]["meets_face"]), abs=1e-4)
    assert document["all_meet"] <= min(r["meets_face"] for r in document["readings"])
    assert document["room"] > 0.9
    words = " ".join(got.out.split())
    assert f"P = {last['within_tolerance']:.3f} over all placements" in words
    assert f"{last['within_tolerance_if_met']:.3f} if every reading hits its face" in words


def test_a_rough_prior_pose_can_be_stated(run):
    got = run(
        "plan", "--part", BRACKET, "--goal", "2mm", "--sensor", "touch_probe_hobby", "--pose-prior",
        "400,200,0mm 0,0,90deg +- 5mm 3deg", "--approach", "0,0,-1,75deg", "--standoff", "30mm", "--json",
    )  # fmt: skip
    document = json.loads(got.out)
    assert got.code == 0
    assert document["pose"]["matrix"][0][3] == pytest.approx(0.4)
    assert all(r["direction"][2] < 0 for r in document["readings"])


@pytest.mark.slow
def test_a_tolerance_out_of_reach_exits_with_3(run):
    got = run("plan", "--part", BRACKET, "--goal", "0.01mm", "--sd", "1mm", "--max-measurements", "4")
    assert got.code == 3
    assert "4 readings do not place" in got.out


@pytest.mark.slow
def test_a_start_too_close_to_a_prior_pose_gives_no_plan(run):
    got = run(
        "plan", "--part", str(PARTS / "step_12mm.step"), "--sensor", "ball_tip_on_cobot", "--standoff", "8mm",
        "--clearance", "4mm", "--pose-prior", "0,0,0mm 0,0,0deg +- 5mm 3deg", "--goal", "0.7mm",
        "--max-measurements", "5",
    )  # fmt: skip
    assert got.code == 3
    assert "within 4 mm of the part, or inside it" in " ".join(got.out.split())


@pytest.mark.slow
def test_a_smaller_clearance_is_proposed_with_its_value(run):
    got = run("plan", "--part", BRACKET, "--sensor", "inductive_analog_m18", "--goal", "1mm")
    assert got.code == 3
    assert "--clearance 3.2mm" in " ".join(got.out.split())  # with which it works: tests/planning/test_plans.py


def test_two_parts_are_distinguished(run, tmp_path):
    report = tmp_path / "twins.html"
    words = ("plan", "--discriminate", BRACKET, str(PARTS / "bracket_right.step"), "--sd", "0.3mm")
    got = run(*words, "--report", str(report))
    assert got.code == 0
    assert "discriminates bracket_left" in got.out
    assert "One reading discriminates bracket_left and bracket_right." in report.read_text(encoding="utf-8")
    document = json.loads(run(*words, "--json").out)
    assert document["schema"] == "tanteo.discrimination/1"
    assert document["information_nats"] > 0.6
    assert np.shape(document["T_first_second"]) == (4, 4)


def test_two_outputs_are_two_files(run, tmp_path):
    same = str(tmp_path / "plan.html")
    words = ("plan", "--part", BRACKET, "--goal", "1mm", "--sd", "0.1mm")
    got = run(*words, "--csv", same, "--report", same)
    assert got.code == 2
    assert "--report: expected another file than that of --csv" in got.err
    assert not (tmp_path / "plan.html").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--goal", "1mm", "--sd", "1mm"), "--part FILE, or --discriminate"),
        (("--part", BRACKET, "--sd", "1mm"), "--goal"),
        (("--part", BRACKET, "--goal", "1mm"), "--sensor, --sd"),
        (("--part", BRACKET, "--goal", "-1mm", "--sd", "1mm"), "--goal"),
        (("--part", BRACKET, "--goal", "1mm", "--sd", "1mm", "--confidence", "1"), "--confidence"),
        (("--part", BRACKET, "--goal", "1mm", "--sd", "1mm", "--approach", "0,0,-1"), "--approach"),
        (("--part", BRACKET, "--goal", "1mm", "--sd", "0mm"), "--sd"),
        (("--part", BRACKET, "--goal", "1mm", "--sensor", "nothing"), "sensor"),
        (("--discriminate", BRACKET, "--sd", "1mm"), "two CAD files"),
        (("--discriminate", BRACKET, "--discriminate", BRACKET, "--sd", "1mm"), "twice"),
        (
            ("--part", BRACKET, "--goal", "1mm", "--sd", "1mm", "--max-measurements", "0"),
            "--max-measurements: expected 1 or more, got 0.",
        ),
        (
            ("--discriminate", BRACKET, "--discriminate", "x.step", "--sd", "1mm", "--csv", "x.csv"),
            "--csv: expected with",
        ),
        (
            (
                "--discriminate",
                BRACKET,
                "--discriminate",
                "x.step",
                "--sd",
                "1mm",
                "--confidence",
                "0.95",
                "--max-measurements",
                "30",
            ),
            "--confidence, --max-measurements: expected with",
        ),
        (("--part", BRACKET, "--goal", "1mm", "--sensor", "vl53l0x", "--standoff", "12mm"), "30 mm or more"),
        (("--part", BRACKET, "--goal", "1mm", "--sd", "1mm", "--report", "plan.pdf"), "--report"),
    ],
)
def test_misuse_is_advice(run, words, message):
    got = run("plan", *words)
    assert got.code == 2
    assert message in got.err
    assert "Traceback" not in got.err


def test_a_file_that_is_not_there_fails(run, tmp_path):
    assert run("plan", "--part", str(tmp_path / "no.step"), "--goal", "1mm", "--sd", "1mm").code == 1
    got = run("plan", "--part", BRACKET, "--goal", "1mm", "--sd", "0.1mm", "--csv", str(tmp_path / "no" / "p.csv"))
    assert got.code == 1
    assert "--csv" in got.err
    assert io.StringIO(got.out).read() == ""


@pytest.mark.slow
def test_a_named_feature_is_planned_for(run, tmp_path):
    out, report = tmp_path / "plan.csv", tmp_path / "plan.html"
    words = ("plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.1mm")
    got = run(*words, "--feature", "edge 3", "--csv", str(out), "--report", str(report))
    assert got.code == 0
    assert "edge 3 of bracket_left within 0.5 mm" in got.out
    assert "edge 3 sd (mm)" in got.out
    page = report.read_text(encoding="utf-8")
    assert "edge 3 within 0.5" in page
    assert "readings place edge 3 of bracket_left." in page
    assert "orst corner" not in page.split("<script")[0]
    rows = list(csv.DictReader(line for line in out.read_text().splitlines() if not line.startswith("#")))
    document = json.loads(run(*words, "--feature", "edge 3", "--json").out)
    all_corners = json.loads(run(*words, "--json").out)
    assert document["feature"] == "edge 3"
    assert all_corners["feature"] is None
    assert len(rows) == len(document["readings"]) < len(all_corners["readings"])
    last = document["readings"][-1]
    assert last["feature_sd_m"] == pytest.approx(float(rows[-1]["feature_sd_mm"]) / 1e3, abs=1e-7)
    assert last["feature_sd_m"] < last["corner_sd_m"]
    assert "feature_sd_m" not in all_corners["readings"][-1]


@pytest.mark.parametrize(
    ("feature", "message"), [("edge 99", "--feature: expected one of a part, got 'edge 99'"), ("left", "'edge 4'")]
)
def test_a_feature_that_is_not_there_is_misuse(run, feature, message):
    got = run("plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.1mm", "--feature", feature)
    assert got.code == 2
    assert message in got.err


def touches_of(script):
    """Return start and stop of every touch of a URScript program, as positions and rotation vectors ``(n, 2, 6)``."""
    rows = [line for line in script.splitlines() if line.startswith('  touch("')]
    return np.array([[[float(v) for v in pose.split(",")] for pose in re.findall(r"p\[([^]]*)\]", r)] for r in rows])


def test_a_robot_program_keeps_to_tool_table_and_time(run):
    got = run(
        "plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.05mm", "--tip-radius", "1.5mm", "--program", "ur",
        "--table", "0+-0.1mm", "--tool-tilt", "30deg", "--tool-body", "50,30,150mm", "--tip-sd", "0,0,0mm",
        "--pose-prior", "400,100,0mm 0,0,20deg +- 2mm 1deg",
    )  # fmt: skip
    assert got.code == 0, got.err
    seconds, slowest = map(float, re.search(r"about (\d+) s, (\d+) s for the slowest", got.err).groups())
    found = touches_of(got.out)
    assert slowest < 25
    assert seconds <= slowest * len(found)
    tool = SO3.exp(found[:, 0, 3:])[:, :, 2]
    assert (-tool[:, 2] >= np.cos(np.radians(30.1))).all()
    flange = found[:, 1, :3] - 0.08 * tool  # the first sphere of the tool behind the stylus
    assert (flange[:, 2] > 0.03).all()
    assert (np.linalg.norm(found[:, 1, :3] - found[:, 0, :3], axis=1) < 0.04).all()  # the slow part


def test_no_program_of_touches_that_cannot_keep_the_goal(run):
    """A tip that is known to 0.3 mm keeps no 0.2 mm: a program of a few touches would look like a plan."""
    words = "plan", "--part", BRACKET, "--sd", "0.05mm", "--tip-radius", "1.5mm", "--program", "ur"
    got = run(*words, "--goal", "0.2mm")
    assert got.code == 3
    assert got.out == ""
    assert "No number of readings places all corners" in got.err
    assert "no program is written" in got.err
    least = re.search(r"Plan for more than ([\d.]+ mm)", got.err)
    assert least
    assert float(least[1].split()[0]) == pytest.approx(0.6, rel=0.4)


def test_a_log_of_a_robot_program_has_the_pose_of_the_tool(run, tmp_path):
    common = "plan", "--part", BRACKET, "--goal", "0.5mm", "--sd", "0.05mm", "--tip-radius", "1.5mm", "--program", "ur"
    assumed = run(*common)
    assert assumed.code == 3
    assert "locate assumes an offset of the tip of 0.3 mm" in assumed.err
    script = run(*common, "--tip-sd", "0,0,0mm").out
    columns = re.search(r'textmsg\("(id,.*)"\)', script)[1]
    rows = [line for line in script.splitlines() if line.startswith('  touch("')]
    log = tmp_path / "log.csv"
    lines = [columns]
    for k, (row, (start, stop)) in enumerate(zip(rows, touches_of(script), strict=True)):
        here = [*(0.5 * (start[:3] + stop[:3])), *stop[3:]]
        facts = re.findall(r'"([^"]*)"\)', row)[0]
        lines.append(f"{k},{','.join(f'{v:.6f}' for v in here[:3])},{','.join(f'{v:.6f}' for v in here)},{facts}")
    log.write_text("\n".join(lines) + "\n")
    readings = read_readings(log)
    assert readings.Ts_world_hand.given.all()
    measured = tanteo.sensors.measure(readings, sd=1e-4, tip_sd=[1e-3, 1e-3, 1e-3])
    assert [error.name for error in measured.shared] == ["tip offset"]


@pytest.mark.slow
def test_the_error_of_the_form_needs_more_touches(run):
    words = ("plan", "--part", BRACKET, "--goal", "0.8mm", "--sd", "0.05mm", "--json")
    plain = json.loads(run(*words).out)
    cast = json.loads(run(*words, "--form-sd", "cast").out)
    assert len(cast["readings"]) > len(plain["readings"])


def test_a_mill_approaches_along_its_axes(run):
    got = run("plan", "--part", BRACKET, "--goal", "0.8mm", "--sd", "0.05mm", "--axis-parallel", "--json")
    directions = np.array([r["direction"] for r in json.loads(got.out)["readings"]])
    assert np.allclose(np.abs(directions).max(axis=1), 1.0)
    assert (directions[:, 2] <= 1e-9).all()
