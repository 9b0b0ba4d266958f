"""An answer that is less certain than the part's smallest feature is insufficient."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo import PosePrior, Priors, Readings, locate
from tanteo.geometry import SE3, SO3

PART = tanteo.read_part(Path(__file__).parents[3] / "examples" / "parts" / "bracket_left.step")
WALL = 0.01
"""Thickness of the bracket [m]."""


def touched(sd, seed):
    """Return touches all over the part, and its pose."""
    rng = np.random.default_rng(seed)
    corners = PART.vertices[PART.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    rows = rng.choice(len(areas), 24, p=areas / areas.sum())
    q = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], 24), corners[rows])
    T = SE3.from_parts(SO3.axis_rotation(2, 0.7), np.array([0.3, 0.1, 0.02]))
    return T, Readings.from_columns(
        points=SE3.apply(T, q) + sd * rng.normal(size=q.shape), sds=np.full(24, sd),
        directions=-(normals / areas[:, None])[rows] @ T[:3, :3].T,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sd", [1e-3, 6e-3])
def test_a_pose_coarser_than_a_wall_is_insufficient(sd, seed):
    answer = locate(touched(sd, seed)[1], PART)
    assert answer.status != "recognized" or 1.96 * answer.best.corner_sd <= WALL
    assert (answer.status == "recognized") == (sd < 2e-3)
    if answer.status == "insufficient":
        assert "more than its thinnest wall (10 mm)" in answer.message


def test_a_prior_pose_states_its_own_uncertainty():
    T, readings = touched(6e-3, 0)
    known = PosePrior(T, np.diag([0.01, 0.01, 0.01, 0.1, 0.1, 0.1]) ** 2)
    assert locate(readings, PART, priors=Priors(pose=known)).status == "recognized"
