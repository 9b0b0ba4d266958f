"""One search: what it finds from several first poses is there once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bare_scenes import SENSORS, box_centred_pose, no_paths, scene
from tanteo.lie import SE3
from tanteo.matching import PosePrior, Priors
from tanteo.parts import read_part
from tanteo.surface_search import prepare_target, search
from tanteo.surface_search.refine import refine
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


def test_a_rough_pose_leads_to_its_maximum_for_every_group(target, monkeypatch):
    """No group of readings leads anywhere; what the rough pose alone leads to is no find of one group."""
    rng = np.random.default_rng(2)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target.surface, T, SENSORS[1], 12, rng)
    priors = Priors(radius=0.1, pose=PosePrior(T, np.diag(np.repeat([2e-3, 0.02], 3)) ** 2))
    monkeypatch.setattr(search, "first_poses", lambda *_: (np.zeros((0, 4, 4)), np.zeros(0, dtype=np.int64)))
    groups = groups_of(touches, target, 3)
    found = search.search(touches, no_paths(), target, priors, Effort(100, 8, 8, 3), groups, 2)
    assert found.groups[0] == 0b11100


def test_later_rounds_do_not_follow_the_reading_that_is_farthest_off(target):
    """One of ten touches is 6 mm off: moved without it, more rough poses come to where the nine others are."""
    rng = np.random.default_rng(3)
    near = {False: 0, True: 0}
    for _ in range(10):
        T = box_centred_pose(rng)
        touches, _, _ = scene(target.surface, T, SENSORS[0], 10, rng)
        touches.points[4] += 6e-3 * rng.choice([-1, 1], 3) / np.sqrt(3)
        rough = T @ SE3.exp(np.repeat([3e-3, 0.05], 3) * rng.normal(size=(40, 6)))
        for trimmed in near:
            Ts, _ = refine(touches, rough, target, np.geomspace(400, 10, 12), trimmed=trimmed)
            off = np.linalg.norm(SE3.apply(Ts, target.part.centroid) - SE3.apply(T, target.part.centroid), axis=1)
            near[trimmed] += int(np.sum(off < 2e-4))
    assert near[True] > 1.3 * near[False] > 0


def test_of_six_readings_none_is_left_out(target):
    rng = np.random.default_rng(4)
    T = box_centred_pose(rng)
    touches, _, _ = scene(target.surface, T, SENSORS[1], 6, rng)
    rough = T @ SE3.exp(1e-3 * rng.normal(size=(5, 6)))
    same, one_out = (refine(touches, rough, target, np.array([9.0, 3.0]), trimmed=flag)[0] for flag in (False, True))
    assert np.array_equal(same, one_out)
