"""Faces touched with a tip that is off by many times the noise, the hand rotated for every touch."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bare_scenes import box_centred_pose, nees
from tanteo import PosePrior, Priors, Readings, identify, locate
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.words.findings import SharedErrorLimits

SD, TIP = 1e-4, np.array([1.5e-3, 1.5e-3, 3e-4])


@pytest.fixture(scope="module")
def bracket():
    """A part without symmetry."""
    return read_part(Path(__file__).parents[1] / "examples" / "parts" / "bracket_left.step")


def touched(part, T, rng, tip):
    """Return five touches on each of six larger faces that fix it, with labels, from the stated places of the
    fingertip."""
    points, normals, labels, planes = [], [], [], np.zeros(0, dtype=int)
    while np.linalg.matrix_rank(part.planes.normals[planes]) < 3:
        planes = rng.permutation(np.argsort(-part.planes.areas)[:9])[:6]
    for plane in planes:
        corners = part.vertices[part.triangles[part.triangle_face == part.planes.faces[plane]]]
        areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        a, b, c = corners[rng.choice(len(corners), 5, p=areas / areas.sum())].transpose(1, 0, 2)
        u, v = np.sort(rng.uniform(size=(2, 5, 1)), axis=0)
        points.append(u * a + (v - u) * b + (1 - v) * c)
        normals.append(np.tile(part.planes.normals[plane], (5, 1)))
        labels += [f"face {plane}"] * 5
    seen = SE3.apply(T, np.concatenate(points)) + SD * rng.normal(size=(30, 3))
    q = rng.normal(size=(30, 4))
    R = SO3.from_quaternion(q / np.linalg.norm(q, axis=1, keepdims=True))
    seen = seen - R @ (tip * rng.normal(size=3))
    return Readings.from_columns(
        seen, sds=np.full(30, SD), features=labels, directions=-np.concatenate(normals) @ T[:3, :3].T,
        Ts_world_hand=SE3.from_parts(R, seen),
    )  # fmt: skip


def test_labels_do_not_stand_in_the_way_of_a_large_tip_offset(bracket):
    rng, values = np.random.default_rng(5), []
    for _ in range(10):
        T = box_centred_pose(rng)
        answer = identify(touched(bracket, T, rng, TIP), [bracket], tip_sd=TIP)
        assert answer.status == "recognized", answer.message
        best = answer.hypotheses[0]
        values.append(nees(bracket, best.T_world_part, best.covariance, T)[0] / 6)
    assert np.mean(values) < 1 + 3.3 * np.sqrt(2 / 6 / len(values))  # 99.9 %


def test_shares_of_the_uncertainty_are_of_the_reported_one(bracket):
    rng = np.random.default_rng(5)
    seen = touched(bracket, box_centred_pose(rng), rng, 0 * TIP)
    level = replace(seen, Ts_world_hand=seen.Ts_world_hand.map(lambda Ts: SE3.from_parts(np.eye(3), Ts[:, :3, 3])))
    answer = identify(level, [bracket], tip_sd=2 * SD * np.ones(3))
    limits = [one for one in answer.findings if isinstance(one, SharedErrorLimits)]
    assert len(limits) == 2, answer.message  # the tip's offset, and errors that are assumed
    for one in limits:
        assert one.corner_sd == pytest.approx(answer.hypotheses[0].corner_sd)
        assert np.hypot(one.share, one.without) == pytest.approx(one.corner_sd)


def test_labels_are_used_where_the_tip_is_known(bracket):
    rng = np.random.default_rng(6)
    T = box_centred_pose(rng)
    readings = touched(bracket, T, rng, 0 * TIP)
    for options in ({}, {"tip_sd": 1e-5 * np.ones(3)}):
        answer = identify(readings, [bracket], **options)
        assert "Labels" not in answer.message
        assert answer.status == "recognized"
    published = identify(readings, [bracket], tip_sd=TIP, as_published=True)
    assert "Labels" not in published.message


def test_a_tip_that_nothing_observes_is_not_contradicted(bracket):
    """Eight touches by a hand that never turns: an offset of the tip is a shift of the part."""
    for seed in range(4):
        rng = np.random.default_rng((53, seed))
        T = box_centred_pose(rng)
        every = touched(bracket, T, rng, np.zeros(3))
        some = every.take(rng.permutation(30)[:8])
        still = SE3.from_parts(np.eye(3), some.points.values)
        readings = Readings.from_columns(
            some.points.values, sds=some.sds.values, directions=some.directions.values, Ts_world_hand=still
        )
        prior = PosePrior(T, np.diag(np.repeat([5e-3, 0.05], 3)) ** 2)
        answer = locate(readings, bracket, priors=Priors(pose=prior))
        assert "0.3 mm (1 sd) is assumed" in answer.message
