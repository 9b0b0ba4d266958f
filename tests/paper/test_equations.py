"""One test per numbered equation of Montano and Sagues (1991): what it states, held against the package.

An equation that is right must come out of ours; one that is wrong is reproduced as printed, and the test shows both.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

import tanteo.features as cs
from tanteo.errors import DegenerateError
from tanteo.features.constraints import published
from tanteo.features.kinds import EDGE, PLANE
from tanteo.geometry import SE3, SO3, relate_arrays
from tanteo.geometry.location import matrix_to_loc
from tanteo.geometry.location_jacobians import (
    J1_at_zero,
    J2_at_zero,
    differential_jacobian,
    differential_jacobian_inverse,
    location_covariance,
)
from tanteo.sensors.noise import sensor_error_cov

H = 1e-6


def frames(seed, n=2):
    rng = np.random.default_rng(seed)
    return SE3.exp(np.c_[0.1 * rng.normal(size=(n, 3)), 0.7 * rng.normal(size=(n, 3))])


def covariance(kind, seed):
    A = 1e-3 * np.random.default_rng(seed).normal(size=(kind.size, kind.size + 2))
    return kind.B.T @ A @ A.T @ kind.B


def slopes(function, T1, T2):
    """Return numeric derivatives of a function of two frames over both body errors."""
    steps = [SE3.exp(H * np.eye(6)[k]) for k in range(6)]
    g1 = [(function(T1 @ s, T2) - function(T1 @ SE3.inverse(s), T2)) / (2 * H) for s in steps]
    g2 = [(function(T1, T2 @ s) - function(T1, T2 @ SE3.inverse(s))) / (2 * H) for s in steps]
    return np.array(g1), np.array(g2)


def variance_by_differences(function, T1, C1, T2, C2):
    g1, g2 = slopes(function, T1, T2)
    return g1 @ C1 @ g1 + g2 @ C2 @ g2


def corner(spin=0.6, angle=1.1):
    """Two edges that meet, the z axis of the first turned ``spin`` off the common normal."""
    T = frames(20, 1)[0]
    T1 = T @ SE3.from_parts(SO3.axis_rotation(0, spin), np.zeros(3)) @ SE3.exp(np.r_[-0.03, np.zeros(5)])
    T2 = T @ SE3.from_parts(SO3.axis_rotation(2, angle), np.zeros(3)) @ SE3.exp(np.r_[0.02, 0, 0, 0.4, 0, 0])
    return T1, T2


def test_section_2_errors_move_by_differential_jacobians():
    T = frames(1, 1)[0]
    x = matrix_to_loc(T)
    e_F = 1e-7 * np.arange(1.0, 7.0)
    e_W = differential_jacobian(x) @ e_F
    np.testing.assert_allclose(SE3.exp(e_W) @ T, T @ SE3.exp(e_F), atol=1e-12)
    np.testing.assert_allclose(differential_jacobian_inverse(x) @ e_W, e_F, rtol=1e-12)


def test_equation_01_the_error_of_the_feature_stays_on_the_right():
    T_RW, T_WF = frames(2)
    e = 1e-3 * np.arange(6.0)
    np.testing.assert_allclose(T_RW @ (T_WF @ SE3.exp(e)), (T_RW @ T_WF) @ SE3.exp(e), atol=1e-15)


def test_equation_02_robot_and_device_errors_add_in_the_feature():
    T_RS, T_SF = frames(3)
    rng = np.random.default_rng(3)
    e_r, e_d = 1e-7 * rng.normal(size=(2, 6))
    e_F = SE3.log(SE3.inverse(T_RS @ T_SF) @ SE3.exp(e_r) @ T_RS @ SE3.exp(e_d) @ T_SF)
    J_r, J_d = SE3.adjoint_inverse(T_RS @ T_SF), SE3.adjoint_inverse(T_SF)
    np.testing.assert_allclose(e_F, J_r @ e_r + J_d @ e_d, atol=1e-13)
    np.testing.assert_allclose(
        sensor_error_cov(T_RS, T_SF, np.outer(e_r, e_r), np.outer(e_d, e_d)),
        np.outer(J_r @ e_r, J_r @ e_r) + np.outer(J_d @ e_d, J_d @ e_d),
        rtol=1e-9,
        atol=1e-30,
    )


def test_equation_03_the_direction_rises_over_the_plane():
    T_S, T_E = frames(4)
    found = cs.coplanarity(T_S, np.zeros((6, 6)), T_E, np.zeros((6, 6)))
    assert found.value[1] == pytest.approx(T_S[:3, 2] @ T_E[:3, 0])


def test_equation_04_the_origin_is_over_the_plane():
    T_S, T_E = frames(4)
    found = cs.coplanarity(T_S, np.zeros((6, 6)), T_E, np.zeros((6, 6)))
    assert found.value[0] == pytest.approx(T_S[:3, 2] @ (T_E[:3, 3] - T_S[:3, 3]))


def test_equation_05_printed_variances_hold_for_one_spin_of_edge():
    T_S, C_S, C_E = frames(5, 1)[0], covariance(PLANE, 5), covariance(EDGE, 6)
    for psi in (0.0, 1.0):
        T_E = T_S @ SE3.from_parts(SO3.axis_rotation(2, 0.3) @ SO3.axis_rotation(0, psi), np.array([0.1, 0.2, 0]))
        value, right = cs.height_and_pitch(cs.coplanarity(T_S, C_S, T_E, C_E))
        printed = published.coplanarity(T_S, C_S, T_E, C_E)
        np.testing.assert_allclose(printed[0], value, atol=1e-15)
        for k, entry in ((0, 2), (1, 4)):
            truth = variance_by_differences(
                lambda a, b, entry=entry: matrix_to_loc(SE3.inverse(a) @ b)[entry], T_S, C_S, T_E, C_E
            )
            assert right[k, k] == pytest.approx(truth, rel=1e-6)
            assert (printed[1][k, k] == pytest.approx(truth, rel=1e-6)) == (psi == 0)


def test_equation_06_three_equations_meet_in_the_corner():
    T1, T2 = corner()
    R, p = cs.relative(T1, T2).R, cs.relative(T1, T2).p
    s = cs.intersect(T1, np.zeros((6, 6)), T2, np.zeros((6, 6))).value
    np.testing.assert_allclose((R[:, 0] * s + p)[1:], 0, atol=1e-15)


@pytest.mark.parametrize("number", ["07", "08", "09"])
def test_equations_07_to_09_give_one_abscissa_where_edges_meet(number):
    T1, T2 = corner()
    none = np.zeros((6, 6))
    printed = {
        "07": lambda: -cs.relative(T1, T2).p[1] / cs.relative(T1, T2).R[1, 0],
        "08": lambda: published.abscissa_y(T1, none, T2, none).value,
        "09": lambda: published.abscissa_z(T1, none, T2, none).value,
    }[number]()
    assert printed == pytest.approx(cs.intersect(T1, none, T2, none).value)


def test_equation_09_is_singular_for_a_coplanar_frame():
    T1, T2 = corner(spin=1e-3)
    C = covariance(EDGE, 7)
    assert published.abscissa_z(T1, C, T2, C).variance > 1e3 * cs.intersect(T1, C, T2, C).variance
    flat = SE3.from_parts(SO3.axis_rotation(2, 1.0), np.array([0.1, 0.2, 0.0]))
    with pytest.raises(DegenerateError, match="equation 9"):
        published.abscissa_z(np.eye(4), C, flat, C)


def test_equation_10_jacobian_at_zero_linearizes_body_error():
    T = SE3.exp(np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6]))
    e = 1e-6 * np.arange(1.0, 7.0)
    x = matrix_to_loc(T)
    np.testing.assert_allclose(matrix_to_loc(T @ SE3.exp(e)) - x, J2_at_zero(x) @ e, atol=1e-10)


def test_equation_11_the_derivative_of_9_by_the_location():
    x = np.array([0.1, -0.05, 0.03, 0.4, 0.7, -0.9])

    def function(v):
        return v[2] / np.sin(v[4])

    g = [(function(x + H * k) - function(x - H * k)) / (2 * H) for k in np.eye(6)]
    sine, cosine = np.sin(x[4]), np.cos(x[4])
    np.testing.assert_allclose(g, [0, 0, 1 / sine, 0, -x[2] * cosine / sine**2, 0], atol=1e-9)


def test_equation_12_the_variance_of_the_corner():
    T1, T2 = corner()
    C1, C2 = covariance(EDGE, 9), covariance(EDGE, 10)
    zero = np.zeros((6, 6))
    for function in (published.abscissa_z, published.abscissa_y, cs.intersect):
        truth = variance_by_differences(lambda a, b, f=function: f(a, zero, b, zero).value, T1, C1, T2, C2)
        assert function(T1, C1, T2, C2).variance == pytest.approx(truth, rel=1e-6)
    # of (12) as a 6 x 6 matrix only one number is not zero: "far from singularities" holds for P, not for it
    assert cs.intersect(T1, C1, T2, C2).variance < 0.9 * published.abscissa_z(T1, C1, T2, C2).variance


def length_frames():
    T_E = frames(11, 1)[0]
    ends = ((-0.02, 1.2, 0.8), (0.03, 2.0, 1.3))
    A, B = (
        T_E
        @ SE3.exp(np.r_[s, np.zeros(5)])
        @ SE3.from_parts(SO3.axis_rotation(2, turn) @ SO3.axis_rotation(0, spin), np.zeros(3))
        for s, turn, spin in ends
    )
    return A, T_E, B


def test_equation_13_the_length_is_the_distance_of_the_corners():
    A, E, B = length_frames()
    assert cs.edge_length(A, E, B, np.zeros((18, 18))).value == pytest.approx(0.05)
    corners = SE3.apply(E, np.array([[-0.02, 0, 0], [0.03, 0, 0]]))
    assert cs.constraints.point.point_distance(*corners, np.eye(3)).value == pytest.approx(0.05)


def test_equation_14_error_of_length_is_linear_in_small_errors():
    A, E, B = length_frames()
    e = 1e-6 * np.random.default_rng(12).normal(size=(3, 6))
    found = cs.edge_length(A, E, B, np.zeros((18, 18)))
    moved = cs.edge_length(A @ SE3.exp(e[0]), E @ SE3.exp(e[1]), B @ SE3.exp(e[2]), np.zeros((18, 18)))
    assert moved.value - found.value == pytest.approx(found.gradient @ e.ravel(), rel=1e-4)


def test_equation_15_printed_variance_counts_common_edge_twice():
    A, E, B = length_frames()
    across = EDGE.B.T @ np.diag([1e-5, 1e-8, 1e-8, 1e-8]) @ EDGE.B  # the middle edge is poorly known across
    C = [covariance(EDGE, 13), across, covariance(EDGE, 15)]
    joint = np.zeros((18, 18))
    for k in range(3):
        joint[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] = C[k]
    each = (A, C[0], E, C[1], B, C[2])
    printed, once = published.edge_length(*each), published.edge_length_shared(*each)
    ends = published.abscissa_z(A, C[0], E, C[1]), published.abscissa_z(B, C[2], E, C[1])
    assert printed.variance == pytest.approx(ends[0].variance + ends[1].variance)

    def by_z(e):
        move = [SE3.exp(e[6 * k : 6 * k + 6]) for k in range(3)]
        return published.edge_length(A @ move[0], C[0], E @ move[1], C[1], B @ move[2], C[2]).value

    g = np.array([(by_z(H * k) - by_z(-H * k)) / (2 * H) for k in np.eye(18)])
    assert once.variance == pytest.approx(g @ joint @ g, rel=1e-6)
    assert printed.variance != pytest.approx(once.variance, rel=0.1)


def test_equation_16_the_angle_of_edges():
    T1, T2 = corner()
    none = np.zeros((6, 6))
    assert cs.angle_edges(T1, none, T2, none).value == pytest.approx(1.1)
    assert published.angle_edges(T1, none, T2, none).value == pytest.approx(1.1)


@pytest.mark.parametrize("number", ["17", "18"])
def test_equations_17_and_18_variance_is_right_as_printed(number):
    T1, T2 = frames(16)
    C1, C2 = covariance(EDGE, 17), covariance(EDGE, 18)
    zero = np.zeros((6, 6))
    found = cs.angle_edges(T1, C1, T2, C2)
    truth = variance_by_differences(lambda a, b: cs.angle_edges(a, zero, b, zero).value, T1, C1, T2, C2)
    assert found.variance == pytest.approx(truth, rel=1e-6)
    assert published.angle_edges(T1, C1, T2, C2).variance == pytest.approx(found.variance, rel=1e-10)
    if number == "17":  # F1 and F2
        g1, g2 = slopes(lambda a, b: cs.angle_edges(a, zero, b, zero).value, T1, T2)
        np.testing.assert_allclose([found.g1, found.g2], [g1, g2], atol=1e-8)


def test_equation_19_the_angle_of_planes():
    T1, T2 = frames(19)
    C1, C2 = covariance(PLANE, 20), covariance(PLANE, 21)
    found, printed = cs.angle_planes(T1, C1, T2, C2), published.angle_planes(T1, C1, T2, C2)
    assert found.value == pytest.approx(np.arccos(T1[:3, 2] @ T2[:3, 2]))
    np.testing.assert_allclose([printed.value, printed.variance], [found.value, found.variance], rtol=1e-9)


@pytest.mark.parametrize("number", ["20", "21"])
def test_equations_20_and_21_have_no_variance_where_they_hold(number):
    C1, C2 = covariance(EDGE, 22), covariance(EDGE, 23)
    T1, T2 = np.eye(4), SE3.from_parts(np.eye(3), np.array([0.1, 0.05, 0.0]))
    cosine, _ = published.parallel_edges(T1, C1, T2, C2)
    if number == "20":
        assert cosine.value == 1
    assert cosine.variance == 0  # 0 / 0 in the test
    found = cs.parallel_edges(T1, C1, T2, C2)
    assert np.linalg.eigvalsh(found.tilt_covariance).min() > 0
    tilted = T2 @ SE3.exp(np.array([0, 0, 0, 0, 2e-3, 3e-3]))
    np.testing.assert_allclose(cs.parallel_edges(T1, C1, tilted, C2).tilt, [3e-3, -2e-3], rtol=1e-3)


@pytest.mark.parametrize("number", ["22", "23"])
def test_equations_22_and_23_planes_likewise(number):
    C1, C2 = covariance(PLANE, 24), covariance(PLANE, 25)
    opposite = SE3.from_parts(SO3.axis_rotation(0, np.pi), np.array([0.1, 0.0, -0.02]))
    cosine, _ = published.parallel_planes(np.eye(4), C1, opposite, C2)
    if number == "22":
        assert cosine.value == pytest.approx(-1)
    assert cosine.variance == pytest.approx(0, abs=1e-30)
    found = cs.parallel_planes(np.eye(4), C1, opposite, C2)
    assert found.sign == -1
    assert found.distance == pytest.approx(-0.02, abs=1e-9)  # minus the thickness


def test_section_4_4_distance_of_edges_is_right_at_given_origins():
    C1, C2 = covariance(EDGE, 26), covariance(EDGE, 27)
    T2 = SE3.from_parts(np.eye(3), np.array([0.1, 0.03, 0.04]))
    found, (_, printed) = cs.parallel_edges(np.eye(4), C1, T2, C2), published.parallel_edges(np.eye(4), C1, T2, C2)
    assert printed.value == pytest.approx(0.05)
    assert printed.variance == pytest.approx(found.joint.covariance[2, 2])
    assert found.variance < printed.variance


def test_equation_24_the_sign_of_the_offset_is_lost():
    C = covariance(PLANE, 28)
    T2 = SE3.from_parts(np.eye(3), np.array([0.0, 0.0, -0.03]))
    _, printed = published.parallel_planes(np.eye(4), C, T2, C)
    found = cs.parallel_planes(np.eye(4), C, T2, C)
    assert printed.value == pytest.approx(0.03)
    assert found.joint.value[2] == pytest.approx(-0.03)
    assert printed.variance == pytest.approx(found.joint.covariance[2, 2])


def test_equation_25_the_gate():
    model = np.linspace(0, 1, 101)
    found = cs.gate(0.5, 0.01, model, 0.05)
    assert pytest.approx(np.sqrt(special.chdtri(1, 0.05))) == found.D_M
    np.testing.assert_array_equal(found.accept, np.abs(model - 0.5) <= np.sqrt(0.01) * found.D_M)


def test_equation_26_the_relative_error_has_a_minus():
    T1, T2 = frames(29)
    e1, e2 = 1e-7 * np.random.default_rng(29).normal(size=(2, 6))
    T12 = SE3.inverse(T1) @ T2
    e12 = SE3.log(SE3.inverse(T12) @ SE3.inverse(T1 @ SE3.exp(e1)) @ T2 @ SE3.exp(e2))
    J = SE3.adjoint_inverse(T12)
    np.testing.assert_allclose(e12, e2 - J @ e1, atol=1e-13)
    C12 = np.outer(e1, e2)
    cov = relate_arrays(T1, np.outer(e1, e1), T2, np.outer(e2, e2), C12)[1]
    np.testing.assert_allclose(cov, np.outer(e12, e12), rtol=1e-4, atol=1e-20)


def test_equation_27_error_does_not_exist_at_90_degrees():
    T12 = SE3.from_parts(SO3.axis_rotation(1, np.pi / 2), np.zeros(3))
    with pytest.raises(DegenerateError, match="gimbal lock"):
        location_covariance(matrix_to_loc(T12), np.eye(6))
    C = covariance(EDGE, 30)
    # scalar constraints do not go through it; nor, with cos(theta) cancelled, do the published ones
    right, printed = cs.angle_edges(np.eye(4), C, T12, C), published.angle_edges(np.eye(4), C, T12, C)
    assert printed.variance == pytest.approx(right.variance)


def test_equation_28_the_error_of_six_numbers_from_body_error():
    T12 = frames(31, 1)[0]
    x = matrix_to_loc(T12)
    np.testing.assert_allclose(
        location_covariance(x, np.eye(6)), J2_at_zero(x) @ J2_at_zero(x).T, rtol=1e-12, atol=1e-15
    )
    assert J1_at_zero(x).shape == (6, 6)
