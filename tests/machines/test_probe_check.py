"""A probe that does not trigger: checked by hand or on a surface first, and found after two expected contacts."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from machines.cells import ABOVE, DOWN, START, at, driver, drivers, session, world, world_of
from tanteo.machines import (
    DirectMachine,
    GrblFake,
    GrblMachine,
    LinuxCncFake,
    LinuxCncMachine,
    MachineLimits,
    SafeMachine,
    UrFake,
    UrMachine,
    World,
    probe_part,
)
from tanteo.machines.link import TcpLink
from tanteo.machines.protocol import StoppedError

LIMITS = MachineLimits(travel=0.2, reach=0.1, stale=1.0, grace=2.0)
CELLS = {"grbl": (GrblFake, GrblMachine), "linuxcnc": (LinuxCncFake, LinuxCncMachine), "ur": (UrFake, UrMachine)}


class Open(World):
    """A body that the probe passes, because its circuit is open."""

    def tripped(self, place):
        return False

    def contact(self, start, end):
        return np.inf


def opened_circuit(there: World) -> World:
    return Open(there.surface, there.T_world_body, there.radius, there.sd, there.seed)


@pytest.fixture(scope="module")
def block(parts):
    return parts["block"]


@pytest.mark.parametrize("name", drivers())
def test_two_expected_contacts_without_one_stop_the_run(name, block):
    with driver(name, opened_circuit(world_of(block)), ABOVE) as machine:
        safe = SafeMachine(machine, LIMITS)
        done = probe_part(session(block, most=30), safe)
        assert len(done.turns) == 2
        assert "circuit is open" in done.stopped
        assert "circuit is open" in done.end.message
        assert not done.end.reached
        assert not any(turn.sensed.hit for turn in done.turns)
        place = machine.status().place
        with pytest.raises(StoppedError, match="circuit is open"):
            safe.move(at(0, 0, 300))
        assert np.array_equal(machine.status().place, place)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in (1, 2))])
def test_a_cable_that_breaks_during_a_run_stops_it(seed, block):
    """The first touches have contacts; then the circuit is open."""
    there = world_of(block, seed)
    machine = DirectMachine(there, ABOVE)
    turns = []

    def watch(turn):
        turns.append(turn)
        if len(turns) == 3:
            machine.tip.world = opened_circuit(there)

    done = probe_part(session(block, tolerance=1e-5, most=30), SafeMachine(machine, LIMITS), watch=watch)
    assert sum(turn.sensed.hit for turn in done.turns) == 3
    assert len(done.turns) <= 3 + 3
    assert "circuit is open" in done.stopped


def test_the_depth_of_a_missed_contact_is_bounded(block):
    there, deepest = world_of(block), 0.0
    one = session(block, most=30)
    with driver("fake:direct", opened_circuit(there), ABOVE) as machine:
        for turn in probe_part(one, SafeMachine(machine, LIMITS)).turns:
            way = there.contact(turn.sensed.start, turn.sensed.start + turn.sensed.reach * turn.sensed.direction)
            deepest = max(deepest, turn.sensed.reach - way if np.isfinite(way) else 0.0)
    assert deepest < 0.01


@pytest.mark.slow
def test_a_touch_that_may_miss_is_no_open_circuit(block):
    """Wrong prior: touches beside the part are no evidence against the probe while poses explain them."""
    for seed in range(2):
        one = session(block, most=8)
        with driver("fake:direct", world_of(block, seed), ABOVE) as machine:
            assert not probe_part(one, SafeMachine(machine, LIMITS)).stopped


def checked(kind: str, press, seconds: float = 0.6):
    start_fake, connect = CELLS[kind]
    fake = start_fake(world(), START)
    try:
        machine = connect(*(TcpLink("127.0.0.1", port) for port in fake.ports))
        try:
            safe = SafeMachine(machine, LIMITS)
            thread = threading.Thread(target=press, args=(fake,))
            thread.start()
            try:
                safe.check_by_hand(seconds)
            finally:
                thread.join()
            assert fake.motions == 0
            safe.move(at(30, 20, 60))
        finally:
            machine.close()
    finally:
        fake.close()


def pressed(fake, seconds: float = 0.35):
    time.sleep(0.1)
    fake.tip.pressed.set()
    time.sleep(seconds)
    fake.tip.pressed.clear()


@pytest.mark.parametrize("kind", CELLS)
def test_a_hand_triggers_the_probe_before_the_first_motion(kind):
    checked(kind, pressed, 2.0)


@pytest.mark.parametrize(
    ("press", "words"),
    [
        (lambda fake: None, "circuit is open"),
        (lambda fake: (time.sleep(0.3), fake.tip.pressed.set()), "stays closed"),
    ],
)
@pytest.mark.parametrize("kind", CELLS)
def test_a_probe_that_fails_its_check_gets_no_motion(kind, press, words):
    with pytest.raises(StoppedError, match=words):
        checked(kind, press)


def test_a_probe_that_reports_contact_at_first_is_refused():
    machine = DirectMachine(world(), START)
    machine.tip.pressed.set()
    safe = SafeMachine(machine, LIMITS)
    with pytest.raises(StoppedError, match="is closed, or inverted"):
        safe.check_by_hand(0.2)
    with pytest.raises(StoppedError, match="probe does not work"):
        safe.move(at(0, 0, 90))


def test_a_known_surface_checks_the_probe():
    safe = SafeMachine(DirectMachine(world(), START), LIMITS)
    safe.check_on_surface(0.021)
    assert np.allclose(safe.place(), START)
    assert not safe.stopped


@pytest.mark.parametrize("height", [0.015, 0.027])
def test_a_surface_at_another_height_is_refused(height):
    machine = DirectMachine(world(), START)
    safe = SafeMachine(machine, LIMITS)
    with pytest.raises(StoppedError, match=r"from its height|without a contact"):
        safe.check_on_surface(height)
    assert np.allclose(machine.tip.place, START)


def test_a_surface_without_a_contact_stops_near_it():
    machine = DirectMachine(opened_circuit(world()), START)
    with pytest.raises(StoppedError, match="without a contact: its circuit is open"):
        SafeMachine(machine, LIMITS).check_on_surface(0.021)
    assert min(place[2] for place in machine.tip.travelled) == pytest.approx(0.019)


def test_a_first_touch_without_contact_alone_does_not_stop(block):
    machine = DirectMachine(world(), START)
    safe = SafeMachine(machine, LIMITS)
    assert not safe.sense(DOWN, 0.01).hit
    assert not safe.stopped


@pytest.mark.parametrize("kind", CELLS)
def test_a_closed_circuit_ends_a_run_at_once(kind, block):
    """The probe reports a contact all the time."""
    start_fake, connect = CELLS[kind]
    fake = start_fake(world_of(block), ABOVE)
    try:
        machine = connect(*(TcpLink("127.0.0.1", port) for port in fake.ports))
        try:
            fake.tip.pressed.set()
            time.sleep(0.4)
            done = probe_part(session(block), SafeMachine(machine, LIMITS))
            assert len(done.turns) == 1
            assert "its circuit is closed" in done.stopped
            assert all(np.allclose(place, ABOVE, atol=1e-6) for place in fake.tip.travelled)
        finally:
            machine.close()
    finally:
        fake.close()


def test_a_probe_that_stays_closed_after_a_touch_ends_a_run():
    machine = DirectMachine(world(), START)
    safe = SafeMachine(machine, LIMITS)
    safe.move(at(30, 20, 40))

    def touch():
        with safe.touching():
            assert safe.sense(DOWN, 0.03).hit
            machine.tip.pressed.set()

    with pytest.raises(StoppedError, match="its circuit is closed"):
        touch()
    assert np.allclose(machine.tip.place, [0.03, 0.02, 0.04])
