"""A reading lies on the commanded line, near the resting tip, in finite numbers; of any driver, also a foreign one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from machines.cells import DOWN, START, at, driver, world
from tanteo.errors import InputError
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.machines import DirectMachine, MachineLimits, SafeMachine
from tanteo.machines.protocol import MachineStatus, RefusedError, Sensed, StoppedError

LIMITS = MachineLimits(travel=0.2, stale=1.0, grace=2.0)
MM = 1e-3


class Reports(DirectMachine):
    """A driver whose readings are changed on their way to the wrapper."""

    change = staticmethod(lambda sensed: sensed)

    def sense(self, direction, reach, speed, seconds):
        sensed = super().sense(direction, reach, speed, seconds)
        end = sensed.start + min(sensed.distance, reach) * direction
        return self.change(replace(sensed, reported=end))


def reading(change, reach: float = 0.03):
    machine = Reports(world(), START)
    machine.change = change
    safe = SafeMachine(machine, LIMITS)
    safe.move(at(30, 20, 40))
    return safe, lambda: safe.sense(DOWN, reach)


def shifted(**values):
    return lambda sensed: replace(sensed, **{name: getattr(sensed, name) + v for name, v in values.items()})


def test_an_unchanged_reading_is_accepted():
    _, sense = reading(lambda sensed: sensed)
    assert sense().distance == pytest.approx(0.019, abs=1e-6)


BENT = {
    "beside by 50 mm": shifted(reported=np.array([50, 0, 0]) * MM),
    "beside by 0.5 mm": shifted(reported=np.array([0, 0.5, 0]) * MM),
    "report along by 0.5 mm": shifted(reported=np.array([0, 0, 0.5]) * MM),
    "distance shorter by 0.5 mm": shifted(distance=-0.5 * MM),
    "distance longer by 0.5 mm": shifted(distance=0.5 * MM),
    "distance and report shorter": shifted(distance=-0.5 * MM, reported=np.array([0, 0, 0.5]) * MM),
    "distance and report longer": shifted(distance=0.5 * MM, reported=np.array([0, 0, -0.5]) * MM),
    "behind the start": lambda s: replace(s, distance=-1e-3),
    "beyond the goal": lambda s: replace(s, distance=0.031),
    "not a number": lambda s: replace(s, distance=np.nan),
    "minus infinity": lambda s: replace(s, distance=-np.inf),
    "no contact half way": lambda s: replace(s, distance=np.inf),
    "no contact half way, no report": lambda s: replace(s, distance=np.inf, reported=None),
    "report not a number": lambda s: replace(s, reported=np.array([0.03, np.nan, 0.021])),
    "report infinite": lambda s: replace(s, reported=np.full(3, np.inf)),
    "start not a number": lambda s: replace(s, start=np.array([np.nan, 0.02, 0.04])),
    "another start": shifted(start=np.array([0, 1, 0]) * MM),
    "another direction": lambda s: replace(s, direction=np.array([0.0, 0.6, -0.8])),
    "direction not a number": lambda s: replace(s, direction=np.array([0.0, np.nan, -1.0])),
    "in inches": lambda s: replace(s, distance=s.distance / 25.4, reported=s.reported / 25.4),
    "in metres": lambda s: replace(s, distance=1e3 * s.distance, reported=1e3 * s.reported),
}


@pytest.mark.parametrize("name", BENT)
def test_a_bent_reading_stops_the_run(name):
    safe, sense = reading(BENT[name])
    with pytest.raises(StoppedError, match="expected readings"):
        sense()
    with pytest.raises(StoppedError):
        safe.move(at(30, 20, 60))


def test_random_reports_are_accepted_near_the_tip_only():
    """The report moves in any direction: within a fifth of a millimetre it is a reading, beyond it is not."""
    rng = np.random.default_rng(4)
    for _ in range(60):
        way = rng.normal(size=3)
        way *= rng.uniform(0, 1.0) * MM / np.linalg.norm(way)

        def change(sensed, way=way):
            along = float(way @ DOWN)
            return replace(sensed, distance=sensed.distance + along, reported=sensed.reported + way)

        _, sense = reading(change)
        along, beside = way @ DOWN, np.linalg.norm(way - (way @ DOWN) * DOWN)
        near = beside <= 0.2 * MM and -0.4 * MM <= along <= 0.2 * MM
        if near:
            sense()
        else:
            with pytest.raises(StoppedError, match="expected readings"):
                sense()


def test_a_tip_that_brakes_rests_beyond_its_contact():
    """At 10 mm/s and GRBL's default of 10 mm/s^2 the tip goes on for 5 mm."""

    class Brakes(Reports):
        def sense(self, direction, reach, speed, seconds):
            sensed = super().sense(direction, reach, speed, seconds)
            self.tip.place = self.tip.place + self.over * direction
            return sensed

    for over, accepted in ((4.9e-3, True), (5.5e-3, False), (-0.5e-3, False)):
        machine = Brakes(world(), START)
        machine.over = over
        safe = SafeMachine(machine, replace(LIMITS, touch=0.01))
        if accepted:
            assert safe.sense(DOWN, 0.1).hit
        else:
            with pytest.raises(StoppedError, match="tip that rests"):
                safe.sense(DOWN, 0.1)


PLACES = [np.full(3, np.nan), np.array([np.nan, 0.02, 0.1]), np.array([0.03, np.inf, 0.1]), np.full(3, -np.inf)]


class Elsewhere(DirectMachine):
    """A driver that reports positions of its own."""

    place: np.ndarray | None = None

    def status(self):
        status = super().status()
        return status if self.place is None else replace(status, place=self.place)


@pytest.mark.parametrize("place", [*PLACES, np.zeros(2)])
def test_a_position_without_numbers_stops_the_run(place):
    box = ForbiddenBox("vise", np.array([0.02, -0.05, 0.045]), np.array([0.04, 0.1, 0.09]))
    limits = replace(LIMITS, workspace=Workspace.everywhere([box]))
    for motion in (lambda s: s.move(at(30, 20, 40)), lambda s: s.sense(DOWN, 0.03)):
        machine = Elsewhere(world(), START)
        machine.place = place
        safe = SafeMachine(machine, limits)
        with pytest.raises(StoppedError, match="three finite numbers"):
            motion(safe)
        machine.place = None
        with pytest.raises(StoppedError):
            motion(safe)
        assert not machine.tip.travelled


@pytest.mark.parametrize("place", PLACES)
def test_a_position_that_is_lost_during_a_motion_stops_it(place):
    machine = Elsewhere(world(), START, speedup=1.0)
    safe = SafeMachine(machine, replace(LIMITS, travel=0.01))

    def later(T, speed, seconds):
        machine.place = place
        DirectMachine.move(machine, T, speed, seconds)

    machine.move = later
    with pytest.raises(StoppedError, match="three finite numbers"):
        safe.move(at(30, 20, 60))
    assert machine.tip.place[2] > 0.09


def test_every_limit_fails_closed():
    """A path with any number that is not finite is refused."""
    box = ForbiddenBox("vise", np.array([0.1, 0.1, 0.1]), np.array([0.2, 0.2, 0.2]))
    limits = MachineLimits(Workspace(np.zeros(3), np.ones(3), [box]))
    here, goal = np.full(3, 0.5), np.full(3, 0.6)
    assert not limits.violation(here, goal)
    for which in range(6):
        for bad in (np.nan, np.inf, -np.inf):
            ends = np.concatenate([here, goal])
            ends[which] = bad
            assert limits.violation(ends[:3], ends[3:])
    nan = np.full((2, 3), np.nan)
    assert box.crossed(nan, nan).all()
    assert box.crossed(here[None], nan[:1]).all()


@pytest.mark.parametrize("name", ["travel", "touch", "reach", "arrival", "stale", "grace", "clearance"])
def test_limits_that_are_not_numbers_are_refused(name):
    with pytest.raises(InputError, match="limits"):
        MachineLimits(**{name: np.nan})


@pytest.mark.parametrize("direction", [np.full(3, np.nan), np.zeros(3), np.array([0.0, 0.0, -2.0]), np.zeros(2)])
def test_a_direction_without_a_unit_is_refused(direction):
    machine = DirectMachine(world(), START)
    with pytest.raises(RefusedError, match="unit vector"):
        SafeMachine(machine, LIMITS).sense(direction, 0.01)
    assert not machine.tip.travelled


@pytest.mark.parametrize("reach", [np.nan, np.inf, -1.0, 0.0])
def test_a_reach_that_is_none_is_refused(reach):
    machine = DirectMachine(world(), START)
    with pytest.raises(RefusedError, match="reach"):
        SafeMachine(machine, LIMITS).sense(DOWN, reach)
    assert not machine.tip.travelled


def test_a_status_whose_age_is_no_number_is_old():
    class Ageless(DirectMachine):
        def status(self):
            return MachineStatus("moving", self.tip.place, False, np.nan)

    safe = SafeMachine(Ageless(world(), START, speedup=1.0), replace(LIMITS, travel=0.01, stale=0.2))
    with pytest.raises(StoppedError, match="has sent nothing"):
        safe.move(at(30, 20, 30))


@pytest.mark.parametrize("name", ["fake:grbl", "fake:linuxcnc", "fake:ur"])
def test_a_driver_ends_when_its_time_is_no_number(name):
    with driver(name, world()) as machine, pytest.raises(StoppedError):
        machine.move(at(30, 20, 60), 0.1, np.nan)


def test_a_log_may_answer_beside_the_line():
    sensed = Sensed(np.array([0.0, 0.0, 0.1]), DOWN, 0.02, 0.05)

    class Log(DirectMachine):
        def sense(self, direction, reach, speed, seconds):
            return sensed

    machine = Log(world(), START)
    machine.facts = replace(machine.facts, recorded=True)
    assert SafeMachine(machine, LIMITS).sense(DOWN, 0.03) is sensed
