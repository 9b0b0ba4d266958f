"""Readings of curved faces: compared with the surface itself, not with the facets of its mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from bare_scenes import SENSORS, box_centred_pose, nees, no_paths, scene, surface_points
from tanteo import Readings, locate
from tanteo.geometry import SE3, SO3
from tanteo.parts import read_part
from tanteo.parts.faces import exact_faces
from tanteo.posterior import Priors, identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def flange():
    return prepare(read_part(PARTS / "flange.step"))


@pytest.mark.slow
def test_touches_of_a_hundredth_of_a_millimetre_are_believed(flange):
    """With facets 36 micrometres deep, as in the mesh, a quarter of such readings would fit no known part."""
    values = []
    for k in range(25):
        rng = np.random.default_rng((1, k))
        T = box_centred_pose(rng)
        touches, _, _ = scene(flange, T, SENSORS[0], 25, rng)
        answer = identify_points(touches, no_paths(), [flange], priors=Priors(radius=flange.part.radius))
        assert answer.status == "recognized"
        best = answer.hypotheses[0]
        assert not best.outliers
        values.append(nees(flange.part, best.T_world_part, best.covariance, T)[0])
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high


def exact(target):
    """Return the round faces that the mesh approximates."""
    return exact_faces(target.part, target.surface.normals)


def distances(target, points):
    """Return distances from the surface itself, not from the facets of its mesh."""
    closest, off = target.surface.closest(points), np.zeros(len(points))
    exact(target).replace(np.array(points), closest.triangles, off, np.array(target.surface.normals[closest.triangles]))
    return np.where(exact(target).rows[closest.triangles] >= 0, off, closest.distances)


@pytest.mark.slow
def test_a_ball_tip_with_sensed_normals_follows_its_covariance(flange):
    """A tip of 3 mm in bores of 7 mm: its centre and the normal are two readings, not one moved by the other."""
    values, r, sd, tilt = [], 3e-3, 1e-4, 0.05
    for k in range(25):
        rng = np.random.default_rng((8, k))
        T = box_centred_pose(rng)
        p, n = surface_points(flange, 3000, rng)
        fits = np.abs(distances(flange, p + r * n) - r) < 1e-6
        p, n = p[fits], n[fits]
        on = exact(flange).rows[flange.surface.closest(p).triangles] >= 0
        rows = np.r_[np.flatnonzero(on)[:10], np.flatnonzero(~on)[:10]]
        centres = SE3.apply(T, p[rows] + r * n[rows]) + sd * rng.normal(size=(20, 3))
        rotated = (SO3.exp(tilt * rng.normal(size=(20, 3))) @ (n[rows] @ T[:3, :3].T)[..., None])[..., 0]
        sensed = {"sds": np.full(20, sd), "radii": np.full(20, r), "normals": rotated, "normal_sds": np.full(20, tilt)}
        answer = locate(Readings.from_columns(centres, **sensed), flange.part)
        if answer.status == "recognized":
            best = answer.hypotheses[0]
            values.append(nees(flange.part, best.T_world_part, best.covariance, T)[0])
    assert len(values) > 21
    low, high = chi2.ppf([0.001, 0.999], 6 * len(values)) / len(values)
    assert low < np.mean(values) < high
