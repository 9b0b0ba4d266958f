"""Output files are checked before the long work, and they survive a closed stream."""

from __future__ import annotations

import os
import re
import subprocess
import sys

import pytest

PROGRAM = [sys.executable, "-c", "from tanteo.cli import main; main()"]
PLAN = ("plan", "--part", "none.stl", "--units", "mm", "--sd", "1mm", "--goal", "1mm")


@pytest.mark.parametrize(
    ("name", "message", "code"),
    [
        ("nowhere/r.html", "there is no folder", 1),
        ("folder.html", "it is a folder", 1),
        ("r.txt", "ends in .html or .htm", 2),
        ("r", "Add the suffix", 2),
        (f"{'x' * 5000}.html", "File name too long", 1),
    ],
)
def test_unwritable_targets_are_reported_beforehand(run, tmp_path, name, message, code):
    (tmp_path / "folder.html").mkdir()
    result = run("identify", "none.csv", "--parts", "none.stl", "--report", tmp_path / name)
    assert (result.code, result.out) == (code, "")
    assert re.match(r"error: --report: expected .*, got '.*'.*\. [A-Z]", result.err)
    assert message in result.err


@pytest.mark.parametrize("option", [("--report", "R.HTML"), ("--csv", "plan")])
def test_what_can_be_written_is_left_alone(run, tmp_path, option):
    result = run(*PLAN, option[0], tmp_path / option[1])
    assert "none.stl" in result.err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_which_nothing_may_be_written(run, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: not (path == tmp_path and mode == os.W_OK))
    refused = run(*PLAN, "--csv", tmp_path / "p.csv")
    assert refused.code == 1
    assert "permission denied" in refused.err
    (tmp_path / "mine.csv").touch()
    assert "none.stl" in run(*PLAN, "--csv", tmp_path / "mine.csv").err  # the file is there, and may be


def test_a_reader_that_has_gone_costs_no_file(parts, tmp_path):
    """``tanteo identify ... | head -0``: the report is written, the exit code is that of the answer."""
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n")
    gone, out = os.pipe()
    os.close(gone)
    args = ["identify", "r.csv", "--sd", "1mm", "--parts", str(parts), "--units", "mm", "--report", "r.html"]
    done = subprocess.run([*PROGRAM, *args], cwd=tmp_path, stdout=out, stderr=subprocess.PIPE, text=True, check=False)
    os.close(out)
    assert (done.returncode, done.stderr) == (3, "")
    assert "1 reading fits any part." in (tmp_path / "r.html").read_text(encoding="utf-8")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_disk_is_reported(parts):
    args = ["part", "show", str(parts / "wedge.stl"), "--units", "mm", "--json"]
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run([*PROGRAM, *args], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: output: expected a place to write to, got: No space left")


def test_closed_streams_are_no_fault():
    done = subprocess.run(["sh", "-c", '"$@" >&- 2>&-', "sh", *PROGRAM, "sensor", "rig", "paper-gripper"], check=False)
    assert done.returncode == 0
