"""What is drawn of a moment: where, in which colour, and what can be hidden."""

from __future__ import annotations

import numpy as np
import pytest

from felt_scenes import gripper
from tanteo.geometry import SE3, SO3
from tanteo.hand import FREE, HIT, LOST, HandReading
from tanteo.planning import Action
from tanteo.render.live import Snapshot, colors, drawing
from tanteo.render.live.primitives import Arrow, Dots, Lines, Mesh
from viewer_scenes import TABLE, TRUE, maker


@pytest.fixture(scope="module")
def moments(targets):
    """Before the first reading, after one, and after five."""
    show, out = maker(targets, tolerance=5e-4)(3, "information"), []
    session = show.session
    session.ask()
    out.append(Snapshot.of(session))
    read = _reader(targets)
    for _ in range(5):
        action = session.ask()
        assert isinstance(action, Action)
        session.tell(read(action))
        session.ask()
        out.append(Snapshot.of(session))
    return out[0], out[1], out[5]


def _reader(targets):
    def read(action):
        to_part = SE3.inverse(TRUE)
        origin, along = SE3.apply(to_part, action.origin), to_part[:3, :3] @ action.direction
        return action.read(float(targets[0].surface.cast(origin[None], along[None]).distances[0]))

    return read


def everything(now):
    return [*drawing.state_primitives(now), *drawing.reading_primitives(now), *drawing.next_primitives(now)]


def test_names_are_unique_and_layers_known(moments):
    for now in moments:
        names = [p.name for p in everything(now)]
        assert len(set(names)) == len(names)
        assert {p.layer for p in everything(now)} <= {"", *drawing.LAYERS}


def test_each_part_is_drawn_where_the_belief_has_it(moments):
    for now in moments:
        meshes = [p for p in drawing.state_primitives(now) if isinstance(p, Mesh)]
        assert len(meshes) == len(now.drawn_modes())
        for mesh, k in zip(meshes, now.drawn_modes(), strict=True):
            np.testing.assert_array_equal(mesh.T, now.state.poses[k])
            assert len(mesh.vertices) == len(now.state.target(int(k)).part.vertices)
    first, last = ([p for p in drawing.state_primitives(now) if isinstance(p, Mesh)] for now in moments[::2])
    assert [m.colour for m in first] == [colors.PART, colors.RIVALS[0]]
    assert [m.layer for m in first] == ["", "rival 1"]
    assert last[0].same_shape(first[0])  # the left bracket, which lies there, is sent once


def test_one_object_is_solid_and_all_others_are_transparent(moments):
    for now in moments:
        meshes = [p for p in drawing.state_primitives(now) if isinstance(p, Mesh)]
        assert [p.opacity for p in meshes if p.layer == ""] == [1.0]
        assert all(p.opacity < 0.5 for p in meshes if p.layer)


def test_how_the_pose_may_be_off_shrinks(moments):
    def spread(now):
        overlays = [p for p in drawing.state_primitives(now) if p.layer == "overlays"]
        return np.linalg.norm(np.std([g.T[:3, 3] for g in overlays], axis=0)) if overlays else np.nan

    assert np.isnan(spread(moments[0]))  # two parts are as likely: whose pose?
    assert 0 < spread(moments[2]) < 0.7 * spread(moments[1])
    again = [p.T for p in drawing.state_primitives(moments[2]) if p.layer == "overlays"]
    np.testing.assert_array_equal(again, [p.T for p in drawing.state_primitives(moments[2]) if p.layer == "overlays"])


def test_readings_and_beams_are_where_they_were_made(moments, targets):
    now = moments[2]
    drawn = {p.name: p for p in drawing.reading_primitives(now)}
    touches = now.state.touches
    np.testing.assert_array_equal(drawn["readings that fit"].points, touches.points)
    beams = drawn["beams"].segments
    np.testing.assert_allclose(beams[:, 1], touches.points)
    hits = [s.action.origin for s in now.steps if s.ids[0] in touches.ids]
    np.testing.assert_allclose(beams[:, 0], hits, atol=1e-9)
    assert drawing.reading_primitives(moments[0]) == []


@pytest.mark.slow
def test_a_reading_that_does_not_fit_has_another_colour(targets):
    show = maker(targets, tolerance=5e-4)(3, "largest-face")
    session, read = show.session, _reader(targets)
    wrong = ""
    while not wrong and isinstance(action := session.ask(), Action):
        readings = read(action)
        if session.count >= 7 and readings.ranges.given[0]:  # the part is known by then: this beam ends 20 mm before it
            wrong, readings = action.name, action.read(float(readings.ranges[0]) - 0.02)
        session.tell(readings)
    now = Snapshot.of(session)
    drawn = {p.name: p for p in drawing.reading_primitives(now)}
    assert now.wrong().tolist() == [name == wrong for name in now.state.touches.ids]
    wrong = drawn["readings that do not fit"]
    assert (wrong.colour, wrong.shape) == (colors.BAD, "diamond")
    assert (drawn["readings that fit"].colour, drawn["readings that fit"].shape) == (colors.GOOD, "circle")
    np.testing.assert_array_equal(wrong.points, now.state.touches.points[now.wrong()])


def test_the_next_reading_points_at_its_place(moments):
    now = moments[1]
    arrow, label = drawing.next_primitives(now)
    assert isinstance(arrow, Arrow)
    np.testing.assert_array_equal(arrow.start, now.action.origin)
    np.testing.assert_allclose(arrow.end - arrow.start, now.action.expected * now.action.direction)
    assert label.text == f"next: {now.action.face} of {now.action.part}"
    assert drawing.next_primitives(Snapshot(now.state, now.steps, None)) == []


def test_the_hand_has_its_pose_and_beams_end_at_their_hits():
    hand = gripper()
    T = SE3.from_parts(SO3.exp(np.array([3.0, 0.2, -0.4])), [0.1, 0.2, 0.3])
    states = np.array([HIT, FREE, LOST] * 4)[: len(hand.origins)]
    ranges = np.where(states == HIT, 0.07, np.nan)
    body, seen, free = drawing.hand_primitives(hand, HandReading(0.0, T, ranges, states))
    np.testing.assert_array_equal(body.T, T)
    hits = np.flatnonzero(states == HIT)
    ends = SE3.apply(T, hand.origins[hits] + 0.07 * hand.axes[hits])
    np.testing.assert_allclose(seen.segments[:, 1], ends)
    length = np.linalg.norm(free.segments - SE3.apply(T, hand.origins[states == FREE][:1]), axis=-1).min()
    assert length == pytest.approx(0, abs=1e-12)
    assert isinstance(seen, Lines)


def test_furniture_and_truth():
    (table,) = drawing.furniture_primitives([TABLE])
    assert (table.colour, table.opacity) == (colors.TABLE, 1.0)
    (outline,) = drawing.truth_primitives([TABLE])
    assert len(outline.segments) == 12  # the edges of a box, and none of its diagonals
    lengths = np.linalg.norm(np.diff(outline.segments, axis=1)[:, 0], axis=1)
    np.testing.assert_allclose(np.sort(lengths), [0.05] * 4 + [0.6] * 8)


def test_dots_are_large_enough_to_be_seen(moments):
    dots = [p for p in drawing.reading_primitives(moments[2]) if isinstance(p, Dots)]
    assert all(0.01 < d.size / moments[2].size < 0.05 for d in dots)
