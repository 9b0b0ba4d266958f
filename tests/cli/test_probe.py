"""``probe``: its options reach the machine, and what cannot be done is refused before anything moves."""

from __future__ import annotations

import io
import os
import signal
import subprocess
import sys
import threading
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.geometry import SE3
from tanteo.machines import GrblFake, Journal, LinuxCncFake, World
from tanteo.parts import Surface

BLOCK = Path(__file__).parents[2] / "examples" / "parts" / "block.step"
PRIOR = "100,100,0mm 0,0,0deg +- 2mm 1deg"
PROBE = ("--sd", "0.02mm", "--tip-radius", "1mm", "--workspace", "-100,-100,-50,400,400,300mm", "--pose-prior", PRIOR)


@pytest.fixture
def cell():
    """A controller on loopback, as one that is no fake is addressed."""
    opened = []

    def start(kind, speedup=np.inf):
        block, T = tanteo.read_part(BLOCK), SE3.from_parts(np.eye(3), np.array([0.101, 0.099, 0.0005]))
        there = World(Surface(block.vertices, block.triangles), T, 1e-3, 2e-5, 1)
        opened.append(
            {"grbl": GrblFake, "linuxcnc": LinuxCncFake}[kind](there, np.array([0.15, 0.15, 0.2]), speedup=speedup)
        )
        return opened[-1], f"{kind}://127.0.0.1:{opened[-1].ports[0]}"

    yield start
    for fake in opened:
        fake.close()


def probe(run, machine, *more):
    return run("probe", "--machine", machine, "--part", BLOCK, "--goal", "0.4mm", *more)


@pytest.mark.parametrize(
    ("kind", "frame"), [("grbl", "grbl:G55"), pytest.param("linuxcnc", "G55", marks=pytest.mark.slow)]
)
def test_a_machine_at_an_address_gets_its_frame(run, cell, kind, frame, tmp_path, monkeypatch):
    fake, address = cell(kind)
    monkeypatch.setattr(sys, "stdin", io.StringIO("y\n"))
    record = ("--record", tmp_path / "run.json", "--wcs", frame, "--write")
    result = probe(run, address, *PROBE, *record, "--travel", "200mm/s", "--feed", "10mm/s")
    assert result.code == 0, result.err
    assert "the controller reports it" in result.err
    assert result.out.count("G10 L2 P2") == 1
    assert np.allclose(fake.modal.offsets[2], [0.101, 0.099, 0.0005], atol=2e-4)


def test_a_machine_needs_its_probe_and_its_workspace(run):
    assert "--tip-radius" in probe(run, "grbl://127.0.0.1:9").err
    assert "--workspace" in probe(run, "grbl://127.0.0.1:9", "--tip-radius", "1mm").err


@pytest.mark.parametrize(
    ("machine", "frame", "words"),
    [
        ("fake:ur", "ur:p", "a controller that can set frames"),
        ("fake:grbl", "haas:G54", "as grbl:G54"),
        ("fake:grbl", "G55@G54", "machine coordinates"),
    ],
)
def test_a_frame_that_it_does_not_take_is_refused_first(run, machine, frame, words):
    result = probe(run, machine, "--wcs", frame, "--write")
    assert result.code == 2
    assert words in result.err
    assert "hit after" not in result.err


@pytest.mark.slow
@pytest.mark.parametrize("machine", ["fake:grbl", "fake:linuxcnc"])
def test_a_frame_alone_is_one_of_the_machine(run, machine):
    """GRBL has no R: a turn that it cannot hold is named."""
    result = probe(run, machine, "--wcs", "G54", "--accept-turn-lost", "--pose-prior", PRIOR)
    line = next(line for line in result.out.splitlines() if line.startswith("G10 L2 P1"))
    assert ("R" in line) == (machine == "fake:linuxcnc")


def test_an_unreached_tolerance_is_not_written(run, tmp_path):
    more = ("--max-measurements", "2", "--wcs", "grbl:G54", "--write", "--accept-turn-lost", "--pose-prior", PRIOR)
    result = probe(run, "fake:grbl", *more)
    assert result.code != 0
    assert "nothing was written" in result.err or "Nothing is written" in result.err


def test_a_session_is_followed_on_a_page(run, monkeypatch):
    """The page is drawn after every reading, and ends with Ctrl-C; standard output stays the machine's."""
    pytest.importorskip("viser", reason="the extra tanteo[viewer] is not installed")
    shown = []
    show_text = import_module("tanteo.render.live.page").LivePage.set_text
    monkeypatch.setattr(
        "tanteo.render.live.page.LivePage.set_text", lambda page, *words: shown.append(words) or show_text(page, *words)
    )
    monkeypatch.setattr("tanteo.cli.live_page.until_interrupted", lambda: None)
    result = probe(run, "fake:direct", "--live", "--no-open", "--pose-prior", PRIOR, "--as", "matrix")
    assert result.code == 0
    assert "Live page: http://127.0.0.1:" in result.err
    assert "viser" not in result.out
    assert sum(place == "bars" for place, _ in shown) == 1 + result.err.count("hit after")


@pytest.mark.skipif(os.name != "posix", reason="other systems have no such signals")
@pytest.mark.parametrize("name", ["SIGTERM", pytest.param("SIGINT", marks=pytest.mark.slow)])
def test_a_signal_stops_the_machine_and_keeps_the_readings(run, cell, name, tmp_path):
    fake, address = cell("grbl", 4.0)
    record = tmp_path / "run.json"
    typed = ("probe", "--machine", address, "--part", BLOCK, "--goal", "0.4mm", *PROBE, "--record", record)
    more = ("--travel", "200mm/s", "--feed", "10mm/s")
    command = [sys.executable, "-m", "tanteo", *map(str, typed + more)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60
    while not (fake.motions >= 9 and fake.tip.moving and fake.modal.motion == "38.3"):
        assert time.monotonic() < end
        assert process.poll() is None
        time.sleep(0.001)
    process.send_signal(getattr(signal, name))
    _, err = process.communicate(timeout=20)
    assert process.returncode == 128 + getattr(signal, name)
    assert f"the process received {name}: a stop was sent" in " ".join(err.split())
    assert "Traceback" not in err
    motions = fake.motions
    fake._take(ord("~"), bytearray())  # cycle start, by the operator
    time.sleep(0.3)
    assert not fake.tip.moving
    assert fake.motions == motions
    assert record.exists()
    Journal(record).rows()  # has whole lines
    result = run(*typed, *more, "--resume")
    assert result.code == 0, result.err


def press(fake, seconds: float = 0.5) -> None:
    """Push the stylus once, some time after the command has begun to wait for it."""
    while not fake.received:
        time.sleep(0.01)
    time.sleep(1.0)
    fake.tip.pressed.set()
    time.sleep(seconds)
    fake.tip.pressed.clear()


def test_the_user_triggers_the_probe_first(run, cell, tmp_path):
    fake, address = cell("grbl")
    hand = threading.Thread(target=press, args=(fake,), daemon=True)
    hand.start()
    more = ("--record", tmp_path / "run.json", "--travel", "200mm/s", "--feed", "10mm/s", "--check-probe", "hand")
    result = probe(run, address, *PROBE, *more)
    assert result.code == 0, result.err
    assert result.err.index("push the stylus") < result.err.index("The probe reports contacts")


def test_a_height_checks_the_probe(run, cell, tmp_path):
    fake, address = cell("grbl")
    fake.tip.place = np.array([0.12, 0.12, 0.09])
    record = ("--record", tmp_path / "run.json")
    result = probe(run, address, *PROBE, *record, "--check-probe", "5mm")
    assert result.code == 1
    assert "its probe does not work: a known surface is" in " ".join(result.err.split())
    assert fake.motions == 2


def test_a_check_that_is_none_is_refused(run):
    assert "expected hand, off or the height" in probe(run, "fake:grbl", "--check-probe", "foot").err


def test_a_robot_needs_the_size_of_its_tool(run):
    typed = ("--tip-radius", "1mm", "--workspace", "0,0,0,1,1,1m")
    assert "--tool-body: expected" in probe(run, "ur://127.0.0.1", *typed).err
    assert "--tool-body: expected" in probe(run, "ur://127.0.0.1", *typed, "--tool-body", "1,2mm").err


def test_a_dry_run_that_passes_exits_with_zero(run):
    got = run("probe", "--machine", "fake:grbl", "--part", BLOCK, "--goal", "0.4mm", "--dry-run")
    assert got.code == 0, got.err
    assert "within the limits" in got.err
    assert "stuck" not in got.err


def test_a_fake_with_large_noise_is_no_fault_of_the_machine(run):
    """Readings of 0.1 mm differ from the place where the fake's tip rests by more than a controller does."""
    for seed in ("0", "1"):
        result = run(
            "probe", "--machine", "fake:grbl", "--part", BLOCK, "--goal", "0.1mm", "--sd", "0.3mm",
            "--tip-radius", "1mm", "--max-measurements", "3", "--seed", seed,
        )  # fmt: skip
        assert result.err.count("hit after") == 3
