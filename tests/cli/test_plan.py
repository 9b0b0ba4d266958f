"""``tanteo plan``: tables, files, and the messages for misuse."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

PARTS = Path(__file__).parents[2] / "examples" / "parts"
BRACKET = str(PARTS / "bracket_left.step")


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
