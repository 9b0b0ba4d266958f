"""What every driver does, and what none ever does: on each driver and its fake."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from machines.cells import DOWN, START, at, cell, driver, drivers, world
from tanteo.machines import Faults, MachineLimits, SafeMachine
from tanteo.machines.protocol import ContactError, LateError, LinkLostError, MachineError, StoppedError

FAST, SECONDS = 0.05, 5.0
START_POSE = at(30, 20, 100)
WIRED = [name for name in drivers() if name != "fake:direct"]
FAKES = [name for name in drivers() if name.startswith("fake:")]
LIMITS = MachineLimits(travel=0.2, stale=1.0, grace=2.0)


@pytest.fixture(params=drivers())
def machine(request):
    with driver(request.param, world()) as one:
        yield one


def test_it_reports_its_position_before_it_moves(machine):
    status = machine.status()
    assert status.state == "idle"
    assert np.allclose(status.place, START, atol=1e-6)
    assert status.age < 1.0
    assert machine.facts.name


def test_a_motion_ends_where_it_was_sent(machine):
    machine.move(at(10, 5, 60), FAST, SECONDS)
    status = machine.status()
    assert np.allclose(status.place, [0.01, 0.005, 0.06], atol=2e-6)
    assert status.state == "idle"
    assert status.age < 0.5
    assert status.tripped is not True


@pytest.mark.parametrize("name", drivers())
def test_a_fast_motion_has_the_requested_speed(name):
    with driver(name, world(), speedup=1.0) as machine:
        begun = time.monotonic()
        machine.move(at(10, 5, 60), 0.4, SECONDS)  # 24,000 mm/min: no controller reads 2.4e+04
        machine.back(START_POSE, 0.4, SECONDS)
        assert time.monotonic() - begun < 2.0


def test_a_touch_reports_the_path_to_the_contact(machine):
    machine.move(at(10, 5, 30), FAST, SECONDS)
    sensed = machine.sense(DOWN, 0.02, 0.002, 30.0)
    assert sensed.hit
    assert sensed.distance == pytest.approx(0.009, abs=3e-6)  # to 20 mm and the ball's radius
    assert np.allclose(sensed.start, [0.01, 0.005, 0.03], atol=2e-6)
    assert machine.status().place[2] == pytest.approx(0.021, abs=3e-6)
    machine.back(at(10, 5, 30), FAST, SECONDS)
    assert machine.status().tripped is not True


def test_a_touch_of_nothing_is_no_error(machine):
    machine.move(at(10, 5, 40), FAST, SECONDS)
    sensed = machine.sense(DOWN, 0.01, 0.002, 30.0)
    assert not sensed.hit
    assert machine.status().place[2] == pytest.approx(0.03, abs=3e-6)


def test_a_way_that_meets_something_ends_there(machine):
    assert machine.facts.guarded
    machine.move(at(-20, 20, 10), FAST, SECONDS)
    with pytest.raises(ContactError, match="clear path"):
        machine.move(at(100, 20, 10), FAST, SECONDS)
    assert machine.status().place[0] == pytest.approx(-0.001, abs=5e-6)
    machine.back(at(-20, 20, 10), FAST, SECONDS)  # it may still move
    machine.move(at(-20, 20, 30), FAST, SECONDS)


def test_nothing_moves_after_an_abort(machine):
    machine.abort()
    machine.abort()
    place = machine.status().place
    for motion in (
        lambda: machine.move(at(0, 0, 60), FAST, SECONDS),
        lambda: machine.back(at(0, 0, 60), FAST, SECONDS),
        lambda: machine.sense(DOWN, 0.01, 0.002, SECONDS),
    ):
        with pytest.raises(StoppedError):
            motion()
    assert np.array_equal(machine.status().place, place)
    assert machine.status().state == "stopped"


@pytest.mark.parametrize("name", drivers())
def test_an_abort_ends_a_motion(name):
    with driver(name, world(), speedup=1.0) as machine:
        timer = threading.Timer(0.2, machine.abort)
        timer.start()
        begun = time.monotonic()
        with pytest.raises(MachineError):
            machine.move(at(30, 20, 30), 0.01, 30.0)  # 7 s of motion
        assert time.monotonic() - begun < 2.0
        time.sleep(0.3)
        first = machine.status().place
        time.sleep(0.3)
        assert np.array_equal(machine.status().place, first)
        assert first[2] > 0.08


@pytest.mark.parametrize("name", drivers())
def test_getters_never_raise_nor_wait(name):
    with driver(name, world()) as machine:
        machine.close()
        machine.close()
        begun = time.monotonic()
        status = machine.status()
        assert time.monotonic() - begun < 0.05
        assert status.state in ("stopped", "lost", "idle")


@pytest.mark.parametrize("name", WIRED)
def test_no_motion_blocks_for_ever(name):
    with driver(name, world(), faults=Faults(silent=1)) as machine:
        begun = time.monotonic()
        with pytest.raises(LateError, match="in time"):
            machine.move(at(0, 0, 60), FAST, 0.6)
        assert time.monotonic() - begun < 2.0


@pytest.mark.parametrize("name", WIRED)
def test_an_old_status_is_not_reported_as_fresh(name):
    with driver(name, world(), faults=Faults(silent=1)) as machine:
        with pytest.raises(MachineError):
            machine.move(at(0, 0, 60), FAST, 0.8)
        assert machine.status().age > 0.5


@pytest.mark.parametrize("faults", [Faults(drop_before=2), Faults(drop_after=2)], ids=["before", "after"])
@pytest.mark.parametrize("name", ["fake:grbl", "fake:ur"])
def test_a_lost_connection_is_reported(name, faults):
    with driver(name, world(), faults=faults) as machine:
        machine.move(at(10, 5, 40), FAST, SECONDS)
        with pytest.raises(LinkLostError, match="expected"):
            machine.sense(DOWN, 0.03, 0.002, SECONDS)
        assert machine.status().state == "lost"
        with pytest.raises(LinkLostError):
            machine.move(at(10, 5, 40), FAST, SECONDS)


@pytest.mark.parametrize("name", WIRED)
def test_an_emergency_stop_is_for_good(name):
    with driver(name, world(), faults=Faults(stop_at=2)) as machine:
        machine.move(at(10, 5, 60), FAST, SECONDS)
        with pytest.raises(StoppedError):
            machine.move(at(10, 5, 40), FAST, SECONDS)
        place = machine.status().place
        with pytest.raises(StoppedError):
            machine.back(at(10, 5, 60), FAST, SECONDS)
        assert np.array_equal(machine.status().place, place)


@pytest.mark.parametrize("name", WIRED)
def test_a_late_answer_is_waited_for(name):
    with driver(name, world(), faults=Faults(late=2, seconds=0.4)) as machine:
        machine.move(at(10, 5, 30), FAST, SECONDS)
        sensed = machine.sense(DOWN, 0.02, 0.002, SECONDS)
        assert sensed.distance == pytest.approx(0.009, abs=3e-6)


@pytest.mark.parametrize("name", drivers())
def test_a_reading_lies_on_its_line_near_the_tip(name):
    with driver(name, world()) as machine:
        safe = SafeMachine(machine, LIMITS)
        safe.move(at(10, 5, 40))
        for direction, reach in ((DOWN, 0.03), (np.array([0.6, 0.0, -0.8]), 0.04), (DOWN, 0.01)):
            with safe.touching():
                sensed = safe.sense(direction, reach)
            end = sensed.start + min(sensed.distance, reach) * direction
            assert sensed.reported is None or np.linalg.norm(sensed.reported - end) < 5e-6
        assert not safe.stopped


BENT = {
    "0.5 mm beside": Faults(beside=2), "50 mm beside": Faults(beside=2, shift=0.05), "0.5 mm along": Faults(along=2),
    "5 mm along": Faults(along=2, shift=5e-3), "none half way": Faults(missed=2),
}  # fmt: skip


@pytest.mark.parametrize("faults", BENT)
@pytest.mark.parametrize("name", WIRED)
def test_a_wrong_contact_is_no_reading(name, faults):
    with driver(name, world(), faults=BENT[faults]) as machine:
        safe = SafeMachine(machine, LIMITS)
        safe.move(at(10, 5, 40))
        with pytest.raises(StoppedError, match="expected readings"):
            safe.sense(DOWN, 0.03)
        place = machine.status().place
        with pytest.raises(StoppedError):
            safe.move(at(10, 5, 40))
        assert np.array_equal(machine.status().place, place)


@pytest.mark.parametrize("name", FAKES)
def test_a_tip_that_another_has_moved_makes_no_motion(name):
    with cell(name) as (machine, fake):
        safe = SafeMachine(machine, LIMITS)
        safe.move(at(30, 20, 60))
        fake.tip.place = fake.tip.place + np.array([0.0, 3e-3, 0.0])
        count = len(fake.tip.travelled)
        with pytest.raises(StoppedError):
            safe.move(at(40, 20, 50))
        with pytest.raises(StoppedError):
            safe.sense(DOWN, 0.01)
        assert len(fake.tip.travelled) == count


@pytest.mark.parametrize("name", FAKES)
def test_a_close_ends_a_motion_for_good(name):
    with cell(name, speedup=1.0) as (machine, fake):
        failed = list[MachineError]()

        def run():
            try:
                machine.sense(DOWN, 0.06, 0.01, 30.0)
            except MachineError as error:
                failed.append(error)

        thread = threading.Thread(target=run)
        thread.start()
        time.sleep(0.3)
        assert fake.tip.moving
        begun = time.monotonic()
        machine.close()
        assert time.monotonic() - begun < 2.5
        assert not fake.tip.moving
        place = fake.tip.place
        fake.tip.hold.clear()  # cycle start of an operator
        time.sleep(0.2)
        assert np.array_equal(fake.tip.place, place)
        thread.join(5.0)
        assert failed


@pytest.mark.parametrize("seconds", [np.nan, -1.0, 0.0])
@pytest.mark.parametrize("name", WIRED)
def test_a_motion_without_time_ends(name, seconds):
    begun = time.monotonic()
    with driver(name, world(), speedup=1.0) as machine, pytest.raises(StoppedError):
        machine.move(at(30, 20, 30), 0.01, seconds)
    assert time.monotonic() - begun < 8.0


def test_positions_are_finite(machine):
    place = machine.status().place
    assert place.shape == (3,)
    assert np.isfinite(place).all()
    axes = machine.status().axes
    assert axes is None or np.allclose(axes @ axes.T, np.eye(3))
    assert machine.facts.deceleration > 0
