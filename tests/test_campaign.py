"""Benchmarks that are stopped and gone on with."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from campaign import options, run_cases


def test_options_are_taken_out():
    assert options(["5", "--keep", "a.jsonl", "7", "--processes", "2"]) == (["5", "7"], Path("a.jsonl"), 2)
    assert options(["--processes", "local:2"]) == ([], None, "local:2")
    assert options(["5"]) == (["5"], None, 1)


def test_a_campaign_goes_on_where_it_stopped(tmp_path):
    calls, keep = [], tmp_path / "rows.jsonl"

    def run(name, k):
        calls.append((name, k))
        return {"half": np.float64(k / 2), "list": np.arange(k)}

    cases = [("a", 1), ("b", 2)]
    run_cases(run, cases, keep)
    rows = run_cases(run, [("a", 0), *cases], keep)
    assert calls == [("a", 1), ("b", 2), ("a", 0)]
    assert [row["half"] for row in rows] == [0, 0.5, 1]
    assert rows[2]["list"] == [0, 1]  # unchanged


def test_a_row_that_cannot_be_kept_is_refused(tmp_path):
    with pytest.raises(TypeError, match="cannot be kept"):
        run_cases(lambda k: {"x": object()}, [(1,)], tmp_path / "rows.jsonl")


def test_rows_of_other_sources_are_reported(tmp_path, capsys):
    keep = tmp_path / "rows.jsonl"
    keep.write_text(json.dumps({"case": [1], "revision": "another", "row": 5}) + "\n")
    assert run_cases(lambda k: 6, [(1,)], keep) == [5]
    assert "another" in capsys.readouterr().err


def test_cases_run_side_by_side():
    assert run_cases(divmod, [(7, 2), (9, 4)], processes=2) == [(3, 1), (2, 1)]


def test_cases_are_the_same_on_workers_of_a_scheduler():
    pytest.importorskip("distributed")
    from families import sizes

    here, there = (run_cases(sizes, [(k, 7) for k in range(5)], processes=who) for who in (1, "local:2"))
    assert [name for name, _ in here] == [name for name, _ in there]
    assert np.array_equal([own for _, own in here], [own for _, own in there])
