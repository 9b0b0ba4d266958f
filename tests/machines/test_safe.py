"""The wrapper around every driver: limits, a watchdog, the way back, nothing after a stop."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from machines.cells import DOWN, START, at, driver, world
from tanteo.errors import InputError
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.machines import DirectMachine, MachineLimits, SafeMachine
from tanteo.machines.protocol import ContactError, LateError, MachineStatus, RefusedError, StoppedError

WORKSPACE = Workspace(np.array([-0.05, -0.05, 0.0]), np.array([0.15, 0.15, 0.12]))


def safe(limits: MachineLimits | None = None, **more) -> SafeMachine:
    return SafeMachine(DirectMachine(world(), START), limits or MachineLimits(WORKSPACE), **more)


def test_limits_hold_before_anything_is_sent():
    one = safe()
    for pose in (at(0, 0, 130), at(-60, 0, 50), at(np.nan, 0, 50)):
        with pytest.raises(RefusedError, match="Nothing was sent"):
            one.move(pose)
    with pytest.raises(RefusedError, match="reach"):
        one.sense(DOWN, 0.2)
    assert one.machine.tip.travelled == []
    one.move(at(0, 0, 110))


def test_ways_do_not_cross_a_forbidden_box():
    box = ForbiddenBox("the vise", np.array([0.06, -0.05, 0.05]), np.array([0.08, 0.1, 0.11]))
    one = safe(MachineLimits(Workspace(WORKSPACE.low, WORKSPACE.high, [box]), clearance=1e-3))
    one.move(at(30, 20, 80))
    with pytest.raises(RefusedError, match="the vise"):
        one.move(at(100, 20, 80))


def test_the_machine_keeps_to_its_speeds():
    speeds = list[float]()

    class Watched(DirectMachine):
        def move(self, T, speed, seconds):
            speeds.append(speed)
            super().move(T, speed, seconds)

        def sense(self, direction, reach, speed, seconds):
            speeds.append(speed)
            return super().sense(direction, reach, speed, seconds)

    one = SafeMachine(Watched(world(), START), MachineLimits(travel=0.03, touch=0.001))
    one.move(at(30, 20, 40))
    one.sense(DOWN, 0.01)
    assert speeds == [0.03, 0.001]


def test_a_no_sends_nothing():
    confirmed = list[str]()

    def confirm(what: str) -> bool:
        confirmed.append(what)
        return len(confirmed) < 2

    one = safe(confirm=confirm)
    one.move(at(30, 20, 60))
    with pytest.raises(RefusedError, match="expected a yes"):
        one.sense(DOWN, 0.02)
    assert len(one.machine.tip.travelled) == 1
    assert "move to (30.000, 20.000, 60.000) mm" in confirmed[0]
    assert "touch along (0.000, 0.000, -1.000), 20.00 mm at most" in confirmed[1]


def test_a_no_to_a_way_ends_the_run():
    one = safe(confirm=lambda what: False)
    with pytest.raises(StoppedError, match="expected a yes"):
        one.move(at(30, 20, 60))
    with pytest.raises(StoppedError, match="the operator declined"):
        one.sense(DOWN, 0.02)
    assert one.machine.tip.travelled == []


def test_a_dry_run_sends_nothing_and_keeps_limits():
    shown = list[str]()
    one = safe(dry_run=True, show=shown.append)
    one.move(at(30, 20, 60))
    assert np.allclose(one.place(), [0.03, 0.02, 0.06])
    one.sense(DOWN, 0.02)
    with pytest.raises(RefusedError):
        one.move(at(0, 0, 500))
    assert one.machine.tip.travelled == []
    assert len(shown) == 2


def test_it_goes_back_whatever_happens_at_the_touch():
    one = safe()
    one.move(at(30, 20, 30))

    def fails():
        with one.touching():
            assert one.sense(DOWN, 0.02).hit
            raise ValueError("of the caller")

    with pytest.raises(ValueError, match="of the caller"):
        fails()
    assert np.allclose(one.place(), [0.03, 0.02, 0.03])
    one.move(at(30, 20, 60))


def test_a_contact_on_a_path_is_released_again():
    one = safe()
    one.move(at(-20, 20, 10))
    with pytest.raises(ContactError):
        one.move(at(100, 20, 10))
    assert np.allclose(one.place(), [-0.02, 0.02, 0.01])
    assert not one.stopped


def test_nothing_moves_after_a_stop():
    one = safe()
    one.move(at(30, 20, 60))
    one.abort("by a test")
    for motion in (lambda: one.move(at(0, 0, 60)), lambda: one.sense(DOWN, 0.01), lambda: one.write_frame("G10")):
        with pytest.raises(StoppedError, match="by a test"):
            motion()


class Hangs(DirectMachine):
    """A driver that breaks its promise."""

    def move(self, T, speed, seconds):
        self.released = threading.Event()
        self.released.wait(20)


def test_a_driver_that_hangs_is_stopped():
    one = SafeMachine(Hangs(world(), START), MachineLimits(grace=0.1, travel=1.0))
    begun = time.monotonic()
    threading.Timer(2.5, lambda: one.machine.released.set()).start()
    with pytest.raises(LateError, match="did not end within"):
        one.move(at(30, 20, 60))
    assert time.monotonic() - begun < 3
    with pytest.raises(StoppedError):
        one.move(at(30, 20, 60))


def test_a_driver_that_errs_stops_the_machine_in_one_sentence():
    class Erring(DirectMachine):
        stops = 0

        def move(self, T, speed, seconds):
            raise KeyError("axis")

        def abort(self):
            self.stops += 1

    machine = Erring(world(), START)
    one = SafeMachine(machine, MachineLimits(WORKSPACE))
    with pytest.raises(StoppedError, match="KeyError: 'axis'"):
        one.move(at(0, 0, 110))
    assert machine.stops
    with pytest.raises(StoppedError, match="got a stopped one"):
        one.move(at(0, 0, 100))


def test_a_controller_that_falls_silent_is_stopped():
    class Silent(Hangs):
        def status(self):
            return MachineStatus("moving", self.tip.place, False, 9.0)

    one = SafeMachine(Silent(world(), START), MachineLimits(stale=0.2, grace=5.0))
    threading.Timer(1.5, lambda: one.machine.released.set()).start()
    with pytest.raises(LateError, match="has sent nothing"):
        one.move(at(30, 20, 60))


def test_a_motion_that_ends_elsewhere_stops_it():
    class Short(DirectMachine):
        def move(self, T, speed, seconds):
            half = T.copy()
            half[:3, 3] = 0.5 * (self.tip.place + T[:3, 3])
            super().move(half, speed, seconds)

    one = SafeMachine(Short(world(), START), MachineLimits())
    with pytest.raises(StoppedError, match="mm from its goal"):
        one.move(at(30, 20, 60))
    assert one.stopped


def test_an_abort_from_another_thread_ends_a_motion():
    one = SafeMachine(DirectMachine(world(), START, speedup=1.0), MachineLimits(travel=0.01))
    threading.Timer(0.2, one.abort).start()
    begun = time.monotonic()
    with pytest.raises(StoppedError):
        one.move(at(30, 20, 30))
    assert time.monotonic() - begun < 1.5
    assert one.place()[2] > 0.09


@pytest.mark.parametrize("limits", [{"travel": 0.0}, {"touch": np.inf}, {"clearance": -1.0}, {"grace": -1}])
def test_limits_that_are_none_are_refused(limits):
    with pytest.raises(InputError, match="limits"):
        MachineLimits(**limits)


def test_a_probe_in_contact_is_reported_before_a_touch():
    start = np.array([0.03, 0.02, 0.021])
    with driver("fake:grbl", world(), start) as machine, pytest.raises(ContactError, match="probe without contact"):
        machine.sense(DOWN, 0.01, 0.002, 5.0)
