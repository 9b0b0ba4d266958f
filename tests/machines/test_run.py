"""Sessions through drivers: they end as the direct one, no fault loses a reading, and a resumed one goes on."""

from __future__ import annotations

import json

import numpy as np
import pytest
from machines.cells import ABOVE, driver, drivers, session, world_of

from tanteo.errors import InputError
from tanteo.io import read_record
from tanteo.machines import Faults, Journal, MachineLimits, SafeMachine, Sensed, probe_part

LIMITS = MachineLimits(travel=0.2, reach=0.1, stale=1.0, grace=2.0)


@pytest.fixture(scope="module")
def block(parts):
    return parts["block"]


@pytest.fixture(scope="module")
def undisturbed(block):
    """The answer, and how many motions it took."""
    there = world_of(block)
    with driver("fake:grbl", there, ABOVE) as machine:
        one = session(block)
        done = probe_part(one, SafeMachine(machine, LIMITS))
    return done, one.answer(), one.count


def test_a_session_ends_as_it_was_asked_to(block, undisturbed):
    done, answer, _ = undisturbed
    assert done.end.reached
    assert answer.status == "recognized"
    true = world_of(block).T_world_body
    error = answer.hypotheses[0].T_world_part[:3, 3] - true[:3, 3]
    assert np.linalg.norm(error) < 0.4e-3


@pytest.mark.parametrize("name", [name for name in drivers() if name != "fake:grbl"])
def test_every_driver_ends_at_the_same_pose(name, block, undisturbed):
    one = session(block)
    with driver(name, world_of(block), ABOVE) as machine:
        done = probe_part(one, SafeMachine(machine, LIMITS))
    assert done.end.reached
    best, other = one.answer().hypotheses[0], undisturbed[1].hypotheses[0]
    apart = best.T_world_part[:3, 3] - other.T_world_part[:3, 3]
    assert np.linalg.norm(apart) < 3 * (best.corner_sd + other.corner_sd)


def faults() -> list[tuple[str, Faults]]:
    steps = (1, 4, 5, 6, 9)
    return [
        *((f"dropped before motion {k}", Faults(drop_before=k)) for k in steps),
        *((f"dropped after motion {k}", Faults(drop_after=k)) for k in steps),
        ("emergency stop", Faults(stop_at=7)),
    ]


@pytest.mark.parametrize("fault", [f for _, f in faults()], ids=[name for name, _ in faults()])
def test_no_fault_loses_a_reading(fault, block, undisturbed, tmp_path):
    record, there = tmp_path / "run.json", world_of(block)
    one = session(block)
    with driver("fake:grbl", there, ABOVE, fault) as machine:
        done = probe_part(one, SafeMachine(machine, LIMITS), record)
        place = machine.status().place
        assert done.stopped
        assert not done.end.reached
        assert np.array_equal(machine.status().place, place)
    resumed = read_record(record, [one.start.targets[0].part])
    assert resumed.count >= one.count
    with driver("fake:grbl", there, ABOVE) as machine:
        assert probe_part(resumed, SafeMachine(machine, LIMITS), record).end.reached
    answer = resumed.answer()
    assert np.array_equal(answer.hypotheses[0].T_world_part, undisturbed[1].hypotheses[0].T_world_part)
    assert resumed.count == undisturbed[2]


def test_power_lost_between_touch_and_record(block, undisturbed, tmp_path, monkeypatch):
    """The reading is in the journal, and no more: a run that is taken up tells it and does not touch again."""
    record, there = tmp_path / "run.json", world_of(block)
    one = session(block)

    class PowerLost(BaseException):
        pass

    def tell(readings, action=None):
        raise PowerLost

    with driver("fake:grbl", there, ABOVE) as machine:
        monkeypatch.setattr(type(one), "tell", lambda self, readings, action=None: tell(readings, action))
        with pytest.raises(PowerLost):
            probe_part(one, SafeMachine(machine, LIMITS), record)
    monkeypatch.undo()
    assert len(Journal(record).rows()) == 1
    resumed = read_record(record, [one.start.targets[0].part])
    assert resumed.count == 0
    with driver("fake:grbl", there, ABOVE) as machine:
        done = probe_part(resumed, SafeMachine(machine, LIMITS), record)
    assert done.resumed == 1
    assert np.array_equal(
        resumed.answer().hypotheses[0].T_world_part, undisturbed[1].hypotheses[0].T_world_part
    )
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


def test_a_full_disk_stops_before_the_next_motion(block, tmp_path, monkeypatch):
    one = session(block)
    with driver("fake:direct", world_of(block), ABOVE) as machine:
        monkeypatch.setattr(Journal, "keep", lambda *_: (_ for _ in ()).throw(InputError("disk: expected room")))
        with pytest.raises(InputError, match="disk"):
            probe_part(one, SafeMachine(machine, LIMITS), tmp_path / "run.json")
        start = one.asked.origin
        assert np.allclose(machine.status().place, start)  # it went back from the part
    assert one.count == 0


def test_a_ball_of_another_size_is_no_sure_answer(block):
    """Wrong tool: the ball is 0.5 mm smaller than said."""
    there = world_of(block)
    there = type(there)(there.surface, there.T_world_body, 0.5e-3, there.sd, there.seed)
    one = session(block, tolerance=0.2e-3, most=16)
    with driver("fake:grbl", there, ABOVE) as machine:
        probe_part(one, SafeMachine(machine, LIMITS))
    answer = one.answer()
    best = answer.hypotheses[0] if answer.hypotheses else None
    off = np.inf if best is None else np.linalg.norm(best.T_world_part[:3, 3] - there.T_world_body[:3, 3])
    assert answer.status != "recognized" or off < 1e-3
