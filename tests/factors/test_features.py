"""Features as points: the points carry exactly the information of the features."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import random_pose, touch
from tanteo.errors import InputError
from tanteo.factors import as_contact_points, as_labelled_points
from tanteo.features import Feature, SharedError, SharedTerm
from tanteo.features.kinds import EDGE, HALF_EDGE, PLANE, VERTEX
from tanteo.geometry import SE3
from tanteo.sensors import Readings, measure

FLIP = SE3.exp(np.array([0, 0, 0, np.pi, 0, 0]))


def fitted_plane(rng, n=6):
    """Return a plane through points of different noise."""
    T, sds = random_pose(rng), rng.uniform(1e-4, 5e-4, n)
    at = rng.normal(size=(n, 2)) * [0.03, 0.01] + [0.02, -0.01]
    A = np.column_stack([np.ones(n), at[:, 1], -at[:, 0]])
    P = np.linalg.inv(A.T @ (A / sds[:, None] ** 2))
    return Feature(PLANE, T, P, "face", support=SE3.apply(T, np.column_stack([at, np.zeros(n)])))


def fitted_edge(rng, n=5):
    """Return an edge through points whose noise across it differs by direction, the same along it."""
    T, x, R = random_pose(rng), rng.uniform(-0.04, 0.06, n), rng.normal(size=(2, 2))
    V = 1e-8 * (R @ R.T + np.eye(2))
    A = np.stack([[[1, 0, 0, s], [0, 1, -s, 0]] for s in x])
    P = np.linalg.inv(np.einsum("nij,ik,nkl->jl", A, np.linalg.inv(V), A))
    return Feature(EDGE, T, P, "rim", support=SE3.apply(T, np.column_stack([x, 0 * x, 0 * x])))


def as_feature(feature, points):
    """Covariance of the feature from its points, by how they move with its perturbation."""
    local = SE3.apply(SE3.inverse(feature.T_world_feature), points.points)
    R, J = feature.T_world_feature[:3, :3], feature.kind.B.T
    across = [i for i in feature.kind.rows if i < 3]
    information = np.zeros((feature.kind.size, feature.kind.size))
    for p, C in zip(local, points.covs, strict=True):
        moves = np.hstack([np.eye(3), -np.cross(np.eye(3), p).T @ -np.eye(3)])[across] @ J
        information += moves.T @ np.linalg.solve((R.T @ C @ R)[np.ix_(across, across)], moves)
    return np.linalg.inv(information)


@pytest.mark.parametrize("make", [fitted_plane, fitted_edge])
@pytest.mark.parametrize("seed", range(5))
def test_the_points_give_the_covariance_of_the_feature(make, seed):
    feature = make(np.random.default_rng(seed))
    points = as_labelled_points([feature])
    scale = np.sqrt(np.diag(feature.P))
    got = as_feature(feature, points) / np.outer(scale, scale)
    np.testing.assert_allclose(got, feature.P / np.outer(scale, scale), atol=1e-6)
    assert set(points.labels) == {feature.label}
    assert not points.directed.any()


def test_points_of_a_plane_are_off_it_as_points_are():
    """By as many squares of standard deviations as there are more than three; and the plane stays where it is."""
    for seed in range(5):
        feature = fitted_plane(np.random.default_rng(seed))
        points = as_labelled_points([feature])
        local = SE3.apply(SE3.inverse(feature.T_world_feature), points.points)
        weights = 1 / points.covs[:, 0, 0]
        A = np.column_stack([np.ones(len(local)), local[:, 1], -local[:, 0]])
        assert weights @ local[:, 2] ** 2 == pytest.approx(len(local) - 3)
        np.testing.assert_allclose(A.T @ (weights * local[:, 2]), 0, atol=1e-6 * np.abs(A.T * weights).sum())
        np.testing.assert_allclose(points.sides, np.tile(feature.T_world_feature[:3, 2], (len(local), 1)))


def test_a_plane_known_better_than_by_its_points_is_a_normal():
    rng = np.random.default_rng(1)
    feature = touch(np.array([0.1, 0, 0]), np.array([0, 0, 1.0]), rng, "t")
    points = as_labelled_points([feature])
    assert points.normals == pytest.approx(feature.T_world_feature[None, :3, 2])
    assert points.normal_sds == pytest.approx([5e-3])
    assert points.sd == pytest.approx([2e-4])


def test_shared_errors_move_points_with_the_feature():
    rng = np.random.default_rng(2)
    for feature in (fitted_plane(rng), fitted_edge(rng), Feature(VERTEX, random_pose(rng), 1e-8 * np.eye(3), "tip")):
        gain = rng.normal(size=(feature.kind.size, 2))
        shared = replace(feature, shared=(SharedTerm(SharedError("common", np.diag([4.0, 9.0])), gain),))
        points = as_labelled_points([shared])
        c, across = 1e-6 * rng.normal(size=2), [i for i in feature.kind.rows if i < 3]
        p = SE3.apply(SE3.inverse(feature.T_world_feature), points.points)
        moved = SE3.apply(SE3.exp(feature.kind.B.T @ (gain @ c)), p) - p
        stated = points.shared_jacobian @ (c / [2.0, 3.0]) @ feature.T_world_feature[:3, :3]
        np.testing.assert_allclose(stated[:, across], moved[:, across], rtol=1e-3, atol=1e-10)


def test_a_plane_of_unknown_side_has_no_side():
    feature = fitted_plane(np.random.default_rng(3))
    other = replace(feature, T_world_feature=feature.T_world_feature @ FLIP)
    assert not as_labelled_points([(feature, other)]).inward.any()
    bare = replace(feature, support=np.zeros((0, 3)))
    with pytest.raises(InputError, match="'face': expected the points where it was sensed"):
        as_labelled_points([(bare, replace(other, support=np.zeros((0, 3))))])


def test_a_plane_touched_by_a_ball_is_given_by_its_centres():
    feature = replace(fitted_plane(np.random.default_rng(6)), tip_radius=3e-3)
    at, points = as_labelled_points([replace(feature, tip_radius=0.0)]), as_labelled_points([feature])
    assert points.radii == pytest.approx(3e-3)
    np.testing.assert_allclose(points.points - at.points, 3e-3 * points.sides, atol=1e-12)


def test_points_in_a_line_or_in_one_place_are_a_normal():
    feature = fitted_plane(np.random.default_rng(7))
    for support in (feature.support[:1].repeat(5, axis=0), feature.support[:1] + np.outer(np.arange(5), [1e-3, 0, 0])):
        assert as_labelled_points([replace(feature, support=support)]).oriented.tolist() == [True]


def test_names_are_distinguished_and_misuse_is_refused():
    feature = fitted_plane(np.random.default_rng(4))
    points = as_labelled_points([feature, replace(feature, label=""), feature])
    assert list(dict.fromkeys(points.ids)) == ["face", "feature 2", "face (3)"]
    assert len(as_labelled_points([])) == 0
    with pytest.raises(InputError, match=r"'half': expected one of .*plane.*, got a half_edge"):
        as_labelled_points([Feature(HALF_EDGE, np.eye(4), 1e-8 * np.eye(5), "half")])
    with pytest.raises(InputError, match="'flat', P: expected a positive variance"):
        as_labelled_points([Feature(PLANE, np.eye(4), np.diag([1e-8, 0, 1e-6]), "flat")])


def test_the_normal_of_a_plane_has_its_largest_tilt():
    for tilts in ((1e-6, 4e-6), (4e-6, 1e-6)):
        feature = Feature(PLANE, random_pose(np.random.default_rng(0)), np.diag([1e-8, *tilts]), "face")
        assert as_labelled_points([feature]).normal_sds == pytest.approx([2e-3])


@pytest.mark.parametrize(("kind", "refused"), [("plane", False), ("cylinder", False), ("edge", True), ("vertex", True)])
def test_a_ball_touches_faces_but_no_edge_at_a_known_place(kind, refused):
    columns = {"features": ["f"], "kinds": [kind], "sds": [1e-4], "radii": np.array([2e-3])}
    readings = Readings.from_columns(points=np.zeros((1, 3)), directions=[[0.0, 0.0, -1.0]], **columns)
    if refused:
        with pytest.raises(InputError, match="expected surface points, got centres of a ball of 2 mm"):
            as_contact_points(measure(readings))
    else:
        assert as_contact_points(measure(readings)).radii == pytest.approx([2e-3])
