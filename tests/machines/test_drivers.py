"""What single drivers do beside the conformance suite: offsets, units, frames read back, forces, what is refused."""

from __future__ import annotations

from contextlib import contextmanager

import numpy as np
import pytest

from machines.cells import DOWN, START, at, driver, world
from tanteo.machines import Faults, GrblFake, GrblMachine, LinuxCncFake, LinuxCncMachine
from tanteo.machines.link import TcpLink
from tanteo.machines.protocol import ContactError, LateError, LinkLostError, MachineError, StoppedError

OFFSET = np.array([0.1, -0.2, 0.05])
FRAME = "(block)\nG21 G90\nG10 L2 P2 X12.5000 Y-3.0000 Z4.2500\n"


@contextmanager
def linuxcnc(**how):
    fake = LinuxCncFake(world(), START, **how)
    try:
        machine = LinuxCncMachine(TcpLink("127.0.0.1", *fake.ports))
        try:
            yield machine, fake
        finally:
            machine.close()
    finally:
        fake.close()


@contextmanager
def grbl(**how):
    fake = GrblFake(world(), START, **how)
    machine = GrblMachine(TcpLink("127.0.0.1", fake.ports[0]))
    try:
        yield machine, fake
    finally:
        machine.close()
        fake.close()


@pytest.mark.parametrize("metric", [True, False], ids=["mm", "inch"])
def test_linuxcnc_touches_with_offsets_in_its_own_unit(metric):
    with linuxcnc(metric=metric, offset=OFFSET, turn=30.0) as (machine, _):
        machine.move(at(10, 5, 30), 0.1, 5.0)
        assert machine.sense(DOWN, 0.02, 0.01, 5.0).distance == pytest.approx(0.009, abs=3e-6)


def test_a_message_taken_by_another_display_is_requested_again():
    with linuxcnc(thief=2) as (machine, _):
        machine.move(at(10, 5, 30), 0.1, 5.0)
        assert np.allclose(machine.status().place, [0.01, 0.005, 0.03], atol=2e-6)


def test_a_display_that_takes_all_messages_stops_it():
    with linuxcnc() as (machine, fake):
        fake._thief = 1000
        with pytest.raises(LateError, match="another display"):
            machine.move(at(10, 5, 30), 0.1, 1.5)


def test_linuxcnc_that_is_off_stays_off():
    with pytest.raises(StoppedError, match="switched off"), linuxcnc(on=False):
        pass


def test_a_turned_frame_in_use_moves_no_goal():
    with linuxcnc() as (machine, fake):
        machine.write_frame("G10 L2 P1 X100 Y50 Z-20 R40\n", 5.0)
        assert fake.modal.turns[1] == pytest.approx(np.radians(40))
        machine.move(at(10, 5, 30), 0.1, 5.0)
        assert np.allclose(machine.status().place, [0.01, 0.005, 0.03], atol=2e-6)
        assert machine.sense(DOWN, 0.02, 0.01, 5.0).distance == pytest.approx(0.009, abs=3e-6)


def test_a_wrong_password_is_reported():
    fake = LinuxCncFake(world(), START)
    try:
        for passwords, words in ((("no", "EMCTOO"), "connect password"), (("EMC", "no"), "enable password")):
            with pytest.raises(LinkLostError, match=words):
                LinuxCncMachine(TcpLink("127.0.0.1", *fake.ports), passwords)
    finally:
        fake.close()


@pytest.mark.parametrize("cell", [linuxcnc, grbl])
def test_a_frame_is_read_back(cell, monkeypatch):
    with cell() as (machine, fake):
        machine.write_frame(FRAME, 5.0)
        assert np.allclose(fake.modal.offsets[2], [0.0125, -0.003, 0.00425])
        monkeypatch.setattr(type(fake.modal), "set_offset", lambda modal, block: None)  # it answers ok and does nothing
        with pytest.raises(MachineError, match="read back"):
            machine.write_frame(FRAME.replace("12.5", "13.5"), 5.0)


@pytest.mark.parametrize("cell", [linuxcnc, grbl])
def test_a_frame_that_is_in_use_moves_no_goal(cell):
    with cell() as (machine, _):
        machine.write_frame("G10 L2 P1 X100 Y50 Z-20\n", 5.0)
        machine.move(at(10, 5, 60), 0.1, 5.0)
        assert np.allclose(machine.status().place, [0.01, 0.005, 0.06], atol=2e-6)


def test_a_probe_that_does_not_trip_ends_at_a_force():
    with driver("fake:ur", world(), faults=Faults(stuck=2)) as machine:
        machine.move(at(10, 5, 40), 0.1, 5.0)
        with pytest.raises(ContactError, match="force of more than 50 N"):
            machine.sense(DOWN, 0.01, 0.01, 5.0)
        machine.back(at(10, 5, 40), 0.1, 5.0)  # it may still move
        assert machine.status().state == "idle"
