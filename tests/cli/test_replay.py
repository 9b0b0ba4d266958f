"""``tanteo replay``: the same answer again, and the gain of each reading."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sensing_scenes import LASER, true_range
from tanteo.io import recognition_document, write_record
from tanteo.parts import read_part
from tanteo.planning import Action, Sensing, Session, Stop
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare


@pytest.fixture(scope="module")
def session(module_parts):
    """A wedge, placed by readings without noise."""
    target = prepare(read_part(module_parts / "wedge.stl", unit="mm", name="my wedge"))
    start = at_pose(target, np.eye(4), np.diag([3e-3, 3e-3, 3e-3, 0.05, 0.05, 0.05]) ** 2)
    session = Session(start, LASER, Sensing(sd=3e-4), stop=Stop(tolerance=3e-3, max_measurements=4))
    while isinstance(action := session.ask(), Action):
        session.tell(action.read(true_range(target, np.eye(4), action)))
    return session


@pytest.fixture
def record(session, tmp_path):
    path = tmp_path / "session.json"
    write_record(session, path)
    return path


def test_the_answer_is_given_again(run, session, record):
    done = run("replay", record, "--json", "-v")
    now, then = json.loads(done.out), recognition_document(session.answer())
    assert then["status"] == "recognized"
    assert done.code == 0
    assert set(now.pop("elapsed_s")) == {"load", "replay", "total"}
    del then["elapsed_s"]
    assert now == then
    assert "again to the last bit" in done.err
    spoken = run("replay", record)
    assert spoken.code == 0
    assert "my wedge at x" in spoken.out
    assert not spoken.err


def test_it_explains_each_reading(run, session, record):
    spoken = run("replay", record, "--explain").out
    assert "Information of each reading" in spoken
    assert "Readings that determine the pose of my wedge" in spoken
    for k in range(session.count):
        assert f"a{k + 1} " in spoken
    explained = json.loads(run("replay", record, "--explain", "--json").out)["explanation"]
    assert explained["schema"] == "tanteo.explanation/1"
    assert [a["readings"] for a in explained["added"]] == [[f"a{k + 1}"] for k in range(session.count)]
    assert len(explained["directions"]) == 6
    for d in explained["directions"]:
        assert sum(d["shares"].values()) + d["prior"] == pytest.approx(1)


def test_the_report_has_how_it_went(run, record, tmp_path):
    file = tmp_path / "report.html"
    done = run("replay", record, "--report", file, "--json")
    assert done.code == 0
    assert f"report written: {file}" in done.err
    page = file.read_text(encoding="utf-8")
    assert "How it went" in page
    assert f"tanteo replay {record}" in page
    assert run("replay", record, "--report", tmp_path / "report.pdf").code == 2


def test_an_undecided_session_is_an_undecided_answer(run, session, tmp_path):
    write_record(Session(session.start, LASER), tmp_path / "new.json")
    done = run("replay", tmp_path / "new.json", "--json", "--explain")
    assert done.code == 3
    assert json.loads(done.out)["status"] == "insufficient"
    assert done.err.startswith("insufficient: ")
    assert "no readings to explain" in run("replay", tmp_path / "new.json", "--explain").out


def test_another_answer_than_the_recorded_one_is_an_error(run, record):
    document = json.loads(record.read_text())
    document["answer"]["hypotheses"][0]["probability"] += 1e-3
    document["answer"]["status"] = "ambiguous"
    record.write_text(json.dumps(document))
    done = run("replay", record, "--json")
    error = json.loads(done.out)
    assert (done.code, error["schema"], error["exit_code"]) == (1, "tanteo.error/1", 1)
    assert done.err == f"error: {error['message']}\n"
    assert "status: 'ambiguous' then, 'recognized' now" in done.err
    assert "hypotheses[0].probability" in done.err


def test_parts_are_read_from_their_present_place(run, module_parts, record, tmp_path):
    elsewhere = module_parts.rename(tmp_path / "elsewhere")
    try:
        lost = run("replay", record)
        assert lost.code == 1
        assert "nothing there" in lost.err
        assert "--parts" in lost.err
        assert run("replay", "--parts", elsewhere, record).code == 0
        wedge = elsewhere / "wedge.stl"
        text = wedge.read_text()
        wedge.write_text(text.replace("60", "61"))
        changed = run("replay", record, "--parts", elsewhere)
        wedge.write_text(text)
        assert changed.code == 1
        assert "another content" in changed.err
    finally:
        elsewhere.rename(module_parts)


@pytest.mark.parametrize("content", ["", "{", "[]", '{"schema": "tanteo.recognition/1"}'])
def test_what_is_no_record_is_an_error_in_one_line(run, record, content):
    record.write_text(content)
    done = run("replay", record, "--json")
    error = json.loads(done.out)
    assert (done.code, error["schema"], error["exit_code"]) == (1, "tanteo.error/1", 1)
    assert error["message"].startswith(str(record))
    assert done.err == f"error: {error['message']}\n"
    assert len(done.err.splitlines()) == 1


def test_misuse(run, tmp_path):
    assert run("replay").code == 2
    assert run("replay", tmp_path / "none.json").code == 1
