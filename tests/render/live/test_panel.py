"""Text of the panel: escaped, in the report's terms, with shares that sum to one."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sensing_scenes import without_modes
from tanteo.factors import FreeRays
from tanteo.render.live import Snapshot, colors, drawing, panel, snapshot
from viewer_scenes import maker


@pytest.fixture(scope="module")
def session(targets):
    return maker(targets)(3, "information").session


def test_before_the_first_reading(session):
    now = Snapshot.of(session)
    assert panel.headline(now) == "No reading yet: 2 parts may be here, bracket_left is drawn."
    bars = panel.bars(now)
    shares = [float(s) for s in re.findall(r"([\d.]+) %</span>", bars)]
    assert sum(shares) == pytest.approx(100, abs=0.2)
    assert [n for n in ("bracket_left", "bracket_right", "unknown object") if n in bars] == [
        "bracket_left", "bracket_right", "unknown object",
    ]  # fmt: skip
    assert "No step yet" in panel.steps([])


def test_an_image_before_the_first_reading_counts(session):
    now = Snapshot.of(session)
    start = replace(now.state.start, weights=np.where(now.state.part == 1, 3.0, 1.0))
    words = panel.headline(replace(now, state=replace(now.state, start=start)))
    assert re.fullmatch(r"Before the first reading, bracket_right is most probable \(7\d\.\d %\)\.", words)


def test_swatches_have_the_colours_of_what_is_drawn(session):
    now = Snapshot.of(session)
    drawn = {colors.css(p.colour) for p in drawing.state_primitives(now) if p.name.endswith("body")}
    assert set(re.findall(r'style="background:(#\w{6})', panel.bars(now))) == drawn


def test_the_text_of_a_file_is_escaped(session):
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


def test_everything_that_is_drawn_has_a_sign_of_its_colour():
    assert set(panel.MARKS) == set(drawing.LAYERS)
    signs = [(kind, hue) for kind, hue in panel.MARKS.values()] + [(kind, hue) for kind, hue, _ in panel.ALWAYS]
    assert len(set(signs)) == len(signs)
    for layer, (kind, hue) in panel.MARKS.items():
        assert colors.css(hue) in panel.sign(layer)
        assert kind in panel.sign(layer)
    assert "Real part" not in panel.legend(scene=False)
    words = panel.legend(scene=True)
    assert "50 mm" in words
    assert all(colors.css(hue) in words and label in words for _, hue, label in panel.ALWAYS)


def test_two_runs_are_compared_in_a_table():
    mine, planned = snapshot.Result(9, "wedge", 0.412, 2.5e-3, np.nan), snapshot.Result(4, "<clamp>", 0.996, 3e-4, 1e-4)
    table = panel.compared(mine, planned, (0, 9), truth=True)
    cells = re.findall(r"<t[hd][^>]*>([^<]*)<", table)
    assert cells == [
        "", "you", "planner", "places", "9", "4", "answer", "wedge", "&lt;clamp&gt;", "probability", "41.2 %", "99.6 %",
        "corner sd", "2.5 mm", "0.3 mm", "distance from the real part", "unknown", "0.1 mm",
    ]  # fmt: skip
    assert "you 2, policy 7" in panel.compared(mine, planned, (7, 2), truth=True)
    assert "distance from the real part" not in panel.compared(mine, planned, (0, 9), truth=False)


def test_nothing_explains_the_readings(session):
    now = Snapshot.of(session)
    nothing = without_modes(now.state.start, _no_touches(now), FreeRays.none())
    step = type("Step", (), {"corner_sd": np.nan, "action": None, "part": -1})()
    assert panel.headline(Snapshot(nothing, (step,), None)) == "No part explains the readings."
    assert drawing.state_primitives(Snapshot(nothing, (step,), None)) == []


def _no_touches(now):
    from tanteo.planning import Sensing
    from tanteo.sensors import Readings

    readings = Readings.from_columns(np.array([[1.0, 0, 0]]), ids=["x"], sds=np.array([1e-3]))
    return Sensing().touches(readings)[0]
