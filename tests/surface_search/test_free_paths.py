"""Paths on which nothing was met, exactly known or somewhere in a cone."""

from pathlib import Path

import numpy as np
import pytest

import tanteo
from tanteo.matching import Priors
from tanteo.surface_search import FreePaths, prepare_target
from tanteo.surface_search.free_space import log_free_paths

PRIORS = Priors(radius=0.1)
C = PRIORS.clutter
HALF = np.radians(5.0)


@pytest.fixture(scope="module")
def block():
    return prepare_target(tanteo.read_part(Path(__file__).parents[2] / "examples" / "parts" / "block.step"))


def from_above(target, inside, half_angle):
    """A path down onto the top, so far inside of its border, free to well below it."""
    low, high = target.part.box
    origin = np.array([high[0] - inside, 0.5 * (low[1] + high[1]), high[2] + 0.1])
    slopes = np.array([0.5 * np.tan(half_angle)])
    return FreePaths(origin[None], np.array([[0.0, 0.0, -1.0]]), np.array([0.12]), np.zeros(1), slopes)


def log(target, path):
    return float(log_free_paths(path, np.eye(4)[None], target, PRIORS)[0])


@pytest.mark.parametrize("half_angle", [0.0, HALF])
def test_well_inside_a_face_a_path_is_blocked_and_far_beside_it_is_not(block, half_angle):
    assert log(block, from_above(block, 0.03, half_angle)) == pytest.approx(np.log(C))
    assert log(block, from_above(block, -0.03, half_angle)) == pytest.approx(np.log1p(-C))


def test_a_path_that_is_exact_is_blocked_up_to_the_border(block):
    assert log(block, from_above(block, 1e-3, 0.0)) == pytest.approx(np.log(C))


def test_a_cone_that_grazes_a_border_passes_beside_it_with_about_its_share(block):
    """Against rays at random in the cone: the five rays are not far off, and nowhere near the certainty of one."""
    rng, path = np.random.default_rng(1), from_above(block, 2e-3, HALF)
    radius, turn = np.tan(HALF) * np.sqrt(rng.uniform(size=4000)), rng.uniform(0, 2 * np.pi, 4000)
    rays = np.stack([radius * np.cos(turn), radius * np.sin(turn), -np.ones(4000)], axis=1)
    hits = block.surface.cast(np.broadcast_to(path.origins, rays.shape), rays / np.linalg.norm(rays, axis=1)[:, None])
    share = np.mean(hits.distances > 0.12)
    assert 0.2 < share < 0.45
    assert abs((np.exp(log(block, path)) - C) / (1 - 2 * C) - share) < 0.25
    assert log(block, path) > np.log(C) + 1.5
