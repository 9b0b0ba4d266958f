"""What is said: escaped, in the report's words, with shares that sum to one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sensing_scenes import without_modes
from tanteo.measurements import FreeRays
from tanteo.viewer import Snapshot, colors, drawing, panel
from viewer_scenes import maker


@pytest.fixture(scope="module")
def session(targets):
    return maker(targets)(3, "information").session


def test_before_the_first_reading(session):
    now = Snapshot.of(session)
    assert panel.headline(now) == "Nothing was sensed yet: 2 parts may be here."
    bars = panel.bars(now)
    shares = [float(s) for s in re.findall(r"([\d.]+) %</span>", bars)]
    assert sum(shares) == pytest.approx(100, abs=0.2)
    assert [n for n in ("bracket_left", "bracket_right", "unknown object") if n in bars] == [
        "bracket_left", "bracket_right", "unknown object",
    ]  # fmt: skip
    assert "Nothing yet" in panel.steps([])


def test_swatches_have_the_colours_of_what_is_drawn(session):
    now = Snapshot.of(session)
    drawn = {colors.css(p.colour) for p in drawing.state_primitives(now) if p.name.endswith("body")}
    assert set(re.findall(r'style="background:(#\w{6})', panel.bars(now))) == drawn


def test_what_a_file_says_is_escaped(session):
    now = Snapshot.of(session)
    target = now.state.start.targets[0]
    evil = replace(target, part=replace(target.part, name="<img src=x>"))
    start = replace(now.state.start, targets=(evil, *now.state.start.targets[1:]))
    now = replace(now, state=replace(now.state, start=start))
    for words in (panel.bars(now), panel.status(now, "<b>x</b>"), panel.steps(["<i>"]), panel.verdict(now, ["<u>"])):
        assert not re.search(r"<(img|b|i|u)[ >]", words)
    assert "&lt;img src=x&gt;" in panel.bars(now)


def test_only_the_last_lines_are_shown_the_last_first():
    words = panel.steps([f"line {k}" for k in range(20)])
    assert re.findall(r"line (\d+)", words) == [str(k) for k in range(19, 11, -1)]


def test_the_legend_has_every_hue_that_has_a_meaning():
    words = panel.legend(hand=True)
    for hue in (
        colors.EDGE,
        colors.RIVALS[0],
        colors.OVERLAY,
        colors.GOOD,
        colors.BAD,
        colors.BEAM,
        colors.FREE,
        colors.INK,
        colors.SOFT,
    ):
        assert colors.css(hue) in words
    assert "50 mm" in words
    assert "hand" not in panel.legend(hand=False)


def test_nothing_explains_the_readings(session):
    now = Snapshot.of(session)
    nothing = without_modes(now.state.start, _no_touches(now), FreeRays.none())
    step = type("Step", (), {"corner_sd": np.nan, "action": None, "part": -1})()
    assert panel.headline(Snapshot(nothing, (step,), None)) == "No part explains the readings."
    assert drawing.state_primitives(Snapshot(nothing, (step,), None)) == []


def _no_touches(now):
    from tanteo.sensors import Readings
    from tanteo.session import Sensing

    readings = Readings.from_columns(np.array([[1.0, 0, 0]]), ids=["x"], sds=np.array([1e-3]))
    return Sensing().touches(readings)[0]
