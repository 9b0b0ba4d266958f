"""``tanteo demo``: the story ends well, and its report is there."""

from __future__ import annotations

import re
import time

import pytest


def test_the_story_ends_with_the_truth_and_a_report(run, tmp_path):
    pytest.importorskip("cv2", reason="the image needs tanteo[vision]")
    report, begun = tmp_path / "demo.html", time.process_time()
    got = run("demo", "--no-open", "--report", str(report))
    assert got.code == 0
    assert time.process_time() - begun < 40  # seconds of one core; under twenty on an idle machine
    assert "The camera above it: step_12mm" in got.out
    assert "step_15mm" in got.out
    assert "It was step_12mm" in got.out
    off = float(re.search(r"worst corner is ([\d.]+) mm", got.out).group(1))
    assert off < 1.0
    ours, others = re.search(r"Readings: (\d+)\. Random places would have taken (.+)\.", got.out).groups()
    assert int(ours) < int(re.search(r"\d+", others).group())
    text = report.read_text(encoding="utf-8")
    assert "How it went" in text
    assert "http://" not in text.replace("http://www.w3.org", "")


def test_without_a_camera_a_feeder_says_where(run, tmp_path, monkeypatch):
    import tanteo.demo.story as story

    monkeypatch.setattr(story, "find_spec", lambda name: None)
    monkeypatch.setattr(story, "_MOST", 14)  # enough for the session; random sensing need not go on, nor be tried again
    monkeypatch.setattr(story, "_TRIES", 1)
    got = run("demo", "--no-open", "--report", str(tmp_path / "demo.html"))
    assert got.code == 0
    assert "No camera" in got.out
    assert "It was step_12mm" in got.out


def test_a_report_that_cannot_be_written_is_said_before_the_story(run, tmp_path):
    assert run("demo", "--no-open", "--report", str(tmp_path / "demo.txt")).code == 2
    assert run("demo", "--no-open", "--report", str(tmp_path / "no" / "demo.html")).code == 1
