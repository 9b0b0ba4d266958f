"""``--report``: the file, what is said about it, and names that cannot be meant."""

from __future__ import annotations

import json

import numpy as np
import pytest


@pytest.fixture
def asked(tmp_path, parts):
    """Touches all around the block, and the arguments to ask where it is."""
    rng = np.random.default_rng(2)
    local = np.array([[90, 20, 5], [90, 30, 12], [70, 50, 6], [20, 50, 14], [60, 50, 9], [70, 20, 20], [10, 30, 20],
                      [0, 10, 10], [0, 40, 6], [30, 0, 15], [80, 0, 5], [20, 10, 0], [75, 40, 0]])  # fmt: skip
    points = local + 0.05 * rng.normal(size=local.shape)
    path = tmp_path / "my touches.csv"
    path.write_text("x_mm,y_mm,z_mm\n" + "".join(",".join(map(repr, p)) + "\n" for p in points.tolist()))
    return ("locate", path, "--part", parts / "block.stl", "--units", "mm", "--sd", "0.05mm")


def test_the_report_is_written_and_says_how_to_run_it_again(run, asked, tmp_path):
    file = tmp_path / "report.html"
    plain = run(*asked)
    result = run(*asked, "--report", file)
    assert result.code == plain.code
    assert result.out == f"{plain.out}report written: {file}\n"
    page = file.read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>")
    assert f"tanteo locate &#x27;{asked[1]}&#x27; --part" in page
    assert "<h1>block, located to " in page


def test_beside_json_only_the_document_is_on_standard_output(run, asked, tmp_path):
    file = tmp_path / "report.html"
    result = run(*asked, "--json", "--report", file)
    assert json.loads(result.out)["schema"] == "tanteo.recognition/1"
    assert f"report written: {file}" in result.err
    assert file.is_file()


@pytest.mark.parametrize(
    ("name", "code"), [("report.pdf", 2), ("report", 2), (".html", 2), ("nowhere/report.html", 1), ("folder.html", 1)]
)
def test_what_cannot_be_a_report_is_said_before_any_work(run, asked, tmp_path, monkeypatch, name, code):
    """A name of another kind is misuse; a folder that is not there, or is of that name, is a failure."""
    (tmp_path / "folder.html").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tanteo.io.read_readings", lambda path: pytest.fail("work was done"))
    result = run(*asked, "--report", name)
    assert result.code == code
    assert result.err.startswith("error: --report: expected a file")
    assert result.out == ""


def test_a_file_that_cannot_be_written_is_said(run, asked, tmp_path, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("tanteo.render.html.write_report", full)
    result = run(*asked, "--report", tmp_path / "report.html")
    assert result.code == 1
    assert "No space left on device" in result.err


def test_what_was_known_beforehand_is_in_the_budget(run, asked, tmp_path):
    file = tmp_path / "report.html"
    run(*asked, "--table", "0+-0.01mm", "--report", file)
    assert "prior" in file.read_text(encoding="utf-8")
