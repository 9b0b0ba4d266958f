"""The doctor: it lists all extras, its self-test can fail, and a broken installation is a message, no exception."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tanteo.cli import installation as doctor
from tanteo.cli import main
from tanteo.errors import PartError

PROJECT = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
FOR_DEVELOPERS = {"benchmarks", "test", "bench", "docs"}


def run(capsys, *args):
    with pytest.raises(SystemExit) as ended:
        main(["doctor", *args])
    return ended.value.code or 0, capsys.readouterr().out


def test_it_lists_every_dependency_and_extra_of_the_project():
    needed = {re.match(r"[\w-]+", line)[0] for line in PROJECT["dependencies"]}
    assert set(doctor.NEEDED) == needed
    assert set(doctor.EXTRAS) == set(PROJECT["optional-dependencies"]) - FOR_DEVELOPERS


def test_a_sound_installation_works(capsys):
    code, out = run(capsys)
    assert code == 0
    assert "works" in out.splitlines()[0]
    assert "self-test: ok, wedge recognized" in out
    assert np.__version__ in out


def test_the_document_has_the_same(capsys):
    code, out = run(capsys, "--json")
    document = json.loads(out)
    assert code == 0
    assert (document["schema"], document["ok"], document["test"]["ok"]) == ("tanteo.doctor/1", True, True)
    assert document["versions"]["numpy"] == np.__version__


def test_the_self_test_takes_less_than_two_seconds():
    doctor.run_self_test()
    import time

    start = time.process_time()
    assert doctor.run_self_test().ok
    assert time.process_time() - start < 2.0


def answering(monkeypatch, change):
    from tanteo import recognition

    real = recognition.identify
    monkeypatch.setattr(recognition, "identify", lambda *a, **k: change(real(*a, **k)))


def test_a_pose_that_is_off_fails(monkeypatch, capsys):
    def shifted(answer):
        (best, *rest) = answer.hypotheses
        T = np.array(best.T_world_part)
        T[0, 3] += 1e-3
        return replace(answer, hypotheses=(replace(best, T_world_part=T), *rest))

    answering(monkeypatch, shifted)
    code, out = run(capsys)
    assert code == 1
    assert "does not work" in out
    assert "self-test: FAILED" in out


def test_another_status_fails(monkeypatch):
    answering(monkeypatch, lambda answer: replace(answer, status="unknown"))
    found = doctor.run_self_test()
    assert not found.ok
    assert "got unknown: " in found.words


def test_an_error_during_the_check_is_reported(monkeypatch):
    def broken(*args, **kwargs):
        raise PartError("wedge.off: expected a part.")

    monkeypatch.setattr("tanteo.parts.read_part", broken)
    assert doctor.run_self_test().words == "wedge.off: expected a part."


def test_missing_extras_are_named_with_how_to_get_them(monkeypatch, capsys):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    code, out = run(capsys)
    assert code == 0
    assert re.search(r"vision +no +parts in images", out)
    assert "pip install -e '.[step,plot,vision,viewer,machines,bags,urdf,ros,sim,arms,cluster]'" in out


def test_a_folder_that_cannot_be_written_is_named(monkeypatch, capsys):
    def read_only(**kwargs):
        raise PermissionError

    monkeypatch.setattr(tempfile, "TemporaryFile", read_only)
    assert "cannot be written" in run(capsys)[1]


def test_a_missing_dependency_is_reported_not_raised():
    """In a process where libigl is not to be had."""
    code = (
        "import sys; from importlib import metadata; real = metadata.version\n"
        "sys.modules['igl'] = None\n"
        "def version(name):\n"
        "    if name == 'libigl': raise metadata.PackageNotFoundError(name)\n"
        "    return real(name)\n"
        "metadata.version = version\n"
        "from tanteo.cli import main; main(['doctor'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1, done.stderr
    assert "libigl not installed" in done.stdout
    assert re.search(r"libigl +MISSING", done.stdout)
