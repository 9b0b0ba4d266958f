"""Poses of a detector as a second opinion: hypotheses with broad errors that may be wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tanteo import _core, identify
from tanteo.errors import InputError
from tanteo.geometry import SE3, SO3
from tanteo.io.poses.detections_file import read_detections, write_detections
from tanteo.parts import read_part
from tanteo.posterior.detections import Detection, Detections, agreement, named
from tanteo.sensors import Readings

PARTS = Path(__file__).parents[2] / "examples" / "parts"
T = SE3.from_parts(SO3.axis_rotation(2, 0.4), np.array([0.1, 0.2, 0.0]))


@pytest.fixture(scope="module")
def parts():
    return [read_part(PARTS / f"{name}.step") for name in ("bracket_left", "bracket_right")]


@pytest.fixture(scope="module")
def few(parts):
    """Three touches on the top of the left bracket, which leave its pose open."""
    part, rng = parts[0], np.random.default_rng(1)
    corners = part.vertices[part.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rows = rng.choice(len(corners), 8, p=np.linalg.norm(normals, axis=1) / np.linalg.norm(normals, axis=1).sum())
    weights = rng.dirichlet(np.ones(3), 8)
    return Readings.from_columns(SE3.apply(T, np.einsum("nk,nkj->nj", weights, corners[rows])))


def test_a_detection_decides_what_touches_leave_open(parts, few):
    off = T @ SE3.exp(np.array([0.004, -0.003, 0.002, 0.02, -0.03, 0.02]))
    shares = []
    for found in ((), (Detection("bracket_left", 0.8, off),)):
        factors = (Detections(found, len(parts), 0.3),) if found else ()
        answer = identify(few, parts, sd=1e-4, factors=factors, conventions=False)
        near = [h for h in answer.hypotheses if np.linalg.norm((h.T_world_part - T)[:3, 3]) < 2e-3]
        shares.append(sum(h.probability for h in near if h.part == "bracket_left"))
    assert shares[1] >= shares[0]
    assert shares[1] > 0.5


def test_a_wrong_detection_loses_against_touches(parts):
    part, rng = parts[0], np.random.default_rng(2)
    corners = part.vertices[part.triangles]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    rows = rng.choice(len(corners), 24, p=areas / areas.sum())
    points = SE3.apply(T, np.einsum("nk,nkj->nj", rng.dirichlet(np.ones(3), 24), corners[rows]))
    wrong = Detection("bracket_right", 0.95, T)
    answer = identify(
        Readings.from_columns(points), parts, sd=1e-4, factors=(Detections((wrong,), 2, 0.3),), conventions=False
    )
    assert answer.best.part == "bracket_left"
    assert answer.best.probability > 0.9


def test_the_factor_is_a_normal_density_or_nothing(parts):
    """A right detection has a normal error, relative to any of two parts with an even density in the workspace."""
    one, radius = Detection("bracket_left", 0.5, T), 0.05
    found = Detections((one,), 2, radius)
    Ts = np.stack([T, T @ SE3.exp(np.array([0.5, 0, 0, 0, 0, 0]))])
    left, right = (_core.term_slopes(found.term(part, 0), Ts, np.zeros((2, 0)), np.zeros(3))[0] for part in parts)
    peak = (2 * np.pi) ** -3 / np.sqrt(np.linalg.det(one.covariance))
    even = 1 / ((2 * radius) ** 3 * 8 * np.pi**2)
    np.testing.assert_allclose(left, np.log([0.5 + 0.5 * 2 * peak / even, 0.5]), rtol=1e-6)
    np.testing.assert_allclose(right, np.log(0.5))
    assert found.log_unknown == pytest.approx(np.log(0.5))


def test_agreement_is_of_poses_of_one_part(parts):
    part = parts[0]
    one = Detection(part.name, 0.9, T)
    shift, turn, inside = agreement(one, part, T @ SE3.exp(np.array([0.005, 0, 0, 0, 0, 0])), 1e-8 * np.eye(6))
    assert shift == pytest.approx(0.005, rel=1e-6)
    assert turn == pytest.approx(0.0, abs=1e-9)
    assert inside
    assert not agreement(one, part, T @ SE3.exp(np.array([0.2, 0, 0, 0, 0, 0])), 1e-8 * np.eye(6))[2]


def test_files_of_detectors(tmp_path, parts):
    own = tmp_path / "own.json"
    own.write_text(json.dumps([
        {"part": "bracket_left", "score": 0.7, "matrix": T.tolist(), "sd_m": 0.002, "sd_rad": 0.02},
        {"part": "cup", "score": 0.2, "position_m": [0, 0, 1], "quaternion_wxyz": [1, 0, 0, 0]},
    ]))  # fmt: skip
    left, cup = read_detections(own)
    np.testing.assert_allclose(left.T_world_part, T)
    np.testing.assert_allclose(np.diag(left.covariance), [4e-6] * 3 + [4e-4] * 3)
    assert named((left, cup), parts) == ((left,), ("cup",))
    w, x, y, z = SO3.as_quaternion(T[:3, :3])
    pose = {
        "position": dict(zip("xyz", T[:3, 3].tolist(), strict=True)),
        "orientation": {"x": x, "y": y, "z": z, "w": w},
    }
    result = {
        "hypothesis": {"class_id": "bracket_left", "score": 0.7},
        "pose": {"pose": pose, "covariance": [0.0] * 36},
    }
    ros = tmp_path / "ros.json"
    ros.write_text(json.dumps({"header": {"frame_id": "base"}, "detections": [{"results": [result]}]}, default=float))
    (again,) = read_detections(ros)
    np.testing.assert_allclose(again.T_world_part, T, atol=1e-12)
    assert np.diag(again.covariance)[0] == pytest.approx(1e-4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[]", "a list of detections"),
        ('[{"part": "a"}]', "Add score"),
        ('[{"part": "a", "score": 2, "position_m": [0, 0, 0], "quaternion_wxyz": [1, 0, 0, 0]}]', "from 0 to 1"),
        ('[{"part": "a", "score": 1, "position_m": [0, 0], "quaternion_wxyz": [1, 0, 0, 0]}]', "3 finite numbers"),
        ('{"detections": [{"results": [{"score": 1}]}]}', "expected results with hypothesis"),
    ],
)
def test_bad_detections_are_named(tmp_path, text, words):
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(InputError, match=words):
        read_detections(file)


def test_written_answers_are_read_as_detections(parts, few, tmp_path):
    answer = identify(few, parts, sd=1e-4, conventions=False)
    file = tmp_path / "found.json"
    write_detections(file, [answer], "cell")
    document = json.loads(file.read_text())
    assert document["detections"][0]["header"]["frame_id"] == "cell"
    again = read_detections(file)
    assert [one.part for one in again] == [h.part for h in answer.hypotheses]
    assert len(again) > 1
    for one, h in zip(again, answer.hypotheses, strict=True):
        assert one.score == pytest.approx(h.probability)
        np.testing.assert_allclose(one.T_world_part, h.T_world_part, atol=1e-12)
        np.testing.assert_allclose(one.covariance, h.covariance, rtol=1e-6, atol=1e-12)
