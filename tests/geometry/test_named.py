"""Covariances by other people's conventions: round trips, meaning by simulation, and gtsam itself when installed."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tanteo import geometry
from tanteo.errors import CovarianceError, InputError
from tanteo.geometry import ROS, SE3, SO3, UncertainFrame
from tanteo.geometry.named import GTSAM, SPATIAL, TANTEO, CovarianceConvention, NamedCovariance

ORDERS = ("x y z rx ry rz", "rx ry rz x y z")
EVERY = [CovarianceConvention(*c) for c in itertools.product(ORDERS, ("part", "world"), ("right", "left"))]
BATCHES = [(), (4,), (2, 3), (0,)]


def uncertain(seed, batch=(), sigma=1e-3):
    rng = np.random.default_rng(seed)
    A = sigma * rng.normal(size=(*batch, 6, 6))
    return UncertainFrame(SE3.exp(2 * rng.normal(size=(*batch, 6))), A @ np.swapaxes(A, -1, -2))


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("convention", EVERY)
class TestRoundTrips:
    def test_there_and_back(self, convention, batch):
        frame = uncertain(1, batch)
        named = geometry.named.name_covariance(frame, convention)
        assert named.convention == convention
        back = geometry.uncertain_frame(named)
        np.testing.assert_allclose(back.C, frame.C, atol=1e-13 * np.abs(frame.C).max(initial=1.0))
        np.testing.assert_array_equal(back.T, frame.T)

    def test_through_any_other(self, convention, batch):
        frame = uncertain(2, batch)
        for other in EVERY:
            named = geometry.named.convert_covariance(geometry.named.name_covariance(frame, convention), other)
            direct = geometry.named.name_covariance(frame, other)
            np.testing.assert_allclose(
                named.covariance, direct.covariance, atol=1e-12 * np.abs(direct.covariance).max(initial=1e-300)
            )


@pytest.mark.parametrize("batch", BATCHES)
def test_flat_forms(batch):
    frame = uncertain(3, batch)
    flat = geometry.as_ros_covariance(frame)
    assert flat.shape == (*batch, 36)
    tolerance = 1e-13 * np.abs(frame.C).max(initial=1.0)
    np.testing.assert_allclose(geometry.from_ros_covariance(frame.T, flat).C, frame.C, atol=tolerance)
    gtsam_like = geometry.named.as_gtsam_covariance(frame)
    np.testing.assert_allclose(geometry.named.from_gtsam_covariance(frame.T, gtsam_like).C, frame.C, atol=tolerance)


def errors_of(T, truth, convention):
    """Return the result of each convention for a true frame, written out from its definition."""
    if convention == TANTEO:
        return SE3.log(SE3.inverse(T) @ truth)
    if convention == GTSAM:
        xi = SE3.log(SE3.inverse(T) @ truth)
        return np.concatenate([xi[..., 3:], xi[..., :3]], axis=-1)
    if convention == SPATIAL:
        return SE3.log(truth @ SE3.inverse(T))
    turn = SO3.log(SE3.rotation(truth) @ SO3.inverse(SE3.rotation(T)))  # R' = exp(dw) R, about axes of the header
    return np.concatenate([SE3.translation(truth) - SE3.translation(T), turn], axis=-1)


@pytest.mark.parametrize("convention", [TANTEO, ROS, GTSAM, SPATIAL])
def test_gain_is_the_derivative_of_the_definition(convention):
    T, h = uncertain(4, (5,)).T, 1e-6
    G = geometry.named.convention_jacobian(T, convention)
    for k, step in enumerate(h * np.eye(6)):
        ahead, minus = (errors_of(T, T @ SE3.exp(s), convention) for s in (step, -step))
        np.testing.assert_allclose(G[..., k], (ahead - minus) / (2 * h), atol=1e-8)


@pytest.mark.parametrize("convention", [TANTEO, ROS, GTSAM, SPATIAL])
def test_meaning_by_sampling(convention):
    frame, rng, n = uncertain(5), np.random.default_rng(6), 20000
    errors = errors_of(frame.T, geometry.sample(frame, rng, (n,)), convention)
    C = geometry.named.name_covariance(frame, convention).covariance
    white = np.linalg.solve(np.linalg.cholesky(C), errors.T)
    np.testing.assert_allclose(white @ white.T / n, np.eye(6), atol=5 * np.sqrt(2 / n))


def test_ros_changes_header_frame_as_tf2_does():
    # tf2 and robot_localization carry the 36 numbers to another header with diag(R, R) on both sides
    frame, T_map_odom = uncertain(7), uncertain(8).T
    R = SE3.rotation(T_map_odom)
    block = np.block([[R, np.zeros((3, 3))], [np.zeros((3, 3)), R]])
    in_odom = geometry.as_ros_covariance(frame).reshape(6, 6)
    in_map = geometry.as_ros_covariance(UncertainFrame(T_map_odom @ frame.T, frame.C)).reshape(6, 6)
    np.testing.assert_allclose(block @ in_odom @ block.T, in_map, atol=1e-18)


def test_ros_rows_by_hand():
    # a part turned 90 degrees about z: its own x axis is the header's y axis
    T = SE3.from_parts(SO3.axis_rotation(2, np.pi / 2), np.array([5.0, 6.0, 7.0]))
    frame = UncertainFrame(T, np.diag([1.0, 2, 3, 4, 5, 6]))
    np.testing.assert_allclose(
        geometry.as_ros_covariance(frame).reshape(6, 6), np.diag([2.0, 1, 3, 5, 4, 6]), atol=1e-15
    )
    np.testing.assert_allclose(geometry.named.as_gtsam_covariance(frame), np.diag([4.0, 5, 6, 1, 2, 3]), atol=1e-15)


def test_roll_pitch_yaw_is_another_covariance():
    # it agrees with ROS' rotation vector only at zero pitch and yaw: the reason for two names
    C = np.diag([1e-6] * 3 + [1e-4, 2e-4, 3e-4])
    flat = np.array([0.1, 0.2, 0.3, 0.7, 0.0, 0.0])
    pitched = np.array([0.1, 0.2, 0.3, 0.7, 1.0, 0.5])
    for x, same in ((flat, True), (pitched, False)):
        frame = UncertainFrame(geometry.location.loc_to_matrix(x), C)
        ros = geometry.as_ros_covariance(frame).reshape(6, 6)
        assert np.allclose(geometry.location_jacobians.location_covariance(x, C), ros, atol=1e-12) == same


def test_refusals():
    with pytest.raises(InputError, match="frame: expected one of"):
        CovarianceConvention("x y z rx ry rz", "base", "right")
    with pytest.raises(InputError, match="order: expected one of"):
        CovarianceConvention("xyzrpy", "part", "right")
    with pytest.raises(CovarianceError, match="36 numbers"):
        geometry.from_ros_covariance(np.eye(4), np.zeros(35))
    with pytest.raises(CovarianceError, match="semidefinite"):
        NamedCovariance(np.eye(4), -np.eye(6), ROS)
    with pytest.raises(InputError, match="T: expected"):
        NamedCovariance(2 * np.eye(4), np.eye(6), ROS)


class TestAgainstGtsam:
    gtsam = None

    @pytest.fixture(autouse=True)
    def _installed(self):
        self.gtsam = pytest.importorskip("gtsam")

    def test_expmap_order(self):
        xi = np.random.default_rng(9).normal(size=6)
        ours = SE3.exp(np.roll(xi, 3))
        np.testing.assert_allclose(self.gtsam.Pose3.Expmap(xi).matrix(), ours, atol=1e-12)

    def test_relating_by_their_jacobians(self):
        a, b = uncertain(10), uncertain(11)
        H1, H2 = np.zeros((6, 6), order="F"), np.zeros((6, 6), order="F")
        pose = self.gtsam.Pose3(a.T).between(self.gtsam.Pose3(b.T), H1, H2)
        C1, C2 = geometry.named.as_gtsam_covariance(a), geometry.named.as_gtsam_covariance(b)
        ours = geometry.relate(a, b)
        np.testing.assert_allclose(pose.matrix(), ours.T, atol=1e-12)
        np.testing.assert_allclose(
            H1 @ C1 @ H1.T + H2 @ C2 @ H2.T, geometry.named.as_gtsam_covariance(ours), atol=1e-15
        )

    def test_marginal_of_a_prior(self):
        frame = uncertain(12)
        graph, values = self.gtsam.NonlinearFactorGraph(), self.gtsam.Values()
        noise = self.gtsam.noiseModel.Gaussian.Covariance(geometry.named.as_gtsam_covariance(frame))
        pose = self.gtsam.Pose3(frame.T)
        graph.add(self.gtsam.PriorFactorPose3(0, pose, noise))
        values.insert(0, pose)
        marginal = self.gtsam.Marginals(graph, values).marginalCovariance(0)
        back = geometry.named.from_gtsam_covariance(frame.T, 0.5 * (marginal + marginal.T))
        np.testing.assert_allclose(back.C, frame.C, atol=1e-9 * np.abs(frame.C).max())
