"""A named feature with a tolerance: its error counts across itself, and the stated values are right."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sensing_scenes import EXACT_MACHINE, LASER, as_rows, drawn_truth, new_session, of_plan, rough, sense
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.parts import named_feature, read_part
from tanteo.planning import Probe, Session, Stop, begin, plan
from tanteo.planning.places import check_feature, places_of
from tanteo.planning.samples import draw
from tanteo.planning.start import at_pose
from tanteo.planning.stopping import chance_within
from tanteo.posterior import prepare
from tanteo.posterior.answers import corner_moves, corner_sd
from tanteo.sensors.presets import NoiseLaw

PARTS = Path(__file__).parents[2] / "examples" / "parts"
TOUCH = Probe("touch", NoiseLaw.of(3e-4), contact=True, standoff=0.03)
C = np.diag(np.repeat([5e-3, 0.05], 3) ** 2)


@pytest.fixture(scope="module")
def wedge():
    return prepare(read_part(PARTS / "wedge.step"))


@pytest.fixture(scope="module")
def flange():
    return prepare(read_part(PARTS / "flange.step"))


@pytest.mark.parametrize("feature", ["face 2", "edge 7", "vertex 3", None])
def test_moves_are_those_of_points_in_directions_that_count(wedge, feature):
    places, rng = places_of(wedge.part, feature), np.random.default_rng(1)
    for xi in 1e-6 * rng.normal(size=(5, 6)):
        moved = SE3.apply(SE3.exp(xi), places.points) - places.points
        expected = (places.across @ moved[..., None])[..., 0]
        np.testing.assert_allclose(places.moves @ xi, expected, atol=1e-11)


def test_a_face_slides_on_itself_and_an_edge_along_itself(wedge):
    part = wedge.part
    n, c = part.planes.normals[2], part.planes.centroids[2]
    t = np.cross(n, [0, 1, 0])
    for xi in (np.r_[t, 0, 0, 0], np.r_[np.cross(c, n), n]):  # along it, and about its normal
        np.testing.assert_allclose(places_of(part, "face 2").moves @ xi, 0.0, atol=1e-12)
    u, m = part.edges.directions[7], part.edges.midpoints[7]
    for xi in (np.r_[u, 0, 0, 0], np.r_[np.cross(m, u), u]):
        np.testing.assert_allclose(places_of(part, "edge 7").moves @ xi, 0.0, atol=1e-12)
    assert np.all(np.linalg.norm(places_of(part, "vertex 3").moves @ np.r_[u, 0, 0, 0], axis=1) > 0.99)


def test_the_worst_place_of_a_face_is_at_its_outline(wedge):
    """Of all points of the mesh of that face, none is worse known along its normal."""
    rng, part = np.random.default_rng(2), wedge.part
    L = rng.normal(size=(6, 6)) * np.repeat([1e-3, 0.02], 3)[:, None]
    own = part.vertices[np.unique(part.triangles[part.triangle_face == 2])]
    inside = own[None] * rng.dirichlet(np.ones(len(own)), size=400)[..., None]
    n = part.planes.normals[list(part.planes.faces).index(2)]
    rows = np.concatenate([np.broadcast_to(n, (400, 3)), np.cross(inside.sum(axis=1), n)], axis=1)
    sds = np.sqrt(np.sum((rows @ L) ** 2, axis=1))
    worst = places_of(part, "face 2").sd(L @ L.T)
    assert sds.max() <= worst * (1 + 1e-9)
    assert sds.max() > 0.7 * worst


def test_a_round_face_counts_along_its_own_normals(flange):
    """A shift along the axis of a bore is nothing to it, one across it is."""
    part = flange.part
    k = next(i for i, f in enumerate(part.faces) if f.surface == "cylinder")
    places, axis = places_of(part, f"face {k}"), part.faces[k].axis_direction
    across = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.9 else [0, 1, 0])
    np.testing.assert_allclose(places.moves @ np.r_[axis, 0, 0, 0], 0.0, atol=1e-12)
    assert places.sd(np.diag(np.r_[1e-6 * across**2, 0, 0, 0])) > 0.9e-3 * np.abs(across).max()


def test_corners_are_as_before(wedge):
    assert places_of(wedge.part).sd(C) == pytest.approx(corner_sd(wedge.part, C), rel=1e-12)
    assert places_of(wedge.part, "face 99").feature is None  # of another part of the session


@pytest.mark.parametrize(("feature", "tolerance"), [("face 2", 4e-3), ("edge 7", 6e-3), ("vertex 3", 8e-3)])
def test_the_chance_of_a_feature_is_that_of_draws_of_the_pose(wedge, feature, tolerance):
    T = SE3.exp(np.array([0.2, -0.1, 0.3, 0.5, -0.4, 1.0]))
    state, rng = begin(at_pose(wedge, T, 0.5 * C)), np.random.default_rng(3)
    places = places_of(wedge.part, feature)
    gaps = SE3.exp(rng.normal(size=(20_000, 6)) @ np.linalg.cholesky(0.5 * C).T)
    moved = SE3.apply(gaps[:, None], places.points) - places.points
    off = np.linalg.norm((places.across @ moved[..., None])[..., 0], axis=-1).max(axis=1)
    expected = np.mean(off <= tolerance)
    assert 0.2 < expected < 0.9
    assert chance_within(state, tolerance, feature) == pytest.approx(expected * (1 - state.unknown), abs=0.02)


def test_useful_is_what_exceeds_tolerance_and_moves_the_feature(wedge):
    """Of corners as by inverting; of a face nothing of what slides it on itself."""
    state, tolerance = begin(at_pose(wedge, np.eye(4), C)), 1e-3
    J = corner_moves(wedge.part)
    enough = (tolerance / 1.6) ** 2 / 6 * np.linalg.inv(np.mean(np.swapaxes(J, 1, 2) @ J, axis=0))
    useful = draw(state, 4, tolerance).useful[0]
    np.testing.assert_allclose(useful, C @ np.linalg.solve(C + enough, C), rtol=1e-7, atol=1e-14)
    of_face = draw(state, 4, tolerance, "face 2").useful[0]
    n = wedge.part.planes.normals[2]
    along = np.linalg.solve(C, np.r_[np.cross(n, [0, 1, 0]), 0, 0, 0])
    assert np.abs(of_face @ along).max() < 1e-9 * np.abs(C @ along).max()
    assert np.linalg.eigvalsh(of_face).min() > -1e-12


@pytest.fixture(scope="module")
def of_corners(wedge):
    """A plan for all corners, within 1.2 mm at 90 %."""
    return plan(at_pose(wedge, np.eye(4), C), TOUCH, 1.2e-3, 0.9)


@pytest.mark.slow
@pytest.mark.parametrize("feature", ["edge 7", pytest.param("face 3", marks=pytest.mark.slow)])
def test_a_plan_for_a_feature_needs_fewer_readings(wedge, of_corners, feature):
    """Simulated readings of the plan, estimated about the expected pose: the feature's errors, the promised chance."""
    start, tolerance = at_pose(wedge, np.eye(4), C), 1.2e-3
    found = plan(start, TOUCH, tolerance, 0.9, feature=feature)
    assert found.reached
    assert len(found.readings) < len(of_corners.readings)
    assert f"{feature} of wedge within 1.2 mm" in found.message
    (G, R), last, rng = as_rows(wedge, *of_plan(found), TOUCH), found.readings[-1], np.random.default_rng(1)
    xi = rng.normal(size=(4000, 6)) @ np.linalg.cholesky(C).T
    y = xi @ G.T + np.sqrt(R) * rng.normal(size=(4000, len(R)))
    left = xi - y @ (C @ G.T @ np.linalg.inv(G @ C @ G.T + np.diag(R))).T
    off = np.linalg.norm(np.einsum("cij,sj->sci", places_of(wedge.part, feature).moves, left), axis=-1)
    assert np.mean(off.max(axis=1) <= tolerance) == pytest.approx(last.within_if_hit, abs=0.02)
    assert np.std(off, axis=0).max() < last.sd == last.feature_sd


@pytest.mark.slow
def test_a_session_ends_with_the_feature_placed_as_reason(wedge):
    start = rough([wedge])
    _, T = drawn_truth(start, np.random.default_rng(7))
    counts = {}
    for feature in (None, "face 3"):
        session = new_session(start, tolerance=0.8e-3, feature=feature, probability=None, errors=EXACT_MACHINE)
        end = sense(session, wedge, T, np.random.default_rng(8))
        assert end.reached, end.message
        counts[feature] = session.count
        assert session.steps[-1].within >= 0.95
    assert "Face 3 of wedge is within 0.8 mm of the estimated place" in end.message
    assert counts["face 3"] < counts[None]
    places, gap = places_of(wedge.part, "face 3"), SE3.inverse(session.state.poses[0]) @ T
    moved = SE3.apply(gap, places.points) - places.points
    assert np.abs(np.einsum("kij,kj->ki", places.across, moved)).max() < 0.8e-3


@pytest.mark.parametrize(
    ("feature", "message"),
    [("hole 3", "expected 'face 3', 'edge 4' or 'vertex 2'"), ("edge 99", "wedge: edge 0 to 14")],
)
def test_a_feature_that_is_not_there_is_refused(wedge, feature, message):
    start = at_pose(wedge, np.eye(4), C)
    with pytest.raises(InputError, match=message):
        Session(start, LASER, stop=Stop(tolerance=1e-3, feature=feature))
    with pytest.raises(InputError, match=message):
        plan(start, TOUCH, 1e-3, feature=feature)


def test_a_feature_without_a_tolerance_is_refused():
    with pytest.raises(InputError, match="expected a tolerance"):
        Stop(feature="edge 3")


def test_of_several_parts_one_has_to_have_it(wedge, flange):
    start = rough([wedge, flange])
    Session(start, LASER, stop=Stop(tolerance=1e-3, feature="face 12"))  # the flange has it
    with pytest.raises(InputError, match="wedge: face 0 to 6, flange: face 0 to 12"):
        Session(start, LASER, stop=Stop(tolerance=1e-3, feature="face 13"))
    assert replace(Stop(tolerance=1e-3), feature="face 12").feature == "face 12"


def test_lines_that_show_a_feature_are_on_it(wedge, flange):
    """A face by its outline, holes too; an edge by itself; a vertex by a cross about it."""
    for part in (wedge.part, flange.part):
        for k in part.planes.faces:
            lines, (n,) = named_feature(part, f"face {k}").outline, part.planes.normals[part.planes.faces == k]
            height = lines.reshape(-1, 3) @ n
            np.testing.assert_allclose(height, height[0], atol=1e-9)
            ends = np.unique(lines.reshape(-1, 3).round(9), axis=0, return_counts=True)[1]
            assert np.all(ends == 2)  # closed
    assert len(named_feature(wedge.part, "face 2").outline) >= 4
    np.testing.assert_array_equal(named_feature(wedge.part, "edge 7").outline[0], wedge.part.edges.ends[7])
    cross = named_feature(wedge.part, "vertex 3").outline
    np.testing.assert_allclose(cross.mean(axis=1), np.tile(wedge.part.corners.points[3], (3, 1)), atol=1e-12)


def test_a_plane_is_the_face_of_its_number(wedge):
    """Answers call a planar face a plane."""
    plane, face = (places_of(wedge.part, name) for name in ("plane 3", "face 3"))
    assert np.array_equal(plane.points, face.points)
    with pytest.raises(InputError, match=r"wedge: face 0 to \d+"):
        check_feature("plane 99", [wedge.part])
