"""``tanteo demo``: the story without a camera, and its report. With one it is in the README (``test_readme``)."""

from __future__ import annotations

import re


def test_without_a_camera_a_feeder_says_where(run, tmp_path, monkeypatch):
    import tanteo.demo.story as story

    monkeypatch.setattr(story, "find_spec", lambda name: None)
    monkeypatch.setattr(story, "_TOLERANCE", 3e-3)  # a few readings
    report = tmp_path / "demo.html"
    got = run("demo", "--no-open", "--report", str(report))
    assert got.code == 0
    assert "No camera" in got.out
    assert "\nstep_12mm, located to" in got.out
    assert float(re.search(r"It was step_12mm, and the corner farthest off is ([\d.]+) mm", got.out)[1]) < 6  # 2 sd
    text = report.read_text(encoding="utf-8")
    assert "How it went" in text
    assert "random" not in got.out  # which was counted with the camera
    assert "http://" not in text.replace("http://www.w3.org", "")


def test_a_report_that_cannot_be_written_is_said_before_story(run, tmp_path):
    assert run("demo", "--no-open", "--report", str(tmp_path / "demo.txt")).code == 2
    assert run("demo", "--no-open", "--report", str(tmp_path / "no" / "demo.html")).code == 1
