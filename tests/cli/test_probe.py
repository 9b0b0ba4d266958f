"""``probe``: its options reach the machine, and what cannot be done is refused before anything moves."""

from __future__ import annotations

import io
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.geometry import SE3
from tanteo.machines import GrblFake, LinuxCncFake, World
from tanteo.parts import Surface

BLOCK = Path(__file__).parents[2] / "examples" / "parts" / "block.step"
PRIOR = "100,100,0mm 0,0,0deg +- 2mm 1deg"
PROBE = ("--sd", "0.02mm", "--tip-radius", "1mm", "--workspace", "-100,-100,-50,400,400,300mm", "--pose-prior", PRIOR)


@pytest.fixture
def cell():
    """A controller on loopback, as one that is no fake is addressed."""
    opened = []

    def start(kind):
        block, T = tanteo.read_part(BLOCK), SE3.from_parts(np.eye(3), np.array([0.101, 0.099, 0.0005]))
        there = World(Surface(block.vertices, block.triangles), T, 1e-3, 2e-5, 1)
        opened.append({"grbl": GrblFake, "linuxcnc": LinuxCncFake}[kind](there, np.array([0.15, 0.15, 0.2])))
        return opened[-1], f"{kind}://127.0.0.1:{opened[-1].ports[0]}"

    yield start
    for fake in opened:
        fake.close()


def probe(run, machine, *more):
    return run("probe", "--machine", machine, "--part", BLOCK, "--tolerance", "0.4mm", *more)


@pytest.mark.parametrize(("kind", "frame"), [("grbl", "grbl:G55"), ("linuxcnc", "G55")])
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
        ("fake:grbl", "G54", "as grbl:G54"),
        ("fake:grbl", "G55@G54", "machine coordinates"),
    ],
)
def test_a_frame_that_it_does_not_take_is_refused_first(run, machine, frame, words):
    result = probe(run, machine, "--wcs", frame, "--write")
    assert result.code == 2
    assert words in result.err
    assert "met after" not in result.err


def test_an_unreached_tolerance_is_not_written(run, tmp_path):
    more = ("--max-measurements", "2", "--wcs", "grbl:G54", "--write", "--pose-prior", PRIOR)
    result = probe(run, "fake:grbl", *more)
    assert result.code != 0
    assert "nothing was written" in result.err or "Nothing is written" in result.err


def test_a_session_is_followed_on_a_page(run, monkeypatch):
    """The page is drawn after every reading, and ends with Ctrl-C; standard output stays the machine's."""
    pytest.importorskip("viser", reason="the extra tanteo[viewer] is not installed")
    shown = []
    show_text = import_module("tanteo.render.live.page").LivePage.say
    monkeypatch.setattr(
        "tanteo.render.live.page.LivePage.say", lambda page, *words: shown.append(words) or show_text(page, *words)
    )
    monkeypatch.setattr("tanteo.cli.looking.until_interrupted", lambda: None)
    result = probe(run, "fake:direct", "--live", "--no-open", "--pose-prior", PRIOR, "--as", "matrix")
    assert result.code == 0
    assert "Live page: http://127.0.0.1:" in result.err
    assert "viser" not in result.out
    assert sum(place == "bars" for place, _ in shown) == 1 + result.err.count("met after")
