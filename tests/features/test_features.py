from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tanteo.errors import CovarianceError, InputError
from tanteo.features import (
    Feature,
    SharedError,
    SharedTerm,
    collect_shared,
    cross_covariance,
    feature_covariance,
    shared_root,
    stacked_covariance,
)
from tanteo.features.kinds import EDGE, KINDS, PLANE, VERTEX, feature_kind, register_kind
from tanteo.features.reframing import flip_edge, reframe, reframe_feature, reframe_near
from tanteo.geometry import SE3


def spd(rng, n, scale=1e-3):
    A = rng.normal(size=(n, n)) * scale
    return A @ A.T


def free_motion(kind, rng):
    xi = np.zeros(6)
    free = list(kind.free)
    translations = [i for i in free if i < 3]
    xi[translations] = rng.normal(size=len(translations))
    S = SE3.exp(xi)
    turn = np.zeros(6)
    turns = [i for i in free if i >= 3]
    turn[turns] = rng.normal(size=len(turns))
    return S @ SE3.exp(turn)


@pytest.mark.parametrize("kind", KINDS.values(), ids=str)
def test_binding_selects_and_free_rows_are_the_rest(kind):
    assert kind.B.shape == (kind.size, 6)
    np.testing.assert_array_equal(kind.B @ kind.B.T, np.eye(kind.size))
    assert sorted(kind.rows + kind.free) == list(range(6))


@pytest.mark.parametrize("kind", KINDS.values(), ids=str)
def test_reframed_perturbations_describe_the_same_feature(kind):
    """T exp(B'p) S and T S exp(B'p') differ by an unobserved direction of the feature only."""
    rng = np.random.default_rng(1)
    T, S, p = SE3.exp(rng.normal(size=6)), free_motion(kind, rng), 1e-6 * rng.normal(size=kind.size)
    moved, _ = reframe(kind, T, np.eye(kind.size), S)
    A = kind.B @ SE3.adjoint_inverse(S) @ kind.B.T
    gap = SE3.log(SE3.inverse(moved @ SE3.exp(kind.B.T @ (A @ p))) @ T @ SE3.exp(kind.B.T @ p) @ S)
    np.testing.assert_allclose(kind.B @ gap, 0, atol=1e-11)


def test_shape_and_direction_follow_from_the_free_rows():
    shapes = {name: (kind.shape, kind.axis) for name, kind in KINDS.items()}
    assert shapes["plane"] == ("plane", 2)
    assert (shapes["edge"], shapes["cylinder"]) == (("line", 0), ("line", 2))
    assert shapes["half_edge"] == ("line", None)
    assert shapes["vertex"] == shapes["sphere"] == ("point", None)
    assert (shapes["cone"], shapes["circle"]) == ((None, 2), (None, 2))


def test_round_kinds_are_axes_and_centres_to_others():
    aspects = {name: kind.aspects for name, kind in KINDS.items()}
    assert (aspects["plane"], aspects["edge"], aspects["vertex"]) == (("plane",), ("line",), ("point",))
    assert aspects["circle"] == aspects["cone"] == ("axis", "centre")
    assert (aspects["cylinder"], aspects["sphere"]) == (("axis",), ("centre",))


def test_a_name_is_registered_once():
    assert register_kind(EDGE) is EDGE
    with pytest.raises(InputError, match="'edge', which is taken"):
        register_kind(replace(EDGE, rows=(0, 1, 2)))


@pytest.mark.parametrize("kind", KINDS.values(), ids=str)
def test_reframing_there_and_back_is_the_identity(kind):
    rng = np.random.default_rng(2)
    T, P, S = SE3.exp(rng.normal(size=6)), spd(rng, kind.size), free_motion(kind, rng)
    T2, P2 = reframe(kind, *reframe(kind, T, P, S), SE3.inverse(S))
    np.testing.assert_allclose(T2, T, atol=1e-12)
    np.testing.assert_allclose(P2, P, rtol=1e-8, atol=1e-15)


def test_edge_slid_and_flipped_as_in_the_table():
    P = np.diag([1.0, 2.0, 3.0, 4.0])
    slide = np.eye(4)
    slide[0, 3] = 2.0
    _, slid = reframe(EDGE, np.eye(4), P, slide)
    assert slid[0, 0] == pytest.approx(1 + 4 * 4.0)  # dy' = dy + s dphi
    assert slid[1, 1] == pytest.approx(2 + 4 * 3.0)  # dz' = dz - s dtheta
    assert slid[1, 2] == pytest.approx(-2 * 3.0)
    T, flipped = reframe(EDGE, np.eye(4), P + 0.1, EDGE.symmetries[1])
    np.testing.assert_allclose(T, flip_edge(np.eye(4)))
    signs = np.array([-1, 1, -1, 1])
    np.testing.assert_allclose(flipped, (P + 0.1) * np.outer(signs, signs))


@pytest.mark.parametrize("kind", [VERTEX, EDGE, PLANE], ids=str)
def test_a_motion_that_moves_the_feature_is_refused(kind):
    xi = np.zeros(6)
    xi[kind.rows[0]] = 0.1
    with pytest.raises(InputError, match=kind.name):
        reframe(kind, np.eye(4), np.eye(kind.size), SE3.exp(xi))


def test_reframe_near_moves_the_origin_to_the_foot():
    rng = np.random.default_rng(3)
    for kind in (PLANE, EDGE):
        feature = Feature(kind, SE3.exp(rng.normal(size=6)), spd(rng, kind.size))
        point = rng.normal(size=3)
        near = reframe_near(feature, point)
        local = SE3.apply(SE3.inverse(near.T_world_feature), point)
        np.testing.assert_allclose(local[[i for i in kind.free if i < 3]], 0, atol=1e-12)
    vertex = Feature(VERTEX, np.eye(4), np.eye(3))
    assert reframe_near(vertex, point) is vertex


def test_a_shared_world_error_cancels_in_the_relative_location():
    rng = np.random.default_rng(4)
    base = SharedError("base", spd(rng, 6))
    features = []
    for _ in range(2):
        T = SE3.exp(rng.normal(size=6))
        jacobian = PLANE.B @ SE3.adjoint_inverse(T)
        features.append(Feature(PLANE, T, np.zeros((3, 3)), shared=(SharedTerm(base, jacobian),)))
    a, b = features
    # e12 = e2 - Ad(T12^-1) e1 over the rows that both planes resolve: the angle between the normals
    n1, n2 = a.T_world_feature[:3, 2], b.T_world_feature[:3, 2]
    w = np.cross(n1, n2)
    g1 = -np.r_[np.zeros(3), a.T_world_feature[:3, :3].T @ w]
    g2 = np.r_[np.zeros(3), b.T_world_feature[:3, :3].T @ w]
    alone = g1 @ feature_covariance(a) @ g1 + g2 @ feature_covariance(b) @ g2
    together = alone + 2 * g1 @ cross_covariance(a, b) @ g2
    assert alone > 1e-8
    assert abs(together) < 1e-12 * alone
    errors, C, shared_jacobian = collect_shared(features)
    assert [e.name for e in errors] == ["base"]
    np.testing.assert_allclose(
        PLANE.B.T @ shared_jacobian[0] @ C @ shared_jacobian[1].T @ PLANE.B, cross_covariance(a, b)
    )
    np.testing.assert_allclose(feature_covariance(reframe_feature(a, np.eye(4))), feature_covariance(a))


BAD_P = {
    "shape": np.eye(4),
    "nan": np.diag([1.0, np.nan, 1.0]),
    "asymmetric": np.eye(3) + np.triu(np.ones((3, 3)), 1),
    "negative": np.diag([1.0, -1e-3, 1.0]),
    "indefinite": np.array([[1, 2, 0], [2, 1, 0], [0, 0, 1.0]]),
}


@pytest.mark.parametrize("name", BAD_P)
def test_bad_covariances_are_refused(name):
    with pytest.raises(CovarianceError, match="expected"):
        Feature(PLANE, np.eye(4), BAD_P[name], label="top")


def test_bad_frames_and_kinds_are_refused():
    with pytest.raises(InputError, match="rigid motion"):
        Feature(PLANE, np.diag([1, 1, -1, 1.0]), np.eye(3))
    with pytest.raises(InputError, match="plane, edge, vertex"):
        feature_kind("face")


def test_arrays_are_read_only_copies():
    T = np.eye(4)
    feature = Feature(VERTEX, T, np.eye(3))
    T[0, 3] = 9
    assert feature.T_world_feature[0, 3] == 0
    with pytest.raises(ValueError, match="read-only"):
        feature.T_world_feature[0, 3] = 1


def test_whitened_errors_keep_their_order_and_do_not_mix():
    """Eigenvectors of all of them together would be sorted by size, whichever error they are of."""
    large = SharedError("robot base", np.diag([4e-6, 9e-6, 1e-6]))
    small = SharedError("tip", 1e-8 * np.array([[2.0, 1.0], [1.0, 2.0]]))
    same_name = SharedError("bias", np.array([[4e-6]]))
    root = shared_root([large, small, same_name])
    assert np.allclose(root @ root.T, stacked_covariance([large, small, same_name]), rtol=1e-12, atol=1e-20)
    assert np.allclose(root[:3, 3:], 0, atol=1e-15)
    assert np.allclose(root[3:5, 5:], 0, atol=1e-15)
    assert np.allclose(root[:3, :3], np.diag([2e-3, 3e-3, 1e-3]))


@pytest.mark.parametrize("name", ["plane", "edge", "vertex", "circle", "cylinder", "cone", "sphere"])
def test_a_kind_needs_as_many_points_as_it_has_parameters(name):
    """A point of a face states one number, on an edge two, at a corner three."""
    kind = KINDS[name]
    parameters = len(kind.rows) + bool(kind.size_name)
    assert kind.min_readings == -(-parameters // kind.faces)
