"""A hand with a viewer: it moves on the page, stays where a command stops it, and senses the same as alone."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from tanteo.hand.simulator import Solid
from tanteo.planning import sense_part
from tanteo.render.live import HELP, Advance, Click, Pause, Player, Quit, hand_show
from unknown_scenes import unknown_scene, unknown_session
from viewer_scenes import Person


def make(targets):
    def of(seed, policy):
        unknown = unknown_scene(targets, 0, np.random.default_rng(seed))
        session = unknown_session(unknown, policy, seed, max_measurements=1)
        part = targets[0].part
        truth = Solid.at("part", part.vertices, part.triangles, unknown.T_world_part)
        return hand_show(session, unknown.robot, unknown.rules, (truth,), known=unknown.furniture)

    return of


class Onlooker(Person):
    """Press stop as soon as the hand has moved, and click then."""

    def __init__(self, *wants):
        super().__init__(*wants)
        self.poses = []

    def show(self, group, primitives):
        super().show(group, primitives)
        if group == "hand":
            self.poses.append(self.groups["hand"]["hand"].T)
            if len(self.poses) == 3:
                self.player.commands.put(Pause())


def test_it_moves_stays_and_senses_equally_without_a_viewer(targets):
    shows = []

    def remembered(*chosen):
        shows.append(make(targets)(*chosen))
        return shows[-1]

    moved = []

    def click(person):
        moved.append(len(person.poses))
        return Click(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])), Advance()

    person = Onlooker(Advance(), click, Quit())
    person.player = Player(remembered, person, 5, "largest-face", speed=8.0)
    person.player.run()
    assert moved == [3]  # it stayed where the command stopped it
    assert any("Wait until the hand rests" in text for text in person.messages)
    assert len(person.poses) > 5
    assert not any(HELP in text for text in person.messages[-2:])
    ways = np.linalg.norm(np.diff([T[:3, 3] for T in person.poses], axis=0), axis=1)
    assert ways.max() < 0.25
    np.testing.assert_allclose(person.poses[-1], shows[0].session.readings.Ts_world_hand[-1], atol=1e-9)
    alone = unknown_scene(targets, 0, np.random.default_rng(5))
    session = unknown_session(alone, "largest-face", 5, max_measurements=1)
    sense_part(session, alone.robot, alone.rules, furniture=alone.furniture)
    np.testing.assert_array_equal(session.readings.ranges, shows[0].session.readings.ranges)
    np.testing.assert_array_equal(session.state.poses, shows[0].session.state.poses)
    assert len(person.groups["truth"]) == 1


def test_the_code_of_the_page_runs(targets, monkeypatch):
    shows = []
    monkeypatch.setattr("tanteo.render.live.play", lambda make, seed, policy, ready: shows.append(make(seed, policy)))
    page = (Path(__file__).parents[3] / "docs" / "view.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)

    def new_run(seed, policy):
        unknown = unknown_scene(targets, 0, np.random.default_rng(seed))
        return unknown_session(unknown, policy, seed), unknown.robot, unknown.rules, ()

    exec(compile(code, "view.md", "exec"), {"new_run": new_run})
    assert [show.session.policy.name for show in shows] == ["information"]
    assert shows[0].hand is not None
