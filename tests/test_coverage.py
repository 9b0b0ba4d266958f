"""Covariances hold for each kind of reading: the NEES of the pose, and how often the 95 % region has the truth.

A small check with fixed seeds and bounds of one false alarm in a thousand; ``make test-all`` and
``benchmarks/region_coverage.py`` have the large ones.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, chi2

from bare_scenes import REACH, Sensing, box_centred_pose, nees, oriented, scene, touches_of
from tanteo import Readings, read_part
from tanteo.factors import FreeRays
from tanteo.fitting import fit_labelled
from tanteo.geometry import SE3
from tanteo.posterior import identify_features, identify_points, prepare
from tanteo.sensors import measure
from tanteo.vision import prepare_vision, see_table
from vision_scenes import random_shot, stated_table

SD, SCENES = 3e-4, 24
TOUCH, LASER = Sensing("touch", SD, False, ()), Sensing("laser", SD, True, ())
BRACKET = Path(__file__).parents[1] / "examples" / "parts" / "bracket_left.step"


@pytest.fixture(scope="module")
def target():
    pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")
    return prepare(read_part(BRACKET))


def on_faces(part, n, rng, least=3e-4):
    """Points on the larger flat faces, ``n`` each: points, outward normals, numbers of the faces."""
    points, normals, names = [], [], []
    for k, face in enumerate(part.faces):
        if face.surface != "plane" or face.area < least:
            continue
        corners = part.vertices[part.triangles[part.triangle_face == k]]
        crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        rows = rng.choice(len(corners), n, p=np.linalg.norm(crossed, axis=1) / np.linalg.norm(crossed, axis=1).sum())
        weights = rng.dirichlet(np.ones(3), n)
        points.append(np.einsum("nk,nki->ni", weights, corners[rows]))
        normals.append(crossed[rows] / np.linalg.norm(crossed[rows], axis=1, keepdims=True))
        names += [f"face {k}"] * n
    return np.concatenate(points), np.concatenate(normals), names


def of_points(points, target):
    return identify_points(points, FreeRays.none(), [target.part])


def contact_points(target, rng):
    T = box_centred_pose(rng)
    return T, of_points(scene(target, T, TOUCH, 20, rng)[0], target)


def beams(target, rng):
    T = box_centred_pose(rng)
    return T, of_points(scene(target, T, LASER, 20, rng)[0], target)


def beams_with_a_shared_bias(target, rng):
    T = box_centred_pose(rng)
    points, _, shared = scene(target, T, LASER, 20, rng, bias_sd=1e-3)
    return T, identify_points(points, FreeRays.none(), [target.part], shared=shared)


def normals(target, rng):
    points, T = oriented(target, 12, rng)
    return T, of_points(points, target)


def labelled_points(target, rng):
    T = box_centred_pose(rng)
    p, outward, names = on_faces(target.part, 3, rng)
    points = SE3.apply(T, p) + SD * rng.normal(size=p.shape)
    touches = touches_of(points, SD, directions=-outward @ T[:3, :3].T, reach=REACH)
    return T, of_points(replace(touches, labels=tuple(names), kinds=("plane",) * len(names)), target)


def sensed_planes(target, rng):
    T = box_centred_pose(rng)
    p, outward, names = on_faces(target.part, 8, rng)
    readings = Readings.from_columns(
        points=SE3.apply(T, p) + SD * rng.normal(size=p.shape),
        directions=-outward @ T[:3, :3].T,
        sds=np.full(len(p), SD),
        features=names,
        kinds=["plane"] * len(p),
    )
    return T, identify_features(fit_labelled(measure(readings)).features, [target.part])


def images(target, rng):
    """Return a table with errors drawn from the stated ones."""
    pytest.importorskip("cv2", reason="the extra tanteo[vision] is not installed")
    model = prepare_vision(target.part)
    shot = random_shot([model], rng)
    (seen,) = see_table(shot.image, shot.camera, [model], T_world_table=stated_table(shot, target.part, rng)).objects
    return shot.T_world_part, seen.answer


KINDS = contact_points, beams, beams_with_a_shared_bias, normals, labelled_points, sensed_planes


@pytest.mark.quick_sets(3)
@pytest.mark.parametrize(
    ("kind", "scenes"),
    [*((kind, SCENES) for kind in KINDS), *(pytest.param(images, n, marks=pytest.mark.slow) for n in (6, 12))],
)
def test_the_region_holds_the_truth(target, kind, scenes):
    values = []
    for seed in range(scenes):
        T, answer = kind(target, np.random.default_rng((2026, seed)))
        if answer.status == "recognized":
            values.append(nees(target.part, answer.pose, answer.covariance, T)[0])
    assert len(values) >= 0.8 * scenes
    contained = int(np.sum(np.array(values) <= chi2.ppf(0.95, 6)))
    assert contained >= binom.ppf(1e-3, len(values), 0.95)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], 6 * len(values))
    assert low <= np.sum(values) <= high
