"""Sessions through drivers: they end as the direct one, no fault loses a reading, and a resumed one goes on."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from machines.cells import ABOVE, DOWN, PLACE, SD, SPREAD, driver, drivers, session, world_of
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.io import read_record
from tanteo.machines import DirectMachine, Faults, Journal, MachineLimits, RangingMachine, SafeMachine, probe_part
from tanteo.machines.address import opened, parse_machine
from tanteo.machines.protocol import Sensed
from tanteo.planning import Sensing, Session, Stop, probe_of
from tanteo.planning.start import at_pose

LIMITS = MachineLimits(travel=0.2, reach=0.1, stale=1.0, grace=2.0)


@pytest.fixture(scope="module")
def block(parts):
    return parts["block"]


SHORT, WHOLE = 2, 12
"""Readings of a session that the quick tests run, and of one that reaches its goal."""


def ended(block, most: int, name: str = "fake:grbl"):
    """Return a session without a fault."""
    one = session(block, most=most)
    with driver(name, world_of(block), ABOVE) as machine:
        done = probe_part(one, SafeMachine(machine, LIMITS))
    return done, one


def pose(one):
    return one.answer().hypotheses[0].T_world_part


@pytest.fixture(scope="module")
def undisturbed(block):
    """The pose after a short session."""
    return pose(ended(block, SHORT)[1])


def test_a_session_ends_by_its_stop_rule(block):
    done, one = ended(block, WHOLE)
    assert done.end.reached
    assert one.answer().status == "recognized"
    assert np.linalg.norm(pose(one)[:3, 3] - world_of(block).T_world_body[:3, 3]) < 0.4e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", drivers())
def test_every_driver_ends_at_the_same_pose(name, block):
    done, one = ended(block, WHOLE, name)
    assert done.end.reached
    assert np.linalg.norm(pose(one)[:3, 3] - world_of(block).T_world_body[:3, 3]) < 0.4e-3


def interrupted(block, fault: Faults, most: int, record, undisturbed, name: str = "fake:grbl") -> None:
    """Return a session that a fault ends and that continues: equal pose, no reading repeated or lost."""
    there, one = world_of(block), session(block, most=most)
    with driver(name, there, ABOVE, fault) as machine:
        done = probe_part(one, SafeMachine(machine, LIMITS), record)
        place = machine.status().place
        assert done.stopped
        assert not done.end.reached
        assert np.array_equal(machine.status().place, place)
    resumed = read_record(record, [one.start.targets[0].part])
    assert resumed.count >= one.count
    with driver(name, there, ABOVE) as machine:
        probe_part(resumed, SafeMachine(machine, LIMITS), record)
    assert np.array_equal(pose(resumed), undisturbed)
    assert resumed.count == most or most > SHORT


QUICK = [Faults(drop_before=4), Faults(drop_after=4), Faults(stop_at=5)]


@pytest.mark.parametrize("fault", QUICK, ids=["dropped before a touch", "dropped after a touch", "emergency stop"])
def test_no_fault_loses_a_reading(fault, block, undisturbed, tmp_path):
    interrupted(block, fault, SHORT, tmp_path / "run.json", undisturbed)


@pytest.fixture(scope="module")
def poses(block):
    """The pose after a complete session of each driver, computed on first use."""
    kept = dict[str, np.ndarray]()

    def of(name: str) -> np.ndarray:
        if name not in kept:
            kept[name] = pose(ended(block, WHOLE, name)[1])
        return kept[name]

    return of


@pytest.mark.slow
@pytest.mark.parametrize("step", range(1, 28))
@pytest.mark.parametrize("kind", ["drop_before", "drop_after", "stop_at", "silent"])
@pytest.mark.parametrize("name", ["fake:grbl", "fake:linuxcnc", "fake:ur"])
def test_no_fault_at_any_step_loses_a_reading(name, kind, step, block, poses, tmp_path):
    interrupted(block, Faults(**{kind: step}), WHOLE, tmp_path / "run.json", poses(name), name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fake:grbl", "fake:linuxcnc", "fake:ur"])
def test_late_answers_change_nothing(name, block, poses):
    for step in range(1, 28, 5):
        one = session(block, most=WHOLE)
        with driver(name, world_of(block), ABOVE, Faults(late=step, seconds=0.3)) as machine:
            assert probe_part(one, SafeMachine(machine, LIMITS)).end.reached
        assert np.array_equal(pose(one), poses(name))


def test_power_lost_between_touch_and_record(block, undisturbed, tmp_path, monkeypatch):
    """The journal has the reading and nothing after it: a resumed run uses it and does not touch again."""
    record, there = tmp_path / "run.json", world_of(block)
    one = session(block, most=SHORT)

    class PowerLost(BaseException):
        pass

    def record_then_raise(readings, action=None):
        raise PowerLost

    with driver("fake:grbl", there, ABOVE) as machine:
        monkeypatch.setattr(type(one), "tell", lambda self, readings, action=None: record_then_raise(readings, action))
        with pytest.raises(PowerLost):
            probe_part(one, SafeMachine(machine, LIMITS), record)
    monkeypatch.undo()
    assert len(Journal(record).rows()) == 1
    resumed = read_record(record, [one.start.targets[0].part])
    assert resumed.count == 0
    with driver("fake:grbl", there, ABOVE) as machine:
        done = probe_part(resumed, SafeMachine(machine, LIMITS), record)
    assert done.resumed == 1
    assert np.array_equal(pose(resumed), undisturbed)
    assert not Journal(record).rows()


def test_a_line_that_was_cut_was_never_read(tmp_path, block):
    journal = Journal(tmp_path / "run.json")
    action = session(block).ask()
    journal.keep(action, Sensed(action.origin, action.direction, 0.02, 0.05))
    with journal.path.open("a") as file:
        file.write('{"question": 2, "start_m": [0.1, 0.')
    assert [number for number, _ in journal.rows()] == [1]
    journal.path.write_text(json.dumps({"question": 1}) + "\n\n" + journal.path.read_text())
    with pytest.raises(InputError, match="line 1"):
        journal.rows()


@pytest.mark.parametrize(
    "row",
    [
        "[" * 50_000,
        '{"question": 1e400, "start_m": [0, 0, 0], "direction": [0, 0, -1], "distance_m": 0.02, "reach_m": 0.05}',
        '{"question": 1, "start_m": [0, 0, NaN], "direction": [0, 0, -1], "distance_m": 0.02, "reach_m": 0.05}',
        '{"question": 1, "start_m": [0, 0, 0], "direction": [0, 0, -1], "distance_m": -1, "reach_m": 0.05}',
    ],
)
def test_a_journal_line_without_a_reading_is_refused(tmp_path, row):
    journal = Journal(tmp_path / "run.json")
    journal.path.write_text(f"{row}\n\n")
    with pytest.raises(InputError, match="line 1: expected a reading"):
        journal.rows()


@pytest.mark.skipif(os.name != "posix", reason="other systems have no such files")
def test_a_journal_that_is_a_pipe_or_a_device_is_refused(tmp_path):
    journal = Journal(tmp_path / "run.json")
    os.mkfifo(journal.path)
    with pytest.raises(InputError, match="a pipe or device"):
        journal.rows()


def test_a_full_disk_stops_before_the_next_motion(block, tmp_path, monkeypatch):
    one = session(block)
    with driver("fake:direct", world_of(block), ABOVE) as machine:
        monkeypatch.setattr(Journal, "keep", lambda *_: (_ for _ in ()).throw(InputError("disk: expected free space")))
        with pytest.raises(InputError, match="disk"):
            probe_part(one, SafeMachine(machine, LIMITS), tmp_path / "run.json")
        start = one.pending.origin
        assert np.allclose(machine.status().place, start)  # it went back from the part
    assert one.count == 0


@pytest.mark.slow
def test_a_ball_of_another_size_is_no_sure_answer(block):
    """Wrong tool: the ball is 0.5 mm smaller than stated."""
    there = world_of(block)
    there = type(there)(there.surface, there.T_world_body, 0.5e-3, there.sd, there.seed)
    one = session(block, tolerance=0.2e-3, most=16)
    with driver("fake:grbl", there, ABOVE) as machine:
        probe_part(one, SafeMachine(machine, LIMITS))
    answer = one.answer()
    best = answer.hypotheses[0] if answer.hypotheses else None
    off = np.inf if best is None else np.linalg.norm(best.T_world_part[:3, 3] - there.T_world_body[:3, 3])
    assert answer.status != "recognized" or off < 1e-3


def test_a_log_answers_as_the_machine_did(block, undisturbed, tmp_path):
    record, one = tmp_path / "run.json", session(block, most=SHORT)
    with driver("fake:grbl", world_of(block), ABOVE) as machine:
        probe_part(one, SafeMachine(machine, LIMITS), record)
    again = session(block, most=SHORT)
    with opened(parse_machine(f"replay:{record}")) as machine:
        probe_part(again, SafeMachine(machine, LIMITS))
        assert not machine.left
    assert np.allclose(pose(again), undisturbed, atol=1e-7)


@pytest.mark.parametrize("text", ["[PRB:1.0,2.0,3.0:1]\n[PRB:4.0,2.0,3.0:1]\n", "x_mm,y_mm,z_mm\n1,2,3\n4,5,6\n"])
def test_a_log_without_directions_leads_to_next(tmp_path, text):
    log = tmp_path / "console.log"
    log.write_text(text)
    with pytest.raises(InputError, match="tanteo next names"), opened(parse_machine(f"replay:{log}")):
        pass


@pytest.mark.slow
def test_a_log_answers_every_request(block, tmp_path):
    """The touches of one session answer another session with other plans: the same part, placed equally well."""
    record, one = tmp_path / "run.json", session(block, most=WHOLE)
    with driver("fake:direct", world_of(block), ABOVE) as machine:
        probe_part(one, SafeMachine(machine, LIMITS), record)
    again = session(block, most=WHOLE)
    again.seed = 5
    with opened(parse_machine(f"replay:{record}")) as machine:
        probe_part(again, SafeMachine(machine, LIMITS))
    assert again.count >= one.count
    assert np.linalg.norm(pose(again)[:3, 3] - world_of(block).T_world_body[:3, 3]) < 0.4e-3


def test_a_point_laser_on_a_machine_places_the_part(block):
    """From above alone: what a beam from there can see is placed, nothing is touched, and the tool stays above."""
    there = world_of(block)
    machine = DirectMachine(there, ABOVE)

    def read() -> float:
        place, along = (
            SE3.apply(SE3.inverse(there.T_world_body), p) for p in (machine.tip.place, machine.tip.place + DOWN)
        )
        return float(there.surface.cast(place[None], (along - place)[None]).distances[0])

    probe = probe_of(SD, approach=DOWN, cone=0.0, standoff=0.08, clearance=0.02, max_range=0.3)
    one = Session(at_pose(block, PLACE, SPREAD), probe, Sensing(sd=SD), stop=Stop(tolerance=1e-3, max_measurements=3))
    done = probe_part(one, SafeMachine(RangingMachine(machine, read), LIMITS))
    assert not done.stopped
    assert one.count == 3
    assert min(place[2] for place in machine.tip.travelled) > 0.1
    sd = np.sqrt(one.answer().hypotheses[0].covariance[2, 2])
    assert sd < 2e-4  # across its top face
