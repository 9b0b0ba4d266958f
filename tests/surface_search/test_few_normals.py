"""A few readings with sensed normals: what fits them as well as the truth does is found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import holds, no_paths, oriented
from tanteo.lie import SE3
from tanteo.matching.priors import sized
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target
from tanteo.surface_search.polish import from_blurred, polish
from tanteo.surface_search.rounds import search_all

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def targets():
    names = "bracket_left", "clamp", "flange", "housing", "t_slot", "block"
    return [prepare_target(read_part(PARTS / f"{name}.step")) for name in names]


def found_with(target, touches):
    return search_all(touches, no_paths(), [target], sized(None, target.part.radius)).maxima[0][1]


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 8])
def test_what_the_truth_climbs_to_is_found(targets, n):
    """In all but two of 48 scenes; of a hundred it was missed in seven before, by up to 20 nats."""
    missed = 0
    for k, target in enumerate(targets):
        for scene in range(8):
            touches, T = oriented(target, n, np.random.default_rng((4, k, scene, n)))
            best = polish(touches, no_paths(), T[None], target, sized(None, target.part.radius))
            maxima = found_with(target, touches)
            matters = best.log_evidence[0] > maxima.log_evidence.max(initial=-np.inf) - 3
            missed += matters and not holds(target, maxima, best)
    assert missed <= 2


def test_a_reading_that_is_astray_where_a_climb_ends_is_tried_again(targets):
    """Climbs from 4 mm beside the truth that end with a reading aside: most reach the truth from there."""
    stuck = freed = 0
    for scene in range(30):
        target, rng = targets[scene % len(targets)], np.random.default_rng((5, scene))
        priors = sized(None, target.part.radius)
        touches, T = oriented(target, 8, rng)
        best = polish(touches, no_paths(), T[None], target, priors)
        beside = SE3.exp(4e-3 * np.r_[rng.normal(size=3), np.zeros(3)]) @ T
        ended = polish(touches, no_paths(), beside[None], target, priors)
        if ended.belongs.min() < 0.5 < best.belongs.min() and not holds(target, ended, best):
            stuck += 1
            freed += holds(target, from_blurred(touches, no_paths(), ended, target, priors), best)
    assert stuck > 10
    assert freed > 0.5 * stuck


def test_where_no_reading_is_aside_nothing_is_climbed_again(targets):
    touches, T = oriented(targets[0], 8, np.random.default_rng(8))
    priors = sized(None, targets[0].part.radius)
    best = polish(touches, no_paths(), T[None], targets[0], priors)
    assert best.belongs.min() > 0.5
    assert not len(from_blurred(touches, no_paths(), best, targets[0], priors).Ts)
