"""One search: what it finds from several first poses is there once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import Priors
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target, search
from tanteo.surface_search.search import Effort, groups_of

PARTS = Path(__file__).parents[2] / "examples" / "parts"


@pytest.fixture(scope="module")
def target():
    return prepare_target(read_part(PARTS / "bracket_left.step"))


def test_poses_turned_over_that_meet_at_one_maximum_are_one(target, monkeypatch):
    """Three more climbs to the best maximum: it is there once, found by them too."""
    rng = np.random.default_rng(1)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target.surface, T, SENSORS[1], 8, rng)
    effort, priors, groups = Effort(500, 8, 10, 3), Priors(radius=0.1), groups_of(touches, target, 2)

    def run(turned):
        monkeypatch.setattr(search, "_turned_over", lambda *_: (turned, np.full(len(turned), 8)))
        return search.search(touches, no_paths(), target, priors, effort, groups)

    alone = run(np.zeros((0, 4, 4)))
    again = run(alone.Ts[:1] @ SE3.exp(1e-6 * rng.normal(size=(3, 6))))
    assert len(again.Ts) == len(alone.Ts)
    assert again.groups[0] == alone.groups[0] | 8
