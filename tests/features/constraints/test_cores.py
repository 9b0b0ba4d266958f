"""The array cores: gradients against differences, invariance, symmetry, batches, degenerate pairs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import tanteo.features as cs
from tanteo.errors import DegenerateError, InputError
from tanteo.features.kinds import EDGE, PLANE, VERTEX
from tanteo.features.reframing import reframe
from tanteo.geometry import SE3, SO3

SCALARS = {
    "angle_edges": (cs.angle_edges, EDGE, EDGE),
    "angle_planes": (cs.angle_planes, PLANE, PLANE),
    "angle_edge_plane": (cs.constraints.angle.angle_edge_plane, PLANE, EDGE),
    "intersect": (cs.intersect, EDGE, EDGE),
    "gap_edges": (cs.gap_edges, EDGE, EDGE),
    "point_plane_distance": (cs.constraints.point.point_plane_distance, PLANE, VERTEX),
    "point_edge_distance": (cs.constraints.point.point_edge_distance, EDGE, VERTEX),
}
VECTORS = {
    "coplanarity": (cs.coplanarity, PLANE, EDGE),
    "collinearity": (cs.collinearity, EDGE, EDGE),
    "parallel_edges": (lambda *a: cs.parallel_edges(*a).joint, EDGE, EDGE),
    "parallel_planes": (lambda *a: cs.parallel_planes(*a).joint, PLANE, PLANE),
}
ALL = SCALARS | VECTORS


def frames(rng, batch=()):
    return SE3.exp(np.concatenate([0.1 * rng.normal(size=(*batch, 3)), rng.normal(size=(*batch, 3))], axis=-1))


def covariance(kind, rng, batch=(), scale=1e-3):
    A = scale * rng.normal(size=(*batch, kind.size, kind.size + 2))
    return kind.B.T @ (A @ np.swapaxes(A, -1, -2)) @ kind.B


def rows(estimate):
    g1, g2 = estimate.g1, estimate.g2
    return (g1[..., None, :], g2[..., None, :]) if g1.ndim == np.ndim(estimate.value) + 1 else (g1, g2)


@pytest.mark.parametrize("name", ALL)
def test_gradients_match_differences(name):
    function, first, second = ALL[name]
    rng = np.random.default_rng(1)
    T1, T2 = frames(rng, (5,)), frames(rng, (5,))
    C1, C2 = covariance(first, rng), covariance(second, rng)
    g1, g2 = rows(function(T1, C1, T2, C2))
    h = 1e-6
    for k in range(6):
        step = SE3.exp(h * np.eye(6)[k])
        back = SE3.inverse(step)
        for g, ahead, minus in (
            (g1, (T1 @ step, C1, T2, C2), (T1 @ back, C1, T2, C2)),
            (g2, (T1, C1, T2 @ step, C2), (T1, C1, T2 @ back, C2)),
        ):
            slope = (function(*ahead).value - function(*minus).value) / (2 * h)
            np.testing.assert_allclose(g[..., k].reshape(slope.shape), slope, atol=2e-8 * max(1, np.abs(g).max()))


@pytest.mark.parametrize("name", ALL)
@pytest.mark.parametrize("batch", [(), (3,), (2, 3)])
def test_batches_equal_single_calls(name, batch):
    function, first, second = ALL[name]
    rng = np.random.default_rng(2)
    T1, T2 = frames(rng, batch), frames(rng, batch)
    C1, C2 = covariance(first, rng, batch), covariance(second, rng, batch)
    A = 1e-3 * rng.normal(size=(*batch, 6, 6))
    C12 = first.B.T @ first.B @ A @ second.B.T @ second.B
    together = function(T1, C1, T2, C2, C12)
    for k in np.ndindex(*batch):
        one = function(T1[k], C1[k], T2[k], C2[k], C12[k])
        np.testing.assert_allclose(together.value[k], one.value, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(rows(together)[1][k], rows(one)[1], rtol=1e-10, atol=1e-13)


def test_values_do_not_depend_on_free_placement_of_frames():
    rng = np.random.default_rng(3)
    for name in ("angle_edges", "angle_planes", "gap_edges", "point_plane_distance", "angle_edge_plane"):
        function, first, second = SCALARS[name]
        T1, T2, C1, C2 = frames(rng), frames(rng), covariance(first, rng), covariance(second, rng)
        before = function(T1, C1, T2, C2)
        U1, D1 = moved(first, T1, C1, rng)
        U2, D2 = moved(second, T2, C2, rng)
        after = function(U1, D1, U2, D2)
        np.testing.assert_allclose(after.value, before.value, rtol=1e-10, err_msg=name)
        np.testing.assert_allclose(after.variance, before.variance, rtol=1e-9, err_msg=name)


def moved(kind, T, C, rng):
    xi = np.zeros(6)
    xi[list(kind.free)] = rng.normal(size=len(kind.free)) * np.where(np.array(kind.free) < 3, 0.2, 1.0)
    turn = np.r_[np.zeros(3), xi[3:]]
    S = SE3.exp(np.r_[xi[:3], np.zeros(3)]) @ SE3.exp(turn)
    if kind is VERTEX:
        S = SE3.exp(turn)
    U, P = reframe(kind, T, kind.B @ C @ kind.B.T, S)
    return U, kind.B.T @ P @ kind.B


def test_joint_coplanarity_not_depend_on_where_edge_frame_sits():
    rng = np.random.default_rng(4)
    T1, T2, C1, C2 = frames(rng), frames(rng), covariance(PLANE, rng), covariance(EDGE, rng)
    before = cs.coplanarity(T1, C1, T2, C2)
    U2, D2 = moved(EDGE, T2, C2, rng)
    after = cs.coplanarity(T1, C1, U2, D2)
    np.testing.assert_allclose(
        cs.chi2_statistic(after.value, after.covariance), cs.chi2_statistic(before.value, before.covariance), rtol=1e-9
    )


def test_intersection_does_not_depend_on_spin_or_order():
    rng = np.random.default_rng(5)
    corner, u1, u2 = rng.normal(size=3), *rng.normal(size=(2, 3))
    T1 = SE3.from_parts(SO3.frame_from_axis(u1, 0), corner - 0.3 * u1 / np.linalg.norm(u1))
    T2 = SE3.from_parts(SO3.frame_from_axis(u2, 0), corner + 0.2 * u2 / np.linalg.norm(u2))
    C = covariance(EDGE, rng)
    spins = SE3.exp(np.array([[0, 0, 0, a, 0, 0] for a in np.linspace(0, 6, 7)]))
    s2 = cs.intersect(T1 @ spins, np.zeros((6, 6)), T2, C)
    np.testing.assert_allclose(s2.value, -0.2, atol=1e-12)
    np.testing.assert_allclose(s2.variance, s2.variance[0], rtol=1e-10)
    np.testing.assert_allclose(cs.intersect(T2, C, T1, C).value, 0.3, atol=1e-12)
    np.testing.assert_allclose(cs.gap_edges(T1, C, T2, C).value, 0, atol=1e-12)


@pytest.mark.parametrize("name", ["angle_edges", "angle_planes", "gap_edges"])
def test_exchanging_the_features_changes_nothing(name):
    function, first, second = SCALARS[name]
    rng = np.random.default_rng(6)
    T1, T2, C1, C2 = frames(rng), frames(rng), covariance(first, rng), covariance(second, rng)
    C12 = first.B.T @ first.B @ (1e-4 * rng.normal(size=(6, 6))) @ second.B.T @ second.B
    one, other = function(T1, C1, T2, C2, C12), function(T2, C2, T1, C1, C12.T)
    np.testing.assert_allclose(one.value, other.value, rtol=1e-10)
    np.testing.assert_allclose(one.variance, other.variance, rtol=1e-10)


@pytest.mark.parametrize("turn", [0.0, np.pi])
def test_parallel_pairs_are_refused_where_undefined(turn):
    C = covariance(EDGE, np.random.default_rng(7))
    T1 = np.eye(4)
    T2 = SE3.from_parts(np.diag([np.cos(turn), np.cos(turn), 1.0]), np.array([0.1, 0.2, 0.0]))
    for function in (cs.angle_edges, cs.intersect, cs.gap_edges):
        with pytest.raises(DegenerateError, match="parallel"):
            function(T1, C, T2, C)
    found = cs.parallel_edges(T1, C, T2, C)
    assert found.sign == np.cos(turn)
    np.testing.assert_allclose(found.tilt, 0, atol=1e-15)
    np.testing.assert_allclose(found.distance, 0.2)
    with pytest.raises(DegenerateError, match="parallel"):
        cs.angle_planes(T1, C, SE3.from_parts(np.diag([1.0, np.cos(turn), np.cos(turn)]), np.zeros(3)), C)


def test_coincident_features_are_refused_where_undefined():
    C = covariance(EDGE, np.random.default_rng(8))
    with pytest.raises(DegenerateError, match="coincident"):
        cs.parallel_edges(np.eye(4), C, SE3.from_parts(np.eye(3), np.array([0.3, 0, 0])), C)
    with pytest.raises(DegenerateError, match="coincident"):
        cs.constraints.point.point_distance(np.ones(3), np.ones(3), np.eye(3))
    with pytest.raises(DegenerateError, match="on it"):
        cs.constraints.point.point_edge_distance(np.eye(4), C, SE3.from_parts(np.eye(3), np.array([0.3, 0, 0])), C)
    with pytest.raises(DegenerateError, match="normal to the plane"):
        cs.constraints.angle.angle_edge_plane(np.eye(4), C, SE3.from_parts(np.eye(3)[[1, 2, 0]], np.zeros(3)), C)
    value = cs.collinearity(np.eye(4), C, SE3.from_parts(np.eye(3), np.array([0.3, 0, 0])), C).value
    np.testing.assert_array_equal(value, 0)


def test_right_angles_along_z_are_ordinary_pairs():
    """theta = pi/2 of the relative location: gimbal lock of the paper's formulas, nothing special here."""
    C = covariance(EDGE, np.random.default_rng(9))
    T2 = SE3.from_parts(SO3.exp(np.array([0, -np.pi / 2, 0])), np.array([0.1, 0.0, 0.2]))
    straight = cs.angle_edges(np.eye(4), C, T2, C)
    tilted = cs.angle_edges(np.eye(4), C, T2 @ SE3.exp(np.array([0, 0, 0, 0, 1e-7, 1e-7])), C)
    np.testing.assert_allclose(straight.value, np.pi / 2)
    np.testing.assert_allclose(tilted.variance, straight.variance, rtol=1e-5)


def test_mirror_images_have_other_signed_angles_only():
    u, v, n = np.eye(3)
    assert cs.constraints.angle.signed_angle(u, v, n) == pytest.approx(np.pi / 2)
    mirror = np.diag([1.0, -1.0, 1.0])
    assert cs.constraints.angle.signed_angle(mirror @ u, mirror @ v, n) == pytest.approx(-np.pi / 2)
    assert cs.constraints.angle.away_from_corner(u, np.array([0.1, 0, 0]), np.zeros(3))
    assert not cs.constraints.angle.away_from_corner(-u, np.array([0.1, 0, 0]), np.zeros(3))


def test_gate_of_many_model_values_and_of_vectors():
    model = np.linspace(-1, 1, 2001)
    found = cs.gate(0.1, 0.04, model, 0.05)
    np.testing.assert_allclose(found.D_M, 1.959963984540054)
    np.testing.assert_array_equal(found.accept, np.abs(model - 0.1) <= 0.2 * found.D_M)
    S = np.array([[4e-8, 1e-6], [1e-6, 1e-4]])
    values = np.array([[1e-4, 0.0], [5e-4, 0.02], [0.0, 0.0]])
    joint = cs.joint_gate(np.zeros(2), S, values, 0.05)
    np.testing.assert_allclose(joint.D2, np.einsum("ni,ij,nj->n", values, np.linalg.inv(S), values), rtol=1e-12)
    np.testing.assert_array_equal(joint.accept, joint.D2 <= 5.991464547107979)
    for wrong in ((0.0, 0.0, 1.0, 0.05), (0.0, 1.0, 1.0, 1.5)):
        with pytest.raises(InputError):
            cs.gate(*wrong)


def test_sidak_keeps_the_family_level():
    for k in (1, 10, 45):
        assert 1 - (1 - cs.sidak(0.05, k)) ** k == pytest.approx(0.05)
    with pytest.raises(InputError):
        cs.sidak(0.05, 0)


def test_joint_test_is_free_of_units_and_of_the_pose():
    rng = np.random.default_rng(10)
    H, f = rng.normal(size=(9, 6)), rng.normal(size=9)
    A = rng.normal(size=(9, 9))
    S = A @ A.T
    found = cs.joint_test(f, H, S)
    N = np.linalg.svd(H)[0][:, 6:]  # all combinations that no pose moves
    free = N.T @ f
    np.testing.assert_allclose(found.D2, free @ np.linalg.solve(N.T @ S @ N, free), rtol=1e-9)
    scale = 10.0 ** rng.integers(-3, 4, 9)
    scaled = cs.joint_test(scale * f, scale[:, None] * H, S * np.outer(scale, scale))
    np.testing.assert_allclose([scaled.D2, scaled.dof], [found.D2, 3], rtol=1e-8)
    first = cs.joint_test(f[:7], H[:7], S[:7, :7])
    alone = np.zeros((9, 9))
    alone[:7, :7], alone[7:, 7:] = S[:7, :7], S[7:, 7:]
    both = cs.constraints.joint.joint_update(first, f[7:], H[7:], S[7:, 7:])
    whole = cs.joint_test(f, H, alone)
    np.testing.assert_allclose([both.D2, *both.xi], [whole.D2, *whole.xi], rtol=1e-7)
    assert (both.dof, both.p_value) == (whole.dof, pytest.approx(whole.p_value))
    np.testing.assert_allclose(both.information, whole.information, rtol=1e-9)
    deficient = cs.joint_test(f, np.c_[H[:, :5], H[:, 4]], S)
    assert deficient.dof == 4


def test_the_evidence_is_the_integral_over_the_pose():
    """Of a linear problem Laplace's formula is exact: density under ``S + wide^2 H H'``, for a wide normal prior."""
    rng, wide = np.random.default_rng(11), 1e3
    H, f = rng.normal(size=(5, 2)), rng.normal(size=5)
    A = rng.normal(size=(5, 5))
    S = A @ A.T
    found = cs.joint_test(f, H, S)
    got = cs.constraints.joint.laplace_log_evidence(
        found.D2, np.linalg.slogdet(S)[1], 5, found.information, -np.log(2 * np.pi) - 2 * np.log(wide)
    )
    exact = multivariate_normal(np.zeros(5), S + wide**2 * H @ H.T).logpdf(f)
    assert got == pytest.approx(exact, abs=1e-4)


def test_height_and_pitch_have_covariance_of_their_derivatives():
    rng = np.random.default_rng(12)
    S = 1e-6 * np.array([[2.0, 1.1], [1.1, 1.0]])
    plane, edge = frames(rng), frames(rng)
    found = cs.coplanarity(plane, covariance(PLANE, rng), edge, covariance(EDGE, rng))
    found = replace(found, covariance=S)
    (height, pitch), C = cs.height_and_pitch(found)
    step = np.array([0.0, 1e-6])
    ahead, minus = (cs.height_and_pitch(replace(found, value=found.value + s * step))[0] for s in (1, -1))
    J = np.stack([[1.0, 0.0], (ahead - minus) / 2e-6], axis=1)
    np.testing.assert_allclose(C, J @ S @ J.T, rtol=1e-6)
    assert height == found.value[0]
    assert np.sin(pitch) == pytest.approx(-found.value[1])
