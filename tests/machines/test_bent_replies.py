"""Bent replies of every controller end in a stop that quotes them: no traceback, no endless wait, no wrong reading."""

from __future__ import annotations

import re
import time
from contextlib import contextmanager

import numpy as np
import pytest

from machines.bending import bent, of_rows
from machines.bent_replies import ENDS, KINDS, NEAR, NUMBERS, TRUE, connected, runs, scenario
from machines.cells import DOWN, START, at, world
from tanteo.machines import GrblFake, GrblMachine, LinuxCncFake, MachineLimits, SafeMachine, UrFake
from tanteo.machines.link import TcpLink
from tanteo.machines.protocol import LateError, LinkLostError, MachineError, StoppedError

LIMITS = MachineLimits(travel=0.2, stale=0.4, grace=0.6)


@pytest.mark.parametrize("kind", KINDS)
def test_random_bends_are_refused_or_harmless(kind):
    ends, bad = runs(kind, 12, 3)
    assert bad == []
    assert ends["refused"] > 3


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_many_random_bends_are_refused_or_harmless(kind):
    assert runs(kind, 300, 4)[1] == []


@contextmanager
def cell(change, fake_kind=GrblFake, **how):
    """Yield a driver with a proxy that changes rows; ``change`` may have a list of one flag that switches it on."""
    fake = fake_kind(world(), START, **how)
    try:
        with bent(fake.ports[0], of_rows(change)) as proxy:
            kind = {GrblFake: "grbl", LinuxCncFake: "linuxcnc"}[fake_kind]
            machine = connected(kind, [proxy.port])
            try:
                yield SafeMachine(machine, LIMITS), fake, proxy
            finally:
                machine.close()
    finally:
        fake.close()


def replaced(start: bytes, new):
    """Change rows that begin in a way."""
    return lambda row: new(row) if row.startswith(start) else row


def number(k: int, value: bytes):
    """Replace the k-th number of a row."""

    def change(row: bytes) -> bytes:
        found = list(re.finditer(rb"-?\d+\.?\d*", row))
        return row[: found[k].start()] + value + row[found[k].end() :] if k < len(found) else row

    return change


HARMLESS = {b"-0.000", b"1000000.000", b"30.", b"25.4", b"1e3"}
"""Values that are numbers of a controller or might be, or that are refused elsewhere."""


@pytest.mark.parametrize("value", [v for v in NUMBERS if v not in HARMLESS])
def test_grbl_reports_only_plain_numbers(value):
    """In a contact, and in a status during the run."""
    with cell(replaced(b"[PRB", number(2, value))) as (safe, _, _), pytest.raises(StoppedError):
        scenario(safe)
    armed = []
    bend = replaced(b"<", number(1, value))
    with cell(lambda row: bend(row) if armed else row) as (safe, fake, _):
        armed.append(True)
        with pytest.raises(StoppedError, match="expected"):
            scenario(safe)
        assert fake.motions <= 1


@pytest.mark.parametrize("kind", [GrblFake, LinuxCncFake])
def test_the_reply_is_quoted(kind):
    armed, bad = [], {GrblFake: (b"<", b"<Idle|MPos:oops>"), LinuxCncFake: (b"ABS_ACT_POS", b"ABS_ACT_POS oops")}[kind]
    with cell(lambda row: bad[1] if armed and row.startswith(bad[0]) else row, kind) as (safe, fake, _):
        armed.append(True)
        with pytest.raises(StoppedError, match="oops"):
            scenario(safe)
        assert fake.motions <= 1


@pytest.mark.parametrize("row", [b"[G54", b"[G92", b"[TLO", b"$13", b"[GC"])
@pytest.mark.parametrize("change", ["missing", "twice", "empty", "nan"])
def test_missing_offsets_and_units_are_refused_before_a_motion(row, change):
    def new(got: bytes) -> bytes:
        tail = b"nan" if change == "nan" else b""
        cut = got[: re.search(rb"[:=]", got).end()] + tail + (b"]" if got.startswith(b"[") else b"")
        return {"missing": b"", "twice": got + b"\r\n" + got}.get(change, cut)

    offset = np.array([0.1, -0.2, 0.05])
    with (
        pytest.raises(StoppedError, match=r"expected one|expected a row"),
        cell(replaced(row, new), offset=offset, inches=True) as (_, fake, _),
    ):
        assert fake.motions == 0


@pytest.mark.parametrize("names", [b"#5221", b"#<_metric>", b"#5220"])
@pytest.mark.parametrize("value", [b"nan", b"", b"######", b"1 2"])
def test_parameters_of_linuxcnc_without_numbers_are_refused(names, value):
    """LinuxCNC writes ``######`` for a parameter that it does not have."""
    fake = LinuxCncFake(world(), START)
    parameter = fake._parameter
    fake._parameter = lambda name: float("nan") if f"#{name}".encode() == names else parameter(name)
    change = replaced(b"OPERATOR_DISPLAY TANTEO", lambda row: row.replace(b"nan", value))
    try:
        with bent(fake.ports[0], of_rows(change)) as proxy, pytest.raises(StoppedError, match="numbers of parameters"):
            connected("linuxcnc", [proxy.port])
        assert fake.motions == 0
    finally:
        fake.close()


@pytest.mark.parametrize("second", [b":1]", b":0]"])
def test_two_contact_reports_are_refused(second):
    double = replaced(b"[PRB", lambda row: row + b"\r\n" + row[:-3] + second)
    with cell(double) as (safe, _, _), pytest.raises(StoppedError, match="one report"):
        scenario(safe)


def test_two_answers_to_one_request_are_refused():
    armed = []
    double = replaced(b"OPERATOR_DISPLAY TANTEO", lambda row: row + b"\r\n" + row if armed else row)
    with cell(double, LinuxCncFake) as (safe, fake, _):
        armed.append(True)
        with pytest.raises(StoppedError, match="one answer for each request"):
            scenario(safe)
        assert fake.motions <= 2


@pytest.mark.parametrize("row", [b"ok", b"error:9"])
def test_an_acknowledgement_without_a_line_is_refused(row):
    with cell(lambda row: row) as (safe, fake, proxy):
        safe.move(at(30, 20, 60))
        proxy.send(row + b"\r\n")
        time.sleep(0.1)
        with pytest.raises(StoppedError, match="an acknowledgement for each line"):
            safe.move(at(30, 20, 50))
        assert fake.motions == 1


def test_rows_without_an_end_and_floods_are_refused_in_time():
    for data in (b"x" * 5000, b"[MSG:hello]\r\n" * 2000):
        with cell(lambda row: row) as (safe, _, proxy):
            safe.move(at(30, 20, 60))
            begun = time.monotonic()
            proxy.send(data)
            if data.startswith(b"x"):
                time.sleep(0.1)
                with pytest.raises(StoppedError, match="at most 4096 bytes"):
                    safe.move(at(30, 20, 50))
            else:
                safe.move(at(30, 20, 50))  # messages between two lines are no answers
            assert time.monotonic() - begun < 2.0


@pytest.mark.parametrize("lost", ["the line", "its ok"])
def test_a_lost_acknowledgement_ends_a_slow_touch_early(lost):
    """The deadline of the touch is 33 s away; the statuses show that the controller rests."""
    armed = []
    fake = GrblFake(world(), START)
    run = fake._run
    fake._run = lambda line: None if armed and lost == "the line" and "G38.3" in line else run(line)
    try:
        change = replaced(b"ok", lambda row: b"" if armed and lost == "its ok" else row)
        with bent(fake.ports[0], of_rows(lambda row: b"" if armed and b"PRB" in row else change(row))) as proxy:
            machine = connected("grbl", [proxy.port])
            try:
                machine.move(at(30, 20, 60), 0.2, 5.0)
                armed.append(True)
                begun = time.monotonic()
                with pytest.raises(LateError, match="it has rested for 2 s"):
                    machine.sense(DOWN, 0.04, 0.002, 33.0)
                assert time.monotonic() - begun < 12.0
            finally:
                machine.close()
    finally:
        fake.close()


def test_a_device_that_never_acknowledges_ends_in_time():
    """Rows arrive all the time, so the wait for one never ends; the deadline does."""
    fake = GrblFake(world(), START)
    begun = time.monotonic()
    try:
        noise = replaced(b"ok", lambda row: b"[MSG:hello]\r\n" * 20)
        with bent(fake.ports[0], of_rows(noise)) as proxy, pytest.raises(MachineError):
            GrblMachine(TcpLink("127.0.0.1", proxy.port), seconds=1.0)
        assert time.monotonic() - begun < 3.0
    finally:
        fake.close()


@pytest.mark.parametrize(
    ("question", "answer"),
    [
        ("robotmode", "Robotmode: NOT_RUNNING"), ("robotmode", "RUNNING? no"), ("safetystatus", "ABNORMAL"),
        ("is in remote control", "untrue"), ("PolyscopeVersion", "hello"), ("robotmode", ""), ("robotmode", "x" * 9000),
        ("robotmode", "\0\0"), ("safetystatus", "Safetystatus: NORMAL Safetystatus: FAULT"),
    ],
)  # fmt: skip
def test_the_dashboard_must_answer_exactly(question, answer):
    fake = UrFake(world(), START)
    original = fake._answer
    fake._answer = lambda query: answer if query == question else original(query)
    try:
        with pytest.raises((StoppedError, LinkLostError), match="expected"):
            connected("ur", fake.ports)
        assert fake.motions == 0
    finally:
        fake.close()


@pytest.mark.parametrize("name", ["actual_TCP_pose", "tcp_offset", "timestamp", "output_double_register_25"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -1e300])
def test_outputs_of_rtde_are_numbers(name, value):
    fake = UrFake(world(), START)
    try:
        machine = connected("ur", fake.ports)
        try:
            safe = SafeMachine(machine, LIMITS)
            safe.move(at(30, 20, 60))
            original = fake._value
            wrong = [value] * 6 if name.endswith(("pose", "offset")) else value
            fake._value = lambda query: wrong if query == name else original(query)
            time.sleep(0.1)
            with pytest.raises(StoppedError, match=f"{name} = "):
                safe.sense(DOWN, 0.03)
            assert fake.motions == 1
        finally:
            machine.close()
    finally:
        fake.close()


@pytest.mark.parametrize("bad", [b"\0\0\0\0", b"\0\2V", b"\0\5V\0\0", b"\0\4V\2", b"x" * 100])
def test_a_server_that_does_not_speak_rtde_is_refused(bad):
    fake = UrFake(world(), START)
    try:
        dashboard, script, data = fake.ports
        with bent(data, lambda got: bad) as proxy, pytest.raises(LinkLostError, match="RTDE"):
            connected("ur", [dashboard, script, proxy.port])
        assert fake.motions == 0
    finally:
        fake.close()


def test_two_results_of_a_program_are_refused():
    fake = UrFake(world(), START)
    try:
        machine = connected("ur", fake.ports)
        try:
            safe = SafeMachine(machine, LIMITS)
            safe.move(at(30, 20, 40))
            original, count = fake._value, 0

            def value(name):
                nonlocal count
                if name == "output_double_register_26" and fake._registers.get("output_int_register_25") == 2:
                    count += 1
                    return 0.021 + 1e-3 * (count > 2)
                return original(name)

            fake._value = value
            with pytest.raises(StoppedError, match=r"one result of its program|tip that rests"):
                safe.sense(DOWN, 0.03)
        finally:
            machine.close()
    finally:
        fake.close()


def test_an_undisturbed_run_reads_the_truth():
    for kind, fake_kind in (("grbl", GrblFake), ("linuxcnc", LinuxCncFake), ("ur", UrFake)):
        fake = fake_kind(world(), START)
        try:
            machine = connected(kind, fake.ports)
            begun = time.monotonic()
            assert abs(scenario(SafeMachine(machine, LIMITS)) - TRUE) < 3e-6 < NEAR
            assert time.monotonic() - begun < ENDS
            machine.close()
        finally:
            fake.close()
