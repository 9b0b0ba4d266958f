"""The laws of SO(3) and SE(3), over batch shapes and regimes (uniform, tiny, near pi)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3

BATCHES = [(), (1,), (7,), (2, 3), (0,)]
REGIMES = {
    "uniform": lambda rng: rng.uniform(0, np.pi - 1e-3),
    "tiny": lambda rng: 1e-8 * rng.uniform(0, 1),
    "series_edge": lambda rng: 1e-2 * rng.uniform(0.9, 1.1),
    "one": lambda rng: rng.uniform(0.95, 1.05),
    "near_pi": lambda rng: np.pi - 10 ** rng.uniform(-12, -3),
}


def tangents(rng, batch, regime):
    w = rng.standard_normal((*batch, 3))
    w /= np.linalg.norm(w, axis=-1, keepdims=True)
    angles = np.array([REGIMES[regime](rng) for _ in range(int(np.prod(batch)))]).reshape(batch)
    return np.concatenate([rng.normal(size=(*batch, 3)), w * angles[..., None]], axis=-1)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("regime", REGIMES)
class TestLaws:
    def test_log_inverts_exp(self, batch, regime):
        xi = tangents(np.random.default_rng(1), batch, regime)
        tolerance = 3e-8 if regime == "near_pi" else 1e-12  # at pi the matrix itself holds the angle to sqrt(eps)
        back = SE3.log(SE3.exp(xi))
        np.testing.assert_allclose(SE3.exp(back), SE3.exp(xi), atol=1e-12)
        np.testing.assert_allclose(back, xi, atol=tolerance)

    def test_rotation_agrees_with_scipy(self, batch, regime):
        w = tangents(np.random.default_rng(2), batch, regime)[..., 3:]
        expected = Rotation.from_rotvec(w.reshape(-1, 3)).as_matrix().reshape(*batch, 3, 3) if w.size else SO3.exp(w)
        np.testing.assert_allclose(SO3.exp(w), expected, atol=1e-15)

    def test_inverse_and_adjoint(self, batch, regime):
        rng = np.random.default_rng(3)
        T, xi = SE3.exp(tangents(rng, batch, regime)), 0.1 * rng.normal(size=(*batch, 6))
        np.testing.assert_allclose(T @ SE3.inverse(T), np.broadcast_to(np.eye(4), T.shape), atol=1e-14)
        moved = T @ SE3.exp(xi) @ SE3.inverse(T)
        np.testing.assert_allclose(SE3.exp(np.einsum("...ij,...j->...i", SE3.adjoint(T), xi)), moved, atol=1e-13)
        np.testing.assert_allclose(SE3.adjoint_inverse(T), SE3.adjoint(SE3.inverse(T)), atol=1e-14)

    def test_right_jacobian_against_differences(self, batch, regime):
        rng = np.random.default_rng(4)
        xi = tangents(rng, batch, regime)
        J, h = SE3.right_jacobian(xi), 1e-5
        T_inverse = SE3.inverse(SE3.exp(xi))
        for k, step in enumerate(h * np.eye(6)):
            column = SE3.log(T_inverse @ SE3.exp(xi + step)) - SE3.log(T_inverse @ SE3.exp(xi - step))
            np.testing.assert_allclose(J[..., k], column / (2 * h), atol=1e-8)
        np.testing.assert_allclose(SE3.right_jacobian_inverse(xi) @ J, np.eye(6) + 0 * J, atol=1e-11)
        J, inverse = SO3.right_jacobian(xi[..., 3:]), SO3.right_jacobian_inverse(xi[..., 3:])
        np.testing.assert_allclose(inverse @ J, np.eye(3) + 0 * J, atol=1e-11)

    def test_quaternion_round_trip(self, batch, regime):
        R = SO3.exp(tangents(np.random.default_rng(5), batch, regime)[..., 3:])
        q = SO3.as_quaternion(R)
        assert np.all(q[..., 0] >= 0)
        np.testing.assert_allclose(SO3.from_quaternion(q), R, atol=1e-14)


def test_exp_is_the_matrix_exponential():
    xi = np.array([0.3, -1.0, 0.2, 0.9, -0.4, 1.1])
    M = np.zeros((4, 4))
    M[:3, :3], M[:3, 3] = SO3.hat(xi[3:]), xi[:3]
    np.testing.assert_allclose(SE3.exp(xi), expm(M), atol=1e-14)
    np.testing.assert_allclose(SE3.adjoint(SE3.exp(xi)), expm(SE3.ad(xi)), atol=1e-13)


def test_vee_inverts_hat_and_takes_the_skew_part():
    w, rng = np.array([[1.0, -2.0, 3.0], [0.5, 0.2, -0.1]]), np.random.default_rng(0)
    S = rng.normal(size=(2, 3, 3))
    np.testing.assert_allclose(SO3.vee(SO3.hat(w) + S + np.swapaxes(S, -1, -2)), w, atol=1e-15)


def test_log_is_exact_at_pi():
    for axis in np.eye(3):
        R = 2 * np.outer(axis, axis) - np.eye(3)
        np.testing.assert_allclose(np.abs(SO3.log(R)), np.pi * axis, atol=1e-15)


def test_right_jacobian_is_smooth_at_the_series_border():
    direction = np.array([100.0, -50.0, 20.0, 0.6, 0.0, 0.8])
    below, above = SE3.right_jacobian(direction * (1 - 1e-13)), SE3.right_jacobian(direction * (1 + 1e-13))
    np.testing.assert_allclose(below, above, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_frame_from_axis(axis):
    d = np.random.default_rng(6).normal(size=(50, 3))
    R = SO3.frame_from_axis(d, axis)
    np.testing.assert_allclose(R[..., axis], d / np.linalg.norm(d, axis=-1, keepdims=True), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)


def test_align_finds_the_rotation_and_refuses_reflections():
    rng = np.random.default_rng(7)
    R = SO3.exp(rng.normal(size=(20, 3)))
    a = rng.normal(size=(20, 4, 3))
    np.testing.assert_allclose(SO3.align(a, SE3.apply(R[:, None], a)), R, atol=1e-12)
    assert np.allclose(np.linalg.det(SO3.align(a, a * [1, 1, -1])), 1.0)


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 0]])
def test_quaternion_without_direction_is_refused(bad):
    with pytest.raises(InputError, match="quaternion"):
        SO3.from_quaternion(np.array(bad, dtype=float))
