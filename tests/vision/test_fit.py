"""Where a refinement comes to rest: edges and a prior balance."""

from __future__ import annotations

import numpy as np
import pytest

from core.image_oracle import normal_equations
from tanteo.geometry import SE3
from tanteo.vision.fit import meet, refine
from tanteo.vision.settings import EDGES
from vision_scenes import bracket, seen_alone


@pytest.fixture(scope="module")
def model():
    return bracket()


@pytest.fixture(scope="module")
def seen(model):
    """Camera, edges of an image of the part on the table, and its pose in the camera."""
    camera, _, edges, T = seen_alone(model, 0.6)
    return camera, edges, T


def test_edges_and_prior_balance_where_the_pose_comes_to_rest(model, seen):
    camera, edges, T = seen
    start = T @ SE3.exp(np.array([1e-3, -1e-3, 5e-4, 0.0, 0.0, 0.004]))
    reaches = (2.5,) * 12
    information = normal_equations(meet(model.frame, camera, edges, T, 2.5), 2.5, EDGES.bias, EDGES.correlation)[0]
    prior = 0.3 * information
    end = refine(model.frame, camera, edges, start[None], prior=prior[None], reaches=reaches)[0]
    pull = normal_equations(meet(model.frame, camera, edges, end, 2.5), 2.5, EDGES.bias, EDGES.correlation)[1]
    back = prior @ SE3.log(SE3.inverse(start) @ end)
    scale = np.r_[np.full(3, model.frame.diagonal), np.ones(3)]
    assert np.linalg.norm(scale * pull) > 0
    assert np.linalg.norm(scale * (pull - back)) < 0.05 * np.linalg.norm(scale * pull)
