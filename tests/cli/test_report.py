"""``--report``: the file, the message about it, and invalid names."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest


@pytest.fixture
def ended_session(tmp_path, parts):
    """Return the arguments that locate the block from touches on all sides."""
    rng = np.random.default_rng(2)
    local = np.array([[90, 20, 5], [90, 30, 12], [70, 50, 6], [20, 50, 14], [60, 50, 9], [70, 20, 20], [10, 30, 20],
                      [0, 10, 10], [0, 40, 6], [30, 0, 15], [80, 0, 5], [20, 10, 0], [75, 40, 0]])  # fmt: skip
    points = local + 0.05 * rng.normal(size=local.shape)
    path = tmp_path / "my touches.csv"
    path.write_text("x_mm,y_mm,z_mm\n" + "".join(",".join(map(repr, p)) + "\n" for p in points.tolist()))
    return ("locate", path, "--part", parts / "block.stl", "--units", "mm", "--sd", "0.05mm")


def test_the_report_has_the_command_that_repeats_it(run, ended_session, tmp_path):
    file = tmp_path / "report.html"
    plain = run(*ended_session)
    result = run(*ended_session, "--report", file)
    assert result.code == plain.code
    assert result.out == f"{plain.out}report written: {file}\n"
    page = file.read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert f"tanteo locate &#x27;{ended_session[1]}&#x27; --part" in page
    assert "<h1>block, located to " in page
    for name in (ended_session[1], ended_session[3]):
        assert hashlib.sha256(name.read_bytes()).hexdigest()[:16] in page


def test_readings_without_a_standard_deviation_have_a_report(run, ended_session, tmp_path):
    file = tmp_path / "report.html"
    result = run(*ended_session[:-2], "--report", file)
    assert result.code == 0, result.err
    assert "No standard deviation is stated" in file.read_text(encoding="utf-8")


def test_beside_json_only_the_document_is_on_standard_output(run, ended_session, tmp_path):
    file = tmp_path / "report.html"
    result = run(*ended_session, "--json", "--report", file)
    assert json.loads(result.out)["schema"] == "tanteo.recognition/1"
    assert f"report written: {file}" in result.err
    assert file.is_file()


@pytest.mark.parametrize(
    ("name", "code"), [("report.pdf", 2), ("report", 2), (".html", 2), ("nowhere/report.html", 1), ("folder.html", 1)]
)
def test_an_impossible_report_is_refused_before_any_work(run, ended_session, tmp_path, monkeypatch, name, code):
    """A name with another suffix is misuse; a missing folder, or a folder with that name, is a failure."""
    (tmp_path / "folder.html").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tanteo.io.read_readings", lambda path: pytest.fail("work was done"))
    result = run(*ended_session, "--report", name)
    assert result.code == code
    assert result.err.startswith("error: --report: expected a file")
    assert result.out == ""


def test_an_unwritable_file_is_reported(run, ended_session, tmp_path, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tanteo.render.html.write_report", full)
    result = run(*ended_session, "--report", tmp_path / "report.html")
    assert result.code == 1
    assert "No space left on device" in result.err


def test_what_was_known_beforehand_is_in_the_budget(run, ended_session, tmp_path):
    file = tmp_path / "report.html"
    run(*ended_session, "--table", "0+-0.01mm", "--report", file)
    assert "prior" in file.read_text(encoding="utf-8")
