"""Error models against the independent 60-digit vectors, finite differences and Monte Carlo."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.errors import InputError
from tanteo.geometry import SE3
from tanteo.sensors.noise import range_variance, sensed_point, sensor_error_cov
from tanteo.sensors.presets import sensor_preset

VECTORS = json.loads(Path(__file__).with_name("vectors.json").read_text())["vectors"]


def motion(x):
    """Location vector -> matrix, spelled out here so that the test owes nothing to the package."""
    (px, py, pz, psi, theta, phi) = x
    cx, sx, cy, sy, cz, sz = np.cos(psi), np.sin(psi), np.cos(theta), np.sin(theta), np.cos(phi), np.sin(phi)
    Rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    Ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    Rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return SE3.from_parts(Rz @ Ry @ Rx, np.array([px, py, pz]))


def relative_error(value, expected):
    expected = np.asarray(expected)
    return np.abs(value - expected).max() / np.abs(expected).max()


def of(fn):
    return pytest.mark.parametrize("v", [v for v in VECTORS if v["fn"] == fn], ids=lambda v: v["id"])


@of("range_variance")
def test_range_variance_vectors(v):
    assert relative_error(range_variance(**v["inputs"]), v["expected"]["var"]) <= v["rtol"]


@of("sensor_error_cov")
def test_sensor_error_cov_vectors(v):
    x = v["inputs"]
    T_rs, T_sf = motion(x["xRS"]), motion(x["xSF"])
    C = sensor_error_cov(T_rs, T_sf, np.array(x["Cr"]), np.array(x["Cd"]))
    assert relative_error(C, v["expected"]["cov"]) <= v["rtol"]
    np.testing.assert_allclose(T_rs @ T_sf, motion(v["expected"]["xRF"]), rtol=1e-11, atol=1e-11)


@of("sensed_point")
def test_sensed_point_vectors(v):
    x = v["inputs"]
    q, C = sensed_point(
        motion(x["xWR"]), motion(x["xRS"]), x["d"], cov_robot=np.array(x["Cr"]), cov_sensor=np.array(x["Cs"]),
        var_range=x["var_d"], cone_half_angle=x["gamma"],
    )  # fmt: skip
    assert relative_error(q, v["expected"]["q"]) <= v["rtol"]
    assert relative_error(C, v["expected"]["C"]) <= v["rtol"]


def test_the_vectors_are_there():
    assert sorted({v["fn"] for v in VECTORS}) == ["range_variance", "sensed_point", "sensor_error_cov"]
    assert len(VECTORS) == 13


def test_range_variance_broadcasts_and_refuses_grazing():
    d, beta = np.linspace(0.1, 1, 5)[:, None], np.array([0.0, 0.5])
    both = range_variance(d, beta, s0=1e-3, k1=0.01, k3=1e-3, s_rho=0.1, s_beta=0.05)
    assert both.shape == (5, 2)
    one = range_variance(d[3, 0], beta[1], s0=1e-3, k1=0.01, k3=1e-3, s_rho=0.1, s_beta=0.05)
    assert both[3, 1] == one
    with pytest.raises(InputError, match="expected an incidence below pi/2"):
        range_variance(0.1, np.pi / 2 + 0.01, s0=1e-3)


@pytest.mark.parametrize("batch", [(), (7,), (2, 3)])
def test_sensed_point_batches_equal_single(batch):
    rng = np.random.default_rng(1)
    T_wr, T_rs = SE3.exp(rng.normal(size=(*batch, 6))), SE3.exp(rng.normal(size=6))
    d = rng.uniform(0.1, 1, size=batch)
    C = np.diag(rng.uniform(1e-6, 1e-4, 6))
    q, cov = sensed_point(T_wr, T_rs, d, cov_robot=C, cov_sensor=2 * C, var_range=1e-6, cone_half_angle=0.1)
    assert q.shape == (*batch, 3)
    assert cov.shape == (*batch, 3, 3)
    for i in np.ndindex(*batch):
        q1, cov1 = sensed_point(T_wr[i], T_rs, d[i], cov_robot=C, cov_sensor=2 * C, var_range=1e-6, cone_half_angle=0.1)
        np.testing.assert_allclose(q1, q[i], rtol=0, atol=1e-15)
        np.testing.assert_allclose(cov1, cov[i], rtol=1e-12, atol=1e-18)


def test_sensed_point_covariance_against_monte_carlo():
    rng, n, gamma = np.random.default_rng(2), 40_000, 0.05
    T_wr, T_rs = SE3.exp(rng.normal(size=6)), SE3.exp(0.3 * rng.normal(size=6))
    A, B = 1e-3 * rng.normal(size=(6, 6)), 1e-3 * rng.normal(size=(6, 6))
    q, C = sensed_point(T_wr, T_rs, 0.4, cov_robot=A @ A.T, cov_sensor=B @ B.T, var_range=1e-6, cone_half_angle=gamma)
    T = T_wr @ SE3.exp(rng.normal(size=(n, 6)) @ A.T) @ T_rs @ SE3.exp(rng.normal(size=(n, 6)) @ B.T)
    turn, off = rng.uniform(0, 2 * np.pi, n), gamma * np.sqrt(rng.uniform(size=n))
    d = 0.4 + 1e-3 * rng.normal(size=n)
    ray = np.stack([d * off * np.cos(turn), d * off * np.sin(turn), d], axis=-1)
    e = SE3.apply(T, ray) - q
    nees = np.einsum("ni,ij,nj->n", e, np.linalg.inv(C), e).sum()
    low, high = chi2.ppf([0.0005, 0.9995], 3 * n)
    assert low < nees < high


def test_robot_and_mounting_errors_propagate_linearly():
    rng, h, d = np.random.default_rng(3), 1e-6, 0.4
    T_wr, T_rs = SE3.exp(rng.normal(size=(4, 6))), SE3.exp(rng.normal(size=6))
    ray, none = np.array([0, 0, d]), np.zeros((6, 6))
    A = rng.normal(size=(6, 6))
    steps = SE3.exp(h * np.concatenate([np.eye(6), -np.eye(6)]))
    of_robot = SE3.apply(T_wr[:, None] @ steps @ T_rs, ray)
    of_mounting = SE3.apply(T_wr[:, None] @ T_rs @ steps, ray)
    for moved, covs in ((of_robot, {"cov_robot": A @ A.T, "cov_sensor": none}),
                        (of_mounting, {"cov_robot": none, "cov_sensor": A @ A.T})):  # fmt: skip
        J = np.swapaxes(moved[:, :6] - moved[:, 6:], 1, 2) / (2 * h)
        _, C = sensed_point(T_wr, T_rs, d, var_range=0.0, **covs)
        np.testing.assert_allclose(C, J @ A @ A.T @ np.swapaxes(J, 1, 2), rtol=1e-7, atol=1e-8)


def test_range_noise_is_along_the_beam_and_the_cone_across_it():
    T, none = SE3.exp(np.array([0.1, 0.2, 0.3, 0.3, -0.2, 0.9])), np.zeros((6, 6))
    _, C = sensed_point(T, np.eye(4), 0.5, cov_robot=none, cov_sensor=none, var_range=4.0, cone_half_angle=4.0)
    a = T[:3, 2]
    np.testing.assert_allclose(C @ a, 4 * a, atol=1e-14)
    np.testing.assert_allclose(np.linalg.eigvalsh(C), [1, 1, 4], atol=1e-14)


def test_exponential_law_is_the_firmware_s():
    """Crazyflie zranger.c: 2.5 mm (1 + exp(k (d - 1))) with k from 0.2 m at 1.3 m."""
    preset = sensor_preset("vl53l0x")
    assert preset.law.sigma(1.0) == pytest.approx(0.005)
    assert preset.law.sigma(1.3) == pytest.approx(0.2 + 0.0025, rel=0.01)
    assert preset.law.sigma(0.2) == pytest.approx(0.0025, rel=1e-4)


def test_quadratic_and_proportional_laws_add_in_quadrature():
    sharp, st = sensor_preset("sharp_gp2y0a41sk0f"), sensor_preset("vl53l4cd")
    assert sharp.law.sigma(0.2) == pytest.approx(np.hypot(0.0003, 0.096 * 0.04))
    np.testing.assert_allclose(st.law.sigma(np.array([0.1, 1.0])), np.hypot(0.0015, [0.0003, 0.003]))
    assert sensor_preset("touch_probe_hobby").law.sigma(np.nan) == 8e-6
