"""Readings that are proposed can be made: they meet what they are aimed at, from where the probe may come."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import LASER
from tanteo.active import at_pose, begin, propose
from tanteo.active.candidates import Candidates, has_room, within_cone
from tanteo.lie import SE3
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NARROW = replace(LASER, standoff=0.03, approach=np.array([0.2, 0.1, -1.0]), cone=np.radians(40))


@pytest.fixture(scope="module")
def belief():
    """A part with pockets and ribs, which hide some of it."""
    target = prepare_target(read_part(PARTS / "housing.step"))
    return begin(at_pose(target, SE3.exp(np.array([0.1, 0.2, 0, 0.3, 0.1, -0.2])), 1e-6 * np.eye(6)))


def on_part(belief, points):
    """World points to the part's frame, at the only mode."""
    return SE3.apply(SE3.inverse(belief.poses[0]), points)


@pytest.mark.parametrize("probe", [LASER, NARROW])
def test_every_beam_meets_its_face_first_at_the_stand_off(belief, probe):
    c, target = propose(belief, probe, 300), belief.target(0)
    assert len(c) > 50
    hits = target.surface.cast(on_part(belief, c.origins), c.directions @ belief.poses[0, :3, :3])
    np.testing.assert_allclose(hits.distances, c.ranges, rtol=2e-3)
    assert (target.part.triangle_face[hits.triangles] == c.face).mean() > 0.95  # but for samples on an edge
    normals = target.surface.normals[hits.triangles] @ belief.poses[0, :3, :3].T
    assert (-np.sum(normals * c.directions, axis=1) > np.cos(probe.max_incidence)).mean() > 0.95


def test_starts_and_ways_in_keep_clear_of_the_part(belief):
    """Exactly, although the room is looked up on a grid; and some would be too near."""
    thick = replace(NARROW, clearance=0.012)
    c, surface = propose(belief, thick, 400), belief.target(0).surface
    back = np.linspace(0, thick.retreat, 30)
    way = c.origins[:, None] - back[:, None] * c.directions[:, None]
    gaps = surface.closest(on_part(belief, way.reshape(-1, 3))).distances
    assert len(c) > 20
    assert np.abs(gaps).min() > 0.012 - 2e-3  # between the four places that are looked at
    assert len(c) < len(propose(belief, replace(NARROW, clearance=1e-4), 400))
    inside = SE3.apply(belief.poses[0], belief.target(0).part.vertices[:1])
    bad = Candidates(inside, np.array([[0.0, 0.0, -1.0]]), np.zeros(1, int), np.zeros(1, int), np.ones(1))
    assert not has_room(belief, bad, thick).any()


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


def test_straight_against_the_approach_the_nearest_is_a_unit_direction_on_the_edge_of_the_cone():
    got = within_cone(-NARROW.approach[None], NARROW)[0]
    assert np.linalg.norm(got) == pytest.approx(1.0, abs=1e-12)
    assert got @ NARROW.approach == pytest.approx(np.cos(NARROW.cone), abs=1e-12)
