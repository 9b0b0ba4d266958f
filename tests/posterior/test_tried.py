"""Similar parts: the poses that explain the readings of one are tried on the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import poisson

from bare_scenes import Sensing, box_centred_pose, nees, no_paths, scene
from tanteo.parts import read_part
from tanteo.posterior import Priors, identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "bracket_left", "bracket_right", "step_12mm", "step_15mm"
TENTH = Sensing("touch 0.1 mm", 1e-4, True, ())


@pytest.fixture(scope="module")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in NAMES]


def answered(targets, scene_seed, seed=0):
    """Return the answer to 16 touches, a tenth of which are outliers, and the probability of the true pose."""
    rng = np.random.default_rng(scene_seed)
    k = int(rng.integers(4))
    T = box_centred_pose(rng)
    touches = scene(targets[k], T, TENTH, 16, rng, outlier=0.1, radius=0.05)[0]
    priors = Priors(radius=0.1, outlier_rate=0.1)
    answer = identify_points(touches, no_paths(), targets, priors=priors, top=50, seed=seed)
    right = [
        h.probability
        for h in answer.hypotheses
        if h.part == NAMES[k] and nees(targets[k].part, h.T_world_part, h.covariance, T)[0] < 60
    ]
    return answer, sum(right)


@pytest.mark.parametrize("seed", range(4))
def test_outliers_do_not_end_search_at_pose_with_many(targets, seed):
    """A wrong part with five outliers explains nothing: every seed finds the pose with the two true outliers."""
    answer, right = answered(targets, (51, 14), seed)
    assert right > 0.95
    assert len(answer.best.outliers) == 2


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_one_more_outlier_costs_similar_part_its_odds(targets, seed):
    """One touch discriminates both steps. As a third outlier of 16 at a rate of 0.1 it cannot exclude the wrong one.

    At the pose of the wrong one that touch is an outlier with a probability near one half.
    """
    answer, right = answered(targets, (51, 30), seed)
    best, other = answer.hypotheses[:2]
    assert (best.part, other.part) == ("step_12mm", "step_15mm")
    assert right > 0.7
    assert other.probability > 0.1
    assert set(best.outliers) <= set(other.outliers)
    assert len(other.outliers) <= len(best.outliers) + 1


@pytest.mark.slow
@pytest.mark.parametrize("scenes", [6, pytest.param(16, marks=pytest.mark.slow)])
def test_similar_parts_with_outliers_are_calibrated(targets, scenes):
    """No more best answers are wrong than their probabilities state, at a level of 1 in 1000."""
    found = [answered(targets, (51, k)) for k in range(100, 100 + scenes)]
    wrong = sum(right < 0.5 * answer.best.probability for answer, right in found)
    expected = sum(1 - answer.best.probability for answer, _ in found)
    assert poisson.sf(wrong - 1, expected) > 1e-3
    assert np.mean([right for _, right in found]) > 0.9
