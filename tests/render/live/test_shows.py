"""Readings of a laser, places of a click, views of a hand's run, and viser stays outside."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tanteo.render.live
from tanteo.geometry import SE3
from tanteo.hand.simulator import Scene, Solid, box
from tanteo.planning import Action
from tanteo.render.live import NOISE, Snapshot, picked, probe_show, simulated
from tanteo.sensors import Readings, measure
from tanteo.words.findings import ChosenByUser, ClickFailed
from viewer_scenes import TRUE, maker

DOWN = np.array([0.0, 0.0, -1.0])


def down(x, y, number=1):
    """Return a reading straight down from 200 mm."""
    return Action(number, np.array([x, y, 0.2]), DOWN, 0.3, 0.1, "part", "face 1", np.nan, ChosenByUser())


@pytest.fixture(scope="module")
def surfaces():
    block, table = box("block", [0, 0, 0], [0.1, 0.1, 0.05]), box("table", [-1, -1, -0.1], [1, 1, 0])
    return Scene.of([block]).surface, Scene.of([table]).surface


def test_the_laser_reads_what_is_there_with_its_noise(surfaces):
    read = simulated(*surfaces, 3)
    ranges = np.concatenate([read(down(0.05, 0.05, k)).ranges for k in range(1, 401)])
    assert abs(ranges.mean() - 0.15) < 4 * NOISE / 20
    assert 0.85 < ranges.std() / NOISE < 1.15
    again = simulated(*surfaces, 3)
    again(down(-0.5, 0.0))  # the second draw is the second reading's, for any hit of the first one
    assert again(down(0.05, 0.05)).ranges[0] == ranges[1]


def test_a_beam_that_ends_on_furniture_was_free_as_far_as_it(surfaces):
    readings = simulated(*surfaces, 3)(down(-0.5, 0.0))
    assert readings.is_free.all()
    assert 0.19 < readings.max_ranges[0] < 0.2
    far = simulated(surfaces[0], None, 3)(down(-0.5, 0.0))
    assert far.max_ranges[0] == 0.3
    assert len(measure(far, sd=NOISE).free.origins) == 1


@pytest.fixture(scope="module")
def session(targets):
    return maker(targets)(3, "information").session


def click(session, place, ray, number=1):
    return picked(session, Snapshot.of(session).drawn_modes(), place - 0.4 * ray, ray, number)


def test_a_click_senses_along_the_normal_at_its_point(session):
    k = int(Snapshot.of(session).drawn_modes()[0])
    target, T = session.state.target(k), session.state.poses[k]
    foot = SE3.apply(T, [0.08, 0.04, 0.012])  # on the foot, from aslant
    ray = np.array([0.5, 0.3, -0.9]) / np.linalg.norm([0.5, 0.3, -0.9])
    action = click(replaced(session, target), foot, ray, 7)
    assert isinstance(action, Action)
    assert action.number == 7
    np.testing.assert_allclose(action.direction, -T[:3, 2], atol=1e-9)
    np.testing.assert_allclose(action.origin + action.expected * action.direction, foot, atol=1e-6)
    assert action.part == target.part.name
    assert action.face.startswith("face ")


def replaced(session, target):
    """Return the session with this part alone, so that no other object is in the way."""
    from tanteo.planning.start import at_pose

    k = next(i for i, t in enumerate(session.start.targets) if t is target)
    start = at_pose(target, session.start.Ts[k], session.start.covariances[k])
    return replace(session, start=start)


def test_a_click_on_an_upright_face_keeps_to_the_cone_of_probe(session):
    target, T = session.start.targets[0], session.start.Ts[0]
    side = SE3.apply(T, [0.0, 0.04, 0.05])
    action = click(replaced(session, target), side, T[:3, 0])
    assert isinstance(action, Action)
    assert action.direction @ session.probe.approach == pytest.approx(np.cos(session.probe.cone), abs=1e-6)


def test_without_clearance_along_the_normal_it_senses_aslant(session):
    alone = replaced(session, session.start.targets[0])
    T = alone.start.Ts[0]
    wall = SE3.apply(T, [0.0, 0.04, 0.03])
    straight = click(alone, wall, T[:3, 0])
    above = replace(alone, probe=replace(alone.probe, workspace=type(alone.probe.workspace).above(0.07)))
    aslant = click(above, wall, T[:3, 0])
    assert isinstance(aslant, Action)
    assert straight.origin[2] < 0.07 < aslant.origin[2]
    np.testing.assert_allclose(aslant.origin + aslant.expected * aslant.direction, wall, atol=1e-6)
    assert aslant.direction @ T[:3, 0] > np.cos(alone.probe.max_incidence)


def test_a_click_beside_the_part_senses_along_the_view(session):
    alone = replaced(session, session.start.targets[0])
    middle = SE3.apply(alone.start.Ts[0], alone.start.targets[0].part.centroid)
    beside_it = middle + np.array([0.0, 0.095, 0.0])
    action = click(alone, beside_it, DOWN)
    assert isinstance(action, Action)
    np.testing.assert_array_equal(action.direction, DOWN)
    assert action.face == "a place beside it"
    assert click(alone, middle + np.array([1.0, 0.0, 0.0]), DOWN) == ClickFailed("nothing")


def test_impossible_motions_of_the_hand_are_reported(session):
    alone = replaced(session, session.start.targets[0])
    foot = SE3.apply(alone.start.Ts[0], [0.08, 0.04, 0.012])
    never = replace(alone, able=lambda state, candidates: np.zeros(len(candidates), dtype=bool))
    assert click(never, foot, DOWN) == ClickFailed("reach")
    low = replace(alone.probe, workspace=type(alone.probe.workspace).above(0.5))
    assert click(replace(alone, probe=low), foot, DOWN) == ClickFailed("space")


def test_the_truth_is_measured_both_ways(session, targets):
    from tanteo.render.live.snapshot import apart

    target, T = session.start.targets[0], session.state.poses[0]
    same = Solid.at("a", target.part.vertices, target.part.triangles, T)
    assert apart(session, [same]) < 1e-9
    up = Solid.at("b", target.part.vertices, target.part.triangles, SE3.from_parts(np.eye(3), [0, 0, 2e-3]) @ T)
    assert apart(session, [up]) == pytest.approx(2e-3, rel=0.01)
    small = box("c", [-1e-3] * 3, [1e-3] * 3, T @ SE3.from_parts(np.eye(3), target.part.vertices[0]))
    assert apart(session, [small]) > 0.05
    assert TRUE.shape == (4, 4)


def test_viser_is_imported_by_the_page_alone():
    folder = Path(tanteo.render.live.__file__).parent
    assert [p.name for p in sorted(folder.rglob("*.py")) if "import viser" in p.read_text(encoding="utf-8")] == [
        "page.py"
    ]
    code = "import sys; sys.modules['viser'] = None; import tanteo.render.live, tanteo.cli.app"
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.slow
def test_every_reading_answers_the_planned_action(targets):
    """A probe that returns an unlabelled point, with its own name, is not sent to the same place again."""
    session = maker(targets, max_measurements=3)(0, "information").session
    bare = lambda action: Readings.from_columns(  # noqa: E731
        (action.origin + action.expected * action.direction)[None], ids=[f"point {session.count}"], sds=np.array([1e-3])
    )
    readings = []

    class Views:
        def place(self, note):
            assert session.pending is None
            readings.append(session.steps[-1].action.number)

    probe_show(session, bare, ()).run(Views())
    assert readings == [1, 2, 3]
