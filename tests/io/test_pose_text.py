"""Poses as controllers write them: read back within what rounding may change, covariances by simulation."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3, UncertainFrame, from_ros_covariance
from tanteo.io import BRANDS, pose_from_brand, read_prior, write_pose
from tanteo.io.poses import POSE_NAMES

NUMBER = re.compile(r"-?\d+\.\d+(?:[eE][-+]?\d+)?")


@pytest.fixture
def rng():
    return np.random.default_rng(35)


def random_frame(rng, sds=None):
    """Return a pose anywhere and a covariance with correlations."""
    A = rng.normal(size=(6, 6))
    C = A @ A.T / 6 + 0.2 * np.eye(6)
    scale = 10 ** rng.uniform(-7, -2, 2) if sds is None else np.array(sds)
    S = np.diag(np.repeat(scale, 3))
    return UncertainFrame(SE3.exp(rng.normal(size=6) * [1, 1, 1, 2, 2, 2]), S @ C @ S)


def least_sds(frame):
    return [np.sqrt(np.linalg.eigvalsh(block)[0]) for block in (frame.C[:3, :3], frame.C[3:, 3:])]


@pytest.mark.parametrize("name", [*BRANDS, "matrix"])
def test_read_back_within_a_hundredth_of_the_sd(name, rng):
    for _ in range(30):
        frame = random_frame(rng)
        pose = write_pose(name, frame)
        numbers = NUMBER.findall(pose.text.split("covariance")[0])
        if name == "matrix":
            T = np.eye(4)
            T[:3] = np.array(numbers, dtype=float).reshape(3, 4)
        else:
            T = pose_from_brand(name, np.array(numbers, dtype=float))
        place, turn = least_sds(frame)
        assert np.linalg.norm(T[:3, 3] - frame.T[:3, 3]) <= min(0.01 * place, 1e-6)
        assert np.linalg.norm(SO3.log(frame.T[:3, :3].T @ T[:3, :3])) <= min(0.01 * turn, 1e-6)
        assert len(pose.values) == (16 if name == "matrix" else len(BRANDS[name].fields))


def test_what_each_controller_reads():
    at = UncertainFrame(
        SE3.from_parts(SO3.axis_rotation(2, np.pi / 2), np.array([0.4, 0.2, 0])), np.diag([1e-8] * 3 + [1e-6] * 3)
    )
    texts = {name: write_pose(name, at).text for name in ("kuka", "ur", "abb", "fanuc", "denso", "staubli")}
    assert texts == {
        "kuka": "{X 400.000, Y 200.000, Z 0.000, A 90.00000, B 0.00000, C 0.00000}",
        "ur": "p[0.400000, 0.200000, 0.000000, 0.000000, 0.000000, 1.570796]",
        "abb": "[[400.000, 200.000, 0.000], [0.707107, 0.000000, 0.000000, 0.707107]]",
        "fanuc": "X = 400.000 mm, Y = 200.000 mm, Z = 0.000 mm, W = 0.00000 deg, P = 0.00000 deg, R = 90.00000 deg",
        "denso": "P(400.000, 200.000, 0.000, 0.00000, 0.00000, 90.00000)",
        "staubli": "{400.000, 200.000, 0.000, 0.00000, 0.00000, 90.00000}",
    }


def drawn(frame, count, rng):
    """Return poses drawn from the covariance, and their errors."""
    xi = rng.normal(size=(count, 6)) @ np.linalg.cholesky(frame.C).T
    return frame.T @ SE3.exp(xi)


def assert_covariance_of(sample, C):
    """Five standard deviations of an estimated covariance."""
    n = len(sample)
    found = sample.T @ sample / n
    spread = np.sqrt((np.outer(np.diag(C), np.diag(C)) + C**2) / n)
    assert (np.abs(found - C) < 5 * spread).all()


def test_ros_covariance_is_of_the_header_frame(rng):
    yaml = pytest.importorskip("yaml")
    frame = random_frame(rng, sds=(1e-3, 2e-3))
    message = yaml.safe_load(write_pose("ros", frame, "base_link").text)
    assert message["header"]["frame_id"] == "base_link"
    C = np.array(message["pose"]["covariance"], dtype=float).reshape(6, 6)
    Ts = drawn(frame, 40_000, rng)
    moved = Ts[:, :3, 3] - frame.T[:3, 3]
    turned = SO3.log(Ts[:, :3, :3] @ frame.T[:3, :3].T)
    assert_covariance_of(np.concatenate([moved, turned], axis=1), C)


def test_ros_is_what_a_prior_file_reads(rng, tmp_path):
    yaml = pytest.importorskip("yaml")
    frame = random_frame(rng, sds=(1e-3, 2e-3))
    pose = yaml.safe_load(write_pose("ros", frame).text)["pose"]
    values = [*pose["pose"]["position"].values(), *pose["pose"]["orientation"].values()]
    path = tmp_path / "prior.toml"
    path.write_text(f"[pose_prior]\nros = {values}\nros_covariance_m_rad = {pose['covariance']}\n", encoding="utf-8")
    prior = read_prior(path)
    np.testing.assert_allclose(prior.T_world_part, frame.T, atol=2e-6)
    np.testing.assert_allclose(prior.covariance, frame.C, atol=1e-4 * np.abs(frame.C).max())
    again = from_ros_covariance(frame.T, np.array(pose["covariance"], dtype=float))
    np.testing.assert_allclose(again.C, frame.C, rtol=1e-6, atol=1e-14)


def gtsam_numbers(text):
    """Pose and covariance of the Python text."""
    pose, covariance = text.split("covariance = ")
    T = np.vstack([np.array(NUMBER.findall(pose), dtype=float).reshape(3, 4), [0, 0, 0, 1]])
    rows = [line.strip(" [],").split(", ") for line in covariance.splitlines()[1:7]]
    return T, np.array(rows, dtype=float)


def test_gtsam_covariance_is_of_a_right_error_turn_first(rng):
    frame = random_frame(rng, sds=(1e-3, 2e-3))
    T, C = gtsam_numbers(write_pose("gtsam", frame).text)
    np.testing.assert_allclose(T, frame.T, atol=2e-6)
    xi = SE3.log(SE3.inverse(frame.T) @ drawn(frame, 40_000, rng))
    assert_covariance_of(np.roll(xi, 3, axis=1), C)


def test_gtsam_itself_reads_it(rng):
    gtsam = pytest.importorskip("gtsam")
    frame = random_frame(rng, sds=(1e-3, 2e-3))
    names: dict = {}
    exec(write_pose("gtsam", frame).text, names)
    np.testing.assert_allclose(names["pose"].matrix(), frame.T, atol=2e-6)
    np.testing.assert_allclose(names["noise"].covariance(), names["covariance"], rtol=1e-6, atol=1e-12)
    xi = rng.normal(size=6) * 1e-3
    other = names["pose"].compose(gtsam.Pose3.Expmap(xi))
    np.testing.assert_allclose(other.matrix(), names["pose"].matrix() @ SE3.exp(np.roll(xi, 3)), atol=1e-9)
    np.testing.assert_allclose(names["pose"].localCoordinates(other), xi, atol=1e-5)


def test_an_unknown_controller_is_named():
    with pytest.raises(InputError, match="Did you mean 'kuka'"):
        write_pose("kukka", UncertainFrame(np.eye(4), np.eye(6)))
    assert {"gtsam", "matrix", "denso", "epson"} <= set(POSE_NAMES)
