"""Parts that nearly are one another: what explains the readings of one is tried on the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import Sensing, box_centred_pose, nees, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import identify_touches, prepare_target, rounds
from tanteo.surface_search.polish import polish
from tanteo.surface_search.tried import tried_on

PARTS = Path(__file__).parents[2] / "examples" / "parts"
NAMES = "bracket_left", "bracket_right", "step_12mm", "step_15mm"
TENTH = Sensing("touch 0.1 mm", 1e-4, True, ())


@pytest.fixture(scope="module")
def targets():
    return [prepare_target(read_part(PARTS / f"{name}.step")) for name in NAMES]


def sixteen(target, seed, stray=0.0):
    rng = np.random.default_rng(seed)
    T = box_centred_pose(rng)
    return scene(target, T, TENTH, 16, rng, stray=stray, radius=0.05)[0], T


def test_the_pose_of_one_part_is_tried_on_its_variant_and_not_on_what_is_nothing_like_it(targets):
    """Touches of the higher step; only the lower one was found, with some of them astray."""
    lower, higher = targets[2:]
    touches, T = sixteen(higher, 5)
    priors = Priors(radius=0.1)
    found = polish(touches, no_paths(), T[None], lower, priors, groups=np.array([3]))
    own, on_higher, on_bracket = tried_on(
        touches, no_paths(), [(lower, found), (higher, None), (targets[0], None)], priors
    )
    assert own is None
    assert on_bracket is None
    assert np.linalg.norm(SE3.log(SE3.inverse(T) @ on_higher.Ts[0])[:3]) < 1e-3
    assert on_higher.log_evidence[0] > found.log_evidence[0] + 5
    assert on_higher.groups[0] == 3


def test_a_variant_whose_own_search_found_nothing_is_found_by_the_other(targets, monkeypatch):
    """Near copies: the part that explains everything must not be dropped as it has no mass yet."""
    higher = targets[3]
    touches, T = sixteen(higher, 5)
    own = rounds.search

    def blind(touches, free, target, *rest):
        found = own(touches, free, target, *rest)
        return found.take(np.arange(0)) if target is higher else found

    monkeypatch.setattr(rounds, "search", blind)
    best = identify_touches(touches, no_paths(), targets[2:]).hypotheses[0]
    assert best.part == "step_15mm"
    assert nees(higher.part, best.T_world_part, best.covariance, T)[0] < 25


@pytest.mark.parametrize("seed", [(51, 14), (51, 30)])
def test_many_strays_do_not_end_the_search_at_a_pose_that_leaves_many(targets, seed):
    """A tenth of sixteen touches is astray, and said to be; a wrong part that leaves five aside is not explained."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(4))
    T = box_centred_pose(rng)
    touches = scene(targets[k], T, TENTH, 16, rng, stray=0.1, radius=0.05)[0]
    answer = identify_touches(touches, no_paths(), targets, priors=Priors(radius=0.1, clutter=0.1), top=50)
    right = [
        h.probability
        for h in answer.hypotheses
        if h.part == NAMES[k] and nees(targets[k].part, h.T_world_part, h.covariance, T)[0] < 60
    ]
    assert sum(right) > 0.9
