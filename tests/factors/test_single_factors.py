"""Laws of single factors: densities of outliers, landmarks, and the tolerance of the made surface."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt

from drilled import as_part, drilled, tip
from scenes import random_pose
from tanteo.factors import SurfacePoint, as_labelled_points
from tanteo.factors.factor import KINDS, SensedDirection
from tanteo.features import Feature
from tanteo.features.kinds import CIRCLE, VERTEX

RADIUS = 0.2
X = np.array([1.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def plate(tmp_path_factory):
    """Return a plate with two bores, two balls on it and two countersinks."""
    body = drilled(((-38, -22, 4), (35, -24, 4)), None, [tip(x, 25, 4, 12.5, 6) for x in (-30, 20)])
    for x in (-10, 15):
        body = BRepAlgoAPI_Fuse(body, BRepPrimAPI_MakeSphere(gp_Pnt(x, 0, 12), 5).Shape()).Shape()
    return as_part(body, tmp_path_factory.mktemp("plate") / "plate.step")


@pytest.mark.parametrize("normal", [None, SensedDirection(X, 0.05)])
def test_an_outlier_of_a_beam_is_somewhere_along_it(normal):
    factor = SurfacePoint(at=np.zeros(3), cov=1e-8 * np.eye(3), approach=-X, normal=normal)
    directions = 1.0 if normal is None else 4 * np.pi
    assert np.exp(factor.log_outlier(RADIUS)) * 2 * RADIUS * directions == pytest.approx(1.0)


def test_a_tolerance_widens_points_in_every_direction():
    vertex = Feature(VERTEX, random_pose(np.random.default_rng(3)), 1e-8 * np.eye(3), "corner")
    exact, made = as_labelled_points([vertex]), as_labelled_points([vertex], tolerance=2e-4)
    np.testing.assert_allclose(made.covs - exact.covs, [4e-8 * np.eye(3)], atol=1e-15)


@pytest.mark.parametrize("kind", ["centre", "sphere_centre", "apex"])
def test_a_centre_is_that_of_one_of_the_landmarks(kind, plate):
    shares = [one.share for one in KINDS[kind].landmarks(plate)]
    assert len(shares) >= 2
    assert shares == pytest.approx([1 / len(shares)] * len(shares))


def test_a_sensed_circle_is_the_centre_of_a_hole():
    T = random_pose(np.random.default_rng(5))
    points = as_labelled_points([Feature(CIRCLE, T, 1e-8 * np.eye(CIRCLE.size), "bore")])
    np.testing.assert_allclose(points.points, [T[:3, 3]])
    assert points.centres.tolist() == [True]
