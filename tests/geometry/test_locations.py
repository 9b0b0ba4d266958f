"""Location vectors and their Jacobians: laws, central differences, gimbal lock."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tanteo import geometry
from tanteo.errors import DegenerateError
from tanteo.geometry import SE3, SO3

BATCHES = [(), (1,), (5,), (2, 3), (0,)]
H = 1e-6


def locations(seed, batch, tilt=1.3):
    rng = np.random.default_rng(seed)
    low, high = np.array([-2.0] * 3 + [-3.1, -tilt, -3.1]), np.array([2.0] * 3 + [3.1, tilt, 3.1])
    return rng.uniform(low, high, size=(*batch, 6))


def difference(x, y):
    """``x - y`` with angles modulo a turn."""
    d = np.asarray(x - y)
    d[..., 3:] = (d[..., 3:] + np.pi) % (2 * np.pi) - np.pi
    return d


def numeric_jacobian(f, x):
    columns = [difference(f(x + step), f(x - step)) / (2 * H) for step in H * np.eye(6)]
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("batch", BATCHES)
class TestLaws:
    def test_matrix_is_the_three_turns_in_order(self, batch):
        x = locations(1, batch)
        psi, theta, phi = np.moveaxis(x[..., 3:], -1, 0)
        turns = SO3.axis_rotation(2, phi) @ SO3.axis_rotation(1, theta) @ SO3.axis_rotation(0, psi)
        T = geometry.location.loc_to_matrix(x)
        assert T.shape == (*batch, 4, 4)
        np.testing.assert_allclose(SE3.rotation(T), turns, atol=1e-14)
        np.testing.assert_array_equal(SE3.translation(T), x[..., :3])

    def test_round_trip(self, batch):
        x = locations(2, batch)
        np.testing.assert_allclose(
            difference(geometry.location.matrix_to_loc(geometry.location.loc_to_matrix(x)), x), 0, atol=1e-13
        )

    def test_group_laws(self, batch):
        x, y = locations(3, batch), locations(4, batch)
        zero = np.zeros_like(x)
        left_inverse = geometry.location.compose_locations(geometry.location.invert_location(x), x)
        np.testing.assert_allclose(difference(left_inverse, zero), 0, atol=1e-13)
        back = geometry.location.compose_locations(x, geometry.location.relate_locations(x, y))
        np.testing.assert_allclose(difference(back, y), 0, atol=1e-12)
        T = geometry.location.loc_to_matrix(geometry.location.compose_locations(x, y))
        np.testing.assert_allclose(
            T, geometry.location.loc_to_matrix(x) @ geometry.location.loc_to_matrix(y), atol=1e-13
        )

    def test_rates(self, batch):
        x = locations(5, batch)
        E = geometry.location_jacobians.E_r(x)
        np.testing.assert_allclose(
            E @ geometry.location_jacobians.K_r(x), np.broadcast_to(np.eye(3), E.shape), atol=1e-14
        )
        Rt = SO3.inverse(SE3.rotation(geometry.location.loc_to_matrix(x)))
        for k, step in enumerate(H * np.eye(6)[3:]):
            ahead, minus = (Rt @ SE3.rotation(geometry.location.loc_to_matrix(x + s)) for s in (step, -step))
            rate = (SO3.log(ahead) - SO3.log(minus)) / (2 * H)
            np.testing.assert_allclose(E[..., :, k], rate, atol=1e-9)

    def test_composition_jacobians(self, batch):
        x1, x2 = locations(6, batch), locations(7, batch, tilt=0.2)
        x1[..., 4] *= 0.5  # keeps the composition away from gimbal lock for most, checked below
        keep = np.abs(np.cos(geometry.location.compose_locations(x1, x2)[..., 4])) > 0.1
        J1, J2 = geometry.location_jacobians.compose_jacobians(x1, x2)
        N1 = numeric_jacobian(lambda x: geometry.location.compose_locations(x, x2), x1)
        N2 = numeric_jacobian(lambda x: geometry.location.compose_locations(x1, x), x2)
        np.testing.assert_allclose(J1[keep], N1[keep], atol=1e-7)
        np.testing.assert_allclose(J2[keep], N2[keep], atol=1e-7)

    def test_jacobians_at_zero(self, batch):
        x, zero = locations(8, batch), np.zeros((*batch, 6))
        J2 = numeric_jacobian(lambda d: geometry.location.compose_locations(x, d), zero)
        J1 = numeric_jacobian(lambda d: geometry.location.compose_locations(d, x), zero)
        np.testing.assert_allclose(geometry.location_jacobians.J2_at_zero(x), J2, atol=1e-7)
        np.testing.assert_allclose(geometry.location_jacobians.J1_at_zero(x), J1, atol=1e-7)
        identity = np.broadcast_to(np.eye(6), J2.shape)
        np.testing.assert_allclose(
            geometry.location_jacobians.J2_at_zero(x) @ geometry.location_jacobians.J2_at_zero_inverse(x),
            identity,
            atol=1e-14,
        )
        np.testing.assert_allclose(geometry.location_jacobians.compose_jacobians(x, zero)[0], identity, atol=1e-12)
        np.testing.assert_allclose(geometry.location_jacobians.compose_jacobians(zero, x)[1], identity, atol=1e-12)

    def test_inverse_jacobian(self, batch):
        x = locations(9, batch, tilt=0.5)
        keep = np.abs(np.cos(geometry.location.invert_location(x)[..., 4])) > 0.1
        np.testing.assert_allclose(
            geometry.location_jacobians.J_ominus(x)[keep],
            numeric_jacobian(geometry.location.invert_location, x)[keep],
            atol=1e-7,
        )

    def test_differential_jacobians_carry_errors(self, batch):
        x, e = locations(10, batch), 1e-3 * locations(11, batch)
        T = geometry.location.loc_to_matrix(x)
        e_W = np.einsum("...ij,...j->...i", geometry.location_jacobians.differential_jacobian(x), e)
        np.testing.assert_allclose(SE3.exp(e_W) @ T, T @ SE3.exp(e), atol=1e-14)
        product = geometry.location_jacobians.differential_jacobian(
            x
        ) @ geometry.location_jacobians.differential_jacobian_inverse(x)
        np.testing.assert_allclose(product, np.broadcast_to(np.eye(6), product.shape), atol=1e-14)


@pytest.mark.parametrize("theta", [np.pi / 2, -np.pi / 2])
class TestGimbalLock:
    @pytest.mark.parametrize("off", [0.0, 1e-15, 1e-12, 1e-9, 1e-6])
    def test_matrix_survives(self, theta, off):
        x = locations(12, (50,))
        x[:, 4] = theta * (1 - off)
        T = geometry.location.loc_to_matrix(x)
        back = geometry.location.matrix_to_loc(T)
        np.testing.assert_allclose(geometry.location.loc_to_matrix(back), T, atol=3e-14)
        assert np.all(np.abs(back[:, 4]) <= np.pi / 2)

    def test_phi_is_zero_and_psi_is_the_documented_one(self, theta):
        x = locations(13, (20,))
        x[:, 4] = theta
        T = geometry.location.loc_to_matrix(x)
        back = geometry.location.matrix_to_loc(T)
        np.testing.assert_array_equal(back[:, 5], 0.0)
        np.testing.assert_allclose(back[:, 3], np.arctan2(-T[:, 1, 2], T[:, 1, 1]), atol=1e-15)

    def test_theta_keeps_its_digits(self, theta):
        x = np.zeros(6)
        x[4] = theta - np.sign(theta) * 1e-7
        assert abs(geometry.location.matrix_to_loc(geometry.location.loc_to_matrix(x))[4] - x[4]) < 1e-15

    def test_rates_are_refused(self, theta):
        x = locations(14, (3,))
        x[1, 4] = theta
        with pytest.raises(DegenerateError, match=r"theta: expected .* gimbal lock"):
            geometry.location_jacobians.K_r(x)
        with pytest.raises(DegenerateError):
            geometry.location_jacobians.location_covariance(x, np.eye(6))
        E = geometry.location_jacobians.E_r(x)  # the other way exists everywhere
        assert np.linalg.matrix_rank(E[1], tol=1e-12) == 2


def test_angles_agree_with_scipy():
    x = locations(15, (100,))
    expected = Rotation.from_euler("ZYX", x[:, :2:-1]).as_matrix()
    np.testing.assert_allclose(SE3.rotation(geometry.location.loc_to_matrix(x)), expected, atol=1e-14)


def test_location_covariance_against_sampling():
    rng = np.random.default_rng(16)
    x = np.array([0.3, -0.2, 0.5, 0.4, 0.7, -1.1])
    A = 2e-3 * rng.normal(size=(6, 6))
    frame = geometry.UncertainFrame(geometry.location.loc_to_matrix(x), A @ A.T)
    n = 20000
    eps = difference(geometry.location.matrix_to_loc(geometry.sample(frame, rng, (n,))), x)
    C = geometry.location_jacobians.location_covariance(x, frame.C)
    whitened = np.linalg.solve(np.linalg.cholesky(C), eps.T)
    # each entry of the sample covariance of n whitened draws has a s.d. of 1 / sqrt(n), or sqrt(2) of it
    np.testing.assert_allclose(np.cov(whitened), np.eye(6), atol=5 * np.sqrt(2 / n))
    np.testing.assert_allclose(geometry.location_jacobians.body_covariance(x, C), frame.C, atol=1e-18)
