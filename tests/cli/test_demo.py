"""``tanteo demo``: the story without OpenCV, and its report. With it, it is in the README (``test_readme``)."""

from __future__ import annotations

import re
import shutil
import sys

import numpy as np
import pytest


def test_without_opencv_the_story_is_the_same(run, tmp_path, monkeypatch):
    from tanteo.bench.demo import stage

    monkeypatch.setattr(stage, "find_spec", lambda name: None)
    report = tmp_path / "demo.html"
    got = run("demo", "--no-open", "--report", str(report))
    assert got.code == 0
    assert got.out.startswith("Goal: the part with 99 %, and every corner of it within 0.5 mm at 95 %.\n")
    assert "evaluated before" in got.out
    assert re.search(r"It may be: step_12mm \(\d+ %\), step_15mm \(\d+ %\)", got.out)
    assert "\nstep_12mm, located to" in got.out
    assert float(re.search(r"It was step_12mm, and the corner farthest off is ([\d.]+) mm", got.out)[1]) < 0.5
    assert int(re.search(r"Readings: (\d+)\.", got.out)[1]) <= 10
    text = report.read_text(encoding="utf-8")
    assert "How it went" in text
    assert "random" not in got.out  # which was counted with the image
    assert "http://" not in text.replace("http://www.w3.org", "")


def test_an_unwritable_report_is_refused_before_the_demo(run, tmp_path):
    assert run("demo", "--no-open", "--report", str(tmp_path / "demo.txt")).code == 2
    assert run("demo", "--no-open", "--report", str(tmp_path / "no" / "demo.html")).code == 1
    both = run("demo", "--live", "--report", str(tmp_path / "demo.html"))
    assert both.code == 2
    assert "--report: expected without --live" in both.err


@pytest.mark.slow
def test_each_question_has_its_expected_gain_and_result(run, tmp_path):
    """The README shows another seed of the same story, which its quick test runs (``test_readme``)."""
    pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")
    report = tmp_path / "demo.html"
    got = run("demo", "--no-open", "--report", str(report), "--seed", "1")
    assert got.code == 0
    planned = re.findall(
        r"^ +(\d+)  (face \d+ of \w+): (.+)\n +([\d.]+ mm|nothing): (\w+) ([\d.]+) %", got.out, re.MULTILINE
    )
    assert [int(line[0]) for line in planned] == list(range(1, len(planned) + 1))
    assert planned[0][2].startswith("it would read of step_12mm ")
    assert planned[-1][4:] == ("step_12mm", max(line[5] for line in planned))
    assert got.out.rstrip().splitlines()[-1].startswith("Plan for a part of your own: tanteo plan --part ")
    text = report.read_text(encoding="utf-8")
    assert text.count("data:image/png;base64,") == 2
    assert '"look":[' in text


@pytest.mark.slow
def test_the_two_candidates_differ_for_camera_at_edges_alone():
    pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")
    import cv2

    from tanteo.bench.demo import set_stage

    shop = set_stage()
    shown = cv2.imdecode(np.frombuffer(shop.seen.likenesses, dtype=np.uint8), cv2.IMREAD_COLOR)
    orange = (shown == (0, 110, 230)).all(axis=-1)
    assert 0.002 < orange.mean() < 0.03
    assert orange[:, : 2 * shown.shape[1] // 3].sum() == 0
    session = shop.session("information", 0)
    assert session.start is shop.start
    assert shop.solid.name == "step_12mm"


def test_what_to_do_next_can_be_typed_as_it_stands(monkeypatch, tmp_path):
    from tanteo.cli import demo

    here = tmp_path / "tanteo"
    here.touch()
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(sys, "argv", [str(here), "demo"])
    assert demo.program_here() == str(here)
    monkeypatch.setattr(sys, "argv", ["-c", "demo"])
    assert demo.program_here() == "tanteo"
    monkeypatch.setattr(shutil, "which", lambda name: "/usr/bin/tanteo")
    monkeypatch.setattr(sys, "argv", [str(here), "demo"])
    assert demo.program_here() == "tanteo"
