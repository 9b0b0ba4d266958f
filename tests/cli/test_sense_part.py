"""``tanteo sense part``: words, JSON, record, live lines and exit codes."""

import errno
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.geometry import SE3, SO3
from tanteo.io import read_readings, read_record

EXAMPLES = Path(__file__).parents[2] / "examples"
SCENE = EXAMPLES / "scenes" / "part_unknown.toml"
LEFT = str(EXAMPLES / "parts" / "bracket_left.step")
PARTS = ["--parts", *(str(EXAMPLES / "parts" / f"bracket_{side}.step") for side in ("left", "right"))]


@pytest.fixture
def sense(run):
    return lambda *options: run("sense", "part", "--scene", str(SCENE), *PARTS, *options)


@pytest.mark.slow
def test_it_ends_with_name_place_and_cost_in_words(run, tmp_path):
    record = tmp_path / "readings.csv"
    report = tmp_path / "report.html"
    one = ("sense", "part", "--scene", str(SCENE), "--parts", LEFT, "--goal", "20mm")
    code, out, err = run(*one, "--record", str(record), "-v", "--report", str(report))
    assert code == 0
    assert out.endswith(f"report written: {report}\n")
    page = report.read_text(encoding="utf-8")
    assert all(
        words in page
        for words in ("bracket_left, located to", "How it went", "Smallest clearance", "all readings share")
    )
    assert out.startswith("bracket_left at x ")
    assert "The goal is reached. It is bracket_left (" in out
    readings = read_readings(record)
    assert f"  cost        {len(readings)} readings, " in out
    assert "clearance" in out
    lines = err.splitlines()
    assert any("of bracket_" in line and "readings: bracket_" in line for line in lines)
    assert any("go to" in line and "reached" in line for line in lines)


@pytest.mark.slow
def test_json_is_one_document_and_the_record_gives_it_again(run, tmp_path):
    record = tmp_path / "session.json"
    one = ("sense", "part", "--scene", str(SCENE), "--parts", LEFT, "--goal", "20mm")
    code, out, err = run(*one, "--json", "--record", str(record))
    document = json.loads(out)
    assert code == 0
    assert document["schema"] == "tanteo.recognition/1"
    assert document["status"] == "recognized"
    best = document["hypotheses"][0]
    assert best["part"] == "bracket_left"
    # the scene has it at (-25, -50, 0) mm, turned by 14 degrees; no farther away than the stated prior allows
    true = SE3.from_parts(SO3.exp(np.radians([0, 0, 14])), [-0.025, -0.05, 0])
    matrix = np.array(best["pose"]["matrix"])
    xi = SE3.log(SE3.inverse(matrix) @ true)
    assert xi @ np.linalg.solve(np.array(best["covariance"]["matrix"]), xi) < chi2.ppf(0.999, 6)
    sensing = document["sensing"]
    assert sensing["reached"] is True
    assert sensing["least_clearance_m"] > 0.006
    assert sensing["readings"] == sum(len(v["readings"]) for v in sensing["visits"])
    assert sensing["visits"][-1]["corner_sd_m"] == pytest.approx(best["corner_sd_m"], rel=0.5)
    assert len(err.splitlines()) >= len(sensing["visits"])
    again = read_record(record).answer()
    assert again.hypotheses[0].probability == best["probability"]
    np.testing.assert_array_equal(again.hypotheses[0].T_world_part, matrix)


def test_what_is_not_reached_exits_with_three(sense):
    code, out, _ = sense("--max-measurements", "1", "--goal", "1mm")
    assert code == 3
    assert "1 were allowed" not in out
    assert "The limit of readings is reached: 1 was allowed" in out


@pytest.mark.slow
def test_the_prior_can_be_stated(sense, tmp_path):
    record = tmp_path / "session.json"
    document = json.loads(
        sense(
            "--max-measurements",
            "1",
            "--unknown-prior",
            "40%",
            "--outlier-rate",
            "5%",
            "--record",
            str(record),
            "--json",
        )[1]
    )
    priors = read_record(record).start.priors
    assert (priors.unknown, priors.outlier_rate) == (0.4, 0.05)
    usual = json.loads(sense("--max-measurements", "1", "--json")[1])
    assert document["unknown_probability"] > 4 * usual["unknown_probability"]


@pytest.mark.slow
def test_the_policies_differ_and_the_seed_repeats(sense):
    outs = [sense("--max-measurements", "2", *more)[2] for more in ((), ("--seed", "1"), ("--policy", "nearest"))]
    assert outs[0] == outs[1] != outs[2]


@pytest.mark.parametrize(
    ("options", "code", "message"),
    [
        (("--policy", "best"), 2, "--policy: expected one of information"),
        (("--probability", "1.5"), 2, "--probability: expected a probability"),
        (("--confidence", "0"), 2, "--confidence: expected a probability"),
        (("--goal", "2"), 2, "expected a unit"),
        (("--goal", "0mm"), 2, "--goal: expected a positive length"),
        (("--feature", "edge 3"), 2, "--feature: expected --goal with 'edge 3'"),
        (("--feature", "edge 999", "--goal", "1mm"), 2, "--feature: expected one of a part, got 'edge 999'"),
        (("--max-measurements", "0"), 2, "--max-measurements: expected 1 or more"),
        (("--seed", "-1"), 2, "--seed: expected 0 or more"),
        (("--standoff", "0mm"), 2, "--standoff: expected a length"),
        (("--unknown-prior", "100%"), 2, "--unknown-prior: expected a fraction above 0 and below one"),
        (("--outlier-rate", "60%"), 2, "--outlier-rate: expected a fraction above 0 and below one half"),
        (("--pose-prior", "0,0,0mm"), 2, "--pose-prior: expected a value and its standard deviation"),
        (("--report", "report.pdf"), 2, "--report: expected a file name"),
        (
            ("--record", "/no/such/folder/x.json", "--max-measurements", "1"),
            1,
            "--record: expected a file that can be written",
        ),
    ],
)
def test_refusals(sense, options, code, message):
    got, out, err = sense(*options)
    assert (got, out) == (code, "")
    assert message in err


def test_a_scene_without_a_rough_place_needs_one_from_options(run):
    scene = str(EXAMPLES / "scenes" / "bracket.toml")
    code, out, err = run("sense", "part", "--scene", scene, *PARTS)
    assert (code, out) == (1, "")
    assert "expected a table [prior]" in err
    near = ("--pose-prior", "0,0,30mm 0,0,0deg +- 8mm 4deg")
    code, _, err = run(
        "sense", "part", "--scene", scene, *PARTS, *near, "--standoff", "40mm", "--max-measurements", "2"
    )
    assert code in (0, 3)
    assert "readings: bracket_" in err
    prior = EXAMPLES.parent / "tests" / "nothing.toml"
    assert run("sense", "part", "--scene", scene, *PARTS, "--prior", str(prior))[0] == 1


@pytest.mark.slow
def test_an_interruption_keeps_the_record_of_the_readings(sense, run, tmp_path, monkeypatch):
    def interrupt(visit, *, verbose):
        if visit.step is not None and visit.step.ids:
            raise KeyboardInterrupt
        return []

    monkeypatch.setattr("tanteo.render.text.visit_lines", interrupt)
    record = tmp_path / "session.json"
    code, out, err = sense("--record", str(record))
    assert (code, out) == (130, "")
    assert f"record written up to here: {record}" in err
    code, out, err = run("replay", str(record), "-v")
    assert code in (0, 3)
    assert "given again to the last bit" in err


@pytest.mark.parametrize("suffix", ["csv", pytest.param("json", marks=pytest.mark.slow)])
def test_the_record_is_there_before_the_end(sense, tmp_path, monkeypatch, suffix):
    """A killed process or a power loss keeps all readings up to then."""
    record = tmp_path / f"session.{suffix}"
    counts = []

    def print_visit(visit, *, verbose):
        if visit.step is not None and visit.step.ids:
            kept = read_readings(record) if suffix == "csv" else read_record(record).readings
            counts.append(len(kept))
        return []

    monkeypatch.setattr("tanteo.render.text.visit_lines", print_visit)
    sense("--max-measurements", "1", "--record", str(record))
    assert counts
    assert counts[0] > 0


def test_a_record_that_cannot_be_written_does_not_cost_answer(sense, tmp_path, monkeypatch):
    def full(session, path):
        raise OSError(errno.ENOSPC, "disk full")

    monkeypatch.setattr("tanteo.io.write_record", full)
    code, out, err = sense("--max-measurements", "2", "--record", str(tmp_path / "r.json"))
    assert code == 1
    assert out.startswith(("bracket_", "ambiguous", "insufficient"))
    assert err.count("disk full. Choose another folder. Sensing continues.") == 1
    assert err.count("error: --record") == 1
