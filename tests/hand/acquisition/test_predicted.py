"""Features of a part where a pose puts them, as ideas for the hand."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.hand import predicted
from tanteo.hand.acquisition import EdgeGuess, FaceGuess, RoundGuess, VertexGuess
from tanteo.parts import Surface, round_features

PARTS = Path(__file__).parents[3] / "examples" / "parts"
POSE = SE3.exp(np.array([0.3, -0.2, 0.1, 0.4, -0.3, 0.8]))
UP = np.array([0.0, 0.0, 1.0])
NONE = 1e-12 * np.eye(6)


@pytest.fixture(scope="module")
def bracket():
    part = tanteo.read_part(PARTS / "bracket_left.step")
    return part, Surface(part.vertices, part.triangles)


def guesses(part, kind, towards=UP, covariance=NONE):
    return predicted(kind, part, POSE, covariance, POSE[:3, :3] @ towards)


def on_face(part, surface, name, point, normal):
    """Return whether a point of the world is on a face and the first hit along its normal."""
    T = SE3.inverse(POSE)
    p, n = SE3.apply(T, point), T[:3, :3] @ normal
    hit = surface.cast(p + 0.5 * n, -n)
    face = part.faces[part.triangle_face[int(hit.triangles)]]
    return face.name == name and abs(float(hit.distances) - 0.5) < 1e-9


def test_faces_point_to_the_hand_and_are_hit_first(bracket):
    found = guesses(bracket[0], "plane")
    assert [p.value for p in found] == sorted((p.value for p in found), reverse=True)
    assert {p.name for p in found} == {"face 6", "face 1", "face 10", "face 4"}  # up, and the rib's slope
    for p in found:
        assert isinstance(p.guess, FaceGuess)
        assert p.guess.normal @ (POSE[:3, :3] @ UP) >= 0.5
        assert on_face(*bracket, p.name, p.guess.point, p.guess.normal)


def test_an_edge_has_its_face_on_the_left(bracket):
    found = guesses(bracket[0], "edge")
    assert found
    for p in found:
        assert isinstance(p.guess, EdgeGuess)
        inward = np.cross(p.guess.normal, p.guess.direction)
        assert on_face(*bracket, p.faces[0], p.guess.point + 5e-4 * inward, p.guess.normal)
        assert len(p.faces) == 2
        outside = SE3.apply(SE3.inverse(POSE), p.guess.point - 5e-4 * inward + 1e-4 * p.guess.normal)
        assert not bracket[1].inside(outside)


def test_a_vertex_lies_between_the_ends_of_its_edges(bracket):
    found = guesses(bracket[0], "vertex")
    assert found
    for p in found:
        assert isinstance(p.guess, VertexGuess)
        for step in (-p.guess.arriving, p.guess.leaving):
            inward = np.cross(p.guess.normal, p.guess.arriving if step is not p.guess.leaving else p.guess.leaving)
            assert on_face(*bracket, p.faces[0], p.guess.point + 1e-3 * step + 1e-4 * inward, p.guess.normal)


def test_what_lies_under_something_is_not_gone_to():
    part = tanteo.read_part(PARTS / "t_slot.step")
    up = {part.faces[f].name for f, n in zip(part.planes.faces, part.planes.normals, strict=True) if n[2] > 0.9}
    found = {p.name for p in predicted("plane", part, np.eye(4), NONE, UP)}
    assert found
    assert found <= up
    surface = Surface(part.vertices, part.triangles)
    for name in up - found:  # everywhere something is above
        rows = part.triangle_face == [face.name for face in part.faces].index(name)
        middles = part.vertices[part.triangles[rows]].mean(axis=1)
        hits = surface.cast(middles + UP, np.broadcast_to(-UP, middles.shape))
        assert not np.isclose(hits.distances, 1.0, atol=1e-9).all()


def test_the_spread_is_that_of_the_pose(bracket):
    rng = np.random.default_rng(7)
    L = np.diag([1e-3, 2e-3, 1e-3, 0.01, 0.005, 0.02]) @ np.tril(rng.uniform(-1, 1, (6, 6)))
    C = L @ L.T + np.diag([1e-7] * 3 + [1e-6] * 3)
    p = guesses(bracket[0], "plane", covariance=C)[0]
    local = SE3.apply(SE3.inverse(POSE), p.guess.point)
    draws = rng.multivariate_normal(np.zeros(6), C, 40_000)
    places = SE3.apply(POSE @ SE3.exp(draws), local)
    np.testing.assert_allclose(p.guess.sd, np.sqrt(np.linalg.eigvalsh(np.cov(places.T))[-1]), rtol=0.03)
    np.testing.assert_allclose(p.guess.turn_sd, np.sqrt(np.linalg.eigvalsh(np.cov(draws[:, 3:].T))[-1]), rtol=0.03)


def test_another_kind_is_refused(bracket):
    with pytest.raises(InputError, match="expected plane, edge, vertex, circle or cylinder, got 'hole'"):
        guesses(bracket[0], "hole")


def test_rims_of_bores_and_bosses_that_open_to_the_hand():
    part = tanteo.read_part(PARTS / "flange.step")
    rims, walls = (guesses(part, kind) for kind in ("circle", "cylinder"))
    assert {p.name for p in walls} == {"hole 0", "hole 1", "hole 2", "hole 4", "hole 5", "boss 3"}
    assert {p.name for p in rims} == {f"rim of {p.name}" for p in walls}
    for p in walls:
        one = next(r for r in round_features(part) if r.name == p.name)
        assert isinstance(p.guess, RoundGuess)
        assert p.guess.convex is not one.hole
        assert p.guess.radius == pytest.approx(one.radii[0])
        assert p.guess.axis == pytest.approx(POSE[:3, 2])
        assert SE3.apply(SE3.inverse(POSE), p.guess.point)[2] == pytest.approx(
            0.018 if p.faces == ("face 2",) else 0.048
        )
    value = {p.name: p.value for p in rims}
    assert value["rim of hole 0"] > value["rim of hole 5"]  # wider, but the ring around it leaves no way to cross it


def test_a_rim_is_gone_to_where_it_opens_to_the_hand_only():
    part = tanteo.read_part(PARTS / "flange.step")
    assert {p.name for p in guesses(part, "circle", -UP)} == {f"rim of hole {k}" for k in (0, 1, 2, 4, 5)}
    assert not guesses(part, "circle", np.array([1.0, 0.0, 0.0]))
