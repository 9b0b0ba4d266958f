"""Files to write are asked for before the long work, and streams that end are no reason to lose them."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tanteo.cli.files import MisuseError, check_target, writing
from tanteo.errors import InputError

PROGRAM = [sys.executable, "-c", "from tanteo.cli import main; main()"]


@pytest.mark.parametrize(
    ("name", "message", "error"),
    [
        ("nowhere/r.html", "there is no folder", InputError),
        ("folder.html", "it is a folder", InputError),
        ("r.txt", "ends in .html or .htm", MisuseError),
        ("r", "Add the suffix", MisuseError),
        (f"{'x' * 5000}.html", "File name too long", InputError),
    ],
)
def test_what_cannot_be_written_is_said_beforehand(tmp_path, name, message, error):
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(error, match=r"^--report: expected .*, got '.*'.*\. [A-Z]") as caught:
        check_target("--report", str(tmp_path / name), (".html", ".htm"))
    assert message in str(caught.value)


def test_what_can_be_written_is_left_alone(tmp_path):
    check_target("--report", None)
    check_target("--report", str(tmp_path / "R.HTML"), (".html",))
    check_target("--record", str(tmp_path / "record"))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_which_nothing_may_be_written(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: not (path == tmp_path and mode == os.W_OK))
    with pytest.raises(InputError, match="permission denied"):
        check_target("--csv", str(tmp_path / "p.csv"))
    (tmp_path / "mine.csv").touch()
    check_target("--csv", str(tmp_path / "mine.csv"))  # the file is there, and may be


def test_what_the_system_refuses_is_advice(tmp_path):
    path = str(tmp_path / "no" / "p.csv")
    message = r"--csv: .* got '.*p\.csv': No such file or directory\. Choose"
    with pytest.raises(InputError, match=message), writing("--csv", path), open(path, "w", encoding="utf-8"):
        pass


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
def test_a_full_disk_is_said(parts):
    args = ["part", "show", str(parts / "wedge.stl"), "--units", "mm", "--json"]
    with open("/dev/full", "w", encoding="utf-8") as full:
        done = subprocess.run([*PROGRAM, *args], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: output: expected a place to write to, got: No space left")


def test_closed_streams_are_no_fault():
    done = subprocess.run(["sh", "-c", '"$@" >&- 2>&-', "sh", *PROGRAM, "sensor", "rig", "paper-gripper"], check=False)
    assert done.returncode == 0
