"""Bores that a hand acquires in one piece in a session: offered, planned, used, kept in the record."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bore_scenes import plate
from felt_scenes import gripper
from random_parts import write_off
from tanteo.errors import InputError
from tanteo.hand.acquisition import least_radius
from tanteo.io import read_record, write_record
from tanteo.parts import read_part
from tanteo.planning import Action, Session, Stop, sense_part
from tanteo.planning.execution import acquirable
from tanteo.planning.start import at_pose
from tanteo.posterior import prepare
from unknown_scenes import CLEARANCE, STANDOFF, off, unknown_scene, unknown_session

RADII = 0.012, 0.015


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    """Two that differ in the radius of their bore only."""
    folder, out = tmp_path_factory.mktemp("plates"), []
    for radius in RADII:
        vertices, triangles = plate(radius)
        write_off(folder / f"{1e3 * radius:.0f}mm.off", 1e3 * vertices, triangles)
        out.append(prepare(read_part(folder / f"{1e3 * radius:.0f}mm.off", unit="mm")))
    return out


def session_about(unknown, targets, number, **stop) -> Session:
    """Return a session that identifies a plate with a pose known to 0.1 mm from whole features only."""
    session = unknown_session(unknown)
    C = np.diag(np.repeat([2e-4, 1e-3], 3) ** 2)
    start = replace(
        at_pose(targets[0], unknown.T_world_part, C), targets=tuple(targets), part=np.arange(2),
        Ts=np.repeat(unknown.T_world_part[None], 2, axis=0), covariances=np.repeat(C[None], 2, axis=0),
        weights=np.ones(2),
    )  # fmt: skip
    return Session(
        start, session.probe, session.sensing, stop=Stop(**stop), able=lambda state, c: np.zeros(len(c), dtype=bool),
        whole=acquirable(gripper(), unknown.rules, session.probe.retreat),
    )  # fmt: skip


def test_where_no_reading_is_possible_the_bore_is_planned(plates, tmp_path):
    unknown = unknown_scene(plates, 0, np.random.default_rng(1))
    session = session_about(unknown, plates, 0, probability=0.99)
    action = session.ask()
    assert isinstance(action, Action)
    assert (action.acquires, action.face) == ("circle", "rim of hole 0")
    assert "as a circle" in action.words
    with pytest.raises(InputError, match="all of rim of hole"):
        action.read(0.05)
    write_record(session, tmp_path / "s.json")
    again = read_record(tmp_path / "s.json", plates, whole=session.whole)
    assert again.pending is not None
    assert (again.pending.acquires, again.pending.face) == (action.acquires, action.face)
    session.refuse(action)
    other = session.ask()
    assert not isinstance(other, Action) or (other.acquires, other.part) != (action.acquires, action.part)


def test_what_the_hand_cannot_acquire_is_not_offered(plates):
    unknown = unknown_scene(plates, 0, np.random.default_rng(1))
    session = session_about(unknown, plates, 0, probability=0.99)
    offers = session.whole(session.state)
    assert {one.kind for one in offers} == {"circle", "cylinder"}
    assert all(one.size > least_radius(gripper(), 0.02, convex=False) for one in offers)
    walled = replace(unknown.rules, workspace=replace(unknown.rules.workspace, high=np.array([1.0, 1.0, 0.03])))
    assert not acquirable(gripper(), walled, 0.05)(session.state)


@pytest.mark.slow
def test_a_hand_distinguishes_two_plates_by_their_bore(plates):
    for number in range(2):
        unknown = unknown_scene(plates, number, np.random.default_rng((3, number)))
        session = session_about(unknown, plates, number, probability=0.99, max_measurements=300)
        done = sense_part(session, unknown.robot, unknown.rules, furniture=unknown.furniture)
        assert done.end.reached
        assert [v.action.acquires for v in done.visits] == ["circle"]
        assert "of the rim" in done.visits[0].note
        assert off(session, number, unknown.T_world_part) < 1.5e-3
        assert unknown.clear > 0.5 * CLEARANCE
        assert session.probe.standoff == STANDOFF
