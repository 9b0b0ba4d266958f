"""Parts that nearly are one another: what explains the readings of one is tried on the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import Sensing, box_centred_pose, nees, no_paths, scene
from tanteo.parts import read_part
from tanteo.posterior import Priors, identify_points, prepare

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "bracket_left", "bracket_right", "step_12mm", "step_15mm"
TENTH = Sensing("touch 0.1 mm", 1e-4, True, ())


@pytest.fixture(scope="module")
def targets():
    return [prepare(read_part(PARTS / f"{name}.step")) for name in NAMES]


@pytest.mark.xfail(strict=False, reason="0.87 of the probability where 0.9 is asked for")
@pytest.mark.parametrize("seed", [(51, 14), (51, 30)])
def test_many_strays_do_not_end_search_at_pose_that_leaves_many(targets, seed):
    """A tenth of sixteen points are outliers and named; a wrong part that leaves five aside is no explanation."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(4))
    T = box_centred_pose(rng)
    touches = scene(targets[k], T, TENTH, 16, rng, outlier=0.1, radius=0.05)[0]
    answer = identify_points(touches, no_paths(), targets, priors=Priors(radius=0.1, outlier_rate=0.1), top=50)
    right = [
        h.probability
        for h in answer.hypotheses
        if h.part == NAMES[k] and nees(targets[k].part, h.T_world_part, h.covariance, T)[0] < 60
    ]
    assert sum(right) > 0.9
