"""``tanteo cache``, and errors as JSON documents."""

from __future__ import annotations

import json

import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("TANTEO_CACHE", str(tmp_path / "cache"))


def test_show_and_clear(run, tmp_path):
    (tmp_path / "a.off").write_text("OFF\n4 4 0\n0 0 0\n9 0 0\n0 9 0\n0 0 9\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n")
    assert run("part", "show", tmp_path / "a.off", "--units", "mm").code == 0
    shown = json.loads(run("cache", "show", "--json").out)
    assert (shown["schema"], shown["parts"], shown["limit_bytes"]) == ("tanteo.cache/1", 1, 1e9)
    assert "1 parts" in run("cache", "show").out
    assert json.loads(run("cache", "clear", "--json").out)["bytes"] == shown["bytes"]
    assert json.loads(run("cache", "show", "--json").out)["entries"] == 0


@pytest.mark.parametrize(("more", "code"), [([], 1), (["--sd", "x"], 2)])
def test_a_failure_is_a_json_document(run, more, code):
    words = ["identify", "none.csv", "--parts", "none.stl", *more]
    done = run(*words, "--json")
    document = json.loads(done.out)
    assert done.code == document["exit_code"] == code
    assert document["schema"] == "tanteo.error/1"
    assert document["message"] in done.err
    assert run(*words).out == ""
