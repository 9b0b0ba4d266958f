"""What another sender changes between two motions stops the run before the next one; no line depends on it."""

from __future__ import annotations

import time
from contextlib import contextmanager

import numpy as np
import pytest

from machines.cells import DOWN, START, at, robot, world
from tanteo.hand import Workspace
from tanteo.machines import GrblFake, GrblMachine, LinuxCncFake, LinuxCncMachine, MachineLimits, SafeMachine
from tanteo.machines.link import TcpLink
from tanteo.machines.protocol import StoppedError

WORKSPACE = Workspace(np.array([-0.05, -0.05, 0.0]), np.array([0.15, 0.15, 0.12]))
LIMITS = MachineLimits(WORKSPACE, travel=0.2, stale=1.0, grace=2.0)
KINDS = {"grbl": (GrblFake, GrblMachine), "linuxcnc": (LinuxCncFake, LinuxCncMachine)}


@contextmanager
def cell(kind: str, **how):
    start_fake, connect = KINDS[kind]
    fake = start_fake(world(), START, **how)
    try:
        machine = connect(TcpLink("127.0.0.1", *fake.ports))
        try:
            yield SafeMachine(machine, LIMITS), fake
        finally:
            machine.close()
    finally:
        fake.close()


def shifted(number: int, *xyz: float):
    def change(modal):
        modal.offsets[number] = np.array(xyz)

    return change


def turned(modal):
    modal.turns[1] = np.radians(30)


CHANGES = {
    **{code: (lambda modal, code=code: modal.read(code)) for code in ("G20", "G91", "G55", "G59", "G93", "G20 G58")},
    "offset of G54": shifted(1, 0.1, 0.0, 0.0), "small offset of G54": shifted(1, 0.0, 0.0, 5e-6),
}  # fmt: skip
FIRST = {"move": lambda s: s.move(at(40, 20, 50)), "touch": lambda s: s.sense(DOWN, 0.02), "back": None}


@pytest.mark.parametrize("motion", FIRST)
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("kind", KINDS)
def test_a_foreign_change_stops_before_a_motion(kind, change, motion):
    with cell(kind, offset=np.array([0.1, -0.2, 0.05])) as (safe, fake):
        safe.move(at(30, 20, 60))
        count = len(fake.tip.travelled)

        def run():
            if motion == "back":
                with safe.touching():
                    CHANGES[change](fake.modal)
            else:
                CHANGES[change](fake.modal)
                FIRST[motion](safe)

        with pytest.raises(StoppedError, match=r"moved it|expected the state"):
            run()
        assert len(fake.tip.travelled) == count
        with pytest.raises(StoppedError, match="a stopped one"):
            safe.move(at(30, 20, 60))
        assert len(fake.tip.travelled) == count


def test_a_foreign_rotation_stops_linuxcnc():
    with cell("linuxcnc") as (safe, fake):
        safe.move(at(30, 20, 60))
        turned(fake.modal)
        with pytest.raises(StoppedError, match="another rotation"):
            safe.move(at(40, 20, 50))
        assert len(fake.tip.travelled) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_machine_that_another_has_moved_is_stopped(kind):
    with cell(kind) as (safe, fake):
        safe.move(at(30, 20, 60))
        fake.tip.place = np.array([0.03, 0.02, 0.062])
        with pytest.raises(StoppedError, match=r"moved it by 2\.000 mm|the position \(30.000, 20.000, 62.000\)"):
            safe.move(at(40, 20, 50))
        assert len(fake.tip.travelled) == 1


@pytest.mark.parametrize("kind", KINDS)
def test_lines_with_motions_are_complete(kind):
    """Each line sets all its modes; a retreat is in machine coordinates."""
    with cell(kind) as (safe, fake):
        safe.move(at(30, 20, 40))
        with safe.touching():
            safe.sense(DOWN, 0.03)
        lines = [line for line in fake.received if " X" in line]
    assert len(lines) == 3
    assert all({"G21", "G90", "G94", "G54"} < set(line.split()) and "F" in line for line in lines)
    assert [("G53" in line, "G38.3" in line) for line in lines] == [(False, True), (False, True), (True, False)]


@pytest.mark.parametrize("kind", KINDS)
def test_a_change_within_the_window_moves_no_goal(kind):
    """Modes that change after they were compared are those of the line, not of the other sender."""
    with cell(kind) as (safe, fake):
        driver = safe.machine
        verify = driver._verify

        def changed(deadline):
            verify(deadline)
            fake.modal.read("G20 G91 G55 G93")

        driver._verify = changed
        safe.move(at(30, 20, 60))
        assert np.allclose(fake.tip.place, [0.03, 0.02, 0.06], atol=1e-6)
        with safe.touching():
            assert not safe.sense(DOWN, 0.02).hit
        assert np.allclose(fake.tip.place, [0.03, 0.02, 0.06], atol=1e-6)


def test_a_frame_that_this_program_sets_is_no_foreign_change():
    with cell("linuxcnc") as (safe, _), cell("grbl") as (other, _):
        for one in (safe, other):
            one.write_frame("G10 L2 P1 X100 Y50 Z-20\n")
            one.move(at(30, 20, 60))


@pytest.mark.parametrize("codes", ["$C", "!"])
def test_a_controller_that_is_not_idle_gets_no_motion(codes):
    """Check mode and a feed hold of another sender."""
    with cell("grbl") as (safe, fake):
        safe.move(at(30, 20, 60))
        if codes == "!":
            fake.tip.hold.set()
        else:
            fake._run(codes)
        with pytest.raises(StoppedError, match=r"in place of Idle|stopped one"):
            safe.move(at(40, 20, 50))
        assert len(fake.tip.travelled) == 1


def test_linuxcnc_in_another_mode_gets_no_motion():
    with cell("linuxcnc") as (safe, fake):
        safe.move(at(30, 20, 60))
        fake._mode = "MANUAL"
        with pytest.raises(StoppedError, match="MODE MANUAL in place of MDI"):
            safe.move(at(40, 20, 50))
        assert len(fake.tip.travelled) == 1


def longer(fake):
    fake.tcp = fake.tcp + np.array([0.0, 0.0, 0.05, 0.0, 0.0, 0.0])


def rotated(fake):
    fake.tcp = fake.tcp + np.array([0.0, 0.0, 0.0, 0.02, 0.0, 0.0])


def moved(fake):
    fake.tip.place = fake.tip.place + np.array([0.0, 0.0, 0.003])


def playing(fake):
    fake._playing = True


SEEN = [(longer, 0), (rotated, 0), (moved, 0), (longer, 0.1), (rotated, 0.1), (moved, 0.1), (playing, 0.1)]


@pytest.mark.parametrize(("change", "wait"), SEEN)
def test_a_foreign_change_stops_a_robot(change, wait):
    """The driver compares its last package; the program compares again before it moves."""
    with robot() as (machine, fake):
        safe = SafeMachine(machine, LIMITS)
        safe.move(at(30, 20, 60))
        change(fake)
        time.sleep(wait)
        with pytest.raises(StoppedError, match=r"expected the state|moved it|stopped one"):
            safe.move(at(40, 20, 50))
        assert len(fake.tip.travelled) == 1
