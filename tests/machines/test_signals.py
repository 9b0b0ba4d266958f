"""A signal to the process stops the machine, cancels the motion and closes the journal, on every fake."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from machines.cells import ABOVE, START, at, session, world, world_of
from tanteo.machines import (
    DirectMachine,
    GrblFake,
    Interrupted,
    LinuxCncFake,
    MachineLimits,
    SafeMachine,
    UrFake,
    probe_part,
    stop_on_signals,
)
from tanteo.machines.protocol import StoppedError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="other systems have no such signals")

FAKES = {"grbl": GrblFake, "serial": GrblFake, "linuxcnc": LinuxCncFake, "ur": UrFake}
SIGNALS = ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGUSR1"]


def until(condition, seconds: float = 20.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.002)


def started(kind: str, fake) -> subprocess.Popen:
    """Return a process that touches, once the tip moves."""
    script = Path(__file__).with_name("moving.py")
    ports = [fake.terminal()] if kind == "serial" else fake.ports
    command = [sys.executable, str(script), kind, *map(str, ports)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    until(lambda: fake.tip.moving)
    return process


def test_a_program_that_handles_a_signal_keeps_its_handler():
    received = []
    before = signal.signal(signal.SIGUSR1, lambda number, frame: received.append(number))
    ignored = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        safe = SafeMachine(DirectMachine(world(), START), MachineLimits(travel=0.2))
        with stop_on_signals(safe):
            signal.raise_signal(signal.SIGUSR1)
            signal.raise_signal(signal.SIGHUP)
            safe.move(at(30, 20, 60))
        assert received == [signal.SIGUSR1]
        assert not safe.stopped
    finally:
        signal.signal(signal.SIGUSR1, before)
        signal.signal(signal.SIGHUP, ignored)


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_between_motions_ends_a_run(name):
    """Handlers are restored, and nothing moves after it."""
    number = getattr(signal, name)
    before = signal.getsignal(number)
    machine = DirectMachine(world(), START)
    safe = SafeMachine(machine, MachineLimits(travel=0.2))
    safe.move(at(30, 20, 60))

    def run():
        with stop_on_signals(safe), safe.touching():
            signal.raise_signal(number)

    with pytest.raises(Interrupted, match=name):
        run()
    assert signal.getsignal(number) == before
    assert len(machine.tip.travelled) == 1
    with pytest.raises(StoppedError, match=name):
        safe.move(at(30, 20, 70))


def test_a_session_is_ended_by_a_signal(parts):
    """Without a context of the caller's: the record is on the disk, and the machine is closed."""
    machine = DirectMachine(world_of(parts["block"]), ABOVE)
    one, turns = session(parts["block"]), []

    def watch(turn):
        turns.append(turn)
        signal.raise_signal(signal.SIGTERM)

    with pytest.raises(Interrupted):
        probe_part(one, SafeMachine(machine, MachineLimits(travel=0.2)), watch=watch)
    assert len(turns) == 1
    assert one.count == 1
    assert machine.status().state == "stopped"


def resumed(kind: str, fake) -> None:
    """Act as an operator after a stop: press cycle start."""
    if kind in ("grbl", "serial"):
        with socket.create_connection(("127.0.0.1", fake.ports[0])) as client:
            client.sendall(b"~")
            time.sleep(0.1)
    time.sleep(0.2)


@pytest.mark.quick_sets(12)
@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize("kind", FAKES)
def test_a_signal_stops_and_cancels(kind, name):
    fake = FAKES[kind](world(), START, speedup=1.0)
    try:
        process, number = started(kind, fake), getattr(signal, name)
        time.sleep(0.2)
        sent = time.monotonic()
        process.send_signal(number)
        until(lambda: not fake.tip.moving or fake.tip.hold.is_set(), 0.6)
        place = fake.tip.place
        out, err = process.communicate(timeout=5)
        assert time.monotonic() - sent < 3.0
        assert process.returncode == 128 + number
        assert f"the process received {name}" in out
        assert "away [-0.0, -0.0, 1.0]" in out
        assert err == ""
        resumed(kind, fake)
        assert not fake.tip.moving
        assert np.linalg.norm(fake.tip.place - place) < 5e-4
        assert fake.tip.place[2] > 0.09  # no retreat, and no continuation
    finally:
        fake.close()


@pytest.mark.parametrize("kind", FAKES)
def test_many_signals_do_not_prevent_the_stop(kind):
    fake = FAKES[kind](world(), START, speedup=1.0)
    try:
        process = started(kind, fake)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT, signal.SIGHUP) * 3:
            process.send_signal(number)
            time.sleep(0.005)
        process.communicate(timeout=5)  # a signal after the end of the stop may end it
        resumed(kind, fake)
        assert not fake.tip.moving
    finally:
        fake.close()
