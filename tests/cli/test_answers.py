"""The complete path from files to answer: a known part at a known pose is found within the stated covariance."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from tanteo.geometry import SE3
from tanteo.io import write_readings
from tanteo.sensors import Readings

EXAMPLES = Path(__file__).parents[2] / "examples"
SD = 5e-5
T_WORLD_PART = SE3.exp(np.array([0.3, -0.1, 0.2, 0.4, -0.3, 0.8]))


def touch(triangles, rng, per_face=5, skip=()):
    """Labelled touches on the faces of a mesh given in mm; coplanar neighbours are one face."""
    corners = triangles * 1e-3
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.einsum("ni,ni->n", normals, corners[:, 0])
    keys = [tuple(key) for key in np.round(np.column_stack([normals, offsets * 1e3]), 6) + 0.0]
    points, labels, aims = [], [], []
    for number, key in enumerate(dict.fromkeys(keys)):
        if number in skip:
            continue
        members = [i for i, k in enumerate(keys) if k == key]
        weights = rng.dirichlet([1, 1, 1], size=per_face)
        on = np.einsum("pk,pki->pi", weights, corners[rng.choice(members, per_face)])
        points.append(on + SD * rng.normal(size=on.shape))
        labels += [f"F{number}"] * per_face
        aims += [-normals[members[0]]] * per_face
    world = SE3.apply(T_WORLD_PART, np.concatenate(points))
    directions = SE3.apply(T_WORLD_PART[:3, :3], np.array(aims))
    n = len(labels)
    return Readings.from_columns(
        world, directions=directions, features=labels, kinds=["plane"] * n, sds=np.full(n, SD), source="made"
    )


@pytest.fixture
def answer(run, tmp_path, parts, wedge):
    def respond(seed=0, skip=(), **options):
        readings = touch(wedge, np.random.default_rng(seed), skip=skip)
        write_readings(readings, tmp_path / "r.csv")
        extra = [word for name, value in options.items() for word in (f"--{name}", value)]
        result = run("identify", tmp_path / "r.csv", "--parts", parts, "--units", "mm", "--json", *extra)
        return result, json.loads(result.out, parse_constant=pytest.fail)

    return respond


def test_a_wedge_is_recognized_where_it_is(answer):
    result, document = answer()
    assert (result.code, document["status"]) == (0, "recognized")
    best = document["hypotheses"][0]
    assert best["part"] == "wedge"
    assert best["probability"] > 0.99
    assert sum(h["probability"] for h in document["hypotheses"]) + document["unknown_probability"] == pytest.approx(1)
    xi = SE3.log(SE3.inverse(np.array(best["pose"]["matrix"])) @ T_WORLD_PART)
    C = np.array(best["covariance"]["matrix"])
    assert xi @ np.linalg.solve(C, xi) < chi2.ppf(0.9999, 6)
    assert best["corner_sd_m"] < 1e-3


def test_the_pose_error_follows_the_covariance(answer):
    """NEES over 20 runs within its chi-square interval."""
    total = 0.0
    for seed in range(20):
        best = answer(seed)[1]["hypotheses"][0]
        xi = SE3.log(SE3.inverse(np.array(best["pose"]["matrix"])) @ T_WORLD_PART)
        total += xi @ np.linalg.solve(np.array(best["covariance"]["matrix"]), xi)
    low, high = chi2.ppf([0.0005, 0.9995], 6 * 20)
    assert low < total < high


def test_the_same_seed_gives_the_same_answer(answer):
    first, second = answer(3)[1], answer(3)[1]
    first.pop("elapsed_s"), second.pop("elapsed_s")
    assert first == second


def test_one_face_is_not_enough(answer):
    result, document = answer(skip=range(1, 6))
    assert result.code == 3
    assert document["status"] in ("insufficient", "ambiguous")
    assert result.err.startswith(document["status"])


def test_a_robot_s_base_error_widens_the_pose(answer):
    alone = np.array(answer()[1]["hypotheses"][0]["covariance"]["matrix"])
    shared = np.array(answer(robot="xarm")[1]["hypotheses"][0]["covariance"]["matrix"])
    # 1 mm and 3 mrad at the base, half a metre away: about 1.5 mm an axis
    assert np.sqrt(np.diag(shared)[:3]).min() > 1e-3 > 5 * np.sqrt(np.diag(alone)[:3]).max()


@pytest.mark.slow
def test_parts_that_are_not_listed_are_named_in_the_message(run):
    """Two parts fit equally; one hypothesis is requested."""
    readings = str(EXAMPLES / "readings" / "step_not_felt.csv")
    words = ("identify", readings, "--parts", str(EXAMPLES / "parts"), "--sd", "0.3mm")
    for top in (1, 5):
        document = json.loads(run(*words, "--json", "--top", str(top)).out)
        assert document["status"] == "ambiguous"
        assert "step_12mm or step_15mm" in document["message"]
        assert (len(document["hypotheses"]) == 1) == (top == 1)
