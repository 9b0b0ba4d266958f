"""The posterior of a prior pose after few readings: bent, cut, in pieces; weighed by samples from all over it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import tanteo
from bare_scenes import inside, nees, no_paths, surface_points, touches_of
from tanteo.geometry import SE3
from tanteo.posterior import PosePrior, Priors, identify_points, prepare, sized

FOLDER = Path(__file__).parents[2] / "examples" / "parts"
ROUGH = np.diag(np.repeat([3e-3, np.radians(2)], 3)) ** 2


@cache
def target_of(name):
    return prepare(tanteo.read_part(FOLDER / f"{name}.step"))


def placed(target, n, rng, sd=1e-4, C=ROUGH):
    """Touches of a part whose pose is drawn from the rough one, and that pose."""
    T = SE3.exp(np.linalg.cholesky(C) @ rng.normal(size=6))
    p, _ = surface_points(target, n, rng)
    return touches_of(SE3.apply(T, p) + sd * rng.normal(size=p.shape), sd), T


def near(target, C=ROUGH):
    return sized(Priors(pose=PosePrior(np.eye(4), C)), target.part.radius)


@pytest.mark.slow
def test_what_is_sure_of_few_touches_is_in_its_region():
    within = []
    for name in ("block", "wedge", "bracket_left"):
        target = target_of(name)
        for k in range(30):
            touches, T = placed(target, 3 + k % 3, np.random.default_rng((4, k)))
            answer = identify_points(touches, no_paths(), [target], priors=near(target))
            if answer.status == "recognized":
                best = answer.hypotheses[0]
                within.append(inside(*nees(target.part, best.T_world_part, best.covariance, T)))
    assert len(within) > 30
    assert np.mean(within) > 0.83  # 0.93 expected; by the curvature of the maxima 0.8
