"""Faces, edges and corners as candidates: readings that lie there, and their common information."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER, STYLUS, beam_hits, drawn_truth, new_session, off, rough, sense
from tanteo.geometry import SE3
from tanteo.parts import read_part
from tanteo.planning import POLICIES, begin, features
from tanteo.planning.candidates import propose
from tanteo.planning.context import DecisionContext
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def context():
    target = prepare(read_part(PARTS / "bracket_left.step"))
    T = SE3.exp(np.array([0.1, 0.2, 0, 0.3, 0.1, -0.2]))
    state = begin(at_pose(target, T, np.diag(np.repeat([1e-4, 1e-3], 3) ** 2)))
    return DecisionContext(state, propose(state, LASER, 300), LASER, None, None, 0, 0)


def test_readings_of_a_feature_lie_on_its_faces_and_near_it(context):
    s = context
    found = features(s.state, s.candidates)
    part, to_part = s.state.target(0).part, SE3.inverse(s.state.poses[0])
    aims = SE3.apply(to_part, s.aims())
    assert {f.kind for f in found} == {"face", "edge", "corner"}
    for f in found:
        assert len(set(f.rows.tolist())) == len(f.rows) == {"face": 3, "edge": 4, "corner": len(f.faces)}[f.kind]
        assert sorted(set(s.candidates.face[f.rows].tolist())) == sorted(f.faces)
        assert all(part.faces[k].name in f.name for k in f.faces)
    for f in (f for f in found if f.kind == "face"):
        a, b, c = aims[f.rows]
        own = aims[s.candidates.face == f.faces[0]]
        spread = np.linalg.norm(own[:, None] - own, axis=-1).max()
        assert max(np.linalg.norm(x - y) for x, y in ((a, b), (b, c), (c, a))) > 0.7 * spread
    corners = {tuple(sorted(f.faces)): aims[f.rows].mean(axis=0) for f in found if f.kind == "corner"}
    for point in part.corners.points:
        near = min(corners.values(), key=lambda x: np.linalg.norm(x - point))
        assert np.linalg.norm(near - point) < 0.6 * part.diagonal


def test_the_gain_of_a_feature_is_the_ratio_of_determinants(context):
    """One pose, so well known that all is linear: against the determinant of the covariance after the readings."""
    state, rng, kinds = context.state, np.random.default_rng(1), set()
    C, T = state.covariances[0], state.poses
    for _ in range(12):
        c = context.candidates.take(np.sort(rng.choice(len(context.candidates), 30, replace=False)))
        choice = POLICIES["features"].choose(DecisionContext(state, c, LASER, None, None, 0, 0))
        reason = choice.reason
        (f,) = (f for f in features(state, c) if (f.name, len(f.rows) - 1) == (reason.feature, reason.others))
        d, cosine, _, g = beam_hits(state.target(0), T, c.origins[f.rows], c.directions[f.rows])
        G, R = g[:, 0], LASER.variance(d, cosine)[:, 0]
        after = np.linalg.inv(np.linalg.inv(C) + G.T @ (G / R[:, None]))
        assert choice.gain == pytest.approx(0.5 * (np.linalg.slogdet(C)[1] - np.linalg.slogdet(after)[1]), rel=1e-6)
        kinds.add(f.kind)
    assert len(kinds) > 1


@pytest.mark.slow
def test_sessions_that_choose_features_reach_goal_and_name_them():
    targets = [prepare(read_part(PARTS / f"{name}.step")) for name in ("bracket_left", "bracket_right")]
    start, rng = rough(targets, (5e-3, 0.1)), np.random.default_rng(8)
    k, T = drawn_truth(start, rng)
    session = new_session(start, policy="features", tolerance=1e-3, max_measurements=25)
    end = sense(session, targets[k], T, rng)
    assert end.reached
    assert off(session, k, T) < 1.5e-3
    names = [step.action.reason.feature for step in session.steps]
    assert all(" of bracket_" in name for name in names)
    assert len({name.split(" of bracket")[0] for name in names}) > 2


def test_where_nothing_makes_a_feature_single_places_are_left(context):
    s = context
    lone = s.candidates.take(np.array([0]))
    (only,) = features(s.state, lone)
    assert only.rows.tolist() == [0]


def test_the_wall_of_a_bore_is_a_feature_of_touches():
    """A stylus from above reaches it: five touches on it, and none of three like a face."""
    target = prepare(read_part(PARTS / "hex_spacer.step"))
    state = begin(at_pose(target, np.eye(4), np.diag(np.repeat([2e-4, 1e-3], 3) ** 2)))
    found = features(state, propose(state, STYLUS, 400))
    (wall,) = (f for f in found if f.kind == "wall")
    assert wall.name == "the wall of hole 0 (face 8) of hex_spacer"
    assert len(set(wall.rows.tolist())) == 5
    assert not any(f.kind == "face" and f.faces == wall.faces for f in found)
