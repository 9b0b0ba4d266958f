"""A hand senses a part at an unknown pose: right, in place, and never in contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sensing_scenes import LASER
from tanteo.hand import Workspace
from tanteo.planning import Done, sense_part
from tanteo.words.findings import NoClearPath, NoPlaceReached
from unknown_scenes import off, unknown_scene, unknown_session


def run(unknown, session, watch=lambda visit: None):
    return sense_part(session, unknown.robot, unknown.rules, furniture=unknown.furniture, watch=watch)


@pytest.mark.slow
@pytest.mark.parametrize("number", [2])
def test_the_part_is_named_and_placed_without_contact(targets, number):
    unknown = unknown_scene(targets, number, np.random.default_rng((5, number)))
    session, seen = unknown_session(unknown, tolerance=3e-3), []
    done = run(unknown, session, seen.append)
    assert done.end.reached
    assert session.answer().status == "recognized"
    assert session.answer().hypotheses[0].part == targets[number].part.name
    assert off(session, number, unknown.T_world_part) < 3e-3
    assert unknown.clear > 0.5 * unknown.rules.clearance
    assert tuple(seen) == done.visits
    assert (np.diff([v.seconds for v in seen]) >= 0).all()
    assert 0 < done.travel < 0.3 * done.seconds
    given = sum(len(v.step.ids) for v in seen if v.step is not None)
    assert session.count == given
    assert all(v.step.action is v.action for v in seen if v.step is not None)  # the hand is not quite where it was sent


@pytest.mark.slow
def test_the_same_seed_gives_the_same_run(targets):
    ends = []
    for _ in range(2):
        unknown = unknown_scene(targets[:2], 0, np.random.default_rng(7))
        session = unknown_session(unknown, max_measurements=3)
        run(unknown, session)
        ends.append(session)
    np.testing.assert_array_equal(*(end.readings.ranges.filled(np.nan) for end in ends))
    np.testing.assert_array_equal(ends[0].state.poses, ends[1].state.poses)


@pytest.mark.slow
def test_without_clearance_it_ends_with_that_reason(targets):
    unknown = unknown_scene(targets[:1], 0, np.random.default_rng(8))
    tight = replace(unknown.rules, workspace=Workspace(np.array([-1, -1, 0.32]), np.ones(3)))
    unknown = replace(unknown, rules=tight)
    session = unknown_session(unknown)
    session.probe = replace(LASER, clearance=0.001, max_range=0.12, standoff=0.04, retreat=0.001)  # too hopeful
    session.able = None
    done = run(unknown, session)
    assert isinstance(done.end, Done)
    assert not done.end.reached
    assert isinstance(done.end.findings[0], NoClearPath | NoPlaceReached)
    assert session.count == 0
    assert unknown.clear > 0


@pytest.mark.slow
def test_fingers_do_not_touch_an_unstated_clamp(targets):
    """The readings of a blocked motion are used, and the session plans another path."""
    unknown = unknown_scene(targets[:2], 1, np.random.default_rng(9), given=False)
    session = unknown_session(unknown, max_measurements=24)
    done = run(unknown, session)
    assert done.visits
    assert unknown.clear > 0
