"""Sensed tori: rings on plates that differ in a radius of the tube are discriminated, and located by Bayes' rule."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("OCP", reason="the extra tanteo[step] is not installed")

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeTorus
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from drilled import as_part
from tanteo import _core, features
from tanteo.factors.factor import KINDS, landmark_rows
from tanteo.features import Feature, Round
from tanteo.geometry import SE3
from tanteo.posterior import identify_features

SD, TILT = 2e-5, 1e-3
TORUS = features.kinds.KINDS["torus"]  # its module registers it
RINGS = ((0, 0, 12, 2.0), (60, 5, 12, 2.0), (20, 45, 8, 2.0))
"""Place, radius and tube of each ring of a plate [mm]."""


def plate(rings, groove=False):
    body = BRepPrimAPI_MakeBox(gp_Pnt(-20, -20, 0), gp_Pnt(80, 65, 10)).Shape()
    for x, y, radius, tube in rings:
        ring = BRepPrimAPI_MakeTorus(gp_Ax2(gp_Pnt(x, y, 10), gp_Dir(0, 0, 1)), radius, tube).Shape()
        body = (BRepAlgoAPI_Cut if groove else BRepAlgoAPI_Fuse)(body, ring).Shape()
    return body


@pytest.fixture(scope="module")
def plates(tmp_path_factory):
    folder = tmp_path_factory.mktemp("rings")
    thick = (*RINGS[:2], (20, 45, 8, 2.5))
    bodies = {"rings": plate(RINGS), "thick": plate(thick), "grooves": plate(RINGS, groove=True)}
    return [as_part(body, folder / f"{name}.step") for name, body in bodies.items()]


def sensed(rings, T, rng, *, convex=True, sizes=True):
    """Return the tori of a plate as features, with their errors."""
    out = []
    for k, (x, y, radius, tube) in enumerate(rings):
        P = np.diag([SD**2] * 3 + [TILT**2] * 2)
        error = np.r_[rng.multivariate_normal(np.zeros(5), P), 0.0]
        at = T @ SE3.from_parts(np.eye(3), 1e-3 * np.array([x, y, 10.0])) @ SE3.exp(-error)
        size = Round(1e-3 * radius + SD * rng.normal(), SD**2, convex=convex) if sizes else None
        second = Round(1e-3 * tube + SD * rng.normal(), SD**2) if sizes else None
        out.append(Feature(TORUS, at, P, f"ring {k}", size=size, second_size=second))
    return out


def random_pose(rng):
    return SE3.exp(np.r_[rng.uniform(-0.3, 0.3, 3), rng.normal(size=3)])


def test_a_part_has_its_tori_as_landmarks(plates):
    rows = landmark_rows(plates[0])
    code = _core.landmark_codes()[KINDS["torus_centre"].core]
    own = rows[rows[:, 11] == code]
    assert np.allclose(np.sort(own[:, 6]), [8e-3, 12e-3, 12e-3])
    assert np.allclose(own[:, 13:], 2e-3)
    assert np.allclose(own[:, 8], 1 / 3)


@pytest.mark.parametrize("which", range(3))
def test_the_radius_of_a_tube_decides_the_part(plates, which):
    rng = np.random.default_rng(which)
    rings = (*RINGS[:2], (20, 45, 8, 2.5)) if which == 1 else RINGS
    T = random_pose(rng)
    answer = identify_features(sensed(rings, T, rng, convex=which < 2), plates)
    assert answer.hypotheses[0].part == plates[which].name
    assert answer.hypotheses[0].probability > 0.9


def test_without_sizes_the_plates_stay_ambiguous(plates):
    rng = np.random.default_rng(7)
    answer = identify_features(sensed(RINGS, random_pose(rng), rng, sizes=False), plates)
    assert answer.status == "ambiguous"
    assert {h.part for h in answer.hypotheses if h.probability > 0.1} == {part.name for part in plates}


def test_errors_of_poses_are_as_large_as_reported(plates):
    rng, squares = np.random.default_rng(11), []
    for _ in range(30):
        T = random_pose(rng)
        best = identify_features(sensed(RINGS, T, rng), plates[:1]).hypotheses[0]
        xi = SE3.log(SE3.inverse(best.T_world_part) @ T)
        squares.append(xi @ np.linalg.solve(best.covariance, xi))
    # the mean of 30 chi-square variables with 6 degrees of freedom, 99.9 % interval
    assert 4.0 < np.mean(squares) < 8.3
