"""Readings that are proposed can be made: they meet what they are aimed at, from where the probe may come."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER, STYLUS, beam_hits, rough
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import ForbiddenBox, Workspace
from tanteo.parts import read_part, signed_distance
from tanteo.planning import begin, has_clearance, probe_of
from tanteo.planning.candidates import Candidates, propose, within_cone
from tanteo.planning.start import at_pose
from tanteo.posterior import Priors, prepare
from tanteo.sensors.presets import sensor_preset

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NARROW = replace(LASER, standoff=0.03, approach=np.array([0.2, 0.1, -1.0]), cone=np.radians(40))


@pytest.fixture(scope="module")
def state():
    """A part with pockets and ribs, which hide some of it."""
    target = prepare(read_part(PARTS / "housing.step"))
    return begin(at_pose(target, SE3.exp(np.array([0.1, 0.2, 0, 0.3, 0.1, -0.2])), 1e-6 * np.eye(6)))


def on_part(state, points):
    """World points to the part's frame, at the only mode."""
    return SE3.apply(SE3.inverse(state.poses[0]), points)


@pytest.mark.parametrize("probe", [LASER, NARROW])
def test_every_beam_meets_its_face_first_at_the_stand_off(state, probe):
    c, target = propose(state, probe, 300), state.target(0)
    assert len(c) > 50
    hits = target.surface.cast(on_part(state, c.origins), c.directions @ state.poses[0, :3, :3])
    np.testing.assert_allclose(hits.distances, c.ranges, rtol=2e-3)
    assert (target.part.triangle_face[hits.triangles] == c.face).mean() > 0.95  # but for samples on an edge
    normals = target.surface.normals[hits.triangles] @ state.poses[0, :3, :3].T
    assert (-np.sum(normals * c.directions, axis=1) > np.cos(probe.max_incidence)).mean() > 0.95


def test_starts_and_ways_in_keep_clear_of_the_part(state):
    """Clearance is exact, although a grid stores it; and some candidates would be too near."""
    thick = replace(NARROW, clearance=0.012)
    c, surface = propose(state, thick, 400), state.target(0).surface
    back = np.linspace(0, thick.retreat, 30)
    way = c.origins[:, None] - back[:, None] * c.directions[:, None]
    gaps = surface.closest(on_part(state, way.reshape(-1, 3))).distances
    assert len(c) > 20
    assert np.abs(gaps).min() > 0.012 - 2e-3  # between the four places that are evaluated
    assert len(c) < len(propose(state, replace(NARROW, clearance=1e-4), 400))
    inside = SE3.apply(state.poses[0], state.target(0).part.vertices[:1])
    bad = Candidates(inside, np.array([[0.0, 0.0, -1.0]]), np.zeros(1, int), np.zeros(1, int), np.ones(1))
    assert not has_clearance(state, bad, thick).any()


def test_the_nearest_allowed_direction_is_taken():
    rng = np.random.default_rng(1)
    d = rng.normal(size=(200, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    got, a = within_cone(d, NARROW), NARROW.approach
    np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1, atol=1e-12)
    angle = np.arccos(np.clip(d @ a, -1, 1))
    np.testing.assert_allclose(np.arccos(np.clip(got @ a, -1, 1)), np.minimum(angle, NARROW.cone), atol=1e-7)
    turned = np.arccos(np.clip(np.sum(got * d, axis=1), -1, 1))
    np.testing.assert_allclose(turned, np.maximum(angle - NARROW.cone, 0), atol=1e-7)


def test_nearest_direction_against_the_approach_is_on_its_cone():
    got = within_cone(-NARROW.approach[None], NARROW)[0]
    assert np.linalg.norm(got) == pytest.approx(1.0, abs=1e-12)
    assert got @ NARROW.approach == pytest.approx(np.cos(NARROW.cone), abs=1e-12)


TOUCH = replace(LASER, contact=True, standoff=0.05, clearance=0.008)


def over_the_top(state, gap, thick=0.01):
    """Return a plate above the part at a distance, larger than it on all sides."""
    corners = SE3.apply(state.poses[0], state.target(0).part.vertices)
    low, high = corners.min(axis=0), corners.max(axis=0)
    bottom = np.r_[low[:2] - 0.3, high[2] + gap]
    return ForbiddenBox("plate", bottom, np.r_[high[:2] + 0.3, bottom[2] + thick])


@pytest.mark.parametrize("probe", [replace(LASER, standoff=0.08), replace(TOUCH, standoff=0.08)])
def test_no_way_to_the_part_leads_through_a_forbidden_box(state, probe):
    """A plate between the starts and the part: the starts are clear, the paths are not; a touch keeps its clearance."""
    plate = over_the_top(state, 0.03)
    free, kept = (propose(state, replace(probe, workspace=Workspace.everywhere(f)), 400) for f in ((), [plate]))
    for c, max_measurements in ((free, 0.5), (kept, 0.0)):
        way = c.origins[:, None] + np.linspace(0, 1, 200)[:, None] * (c.aims - c.origins)[:, None]
        gaps = plate.distances(way)[0]
        crossed = gaps.min(axis=1) < 0
        assert crossed.mean() <= max_measurements
        assert crossed.any() == (c is free)
        if probe.contact and c is kept:  # but for the end, where the tip is as near to the part
            assert gaps[:, :179].min() >= probe.clearance - 1e-9
    assert len(kept) > 50


def test_a_touch_stays_inside_the_workspace_its_beam_need_not(state):
    """The far half of the part is out of bounds; starts before it are clear."""
    middle = SE3.apply(state.poses[0], state.target(0).part.centroid)[2]
    for probe, out in ((TOUCH, False), (replace(TOUCH, contact=False), True)):
        c = propose(state, replace(probe, workspace=Workspace.above(middle)), 400)
        assert (c.aims[:, 2] < middle).any() == out
        assert len(c) > 20


def test_a_thin_part_on_a_forbidden_table_is_touched_from_above():
    target = prepare(read_part(PARTS / "block.step"))
    state, low = begin(at_pose(target, np.eye(4), 1e-8 * np.eye(6))), target.part.box[0]
    table = ForbiddenBox("table", np.r_[low[:2] - 1, low[2] - 0.1], np.r_[low[:2] + 2, low[2]])
    thick = replace(TOUCH, clearance=0.06, standoff=0.1, workspace=Workspace.everywhere([table]))
    assert target.part.box[1, 2] - low[2] < thick.clearance
    c = propose(state, thick, 300)
    assert len(c) > 20
    np.testing.assert_allclose(c.directions, np.tile([0, 0, -1.0], (len(c), 1)), atol=1e-9)


def test_starts_keep_clear_of_the_part_wherever_it_may_be():
    """Of new samples of a prior pose, not only of its mean; where that leaves nothing, nothing is left."""
    target = prepare(read_part(PARTS / "bracket_left.step"))
    C = np.diag(np.repeat([0.008, 0.2], 3) ** 2)
    state, rng, near = begin(at_pose(target, np.eye(4), C)), np.random.default_rng(5), []
    to_part = SE3.inverse(SE3.exp(rng.normal(size=(2000, 6)) @ np.linalg.cholesky(C).T))[:, None]
    for anywhere in (True, False):
        c = propose(state, TOUCH, 300, anywhere=anywhere)
        assert len(c) > 40
        near.append(np.mean(signed_distance(target.surface, SE3.apply(to_part, c.origins))[0] < TOUCH.clearance))
    assert near[0] < 0.008
    assert near[1] > 0.02
    block = prepare(read_part(PARTS / "block.step"))
    assert not len(propose(begin(rough([block], (0.03, 0.15))), replace(TOUCH, clearance=0.01), 300))


def test_clearance_holds_for_every_mode_if_unknown_is_probable():
    target, C = prepare(read_part(PARTS / "block.step")), np.diag(np.repeat([0.012, 0.12], 3) ** 2)
    states = [begin(at_pose(target, np.eye(4), C, Priors(unknown=u))) for u in (0.05, 0.9999)]
    first, second = (propose(state, TOUCH, 200) for state in states)
    np.testing.assert_array_equal(first.origins, second.origins)
    np.testing.assert_array_less(TOUCH.clearance, signed_distance(target.surface, second.origins)[0])


def test_readings_nearer_than_the_least_range_are_improbable():
    """The test uses new samples of a prior pose; the excluded ones are those nearest to the middle."""
    target, C = prepare(read_part(PARTS / "bracket_left.step")), np.diag(np.repeat([0.01, 0.1], 3) ** 2)
    state, rng, share = begin(at_pose(target, np.eye(4), C)), np.random.default_rng(3), []
    Ts = SE3.exp(rng.normal(size=(1000, 6)) @ np.linalg.cholesky(C).T)
    for least in (0.065, 0.0):
        c = propose(state, replace(LASER, min_range=least), 300)
        share.append(np.mean(beam_hits(target, Ts, c.origins, c.directions)[0] < 0.065))
        assert len(c) > 30
    assert share[0] < 0.015
    assert share[1] > 2 * share[0]


def test_a_probe_has_the_least_range_of_its_sensor():
    probe = probe_of(sensor_preset("keyence_il300"))
    assert probe.min_range == 0.16
    np.testing.assert_array_equal(
        probe.answers(np.array([0.15, 0.16, 0.3, 0.5]), np.ones(4)), [False, True, True, False]
    )
    assert probe_of(sensor_preset("touch_trigger_cnc")).min_range == 0
    with pytest.raises(InputError, match="the smallest range of the sensor"):
        replace(probe, standoff=0.1)


@pytest.fixture(scope="module")
def spacer():
    """A part with a through bore of 36 mm along z, and how well it is known."""
    return begin(at_pose(prepare(read_part(PARTS / "hex_spacer.step")), np.eye(4), 1e-8 * np.eye(6)))


def test_a_stylus_touches_the_wall_of_a_bore_from_its_axis(spacer):
    c, part = propose(spacer, STYLUS, 400), spacer.target(0).part
    inside = np.array([part.faces[f].surface == "cylinder" for f in c.face])
    assert inside.any()
    wide = propose(spacer, replace(STYLUS, standoff=0.05), 400)
    rows = np.array([part.faces[f].surface == "cylinder" for f in wide.face])
    np.testing.assert_allclose(wide.ranges[rows], 0.018, rtol=1e-2)  # half of the way to the wall behind
    assert np.abs(wide.origins[rows, :2]).max() < 1.5e-3  # the mesh has facets
    back = wide.origins[rows][:, None] + np.linspace(0, STYLUS.retreat, 9)[:, None] * STYLUS.stylus
    assert (signed_distance(spacer.target(0).surface, back.reshape(-1, 3))[0] >= STYLUS.clearance - 1e-9).all()


@pytest.mark.parametrize("change", [{"stylus": None, "stylus_along_motion": True}, {"clearance": 0.0181}])
def test_no_bore_is_entered_sideways_or_without_clearance(spacer, change):
    c, part = propose(spacer, replace(STYLUS, standoff=0.05, **change), 400), spacer.target(0).part
    assert len(c)
    assert not any(part.faces[f].surface == "cylinder" for f in c.face)
