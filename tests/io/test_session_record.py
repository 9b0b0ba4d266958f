"""A record gives the session again, to the last bit; what is not a whole record is refused with advice."""

from __future__ import annotations

import copy
import json
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sensing_scenes import LASER, drawn_truth, new_session, rough, true_range
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.io import load_record, read_record, read_rig, write_record
from tanteo.io.documents import part_file, parts_of, resumed, session_document
from tanteo.parts import read_part
from tanteo.planning import POLICIES, Action, Sensing, Session, Stop, probe_of
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from tanteo.sensors import Readings
from tanteo.sensors.presets import sensor_preset

EXAMPLES = Path(__file__).parents[2] / "examples"
RELAXED = settings(
    max_examples=80, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(scope="module")
def targets():
    pytest.importorskip("OCP", reason="reading STEP needs tanteo[step]")
    return [prepare(read_part(EXAMPLES / "parts" / f"{name}.step")) for name in ("bracket_left", "wedge")]


def plain_touches(targets):
    """Return a session with two parts of unequal probability, unplanned readings, and one repeated reading."""
    rng = np.random.default_rng(4)
    start = replace(rough(targets), weights=np.array([0.51, 0.9]))
    k, T = drawn_truth(start, rng)
    session = new_session(start, seed=3, max_measurements=50)

    def recorded_plan():
        action = session.ask()
        return action.read(true_range(targets[k], T, action) + 3e-4 * rng.normal())

    first = recorded_plan()
    free = Readings.from_columns(
        T[None, :3, 3] + [0, 0, 0.2], ids=["beside"], directions=np.array([[0.0, 1.0, 0.0]]),
        is_free=np.array([True]), max_ranges=np.array([0.3]),
    )  # fmt: skip
    return session, [lambda: first, lambda: free, lambda: first, recorded_plan]


def shared_errors(targets):
    """Robot and tip err in all readings together; the hand's pose comes with each."""
    rng = np.random.default_rng(5)
    start = at_pose(targets[1], SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])), 1e-4 * np.eye(6))
    _, T = drawn_truth(start, rng)
    session = Session(
        start, replace(LASER, contact=True, radius=1e-3),
        Sensing(sd=3e-4, robot="generic_6axis_uncalibrated", tip_sd=[1e-3, 1e-3, 3e-4], bias_sd=1e-4, tolerance=1e-4),
        POLICIES["nearest"], Stop(tolerance=1e-3, feature="face 2"),
    )  # fmt: skip

    def recorded_plan():
        action = session.ask()
        one = action.read(true_range(targets[1], T, action) + 3e-4 * rng.normal())
        return replace(one, Ts_world_hand=action.T_world_probe[None])

    return session, [recorded_plan, recorded_plan]


def rig(targets):
    """Ranges of a sensor on the hand, one of them free; a workspace with a forbidden box."""
    rng = np.random.default_rng(6)
    hand = read_rig(EXAMPLES / "readings" / "laser_rig.toml")
    start = at_pose(targets[0], np.eye(4), np.diag([2e-3, 2e-3, 2e-3, 0.02, 0.02, 0.02]) ** 2)
    _, T = drawn_truth(start, rng)
    space = Workspace.above(-0.5, [ForbiddenBox("post", [0.3, 0.3, 0.0], [0.4, 0.4, 0.2])])
    approach = np.random.default_rng(0).normal(size=3)  # of unit length, a second normalisation changes it
    probe = probe_of(sensor_preset("keyence_il030"), workspace=space, approach=approach, cone=2.5)
    session = Session(start, probe, Sensing(rig=hand), POLICIES["information-per-second"])

    def recorded_plan(free=False):
        action = session.ask()
        T_world_hand = action.T_world_probe @ SE3.inverse(hand.sensors[0].T_hand_sensor)
        distance = true_range(targets[0], T, action)
        return Readings.from_columns(
            n=1, ids=[f"r{action.number}"], sensors=["laser"], Ts_world_hand=T_world_hand[None],
            ranges=None if free else np.array([distance]), is_free=np.array([free]),
        )  # fmt: skip

    return session, [recorded_plan, lambda: recorded_plan(True), recorded_plan]


def same(a, b):
    """Return whether two sessions are equal to the last bit."""
    for name in ("weights", "poses", "covariances", "part", "rows"):
        np.testing.assert_array_equal(getattr(a.state, name), getattr(b.state, name))
    assert a.state.unknown == b.state.unknown
    if a.state.draws is not None:
        np.testing.assert_array_equal(a.state.draws.Ts, b.state.draws.Ts)
        np.testing.assert_array_equal(a.state.draws.weights, b.state.draws.weights)
    for one, other in zip(a.steps, b.steps, strict=True):
        assert (one.ids, one.note, one.unknown) == (other.ids, other.note, other.unknown)
        np.testing.assert_array_equal(one.covariance, other.covariance)
        np.testing.assert_array_equal(one.probabilities, other.probabilities)
    assert session_document(a) == session_document(b)


def same_plan(a, b):
    first, second = a.ask(), b.ask()
    assert type(first) is type(second)
    assert session_document(a)["pending"] == session_document(b)["pending"]


@pytest.mark.parametrize(
    "scene", [shared_errors, *(pytest.param(s, marks=pytest.mark.slow) for s in (plain_touches, rig))]
)
def test_a_session_is_resumed_to_the_last_bit_at_any_point(scene, targets, tmp_path):
    session, readings_given = scene(targets)
    some = [target for target in targets if target in session.start.targets]
    path = tmp_path / "session.json"
    for k, reading in enumerate(readings_given):
        write_record(session, path)
        again = read_record(path, some[::-1])
        same(session, again)
        new_reading = reading()
        if k % 2:  # with a question waiting, and without
            write_record(session, path)
            again = read_record(path, some)
        same_plan(session, again)
        for one in (session, again):
            one.tell(new_reading, None if scene is plain_touches else one.pending)  # others are ambiguous
        same(session, again)
    if isinstance(action := session.ask(), Action):  # what cannot be made is not forgotten
        session.refuse(action)
    write_record(session, path)
    again = read_record(path, some)
    same(session, again)
    same_plan(session, again)


def test_questions_that_were_replaced_are_counted_too(targets, tmp_path):
    session, _ = plain_touches(targets)
    session.ask()
    session.put(None)
    write_record(session, tmp_path / "a.json")
    again = read_record(tmp_path / "a.json", targets)
    same_plan(session, again)
    assert again.pending.number == 2


def test_late_answers_are_replayed_under_their_questions(targets, tmp_path):
    session, readings_given = plain_touches(targets)
    first = session.ask()
    session.put(None)
    session.ask()
    session.tell(first.read(first.expected), first)
    session.tell(readings_given[1]())  # of no question
    write_record(session, tmp_path / "a.json")
    again = read_record(tmp_path / "a.json", targets)
    same(session, again)
    assert [s.action and s.action.number for s in again.steps] == [1, None]
    assert again.pending.number == 2
    same_plan(session, again)
    again.tell(again.pending.read(np.inf))
    assert again.pending is None


def test_the_abilities_of_a_hand_are_restored(targets, tmp_path):
    session, _ = plain_touches(targets)
    session.put(None)  # no question waits
    write_record(session, tmp_path / "free.json")
    without = read_record(tmp_path / "free.json", targets).ask().direction
    session.able = lambda state, candidates: candidates.directions @ without < 0.5
    write_record(session, tmp_path / "a.json")
    same_plan(session, read_record(tmp_path / "a.json", targets, able=session.able))
    assert session.ask().direction @ without < 0.5
    assert read_record(tmp_path / "a.json", targets).ask().direction @ without > 0.99  # the record does not keep it


def test_parts_are_read_again_from_their_files(targets, tmp_path):
    session = new_session(rough(targets))
    write_record(session, tmp_path / "a.json")
    same_plan(session, read_record(tmp_path / "a.json"))


def block(path, size=1.0):
    import trimesh

    trimesh.creation.box(np.array([60.0, 40.0, 30.0]) * size).export(path)
    return read_part(path, unit="mm")


@pytest.fixture
def recorded(tmp_path):
    """A session on a part in STL with one reading, and its record."""
    target = prepare(block(tmp_path / "block.stl"))
    session = new_session(at_pose(target, np.eye(4), 1e-6 * np.eye(6)))
    session.tell(session.ask().read(0.1))
    session.ask()
    write_record(session, tmp_path / "session.json")
    return session, tmp_path / "session.json"


def test_a_changed_part_is_reported(recorded, tmp_path):
    _, path = recorded
    same(recorded[0], read_record(path))
    block(tmp_path / "block.stl", 1.01)
    with pytest.raises(InputError, match=r"'block' unchanged .* another content in .*block.stl"):
        read_record(path)
    (tmp_path / "block.stl").unlink()
    with pytest.raises(InputError, match="nothing there"):
        read_record(path)
    with pytest.raises(InputError, match="expected a part 'block', got none"):
        read_record(path, [])


def test_a_part_is_found_where_it_is_now(recorded, tmp_path):
    session, path = recorded
    document = session_document(session)
    (tmp_path / "moved").mkdir()
    (tmp_path / "block.stl").rename(tmp_path / "moved" / "other.stl")
    record = load_record(path)
    again = session_document(resumed(record, parts_of(record.parts, record.source, folders=[tmp_path / "moved"])))
    assert again["observations"] == document["observations"]
    assert again["answer"]["hypotheses"][0]["pose"] == document["answer"]["hypotheses"][0]["pose"]


def test_a_part_without_a_file_is_known_by_its_mesh(recorded, tmp_path):
    session, path = recorded
    part = replace(session.start.targets[0].part, source="made")
    other = replace(part, vertices=part.vertices * 1.01)
    assert part_file(part).file is None
    write_record(Session(at_pose(prepare(part), np.eye(4), np.eye(6)), LASER), path)
    read_record(path, [part])
    with pytest.raises(InputError, match="unchanged"):
        read_record(path, [other])
    with pytest.raises(InputError, match="Pass it"):
        read_record(path)


def test_what_a_record_cannot_hold_is_refused(recorded, tmp_path):
    class Own:
        name = "own"

    session, _ = recorded
    with pytest.raises(FileNotFoundError):
        write_record(session, tmp_path / "no" / "b.json")
    session.policy = Own()
    with pytest.raises(InputError, match="policy: expected one of information"):
        write_record(session, tmp_path / "b.json")
    assert not (tmp_path / "b.json").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "tanteo.session/2"}, "schema: expected tanteo.session/1, got tanteo.session/2"),
        ({"sead": 1}, r"expected one of schema, .*, got 'sead'. Did you mean 'seed'"),
        ({"seed": -1}, "seed: expected a whole number of zero or more, got -1"),
        ({"questions": 1}, "questions: expected 2 or more, the largest number of a question, got 1"),
        ({"seed": True}, "seed: expected a whole number of zero or more, got True"),
        ({"stop": {}}, "stop: expected 'probability', got nothing"),
        ({"policy": {"kind": "Best"}}, "policy: expected 'kind' to be one of Greedy"),
        ({"observations": {}}, "observations: expected a list"),
        ({"answer": 3}, "answer: expected a table"),
    ],
)
def test_what_is_wrong_is_named(change, message, recorded):
    _, path = recorded
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=f"^{re.escape(str(path))}.*{message}"):
        read_record(path)


def test_readings_that_cannot_be_are_named(recorded):
    _, path = recorded
    document = json.loads(path.read_text())
    document["observations"].append(document["observations"][0])
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"observations\[1\]: id: expected every reading to have its own"):
        read_record(path)
    document["start"]["part"] = [1]
    path.write_text(json.dumps(document))
    with pytest.raises(InputError, match="start, part: expected indices of 1 parts"):
        read_record(path)


def test_questions_that_cannot_be_are_named(recorded):
    _, path = recorded
    document = json.loads(path.read_text())
    for change, message in (
        ({"number": -5}, "number: expected 1 or more"),
        ({"direction": [0, 0, 2]}, "a unit direction"),
    ):
        path.write_text(json.dumps(document | {"pending": document["observations"][0]["action"] | change}))
        with pytest.raises(InputError, match=f"^{re.escape(str(path))}, pending.*{message}"):
            read_record(path)


def align(path, target):
    """Load; what is loaded makes a session before its first reading, what is refused names the file."""
    complaint = str(path)
    try:
        record = load_record(path)
        resumed(msgspec.structs.replace(record, observations=(), pending=None), [target] * len(record.parts))
    except InputError as error:
        complaint = str(error)
    assert complaint.startswith(str(path))


PLAIN = (
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=4) | st.sampled_from(["nan", "inf", "-inf", "../..", "a\0b"])
)  # fmt: skip
NESTED = PLAIN | st.lists(PLAIN, max_size=3) | st.dictionaries(st.text(max_size=4), PLAIN, max_size=3)
ANYTHING = NESTED | st.lists(NESTED, max_size=2) | st.dictionaries(st.text(max_size=4), NESTED, max_size=2)


@RELAXED
@given(st.lists(st.integers(0, 999), min_size=10, max_size=10), st.none() | st.tuples(ANYTHING))
def test_a_record_with_anything_in_it(recorded, steps, new):
    session, path = recorded
    document = copy.deepcopy(session_document(session))
    place = document
    for step in steps:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = keys[step % len(keys)]
        inner = isinstance(place[key], dict | list) and len(place[key])
        if not inner or step > 750:
            break
        place = place[key]
    if new is None:
        del place[key]
    else:
        place[key] = new[0]
    path.write_text(json.dumps(document))
    align(path, session.start.targets[0])


@RELAXED
@given(st.integers(0, 10**6), st.binary(max_size=3))
def test_a_cut_record_and_other_bytes(recorded, cut, tail):
    session, path = recorded
    text = (json.dumps(session_document(session)) + "\n").encode()
    path.write_bytes(text[: cut % (len(text) - 2)] + tail)
    with pytest.raises(InputError, match=re.escape(str(path))):
        load_record(path)


def test_a_mark_that_an_editor_put_before_it_is_no_fault(recorded):
    session, path = recorded
    write_record(session, path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_record(path).seed == session.seed


def test_unit_vectors_and_infinite_bounds_stay(recorded):
    session, path = recorded
    session.probe = replace(session.probe, approach=np.random.default_rng(0).normal(size=3))
    write_record(session, path)
    probe = load_record(path).probe
    assert np.isinf(probe.workspace.low).all()
    np.testing.assert_array_equal(probe.approach, session.probe.approach)
