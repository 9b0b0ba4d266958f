"""A person plays: what is sensed depends on seed and wishes alone, the truth shows at the end, counts are compared."""

from __future__ import annotations

import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from tanteo.geometry import SE3
from tanteo.render.live import Advance, AnswerNow, Choose, Click, Contest, Go, Pause, Player, Quit, Restart, drawing
from tanteo.words.findings import ChosenByUser
from viewer_scenes import TRUE, Person, maker


def play(make, *wants, seed=3):
    """Return a simulated user with given actions, and the sessions that were begun, in order."""
    begun = []

    def remembered(*chosen):
        begun.append(make(*chosen))
        return begun[-1]

    person = Person(*wants)
    person.player = Player(remembered, person, seed, "largest-face", speed=np.inf)
    person.player.run()
    assert person.wants == []
    return person, [show.session for show in begun]


def from_above(x, y, tilt=0.0):
    """Return a click along -z, or from a side, on a point of the part's frame [m]."""

    def wish(person):
        ray = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
        return Click(SE3.apply(TRUE, [x, y, 0.0]) - 0.5 * ray, ray)

    return wish


@pytest.fixture(scope="module")
def went(targets):
    """One that was let go."""
    return play(maker(targets), Go(), Quit())


def test_it_goes_to_its_end_and_names_the_part(went):
    person, (session,) = went
    assert session.stop.reached(session.state)
    assert "bracket_left, located to " in person.words["status"]
    far = float(re.search(r"surface is within ([\d.]+) mm", person.words["status"])[1])
    assert 0.1 < far < 4e3 * session.steps[-1].corner_sd
    assert f"Places sensed: {len(session.steps)}" in person.words["status"]
    assert person.words["steps"].count("<li>") == min(len(session.steps), 8)
    assert "compared" not in person.words["status"]


def test_the_truth_is_not_drawn_before_the_end(targets):
    shown = []

    def view(then):
        return lambda person: shown.append(len(person.groups["truth"])) or then

    play(maker(targets, max_measurements=2), view(Advance()), view(Advance()), view(Quit()))
    assert shown == [0, 0, 1]


def test_steps_and_pauses_change_nothing(targets, went):
    _, (one,) = went
    assert len(one.steps) > 1
    _, (other,) = play(maker(targets), Pause(), Advance(), (Choose(speed=1e9), Go()), Quit())
    np.testing.assert_array_equal(one.readings.points, other.readings.points)
    np.testing.assert_array_equal(one.state.poses, other.state.poses)
    _, (another,) = play(maker(targets, max_measurements=1), Go(), Quit(), seed=4)
    assert not np.array_equal(one.readings.points[:1], another.readings.points)


@pytest.mark.slow
def test_a_click_senses_there_and_the_counts_are_compared(targets, went):
    person, (session, alone) = play(maker(targets), from_above(0.06, 0.02), Go(), Quit())
    first, *others = (step.action for step in session.steps)
    assert [isinstance(a.reason, ChosenByUser) for a in (first, *others)] == [True, *[False] * len(others)]
    # at the clicked place: the click's ray was vertical, and so was its hit
    np.testing.assert_allclose(first.origin[:2], SE3.apply(TRUE, [0.06, 0.02, 0.0])[:2], atol=5e-3)
    assert first.direction[2] < -0.95
    own = len(others)
    assert own > 0
    assert f"Places sensed: {1 + own} (1 by you, {own} by the policy)" in person.words["status"]
    assert len(alone.steps) == len(went[1][0].steps)
    cells = re.findall(r"<t[hd][^>]*>([^<]*)<", person.words["status"])
    assert cells[:6] == ["", f"you 1, policy {own}", "planner", "places", f"{1 + own}", f"{len(alone.steps)}"]
    assert "1. You, " in person.words["steps"]


def test_a_click_beside_everything_is_reported_without_sensing(targets):
    away = Click(np.array([2.0, 2.0, 1.0]), np.array([0.0, 0.0, -1.0]))
    person, (session,) = play(maker(targets, max_measurements=2), away, Quit())
    assert "Nothing is there" in person.words["status"]
    assert session.count == 0


def test_another_policy_plans_again_and_survives_a_restart(targets):
    questions = []

    def note(then):
        return lambda person: questions.append(person.groups["next"]["next"].start) or then

    wants = [note(Choose(policy="nearest")), note(Restart()), Quit()]
    _, (one, other) = play(maker(targets), *wants)
    assert not np.array_equal(questions[0], questions[1])
    assert one.policy.name == other.policy.name == "nearest"


def test_a_restart_begins_again_and_another_seed_holds_from_then(targets):
    make = maker(targets)
    wants = [Advance(), Restart(), Advance(), (Choose(seed=9), Restart()), Advance(), Quit()]
    _, (one, two, three) = play(make, *wants)
    np.testing.assert_array_equal(one.readings.points, two.readings.points)
    assert three.seed == 9
    assert not np.array_equal(one.readings.points, three.readings.points)


def test_a_click_does_not_meet_what_is_hidden(targets):
    """Another object may lie in front: a user senses what the view shows."""
    click = from_above(0.06, 0.02)
    hidden = lambda person: replace(click(person), hidden=frozenset(drawing.HIDDEN_AT_FIRST))  # noqa: E731
    _, (session, _) = play(maker(targets, max_measurements=1), hidden, Quit())
    assert session.steps[0].action.part == "bracket_left"


@pytest.mark.slow
def test_in_a_contest_the_places_are_the_persons(targets, went):
    """The planner plays the same scene with the same errors; nothing of it is shown but how sure it is."""
    arrows = []

    def view(then):
        return lambda person: arrows.append(len(person.groups["next"])) or (then(person) if callable(then) else then)

    here = [view(from_above(0.06, 0.02)), view(from_above(0.02, 0.05))]
    wants = [Contest(), view(Advance()), *here, view(AnswerNow()), Quit()]
    person, (_, mine, planned) = play(maker(targets, tolerance=1e-5), *wants)
    assert arrows == [0, 0, 0, 0]
    assert [step.action.reason for step in mine.steps] == [ChosenByUser()] * 2
    assert any("you choose all places: click" in text for text in person.messages)
    assert any(
        "The planner has sensed 1 place: " in text and "sure, largest corner sd" in text for text in person.messages
    )
    _, (alone,) = play(maker(targets, tolerance=1e-5), Go(), Quit())
    np.testing.assert_array_equal(planned.readings.points, alone.readings.points)
    cells = re.findall(r"<t[hd][^>]*>([^<]*)<", person.words["status"])
    assert cells[:6] == ["", "you", "planner", "places", "2", f"{len(alone.steps)}"]
    assert person.groups["planner"]


def test_a_contest_can_be_left_at_any_time(targets):
    make = maker(targets, max_measurements=2)
    wants = [Contest(), from_above(0.06, 0.02), Restart(), Contest(), AnswerNow(), Contest(), Quit()]
    _, sessions = play(make, *wants)
    assert len(sessions) == 1 + 2 + 1 + 2 + 2
    for thread in threading.enumerate():
        if thread.name == "planner":
            thread.join(timeout=30)
            assert not thread.is_alive()


def test_what_goes_wrong_with_the_planner_is_not_hidden(targets):
    make = maker(targets)

    def broken(seed, policy):
        show = make(seed, policy)
        made.append(show)
        return show if len(made) != 3 else replace(show, run=lambda watch: 1 / 0)

    made = []
    with pytest.raises(ZeroDivisionError):
        play(broken, Contest(), from_above(0.06, 0.02), Quit())


def test_after_the_end_everything_but_a_restart_is_refused(targets):
    person, sessions = play(maker(targets, max_measurements=1), Go(), Advance(), Restart(), Quit())
    assert any("The session has ended. Press Restart" in text for text in person.messages)
    assert [s.count for s in sessions] == [1, 0]
