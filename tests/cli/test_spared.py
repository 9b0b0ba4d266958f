"""No command overwrites its input, and none goes on without a part that the user named."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PROGRAM = [sys.executable, "-c", "from tanteo.cli import main; main()"]


@pytest.mark.parametrize(
    "words",
    [
        "locate r.html --part wedge.stl --units mm --report r.html",
        "identify r.csv --rig rig.html --parts wedge.stl --units mm --report rig.html",
        "plan --part wedge.stl --units mm --goal 1mm --sd 0.1mm --csv wedge.stl",
        "replay session.html --report session.html",
        "see image.png --camera camera.yaml --parts wedge.stl --units mm --picture image.png",
        "sense plane --scene s.toml --record s.toml",
        "sense part --scene s.toml --parts wedge.stl --record wedge.stl",
        "sense part --scene s.toml --parts . --record wedge.stl",
        "sensor fit log.csv --sensor vl53l0x --write log.csv",
        "sensor fit log.csv --rig rig.png --picture rig.png",
        "sensor fit log.csv --rig rig.png --write ./log.csv",
    ],
)
def test_what_is_read_is_not_written_over(run, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    for name in {w.removeprefix("./") for w in words.split() if "." in w[1:] and not w[0].isdigit()}:
        (tmp_path / name).write_text("mine")
    (tmp_path / "wedge.stl").write_text("mine")
    before = {file.name: file.read_text() for file in tmp_path.iterdir()}
    code, out, err = run(*words.split())
    assert (code, out) == (2, "")
    assert "expected another file than that of" in err
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == before


def test_a_part_that_was_named_and_cannot_be_read_ends_command(run, parts, tmp_path):
    """The rest would be given as sure, though it may be that one."""
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n")
    broken = tmp_path / "broken.stl"
    broken.write_text("x")
    words = ["identify", tmp_path / "r.csv", "--sd", "1mm", "--units", "mm", "--parts", parts / "wedge.stl"]
    for named in (tmp_path / "none.stl", broken):
        code, out, err = run(*words, named)
        assert (code, out) == (1, "")
        assert f"error: {named.name if named is broken else named}" in err


def test_a_link_to_nowhere_in_folder_is_part_that_cannot_be_read(run, parts, tmp_path):
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n")
    folder = tmp_path / "some"
    folder.mkdir()
    shutil.copy(parts / "wedge.stl", folder)
    (folder / "lost.stl").symlink_to(tmp_path / "nowhere.stl")
    code, _, err = run("identify", tmp_path / "r.csv", "--sd", "1mm", "--units", "mm", "--parts", folder)
    assert code == 3
    assert "lost.stl: expected a file, got a broken link" in err


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up")
def test_a_closed_terminal_loses_no_readings(tmp_path):
    scene, record = EXAMPLES / "scenes" / "part_unknown.toml", tmp_path / "session.json"
    parts = [str(EXAMPLES / "parts" / f"bracket_{side}.step") for side in ("left", "right")]
    words = ["sense", "part", "--scene", str(scene), "--parts", *parts, "--goal", "0.1mm", "--record", str(record)]
    with subprocess.Popen([*PROGRAM, *words], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:  # of the first visit that read something
            if "1 reading" in line:
                break
        process.send_signal(signal.SIGHUP)
        begun = time.monotonic()
        rest = process.stderr.read()
        assert process.wait() == 130
    assert time.monotonic() - begun < 60
    assert "record written up to here" in rest
    assert record.stat().st_size > 1000
    assert os.listdir(tmp_path) == ["session.json"]


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up")
def test_who_does_not_want_to_hear_of_it_goes_on():
    """``nohup tanteo sense part ...``"""
    from tanteo.cli.session_record import kept

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with kept(None, None):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_IGN, signal.SIG_DFL)
        assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_rig_in_metres_raises_a_question(run, tmp_path):
    rig = tmp_path / "rig.toml"
    text = '[sensors.eye]\npreset = "vl53l0x"\nposition_{} = [0.04, 0, 0.06]\ndirection = [0, 0, 1]\n'
    rig.write_text(text.format("mm"))
    code, _, err = run("sensor", "rig", rig)
    assert code == 0
    assert "sensors.eye: it sits 0.072 mm from the origin of the hand's frame. Is its position in metres?" in err
    rig.write_text(text.format("m"))
    assert run("sensor", "rig", rig).err == ""


def test_a_column_in_capitals_is_taken_for_the_same_one(run, parts, tmp_path):
    messages = []
    for header in ("x_mm,y_mm,z_mm", "X_MM,Y_mm,Z_Mm"):
        (tmp_path / "r.csv").write_text(f"{header}\n0,0,0\n")
        messages.append(run("identify", tmp_path / "r.csv", "--sd", "1mm", "--units", "mm", "--parts", parts))
    assert messages[0] == messages[1]
    assert messages[0].code == 3


def test_a_link_that_leads_in_a_circle_is_replaced(run, parts, tmp_path):
    (tmp_path / "r.csv").write_text("x_mm,y_mm,z_mm\n0,0,0\n")
    report = tmp_path / "r.html"
    report.symlink_to(report)
    words = ["identify", tmp_path / "r.csv", "--sd", "1mm", "--units", "mm", "--parts", parts, "--report", report]
    assert run(*words).code == 3
    assert not report.is_symlink()
    assert report.stat().st_size > 1000
