"""Values of the public interface: short representation, read-only arrays, copies in other processes, notebooks."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.sensors import Column
from tanteo.values import MOST, Value

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def values(parts):
    """One value of each type; the fixture of parts skips where STEP cannot be read."""
    parts = tanteo.read_parts(EXAMPLES / "parts")
    readings = tanteo.read_readings(EXAMPLES / "readings" / "bracket_left.csv")
    part = parts["bracket_left"]
    start = tanteo.at_place([part], np.eye(4), np.diag([1e-4] * 3 + [1e-2] * 3))
    probe = tanteo.probe_of("keyence_il300")
    session = tanteo.Session(start, probe)
    answer = tanteo.locate(readings, part)
    return {
        "parts": parts,
        "part": part,
        "readings": readings,
        "rig": tanteo.read_rig(EXAMPLES / "readings" / "tof_rig.toml"),
        "answer": answer,
        "hypothesis": answer.best,
        "start": start,
        "probe": probe,
        "action": session.ask(),
        "session": session,
        "state": session.state,
        "prior": tanteo.PosePrior(np.eye(4), np.diag([1e-4] * 6)),
        "frame": tanteo.UncertainFrame(np.eye(4), np.diag([1e-4] * 6)),
    }


NAMES = (
    "parts", "part", "readings", "rig", "answer", "hypothesis", "start", "probe", "action", "session", "state",
    "prior", "frame",
)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_value_is_printed_on_a_short_line(values, name):
    text = repr(values[name])
    assert "\n" not in text
    assert len(text) <= MOST + 60
    assert type(values[name]).__name__ in text


@pytest.mark.parametrize("name", NAMES)
def test_arrays_of_values_are_read_only(values, name):
    value = values[name]
    arrays = {one.name: getattr(value, one.name) for one in fields(value)}
    assert [key for key, array in arrays.items() if isinstance(array, np.ndarray) and array.flags.writeable] == []


@pytest.mark.parametrize("name", NAMES)
def test_a_value_can_be_sent_to_another_process(values, name):
    value = values[name]
    copy = pickle.loads(pickle.dumps(value))
    assert type(copy) is type(value)
    assert repr(copy) == repr(value)


def test_a_copied_session_continues_with_the_same_question(values):
    session = values["session"]
    copy = pickle.loads(pickle.dumps(session))
    action = session.pending
    got = tanteo.Readings.from_columns(points=[action.origin + 0.19 * action.direction], sds=[3e-4])
    first, second = session.tell(got), copy.tell(got)
    np.testing.assert_allclose(first.T_world_part, second.T_world_part, atol=1e-9)
    np.testing.assert_array_equal(session.ask().origin, copy.ask().origin)
    later, action = pickle.loads(pickle.dumps(session)), session.pending
    got = tanteo.Readings.from_columns(points=[action.origin + 0.19 * action.direction], sds=[3e-4])
    first, second = session.tell(got), later.tell(got)
    np.testing.assert_allclose(first.T_world_part, second.T_world_part, atol=1e-9)
    np.testing.assert_array_equal(session.ask().origin, later.ask().origin)


def test_parts_are_a_sequence_and_found_by_name(values):
    parts = values["parts"]
    assert len(parts) == 12
    assert parts[0] is parts[parts[0].name]
    assert [part.name for part in parts[1:3]] == ["bracket_left", "bracket_right"]
    assert "flange" in parts
    assert parts["flange"] in parts
    assert "flunge" not in parts
    assert next(reversed(parts)) is parts[-1]
    with pytest.raises(tanteo.InputError, match="got 'flunge'"):
        parts["flunge"]
    with pytest.raises(IndexError):
        parts[12]


def test_notebooks_show_tables_and_a_picture(values):
    assert "bracket_left" in values["answer"]._repr_html_()
    assert values["answer"].message in values["answer"]._repr_html_()
    assert "10 more readings" in values["readings"]._repr_html_()
    assert values["parts"]._repr_html_().count("<tr>") == 13
    picture = values["part"]._repr_html_()
    assert picture.startswith("<svg")
    assert picture.count("<polygon") > 5


def test_only_visible_edges_of_a_box_are_drawn(values):
    """Three faces of a box face the viewer: nine of its twelve edges, in twelve pieces each."""
    assert values["parts"]["block"]._repr_html_().count("<line") == 9 * 12


def test_names_in_tables_are_text(tmp_path, values):
    readings = tanteo.Readings.from_columns(points=[[0.0, 0.0, 0.0]], ids=["<script>"])
    assert "<script>" not in readings._repr_html_()


def test_default_and_private_fields_are_not_printed():
    @dataclass(frozen=True, slots=True, eq=False, repr=False)
    class Place(Value):
        position: np.ndarray
        name: str = ""
        _hidden: int = 3

    assert repr(Place(np.array([0.1, 0.2, 0.0]))) == "Place(position=[0.1, 0.2, 0])"
    assert repr(Place(np.zeros((4, 4)), "a")) == "Place(position=<float64 4 x 4>, name='a')"


def test_a_column_is_printed_by_its_sizes():
    assert len(repr(Column.from_rows(np.ones((300, 3))))) < 120
